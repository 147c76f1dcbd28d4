"""Which channels of the maps belong to each axis, and where a flight shows in them."""

from __future__ import annotations

from typing import NamedTuple


class AxisChannels(NamedTuple):
    """Canonical names of an axis: command, body rate, set-point of the rate."""

    command: str
    rate: str
    set_point: str


_COPTER = {
    "roll": AxisChannels("tau_phi", "p", "p_ref"),
    "pitch": AxisChannels("tau_theta", "q", "q_ref"),
    "yaw": AxisChannels("tau_psi", "r", "r_ref"),
}
_PLANE = {
    "roll": AxisChannels("aileron", "p", "p_ref"),
    "pitch": AxisChannels("elevator", "q", "q_ref"),
    "yaw": AxisChannels("rudder", "r", "r_ref"),
}


def axes_of(vehicle: str | None) -> dict[str, AxisChannels]:
    """Channels of roll, pitch and yaw for a kind of vehicle; mixer commands where it is unknown."""
    return _PLANE if vehicle == "plane" else _COPTER
