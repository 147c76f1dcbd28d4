"""Gains as flown, in the forms in which an engineer has them: a loop, a log, or parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress

from flightid.control.autopilots import AxisLoop, axis_loop, axis_loop_of
from flightid.control.tuning.gain_steps import reached
from flightid.errors import DataError, OptionError
from flightid.logs import Log

Gains = AxisLoop | Log | Mapping[str, float]
GainsOfAxes = Mapping[str, AxisLoop] | Log | Mapping[str, float]


def flown_loop(gains: Gains | GainsOfAxes, autopilot: str, axis: str) -> AxisLoop:
    """Controllers of an axis as flown.

    Parameters
    ----------
    gains : AxisLoop, Log, or mapping of str to float or to AxisLoop
        The axis itself; the log of the flight; parameters by name; or loops by axis.
    autopilot, axis : str
        Of parameters given by name; a log tells its own autopilot.

    Raises
    ------
    DataError
        A log whose parameters are missing or changed in flight; see `axis_loop_of`.
    OptionError
        The rate of the controller is not known.
    """
    if isinstance(gains, AxisLoop):
        return gains
    if isinstance(gains, Log):
        return axis_loop_of(gains, axis)
    own = gains.get(axis)
    if isinstance(own, AxisLoop):
        return own
    named = {name: value for name, value in gains.items() if not isinstance(value, AxisLoop)}
    return axis_loop(autopilot, axis, named)


def loops_of(gains: GainsOfAxes, autopilot: str, axes: Iterable[str]) -> list[AxisLoop]:
    """Controllers of those axes that the flight tells."""
    found = []
    for axis in axes:
        with suppress(DataError):
            found.append(flown_loop(gains, autopilot, axis))
    return found


def require_known(values: Mapping[str, float], loops: Sequence[AxisLoop]) -> None:
    """Refuse gains by hand that no axis has, or that lie outside the autopilot's range.

    Raises
    ------
    OptionError
        Names every one of them.
    """
    ranges = {name: each for loop in loops for name, each in loop.ranges.items()}
    known = {name for loop in loops for name in loop.names.values()}
    unknown = [name for name in values if name not in known]
    if unknown:
        raise OptionError(
            "by_hand names what is no gain of these axes",
            found=", ".join(unknown),
            needed="among " + ", ".join(sorted(known & ranges.keys())),
        )
    flown = {n: value for loop in loops if loop.has_flown for n, value in loop.gains.items()}
    ends = {n: reached(each.low, each.high, flown.get(n), each.unit) for n, each in ranges.items()}
    outside = [
        f"{name} = {value:g} ({ends[name][0]:g} to {ends[name][1]:g})"
        for name, value in values.items()
        if name in ends and not ends[name][0] <= value <= ends[name][1]
    ]
    if outside:
        raise OptionError(
            "a gain by hand lies outside its range",
            found=", ".join(outside),
            needed="values in the range of the autopilot's documentation, which reaches what flew",
        )
