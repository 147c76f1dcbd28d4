"""Autopilots' own controllers: exact structure, exact discrete time, their own parameter names."""

from flightid.control.autopilots.axis_loop import AxisLoop, LoopFlags, LoopRun
from flightid.control.autopilots.make import AUTOPILOTS, axis_loop
from flightid.control.autopilots.parameter_table import AXES, GainRange, defaults, gain_ranges

__all__ = [
    "AUTOPILOTS",
    "AXES",
    "AxisLoop",
    "GainRange",
    "LoopFlags",
    "LoopRun",
    "axis_loop",
    "defaults",
    "gain_ranges",
]
