"""What loops depend on beside their gains: vehicle, autopilot, firmware, frame, motors, battery."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from flightid.frozen import dataclass
from flightid.inspection.actuators import find_actuators
from flightid.inspection.flight_phases import flight_phases
from flightid.logs import Log
from flightid.review.identity import flight_identity

if TYPE_CHECKING:
    from flightid.review.result import FlightReview

MATERIAL_VOLTAGE = 1.2
"""Ratio of first voltages beyond which the batteries are not alike: a cell empties by a fifth."""
OTHERS = ("vehicle", "autopilot", "frame")
"""What tells another vehicle; the rest may change on one."""
BY_NUMBER = "FRAME_CLASS"


@dataclass(frozen=True)
class FlightState:
    """What a flight tells of what flew, as far as its loops depend on it.

    Attributes
    ----------
    told : mapping of str to str
        By what it is: ``"firmware"``; what a log does not tell is absent.
    start_v : float or None
        First voltage of the battery, V.

    Example
    -------
    >>> before = FlightState({"vehicle": "ardupilot copter", "frame": "QUAD/X"}, 16.4)
    >>> before.unlike(FlightState({"vehicle": "ardupilot plane"}, 12.1))
    {'vehicle': ('ardupilot copter', 'ardupilot plane'), 'battery': ('16.4 V', '12.1 V')}
    """

    told: Mapping[str, str]
    start_v: float | None = None

    @classmethod
    def of(cls, flown: FlightReview | Log) -> FlightState:
        """State of a flight, from its review or its log."""
        if isinstance(flown, Log):
            identity = flight_identity(flown, flight_phases(flown, find_actuators(flown)))
        else:
            identity = flown.identity
        battery = identity.battery
        cells = None if battery is None else battery.cells
        told = _told(
            flown.kind, flown.vehicle, flown.firmware, identity.frame, identity.board,
            identity.motors, cells,
        )  # fmt: skip
        return cls(dict(told), None if battery is None else battery.start_v)

    @classmethod
    def in_results(cls, review: Mapping[str, object]) -> FlightState:
        """State of the flight of a study, from the review in its ``results.json``."""
        identity = _mapping(review, "identity")
        battery, motors = _mapping(identity, "battery"), _mapping(identity, "motors")
        start_v, cells = battery.get("start_v"), battery.get("cells")
        words = (review.get("kind"), review.get("vehicle"), review.get("firmware"))
        told = _told(
            *words, identity.get("frame"), identity.get("board"),
            {name: value for name, value in motors.items() if isinstance(value, float | int)},
            cells if isinstance(cells, int) else None,
        )  # fmt: skip
        return cls(dict(told), float(start_v) if isinstance(start_v, float | int) else None)

    def unlike(self, other: FlightState) -> dict[str, tuple[str, str]]:
        """What differs from another, of what both tell: this, the other."""
        old, new = self.told, other.told
        found = {k: (old[k], new[k]) for k in old if new.get(k, old[k]) != old[k]}
        # One log names its frame where another has its number alone.
        if len({BY_NUMBER in frame for frame in found.get("frame", ())}) == 2:
            del found["frame"]
        if "battery cells" not in found and self.start_v and other.start_v:
            low, high = sorted((self.start_v, other.start_v))
            if high > MATERIAL_VOLTAGE * low:
                found["battery"] = f"{self.start_v:.3g} V", f"{other.start_v:.3g} V"
        return found


def _told(
    kind: object,
    vehicle: object,
    firmware: object,
    frame: object,
    board: object,
    motors: Mapping[str, float],
    cells: int | None,
) -> Iterator[tuple[str, str]]:
    said = {
        "vehicle": " ".join(str(each) for each in (kind, vehicle) if each),
        "autopilot": board,
        "firmware": firmware,
        "frame": frame,
        "motors' curve": ", ".join(f"{name} {value:.4g}" for name, value in motors.items()),
        "battery cells": cells,
    }
    yield from ((what, str(value)) for what, value in said.items() if value)


def _mapping(of: Mapping[str, object], name: str) -> Mapping[str, object]:
    found = of.get(name)
    return found if isinstance(found, dict) else {}
