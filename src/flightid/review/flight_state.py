"""What loops depend on beside gains: vehicle, autopilot, frame, motors, filters, battery."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from flightid.control.autopilots import AXES, axis_loop_of
from flightid.control.autopilots.filter_stages import FilterStage
from flightid.control.autopilots.filters import Section
from flightid.errors import FlightidError
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
MOTORS = "motors' curve"
OFF = "off"
MATERIAL_DELAY_S = 0.5e-3
"""Of a filter, beyond which it is another one to a loop: a degree at 5.6 Hz (ours). Notches
that follow the motors mostly differ from flight to flight by less."""


@dataclass(frozen=True)
class FlightState:
    """What a flight tells of what flew, as far as its loops depend on it.

    Attributes
    ----------
    told : mapping of str to str
        By what it is: ``"firmware"``; what a log does not tell is absent.
    start_v : float or None
        First voltage of the battery, V.
    gyro : tuple of FilterStage or None
        Filters on the gyroscope that were on: models of its rates hold them, so promises are of
        those. The other filters of a promise are those of the flight that it is held against.

    Example
    -------
    >>> before = FlightState({"vehicle": "ardupilot copter", "frame": "QUAD/X"}, 16.4)
    >>> before.unlike(FlightState({"vehicle": "ardupilot plane"}, 12.1))
    {'vehicle': ('ardupilot copter', 'ardupilot plane'), 'battery': ('16.4 V', '12.1 V')}
    """

    told: Mapping[str, str]
    start_v: float | None = None
    gyro: tuple[FilterStage, ...] | None = None

    @classmethod
    def of(cls, flown: FlightReview | Log) -> FlightState:
        """State of a flight, from its review or its log."""
        if isinstance(flown, Log):
            identity = flight_identity(flown, flight_phases(flown, find_actuators(flown)))
            gyro = _flown_gyro(flown)
        else:
            identity = flown.identity
            axes = flown.filters.axes
            gyro = _of_gyro(stage for use in axes for stage in use.stages) if axes else None
        battery = identity.battery
        cells = None if battery is None else battery.cells
        told = _told(
            flown.kind, flown.vehicle, flown.firmware, identity.frame, identity.board,
            identity.motors, cells,
        )  # fmt: skip
        return cls(dict(told), None if battery is None else battery.start_v, gyro)

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
        volts = float(start_v) if isinstance(start_v, float | int) else None
        return cls(dict(told), volts, _told_gyro(_mapping(review, "filters").get("axes")))

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

    def other_filters(self, other: FlightState) -> dict[str, tuple[str, str]]:
        """Filters on the gyroscope with another delay, in words of both; none where one is silent.

        Example
        -------
        >>> FlightState({}).other_filters(FlightState({}, gyro=()))
        {}
        """
        if self.gyro is None or other.gyro is None:
            return {}
        old, new = ({stage.name: stage for stage in each} for each in (self.gyro, other.gyro))
        pairs = {name: (old.get(name), new.get(name)) for name in {**old, **new}}
        return {
            name: (_words(one), _words(two))
            for name, (one, two) in pairs.items()
            if abs(_delay_s(one) - _delay_s(two)) > MATERIAL_DELAY_S
        }


def _words(stage: FilterStage | None) -> str:
    return OFF if stage is None else stage.settings


def _delay_s(stage: FilterStage | None) -> float:
    return 0.0 if stage is None else stage.delay_s


def _of_gyro(stages: Iterable[FilterStage]) -> tuple[FilterStage, ...]:
    """Those on the gyroscope, of which axes share most, once."""
    return tuple({stage.name: stage for stage in stages if stage.path == "gyro"}.values())


def _flown_gyro(log: Log) -> tuple[FilterStage, ...] | None:
    try:
        loops = [axis_loop_of(log, axis) for axis in AXES]
    except FlightidError:
        return None
    return _of_gyro(stage for loop in loops for stage in loop.filter_stages())


def _section(*five: float) -> Section:
    b0, b1, b2, a1, a2 = map(float, five)
    return b0, b1, b2, a1, a2


def _told_gyro(axes: object) -> tuple[FilterStage, ...] | None:
    """Of the filters of a review in results; None where they tell none."""
    if not isinstance(axes, list) or not axes:
        return None
    try:
        told = [stage for use in axes for stage in use["stages"]]
        return _of_gyro(
            FilterStage(
                str(each["name"]), str(each["settings"]), each["path"], float(each["rate_hz"]),
                tuple(_section(*section) for section in each["sections"]),
            )
            for each in told
        )  # fmt: skip
    except (KeyError, TypeError, ValueError):
        return None


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
        MOTORS: ", ".join(f"{name} {value:.4g}" for name, value in motors.items()),
        "battery cells": cells,
    }
    yield from ((what, str(value)) for what, value in said.items() if value)


def _mapping(of: Mapping[str, object], name: str) -> Mapping[str, object]:
    found = of.get(name)
    return found if isinstance(found, dict) else {}
