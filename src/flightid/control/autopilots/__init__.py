"""Autopilots' own controllers: exact structure, exact discrete time, their own parameter names."""

from flightid.control.autopilots.axis_loop import AxisLoop, LoopFlags, LoopRun
from flightid.control.autopilots.make import AUTOPILOTS, axis_loop
from flightid.control.autopilots.parameter_files import (
    GainChange,
    WrittenParameters,
    read_parameters,
    write_param,
    write_params,
)
from flightid.control.autopilots.parameter_table import AXES, GainRange, defaults, gain_ranges
from flightid.control.autopilots.px4_autotune import Px4AutotuneGains, px4_autotune_gains

__all__ = [
    "AUTOPILOTS",
    "AXES",
    "AxisLoop",
    "GainChange",
    "GainRange",
    "LoopFlags",
    "LoopRun",
    "Px4AutotuneGains",
    "WrittenParameters",
    "axis_loop",
    "defaults",
    "gain_ranges",
    "px4_autotune_gains",
    "read_parameters",
    "write_param",
    "write_params",
]
