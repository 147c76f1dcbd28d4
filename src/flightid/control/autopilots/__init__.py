"""Autopilots' own controllers: exact structure, exact discrete time, their own parameter names."""

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.betaflight_filters import betaflight_filters
from flightid.control.autopilots.filter_stages import FilterStage
from flightid.control.autopilots.from_log import axis_loop_of, parameters_at
from flightid.control.autopilots.loop_run import LoopFlags, LoopRun, LoopState
from flightid.control.autopilots.make import AUTOPILOTS, axis_loop
from flightid.control.autopilots.notch_tracking import NotchTracking, notch_tracking
from flightid.control.autopilots.parameter_files import (
    GainChange,
    WrittenParameters,
    read_parameters,
    write_ardupilot_parameters,
    write_betaflight_settings,
    write_parameters,
    write_px4_parameters,
)
from flightid.control.autopilots.parameter_table import AXES, GainRange, defaults, gain_ranges
from flightid.control.autopilots.px4_autotune import Px4AutotuneGains, px4_autotune_gains
from flightid.control.autopilots.replay import replay
from flightid.control.autopilots.replay_result import Replay, TermReplay

__all__ = [
    "AUTOPILOTS",
    "AXES",
    "AxisLoop",
    "FilterStage",
    "GainChange",
    "GainRange",
    "LoopFlags",
    "LoopRun",
    "LoopState",
    "NotchTracking",
    "Px4AutotuneGains",
    "Replay",
    "TermReplay",
    "WrittenParameters",
    "axis_loop",
    "axis_loop_of",
    "betaflight_filters",
    "defaults",
    "gain_ranges",
    "notch_tracking",
    "parameters_at",
    "px4_autotune_gains",
    "read_parameters",
    "replay",
    "write_ardupilot_parameters",
    "write_betaflight_settings",
    "write_parameters",
    "write_px4_parameters",
]
