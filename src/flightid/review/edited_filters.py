"""Filters that a hand edits: what they make of a flight's gyro noise, and the phase they cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AXES, AxisLoop, GainChange, axis_loop_of
from flightid.control.autopilots.filter_stages import FilterStage
from flightid.control.autopilots.filters import Section
from flightid.control.autopilots.gyro_notches import ardupilot_notches, px4_notches
from flightid.control.autopilots.notch_tracking import NotchTracking, notch_tracking
from flightid.control.autopilots.output_noise import LEAST_POWER, output_noise
from flightid.control.tuning.filter_choice import MOVABLE, FilterChoice, phase_deg
from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass
from flightid.inspection.actuators import find_actuators
from flightid.inspection.flight_phases import flight_phases
from flightid.logs import Log
from flightid.review.filters import filter_review
from flightid.review.flown_range import flown_ranges
from flightid.review.gyro_noise import GyroNoise, gyro_noise
from flightid.review.loops import loop_responses

Array = NDArray[np.float64]
NOTCHES: dict[str, dict[str, float]] = {
    "ardupilot": {
        "INS_HNTCH_ENABLE": 0.0, "INS_HNTCH_MODE": 1.0, "INS_HNTCH_REF": 0.0,
        "INS_HNTCH_FREQ": 80.0, "INS_HNTCH_BW": 40.0, "INS_HNTCH_ATT": 40.0,
        "INS_HNTCH_HMNCS": 3.0, "INS_HNTCH_FM_RAT": 1.0,
    },
    "px4": {
        "IMU_GYRO_NF0_FRQ": 0.0, "IMU_GYRO_NF0_BW": 20.0,
        "IMU_GYRO_NF1_FRQ": 0.0, "IMU_GYRO_NF1_BW": 20.0, "IMU_GYRO_DNF_EN": 0.0,
    },
}  # fmt: skip
"""Parameters of notches that are edited, with what firmware takes where a log has none."""
NOTCH = ("INS_HNTCH_", "IMU_GYRO_NF0_", "IMU_GYRO_NF1_", "IMU_GYRO_DNF_")
"""What the names of one notch begin with: its effect rests on all of them."""
HIGHEST_HZ = 1e4
UNTOLD = "not in the log: what firmware takes"


@dataclass(frozen=True, eq=False)
class EditedAxis:
    """What edited filters do to one axis.

    Attributes
    ----------
    axis : str
    frequency_hz : ndarray, shape (n_f,)
    ahead, flown, edited : ndarray, shape (n_f,)
        One-sided density ahead of the gyro's filters, and behind the flown and the edited ones,
        (rad/s)² per Hz; NaN where the flown filters left too little to tell what was ahead.
    phase_flown_deg, phase_edited_deg : float
        Of the controller, its filters included, at `FilterBench.at_hz`.
    noise_flown, noise_edited : float
        Rms of the output that the gyro's noise makes, share of full command.
    stages : tuple of FilterStage
        Edited filters that are on.
    """

    axis: str
    frequency_hz: Array
    ahead: Array
    flown: Array
    edited: Array
    phase_flown_deg: float
    phase_edited_deg: float
    noise_flown: float
    noise_edited: float
    stages: tuple[FilterStage, ...]


@dataclass(frozen=True, eq=False)
class FilterBench:
    """The gyro's noise of a flight and its controllers, to try filters on.

    Attributes
    ----------
    loops : mapping of str to AxisLoop
        As flown, by axis.
    noise : GyroNoise
    at_hz : float
        Where phase counts.
    measured : bool
        Whether the flight tells that frequency.
    parameters : mapping of str to float
        Of the vehicle.
    tracking : NotchTracking
        What its notches follow.
    kind : str
        Of the log.
    choice : FilterChoice or None
        Filters that would serve better.
    margins_deg : mapping of str to tuple of float
        Phase margins that the flown filters and gains keep, by axis; see `filter_costs`.
    """

    loops: Mapping[str, AxisLoop]
    noise: GyroNoise
    at_hz: float
    measured: bool
    parameters: Mapping[str, float]
    tracking: NotchTracking
    kind: str
    choice: FilterChoice | None
    margins_deg: Mapping[str, tuple[float, float]]

    @property
    def seen_hz(self) -> float:
        """Up to where the log shows noise: half of the rate of its samples."""
        return 0.5 * self.noise.rate_hz

    @property
    def low_passes(self) -> dict[str, float]:
        """Cut-offs that can be edited, as flown, Hz; 0: off."""
        return {
            loop.names[role]: loop.values[role]
            for loop in self.loops.values()
            for role in MOVABLE
            if role in loop.values
        }

    @property
    def values(self) -> dict[str, float]:
        """Every filter's parameter that can be edited, as flown."""
        usual = NOTCHES.get(self.kind, {})
        return self.low_passes | {name: self.parameters.get(name, usual[name]) for name in usual}

    def edited(self, values: Mapping[str, float]) -> tuple[EditedAxis, ...]:
        """What other filters would make of the noise that was logged.

        Parameters
        ----------
        values : mapping of str to float
            By the autopilot's names; the others stay as flown.

        Raises
        ------
        OptionError
            A parameter that is none of these, or a value without meaning.

        Assumes
        -------
        The noise ahead of the filters stays as it was: loops that are closed move nothing there.
        """
        bad = self.refused(values)
        if bad:
            raise OptionError(
                "no filter of this vehicle",
                found=", ".join(f"{name} = {value:g}" for name, value in bad.items()),
                needed=f"values from 0 to {HIGHEST_HZ:g} of {', '.join(self.values)}",
            )
        return tuple(self._axis(axis, values) for axis in self.loops)

    def refused(self, values: Mapping[str, float]) -> dict[str, float]:
        """Those of some values that cannot be tried: no such filter, or out of its range."""
        known = self.values
        return {n: v for n, v in values.items() if n not in known or not 0.0 <= v <= HIGHEST_HZ}

    def changes(self, values: Mapping[str, float]) -> tuple[GainChange, ...]:
        """Parameters that a file would set: what differs, and what a notch rests on beside it.

        A log that holds no parameter of a notch leaves it to what firmware takes; a file that sets
        some of them sets the others to that as well.
        """
        known, held = self.values, self.parameters
        edited = {name: value for name, value in values.items() if value != known.get(name)}
        notches = tuple(each for each in NOTCH if any(name.startswith(each) for name in edited))
        assumed = {
            name: value
            for name, value in NOTCHES.get(self.kind, {}).items()
            if name not in held and name not in edited and name.startswith(notches)
        }
        set_ = [GainChange(n, value, held.get(n), "filter") for n, value in edited.items()]
        beside = [GainChange(n, value, None, "not in the log") for n, value in assumed.items()]
        return (*set_, *beside)

    def way_back(self, values: Mapping[str, float]) -> tuple[GainChange, ...]:
        """What sets every one of them as it flew; what the log lacks to what firmware takes."""
        known = self.values
        return tuple(
            GainChange(each.name, known[each.name], None, "" if self.knows(each.name) else UNTOLD)
            for each in self.changes(values)
        )

    def knows(self, name: str) -> bool:
        """Whether the log tells the value of a parameter that flew."""
        return name in self.parameters

    def _axis(self, axis: str, values: Mapping[str, float]) -> EditedAxis:
        flown = self.loops[axis]
        own = {name: value for name, value in values.items() if name in flown.gains}
        made = replace(flown.with_gains(own), gyro_notches=self._notches(flown, values))
        spectrum = self.noise.of_axis(axis)
        omega = 2.0 * np.pi * spectrum.frequency_hz
        power = np.abs(flown.gyro_response(omega)) ** 2
        if spectrum.gyro == "raw":
            ahead, behind = spectrum.density, spectrum.density * power
        else:
            behind = spectrum.density
            ahead = np.where(power >= LEAST_POWER, behind / np.maximum(power, LEAST_POWER), np.nan)
        full, turn = flown.full_output, 2.0 * np.pi * self.at_hz
        return EditedAxis(
            axis,
            spectrum.frequency_hz,
            ahead,
            behind,
            ahead * np.abs(made.gyro_response(omega)) ** 2,
            before := phase_deg(flown, turn),
            before + (phase_deg(made, turn) - before + 180.0) % 360.0 - 180.0,
            output_noise(flown, spectrum).total / full,
            output_noise(made, spectrum, flown=flown).total / full,
            made.filter_stages(),
        )

    def _notches(self, loop: AxisLoop, values: Mapping[str, float]) -> tuple[Section, ...]:
        """Those that flew, where none of their parameters was edited."""
        usual = NOTCHES.get(self.kind, {})
        if not any(name in usual for name in values):
            return loop.gyro_notches
        asked = {**usual, **self.parameters, **values}
        if self.kind == "px4":
            place = AXES.index(loop.axis)
            return px4_notches(asked, loop.gyro_rate_hz, self.tracking, place).sections
        return ardupilot_notches(asked, loop.gyro_rate_hz, self.tracking).sections


def filter_bench(log: Log) -> FilterBench:
    """What filters can be tried on: the noise of a flight and the controllers that flew it.

    Parameters
    ----------
    log : Log

    Raises
    ------
    DataError
        The log tells no controller, or no spectrum of the gyro in the air.

    Example
    -------
    >>> import flightid as fid
    >>> log = fid.read_log("flight.bin")                             # doctest: +SKIP
    >>> filter_bench(log).edited({"INS_GYRO_FILTER": 40.0})          # doctest: +SKIP
    """
    spans = flight_phases(log, find_actuators(log)).airborne
    noise = gyro_noise(log, spans)
    loops = loop_responses(log, spans)
    review = filter_review(log, spans, noise, loops)
    if review.reason or not (noise.is_told and spans):
        raise DataError(
            f"no filters can be tried on this log: {review.reason or noise.reason or 'no flight'}",
            needed="a spectrum of the gyro in the air, and the parameters of the controller",
            action="log the gyro faster: raw batches (ArduPilot), the high rate (PX4)",
        )
    return FilterBench(
        {axis: axis_loop_of(log, axis) for axis in AXES},
        noise,
        review.at_hz,
        review.measured,
        log.parameters,
        notch_tracking(log, spans),
        log.kind,
        review.choice,
        {
            each.axis: each.phase_margin_deg
            for each in flown_ranges(log, loops)
            if each.phase_margin_deg is not None
        },
    )
