"""What an autopilot's filters cost in phase, what noise they let through, and better ones."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from flightid.control.autopilots import AXES, AxisLoop, axis_loop_of
from flightid.control.autopilots.filter_stages import FilterStage, centre_hz
from flightid.control.autopilots.output_noise import (
    LOWEST_HZ,
    GyroSpectrum,
    OutputNoise,
    output_noise,
)
from flightid.control.tuning.filter_choice import FilterChoice, choose_filters
from flightid.errors import FlightidError
from flightid.frozen import dataclass
from flightid.inspection.signals import Span
from flightid.logs import Log
from flightid.review.gyro_noise import GyroNoise
from flightid.review.loop_response import LoopResponse
from flightid.review.notch_proposal import NEAR, proposed_notches
from flightid.review.thresholds import OUTPUT_NOISE
from flightid.table import Cell, Column, Table

USUAL_HZ = 5.0
"""Where multirotors of middle size cross over: taken where the flight tells no frequency."""


@dataclass(frozen=True)
class AxisFilterUse:
    """Filters of one axis as flown.

    Attributes
    ----------
    axis : str
    stages : tuple of FilterStage
        Those that were on.
    noise : OutputNoise or None
        What the gyro's noise makes of the output; None where the log has no spectrum.
    full : float
        Full command in the unit of the output.
    """

    axis: str
    stages: tuple[FilterStage, ...]
    noise: OutputNoise | None
    full: float


@dataclass(frozen=True)
class FilterReview:
    """Filters of a flight.

    Attributes
    ----------
    axes : tuple of AxisFilterUse
    at_hz : float
        Where phase counts.
    measured : bool
        Whether it is the highest frequency where a rate loop lags by 90°, and not the usual one.
    choice : FilterChoice or None
        Better filters; None where the log has no spectrum.
    missed : tuple of str
        Sentences on motors' peaks that no notch stands on, though notches are on.
    unknown : tuple of str
        Sentences on notches whose place the log does not tell.
    reason : str
        Why there are none.
    """

    axes: tuple[AxisFilterUse, ...] = ()
    at_hz: float = USUAL_HZ
    measured: bool = False
    choice: FilterChoice | None = None
    missed: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    reason: str = ""

    def table(self) -> Table:
        """Every filter with its delay and phase; those that all axes share once."""
        columns = (
            Column("axis"),
            Column("filter"),
            Column("form"),
            Column("on"),
            Column("delay", "ms", 3),
            Column(f"phase at {self.at_hz:.3g} Hz", "deg", 3),
        )
        rows: list[tuple[Cell, ...]] = []
        for use in self.axes:
            for stage in use.stages:
                shared = all(stage in other.stages for other in self.axes)
                if shared and use is not self.axes[0]:
                    continue
                axis = "all" if shared and len(self.axes) > 1 else use.axis
                phase = stage.phase_deg(2.0 * np.pi * self.at_hz)
                rows.append(
                    (axis, stage.name, stage.settings, stage.path, 1e3 * stage.delay_s, phase)
                )
        why = (
            "Phase where the fastest rate loop lags by 90 deg."
            if self.measured
            else f"This log tells no crossover: phase at {USUAL_HZ:g} Hz, where multirotors of "
            "middle size cross over."
        )
        return Table("Filters as flown", columns, tuple(rows), (why, *self.unknown))

    def noise_table(self) -> Table:
        """Noise of the gyro in each output, by path, in percent of full command."""
        columns = (
            Column("axis"),
            Column("by P", "%", 3),
            Column("by D", "%", 3),
            Column("in all", "%", 3),
        )
        rows: list[tuple[Cell, ...]] = []
        for use in self.axes:
            if use.noise is not None:
                scale = 100.0 / use.full
                paths = [_path(use.noise, letter, scale) for letter in "PD"]
                rows.append((use.axis, *paths, scale * use.noise.total))
        told = (use.noise.highest_hz for use in self.axes if use.noise is not None)
        note = (
            f"Rms in percent of full command, of what the gyroscope holds from {LOWEST_HZ:g} to "
            f"{min(told, default=0.0):.4g} Hz."
        )
        return Table("Noise of the gyroscope in the outputs", columns, tuple(rows), (note,))

    def choice_table(self) -> Table:
        """Parameters that would serve better, with what they cost and save."""
        changes = () if self.choice is None else self.choice.changes
        columns = (Column("parameter"), Column("flown", digits=4), Column("better", digits=4))
        rows = tuple((change.name, change.old, change.value) for change in changes)
        return Table("Filters that would serve better", columns, rows, tuple(self.words()))

    def words(self) -> Iterator[str]:
        """What the better filters do to each axis."""
        if self.choice is None or not self.choice.changes:
            return
        full = {use.axis: use.full for use in self.axes}
        for each in self.choice.axes:
            scale, gained = 100.0 / full[each.axis], each.phase_gained_deg
            if each.noise_flown == each.noise_new and gained == 0.0:
                continue
            word = "saves" if gained >= 0.0 else "costs"
            yield (
                f"{each.axis}: {word} {abs(gained):.2g} deg at "
                f"{each.crossover_rad_s / (2 * np.pi):.3g} Hz, noise "
                f"{scale * each.noise_flown:.2g} → {scale * each.noise_new:.2g} %"
            )


def _path(noise: OutputNoise, letter: str, scale: float) -> float | None:
    found = (value for name, value in noise.paths.items() if name.endswith(f"_{letter}"))
    value = next(found, None)
    return None if value is None else scale * value


def filter_review(
    log: Log,
    spans: Sequence[Span],
    noise: GyroNoise,
    loops: Sequence[LoopResponse],
    *,
    keep_phase: Collection[str] = (),
) -> FilterReview:
    """Read the filters from the log's parameters and judge them by the spectrum of the flight.

    Parameters
    ----------
    log : Log
    spans : sequence of tuple of float
        Where the vehicle flew.
    noise : GyroNoise
    loops : sequence of LoopResponse
        Rate loops tell where phase counts.
    keep_phase : collection of str
        Axes that the better filters may cost no phase.
    """
    try:
        flown: dict[str, AxisLoop] = {axis: axis_loop_of(log, axis) for axis in AXES}
    except FlightidError as error:
        return FilterReview(reason=str(error))
    read: dict[str, float | None] = {axis: _lags_by_90_hz(loops, axis) for axis in AXES}
    at_hz = max((hz for hz in read.values() if hz), default=USUAL_HZ)
    told = noise.is_told and bool(spans)
    spectra: dict[str, GyroSpectrum] = {axis: noise.of_axis(axis) for axis in AXES if told}
    uses = tuple(
        AxisFilterUse(
            axis,
            loop.filter_stages(),
            output_noise(loop, spectra[axis]) if told else None,
            loop.full_output,
        )
        for axis, loop in flown.items()
    )
    unknown = tuple(dict.fromkeys(text for loop in flown.values() for text in loop.unknown_notches))
    found = FilterReview(uses, at_hz, any(read.values()), unknown=unknown)
    if not told:
        return found
    choice = choose_filters(
        flown,
        spectra,
        dict.fromkeys(flown, 2.0 * np.pi * at_hz),
        {use.axis: OUTPUT_NOISE.value * use.full for use in uses},
        variants=list(proposed_notches(log, spans, noise, flown)),
        keep_phase=keep_phase,
    )
    return replace(found, choice=choice, missed=tuple(_missed(flown["roll"], noise)))


def _lags_by_90_hz(loops: Sequence[LoopResponse], axis: str) -> float | None:
    for loop in loops:
        if (loop.axis, loop.loop) == (axis, "rate"):
            return next((r.value for r in loop.readings if r.name.endswith("-90 deg")), None)
    return None


def _missed(loop: AxisLoop, noise: GyroNoise) -> Iterator[str]:
    """Peaks ahead of the filters that notches, though they are on, do not stand on."""
    if not loop.gyro_notches or noise.gyro != "raw" or not noise.peaks:
        return
    centres = [centre_hz(section, loop.gyro_rate_hz) for section in loop.gyro_notches]
    left = [
        peak.frequency_hz
        for peak in noise.peaks
        if all(abs(centre - peak.frequency_hz) > NEAR * peak.frequency_hz for centre in centres)
        and peak.frequency_hz < 0.5 * loop.gyro_rate_hz
    ]
    if len(left) == len(noise.peaks):
        at = ", ".join(f"{hz:.3g}" for hz in sorted(set(np.round(centres, 1))))
        tops = ", ".join(f"{hz:.3g}" for hz in left)
        yield f"the notches stood at {at} Hz, and no peak of the gyroscope is there: {tops} Hz"
