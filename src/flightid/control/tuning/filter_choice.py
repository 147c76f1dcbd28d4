"""Cut-offs of low-passes, chosen from the gyro's noise and the phase that they cost."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop, GainChange
from flightid.control.autopilots.output_noise import GyroSpectrum, output_noise
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table

Array = NDArray[np.float64]
MOVABLE = ("gyro_filter", "fltd", "derivative_filter")
"""Roles of the low-passes that are moved; the error's and the target's stay."""
STEPS = 9
"""Cut-offs that are tried between the lowest and the highest."""
LOWEST_HZ = 5.0
"""Lowest cut-off that is tried, Hz."""
BEYOND = 3.0
"""Times a cut-off that a spectrum must reach to tell what passes it."""
WORTH_DEG = 1.0
"""Less phase than that is no reason to change a filter."""


@dataclass(frozen=True)
class AxisFilters:
    """What other filters do to one axis.

    Attributes
    ----------
    axis : str
    crossover_rad_s : float
        Where the phase is read, rad/s.
    phase_flown_deg, phase_new_deg : float
        Of the controller, its gyro filters included, at the crossover.
    noise_flown, noise_new, noise_limit : float
        Rms of the output from the gyro's noise, and what it may be.
    unit : str
        Of the output.
    phase_shared_deg, noise_shared : float
        With the new ones of those filters alone that other axes share.
    noise_tuned : float or None
        With new gains too; None where none were tuned.
    """

    axis: str
    crossover_rad_s: float
    phase_flown_deg: float
    phase_new_deg: float
    noise_flown: float
    noise_new: float
    noise_limit: float
    unit: str
    phase_shared_deg: float
    noise_shared: float
    noise_tuned: float | None = None

    @property
    def phase_gained_deg(self) -> float:
        """Lag that the new filters save at the crossover."""
        return self.phase_new_deg - self.phase_flown_deg


@dataclass(frozen=True, eq=False)
class FilterChoice(
    Result,
    schema="flightid.filter_choice/1",
    untold={"loops": "controllers with the filters", "spectra": "the log's own"},
):
    """Filters that cost the least phase and keep the output's noise below a limit.

    Attributes
    ----------
    changes : tuple of GainChange
        Parameters to set, with the flown values; none where the flown ones are as good.
    axes : tuple of AxisFilters
    within_limit : bool
        Whether every axis keeps its limit; False: the least noise that the ranges allow.
    loops : mapping of str to AxisLoop
        By axis: gains as flown and the chosen filters, around the plant of the flown ones.
    spectra : mapping of str to GyroSpectrum

    Example
    -------
    >>> import numpy as np, flightid as fid
    >>> from flightid.control.autopilots.output_noise import GyroSpectrum
    >>> loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0, gyro_rate_hz=2000.0)
    >>> quiet = GyroSpectrum(np.linspace(1.0, 1000.0, 500), np.full(500, 1e-9), "raw")
    >>> choose_filters({"roll": loop}, {"roll": quiet}, {"roll": 25.0}, {"roll": 0.01})
    FilterChoice(INS_GYRO_FILTER 20 to 40, ATC_RAT_RLL_FLTD 20 to 40)
    """

    changes: tuple[GainChange, ...]
    axes: tuple[AxisFilters, ...]
    within_limit: bool
    loops: Mapping[str, AxisLoop] = field(default_factory=dict)
    spectra: Mapping[str, GyroSpectrum] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Changes on one line."""
        return f"FilterChoice({self.words or 'as flown'})"

    @property
    def words(self) -> str:
        """Changes in words."""
        each = (
            f"{c.name} {c.value:.4g}" if c.old is None else f"{c.name} {c.old:.4g} to {c.value:.4g}"
            for c in self.changes
        )
        return ", ".join(each)

    def changes_of(self, axis: str) -> tuple[GainChange, ...]:
        """Changes of an axis: its own, and those that all axes share."""
        others = {
            name for other, loop in self.loops.items() if other != axis for name in loop.gains
        }
        foreign = others - set(self.loops[axis].gains)
        return tuple(each for each in self.changes if each.name not in foreign)

    @property
    def values(self) -> dict[str, float]:
        """New values by parameter."""
        return {change.name: change.value for change in self.changes}

    def summary(self) -> Table:
        """Phase and noise of each axis before and after."""
        columns = (
            Column("axis"),
            Column("at", "Hz", 3),
            Column("phase as flown", "deg", 3),
            Column("new", "deg", 3),
            Column("noise as flown", digits=2),
            Column("new", digits=2),
            Column("limit", digits=2),
            Column("unit"),
        )
        rows: list[tuple[Cell, ...]] = [
            (
                *(a.axis, a.crossover_rad_s / (2.0 * np.pi), a.phase_flown_deg, a.phase_new_deg),
                *(a.noise_flown, a.noise_new, a.noise_limit, a.unit),
            )
            for a in self.axes
        ]
        told = change_words(self.changes) or "As flown: none is worth a change."
        return Table("Filters", columns, tuple(rows), (told,))


def change_words(changes: Iterable[GainChange]) -> str:
    """Old and new values of parameters; of one that the log does not hold the new alone."""
    return "; ".join(
        f"{c.name} {'' if c.old is None else f'{c.old:.4g} → '}{c.value:.4g}" for c in changes
    )


def choose_filters(
    loops: Mapping[str, AxisLoop],
    spectra: Mapping[str, GyroSpectrum],
    crossovers_rad_s: Mapping[str, float],
    noise_limits: Mapping[str, float],
    *,
    step_limit: float = 2.0,
    variants: Sequence[tuple[Sequence[GainChange], Mapping[str, AxisLoop]]] = (),
    keep_phase: Collection[str] = (),
) -> FilterChoice:
    """Choose low-passes of gyro and D: the least lag at the crossover within a limit of noise.

    Parameters
    ----------
    loops : mapping of str to AxisLoop
        By axis: gains and filters as flown.
    spectra, crossovers_rad_s, noise_limits : mappings by axis
        Noise of the gyro; where phase counts, rad/s; largest rms of the output, in its unit.
    step_limit : float
        Largest ratio of a cut-off to the flown one.
    variants : sequence of pairs
        Other notches to try: their parameters, and the loops with them.
    keep_phase : collection of str
        Axes that may lose no phase (1° at most), for no gains are tuned to it.

    Notes
    -----
    A parameter that several axes share is one number. Without a choice within the limits, the one
    whose worst axis exceeds its limit least is taken.

    Reference
    ---------
    Åström & Hägglund, *Advanced PID Control* (2006), section 4.3 (filters against noise).
    """
    axes = list(loops)
    shared = _shared(loops)
    best: tuple[tuple[bool, float], dict[str, float], int] | None = None
    every = [((), dict(loops)), *((tuple(c), dict(v)) for c, v in variants)]
    for place, (_, base) in enumerate(every):
        for values in _grid(loops[axes[0]], shared, step_limit, spectra[axes[0]]):
            score, chosen = _score(
                base, loops, values, shared, spectra, crossovers_rad_s, noise_limits, step_limit,
                keep_phase,
            )  # fmt: skip
            worth = score[1] - (WORTH_DEG if place else 0.0)
            if best is None or (score[0], worth) > best[0]:
                best = ((score[0], worth), values | chosen, place)
    assert best is not None
    return _told(best, every, loops, spectra, crossovers_rad_s, noise_limits)


def _shared(loops: Mapping[str, AxisLoop]) -> tuple[str, ...]:
    """Parameters that every axis has, by name; of one axis alone those of the gyro."""
    names = [{loop.names[r] for r in MOVABLE if loop.values.get(r)} for loop in loops.values()]
    first = next(iter(loops.values()))
    common = set.intersection(*names) if len(names) > 1 else set()
    if first.values.get("gyro_filter"):
        common.add(first.names["gyro_filter"])
    return tuple(sorted(common))


def _cutoffs(loop: AxisLoop, name: str, step_limit: float, known_hz: float) -> list[float]:
    """Whole hertz from the flown cut-off over the limit to times the limit, inside its range.

    A cut-off is raised only where the spectrum goes far enough beyond it.
    """
    flown, known = loop.gains[name], loop.ranges.get(name)
    low, high = (known.low, known.high) if known else (flown, flown)
    low, high = max(low, LOWEST_HZ, flown / step_limit), min(high, flown * step_limit)
    high = min(high, max(flown, known_hz / BEYOND))
    if low >= high:
        return [flown]
    return sorted({flown, *np.round(np.geomspace(low, high, STEPS)).tolist()})


def _grid(
    loop: AxisLoop, names: Sequence[str], step_limit: float, spectrum: GyroSpectrum
) -> Iterator[dict[str, float]]:
    known_hz = float(spectrum.frequency_hz[-1])
    for values in product(*(_cutoffs(loop, name, step_limit, known_hz) for name in names)):
        yield dict(zip(names, values, strict=True))


def _own(loop: AxisLoop, shared: Sequence[str]) -> list[str]:
    """Names of the axis' own cut-offs: of a D that is zero none."""
    if not loop.values.get("d"):
        return []
    names = (loop.names[role] for role in MOVABLE if loop.values.get(role))
    return [name for name in names if name not in shared]


def phase_deg(loop: AxisLoop, omega: float) -> float:
    """Phase of the controller from the raw gyro to the output."""
    return float(np.angle(loop.feedback([omega], with_hold=False)[0], deg=True))


def _score(
    base: Mapping[str, AxisLoop],
    flown: Mapping[str, AxisLoop],
    values: Mapping[str, float],
    shared: Sequence[str],
    spectra: Mapping[str, GyroSpectrum],
    crossovers: Mapping[str, float],
    limits: Mapping[str, float],
    step_limit: float,
    keep_phase: Collection[str],
) -> tuple[tuple[bool, float], dict[str, float]]:
    """Whether all limits hold, and the mean phase gained (else the worst excess, as a loss)."""
    gained: list[float] = []
    excess: list[float] = []
    chosen: dict[str, float] = {}
    for axis, loop in base.items():
        before = phase_deg(flown[axis], crossovers[axis])
        found: list[tuple[float, float, AxisLoop, dict[str, float]]] = []
        for own in _grid(loop, _own(loop, shared), step_limit, spectra[axis]):
            tried = loop.with_gains({**values, **own})
            gain = phase_deg(tried, crossovers[axis]) - before
            if axis in keep_phase and gain < -WORTH_DEG:
                continue
            moved = any(value != flown[axis].gains[name] for name, value in own.items())
            found.append((gain - WORTH_DEG * moved, gain, tried, own))
        if not found:
            return (False, -np.inf), {}
        gain, noise, own = _first_within(found, spectra[axis], flown[axis], limits[axis])
        gained.append(gain)
        excess.append(noise)
        chosen |= own
    within = max(excess) <= 1.0
    return (within, float(np.mean(gained)) if within else -max(excess)), chosen


def _first_within(
    found: Sequence[tuple[float, float, AxisLoop, dict[str, float]]],
    spectrum: GyroSpectrum,
    flown: AxisLoop,
    limit: float,
) -> tuple[float, float, dict[str, float]]:
    """Of tried cut-offs the worthiest within the limit of noise, else the least noisy.

    The noise of those worth less is never asked for.
    """
    least: tuple[float, float, dict[str, float]] | None = None
    for _, gain, tried, own in sorted(found, key=lambda each: -each[0]):
        noise = output_noise(tried, spectrum, flown=flown).total / limit
        if least is None or noise < least[1]:
            least = gain, noise, own
        if noise <= 1.0:
            break
    assert least is not None
    return least


def _told(
    best: tuple[tuple[bool, float], dict[str, float], int],
    every: Sequence[tuple[Sequence[GainChange], Mapping[str, AxisLoop]]],
    loops: Mapping[str, AxisLoop],
    spectra: Mapping[str, GyroSpectrum],
    crossovers: Mapping[str, float],
    limits: Mapping[str, float],
) -> FilterChoice:
    (within, score), values, place = best
    noisy = any(
        output_noise(loop, spectra[axis]).total > limits[axis] for axis, loop in loops.items()
    )
    if within and not noisy and score < WORTH_DEG:
        values, place = {}, 0
    flown = {name: value for loop in loops.values() for name, value in loop.gains.items()}
    moved = [
        GainChange(name, value, flown[name], "filter")
        for name, value in values.items()
        if value != flown[name]
    ]
    told, chosen = [], {}
    for axis, loop in loops.items():
        known = {name: value for name, value in values.items() if name in loop.gains}
        new = every[place][1][axis].with_gains(known)
        chosen[axis] = new.around_plant_of(loop)
        others = {name for other in loops if other != axis for name in loops[other].gains}
        own = {name: value for name, value in loop.gains.items() if name not in others}
        alone = new.with_gains(own)
        told.append(
            AxisFilters(
                axis,
                crossovers[axis],
                phase_deg(loop, crossovers[axis]),
                phase_deg(new, crossovers[axis]),
                output_noise(loop, spectra[axis]).total,
                output_noise(new, spectra[axis], flown=loop).total,
                limits[axis],
                loop.output_unit,
                phase_deg(alone, crossovers[axis]),
                output_noise(alone, spectra[axis], flown=loop).total,
            )
        )
    return FilterChoice((*every[place][0], *moved), tuple(told), within, chosen, dict(spectra))
