"""Options of holding a rotor against its physics; see `flightid.rotor_physics`."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.frozen import dataclass
from flightid.options import Options, option


@dataclass(frozen=True)
class RotorOptions(Options):
    """The rotor's speed, and what is known of it beside the model.

    Example
    -------
    >>> RotorOptions(rotor_speed_rad_s=89.0).lock_number is None
    True
    """

    rotor_speed_rad_s: float = option(unit="rad/s", above=0.0, doc="Speed of the rotor.")
    lock_number: float | None = option(None, above=0.0, doc="Of a blade, for the theory.")
    bar_lock_number: float | None = option(None, above=0.0, doc="Of the stabilizer bar.")
    expected: Mapping[str, float] | None = option(
        None, doc="Other numbers to hold the identified ones against, by their name."
    )
    names: Mapping[str, str] | None = option(
        None, doc="Parameters by role where they differ from the library's."
    )
