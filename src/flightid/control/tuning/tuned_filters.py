"""Filters that gains were tuned with: phase, noise, and axes that fly them unjudged."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field, replace

import numpy as np

from flightid.control.autopilots import GainChange
from flightid.control.autopilots.output_noise import GyroSpectrum, output_noise
from flightid.control.tuning.filter_choice import (
    WORTH_DEG,
    AxisFilters,
    FilterChoice,
    change_words,
    phase_deg,
)
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.requirements import TuningRequirements
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.table import Cell, Column, Table

REACHED = 1.005
"""A limit that is passed by less is kept."""


@dataclass(frozen=True)
class TunedFilters:
    """Filters that were chosen by the noise of the flight, and gains tuned with them.

    Attributes
    ----------
    changes : tuple of GainChange
        Parameters to set with the gains; none where the flown ones are as good.
    axes : tuple of AxisFilters
        With the new gains where the axis was tuned, at the crossover that they make.
    tuned : tuple of str
        Axes whose gains are new.
    reason : str
        Why no filters could be chosen; the flown ones stand.
    shared_deg : mapping of str to float
        By axis: phase that the filters of all axes alone save, deg.

    Example
    -------
    >>> TunedFilters(reason="no spectrum").findings()[0].code
    'filters-as-flown'
    """

    changes: tuple[GainChange, ...] = ()
    axes: tuple[AxisFilters, ...] = ()
    tuned: tuple[str, ...] = ()
    reason: str = ""
    shared_deg: Mapping[str, float] = field(default_factory=dict)

    def table(self) -> Table:
        """Phase and noise of each axis, as flown, with the filters, and with the gains too."""
        columns = (
            *(Column("axis"), Column("at", "Hz", 3), Column("phase saved", "deg", 2)),
            *(Column("noise as flown", digits=2), Column("with these filters", digits=2)),
            *(Column("and the new gains", digits=2), Column("fine below", digits=2)),
            Column("unit"),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                *(each.axis, each.crossover_rad_s / (2.0 * np.pi), each.phase_gained_deg),
                *(each.noise_flown, each.noise_new, each.noise_tuned, each.noise_limit, each.unit),
            )
            for each in self.axes
        ]
        said = change_words(self.changes) or self.reason
        said = said or "As flown: no other is worth a change."
        notes = (said, "Noise: rms of the gyroscope's in the output from 20 Hz up, 1 is full.")
        return Table("Filters tuned with", columns, tuple(rows), notes if self.axes else (said,))

    @property
    def words(self) -> tuple[str, ...]:
        """What the filters do to each axis, one sentence each; why there are none."""
        if self.reason or not self.changes:
            said = f"Filters as flown: {self.reason or 'no other is worth a change'}."
            return (said, *self._freed())
        told = (
            f"Filters, {each.axis}: {abs(each.phase_gained_deg):.2g} deg "
            f"{'saved' if each.phase_gained_deg >= 0.0 else 'lost'} at the crossover, output noise "
            f"{each.noise_flown:.2g} as flown, {each.noise_new:.2g} with the filters"
            + ("" if each.noise_tuned is None else f", {each.noise_tuned:.2g} with the gains too")
            for each in self.axes
        )
        return (*told, *self._freed())

    def _freed(self) -> Iterator[str]:
        """That measured noise lets gains go further than a bound on its growth would."""
        usual = TuningRequirements().noise_growth or math.inf
        freed = [
            f"{each.axis} {each.noise_flown:.2g} as flown, {each.noise_tuned:.2g} with the new "
            f"gains ({each.noise_limit:.2g} is fine)"
            for each in self.axes
            if each.noise_tuned is not None and each.noise_tuned > usual * each.noise_flown
        ]
        if freed:
            yield (
                "Where filters are asked for, the noise that was measured bounds the gains, not "
                f"{usual:g} times that of the flown ones: they go further. Output noise: "
                f"{', '.join(freed)}."
            )

    def unjudged(self, left: Iterable[str]) -> dict[str, float]:
        """Phase that axes which stay as flown would lose to filters that all axes share, deg."""
        lost = {axis: -self.shared_deg.get(axis, 0.0) for axis in left}
        return {axis: deg for axis, deg in lost.items() if deg > WORTH_DEG}

    def findings(self) -> tuple[Finding, ...]:
        """Verdicts."""
        return tuple(self._findings())

    def _findings(self) -> Iterator[Finding]:
        if self.reason:
            said = f"filters are kept as flown: {self.reason}"
            yield Finding("filters-as-flown", Light.AMBER, said, "log the gyro at the loop's rate")
        for each in self.axes:
            noise = each.noise_new if each.noise_tuned is None else each.noise_tuned
            if noise > REACHED * each.noise_limit:
                said = (
                    f"noise of the gyroscope moves the {each.axis} output by {noise:.2g}, rms "
                    f"({each.noise_flown:.2g} as flown); {each.noise_limit:g} is fine"
                )
                mend = "balance propellers and damp the mount"
                yield Finding(f"output-noise-{each.axis}", Light.AMBER, said, mend)
        still = [axis for axis, deg in self.shared_deg.items() if deg and axis not in self.tuned]
        if still:
            said = f"{' and '.join(still)} fly the shared filters with their old gains, unjudged"
            yield Finding(
                "filters-unjudged", Light.AMBER,
                f"{said}; they lose at most {WORTH_DEG:g} deg by them", "sweep these axes too",
            )  # fmt: skip


def tuned_filters(choice: FilterChoice, designs: Mapping[str, PidDesign]) -> TunedFilters:
    """Phase and noise of the filters with the gains that were tuned with them."""
    tuned = tuple(axis for axis, design in designs.items() if design.exists)
    axes = tuple(
        _with_gains(each, designs[each.axis], choice.spectra[each.axis])
        if each.axis in tuned
        else replace(each, phase_new_deg=each.phase_shared_deg, noise_new=each.noise_shared)
        for each in choice.axes
    )
    kept = {change for axis in tuned for change in choice.changes_of(axis)}
    changes = tuple(change for change in choice.changes if change in kept)
    shared = {each.axis: each.phase_shared_deg - each.phase_flown_deg for each in choice.axes}
    return TunedFilters(changes, axes, tuned, shared_deg=shared)


def _with_gains(told: AxisFilters, design: PidDesign, spectrum: GyroSpectrum) -> AxisFilters:
    crossing = design.worst_case("rate loop", "crossover").nominal or told.crossover_rad_s
    gains = design.flown.with_gains(design.gains)
    noise = output_noise(design.loop, spectrum, flown=design.flown).total
    return replace(
        told, crossover_rad_s=crossing, phase_flown_deg=phase_deg(gains, crossing),
        phase_new_deg=phase_deg(design.loop, crossing), noise_tuned=noise,
    )  # fmt: skip
