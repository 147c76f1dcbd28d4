"""Gains as flown, in the forms in which an engineer has them: a loop, a log, or parameters."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.control.autopilots import AxisLoop, axis_loop, axis_loop_of
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
