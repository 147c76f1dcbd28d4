"""Records that share their noise: copies of one flight, rounded, thinned, scaled or cut elsewhere.

Two flights may share inputs, dynamics and what a model lacks of them; noise they do not share. What
a short linear recursion leaves of one record's outputs is held against what it leaves of another's
at every shift. Where they go together, the noise has to: in most bands of the spectrum and where
little is left, for what a model lacks lies where the vehicle moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.quantiles import normal_quantiles

Array = NDArray[np.float64]
ORDER = 6
"""Past samples that the recursion takes of outputs and inputs."""
LEAST = 48
"""Samples that two records have to hold together."""
TOLD_BY = 20_000
"""Samples that the recursion is fitted to."""
CLIPPED = 3.0
"""Deviations to which single errors are cut: one spike is no noise in common."""
FALSE_ALARM = 1e-4
"""Chance that flights are told to share noise, over all pairs and shifts."""
SUSPECT = 0.5
"""Correlation at the best shift from which a pair is looked at."""
SHARED = 0.95
"""Correlation in each look; what a model lacks reaches it where it is 100 times the noise."""
BANDS = 8
"""Of equal width, whose median counts."""
QUIET = 3
"""One of so many samples, where least is left around, is looked at apart."""
AROUND = 6
"""Samples to either side that tell how much is left around one."""
AS_MUCH = 1e-3
"""Relative difference below which two factors are one."""
DIGITS = 1e-6
"""Of the outputs (rms): what a recursion leaves below it are digits of a run without noise."""
NOISE = 1e-3
"""Of the outputs (rms), from which what is left is taken for noise, wherever it lies."""
EVEN = 0.6
"""Least part of its rms that noise keeps in the tenth where least is left; white keeps 0.66."""
DEVIATIONS = 5.0
"""By which two factors differ that are not one."""
LITTLE = 0.1
"""Of its noise (rms), by which a record differs from another that was scaled, rounding included."""
PHASES = 12
"""Samples of a finer record at which a coarser one may begin."""


@dataclass(frozen=True, eq=False)
class RecordSeries:
    """Samples of one record.

    Attributes
    ----------
    names : tuple of str
        Of the outputs.
    outputs, inputs : ndarray, shapes (n_outputs, n_samples) and (n_inputs, n_samples)
    step_s : float
    """

    names: tuple[str, ...]
    outputs: Array
    inputs: Array
    step_s: float

    @property
    def n_samples(self) -> int:
        """Of each channel."""
        return int(self.outputs.shape[1])

    def of(self, names: Sequence[str]) -> RecordSeries:
        """Some outputs."""
        rows = self.outputs[[self.names.index(name) for name in names]]
        return RecordSeries(tuple(names), rows, self.inputs, self.step_s)

    def at(self, step_s: float) -> list[RecordSeries]:
        """On another grid; a coarser one may begin at each of the first samples."""
        ratio = step_s / self.step_s
        if abs(ratio - 1.0) < AS_MUCH:
            return [self]
        found = []
        for first in range(max(min(int(np.ceil(ratio - AS_MUCH)), PHASES), 1)):
            places = first + ratio * np.arange(int((self.n_samples - 1 - first) / ratio) + 1)
            near = np.rint(places)
            at = np.asarray(np.where(np.abs(places - near) < AS_MUCH, near, places), dtype=float)
            rows = (_between(self.outputs, at), _between(self.inputs, at))
            found.append(RecordSeries(self.names, *rows, step_s))
        return found

    def cut(self, first: int, count: int) -> RecordSeries:
        """Some samples."""
        rows = (self.outputs[:, first : first + count], self.inputs[:, first : first + count])
        return RecordSeries(self.names, *rows, self.step_s)


@dataclass(frozen=True)
class SharedNoise:
    """Two records with one noise.

    Attributes
    ----------
    first, second : int
        Places of the records.
    correlation : float
        Of what a recursion leaves of their outputs.
    shift : int
        Samples by which the second begins later than the first, on the grid that was compared.
    count : int
        Samples that both hold, on that grid.
    step_s : float or None
        Of the grid, where the records have different ones.
    factors : tuple of float
        Of the second's outputs to the first's, where those are scaled and little else.
    """

    first: int
    second: int
    correlation: float
    shift: int
    count: int
    step_s: float | None = None
    factors: tuple[float, ...] = ()


def shared_noise(series: Sequence[RecordSeries]) -> SharedNoise | None:
    """The two records whose noise is most one; None where flights have each its own.

    Parameters
    ----------
    series : sequence of RecordSeries
        Of the same outputs, in the same order.

    Reference
    ---------
    Box & Jenkins, *Time Series Analysis*, section 11.2 (series are whitened before they are
    correlated); chance by the normal distribution for all shifts and pairs (Bonferroni).

    Example
    -------
    >>> noise = np.random.default_rng(0).standard_normal((2, 400))
    >>> none = np.zeros((0, 400))
    >>> flights = [RecordSeries(("p",), row[None], none, 0.02) for row in noise]
    >>> shared_noise(flights) is None
    True
    >>> copy = RecordSeries(("p",), noise[:1, 30:].round(2), none[:, 30:], 0.02)
    >>> found = shared_noise([*flights, copy])
    >>> found.first, found.second, found.shift, found.correlation > 0.99
    (0, 2, 30, True)
    """
    long = [(place, each) for place, each in enumerate(series) if each.n_samples >= LEAST + ORDER]
    pairs = len(long) * (len(long) - 1) / 2
    steps: list[float] = []
    for step in sorted(each.step_s for _, each in long):
        if not steps or step > steps[-1] * (1.0 + AS_MUCH):
            steps.append(step)
    best: SharedNoise | None = None
    for step in steps:
        # Whichever was made of the other is its own again on the grid that it is on.
        grids = [
            (p, grid, abs(each.step_s / step - 1.0) < AS_MUCH)
            for p, each in long
            for grid in each.at(step)
            if grid.n_samples >= LEAST + ORDER
        ]
        left = [_left(grid, _recursion(grid)) for _, grid, _ in grids]
        transforms = _transforms(left)
        for here, (p, grid, at_home) in enumerate(grids):
            for other in range(here + 1, len(grids)):
                q, its, too = grids[other]
                if p == q or not (at_home or too):
                    continue
                met = _met(left[here], left[other], transforms[here], transforms[other], pairs)
                if met is None or (best is not None and met[1] <= best.correlation):
                    continue
                shift, count = met[0], met[2]
                one, two = grid.cut(max(shift, 0), count), its.cut(max(-shift, 0), count)
                value = _looked_at(one, two)
                if value is not None and (best is None or value > best.correlation):
                    told_step = None if len(steps) == 1 else step
                    factors = _told_factors(one, two)
                    best = SharedNoise(p, q, value, shift, count, told_step, factors)
    return best


def _between(rows: Array, places: Array) -> Array:
    """Rows at places between samples, by straight lines."""
    grid = np.arange(rows.shape[1])
    return np.array([np.interp(places, grid, row) for row in rows]).reshape(len(rows), -1)


def _columns(series: RecordSeries, output: int) -> Array:
    """One, the output's past and the inputs' past and present, (n_samples - ORDER, k)."""
    n = series.n_samples
    rows = [np.ones(n - ORDER)]
    rows += [series.outputs[output, ORDER - lag : n - lag] for lag in range(1, ORDER + 1)]
    rows += [row[ORDER - lag : n - lag] for row in series.inputs for lag in range(ORDER + 1)]
    return np.array(rows).T


def _recursion(series: RecordSeries) -> list[Array]:
    """By output, the weights of `_columns` by least squares."""
    short = series.cut(max((series.n_samples - TOLD_BY) // 2, 0), TOLD_BY)
    found = []
    for output, row in enumerate(short.outputs):
        columns = _columns(short, output)
        size = np.sqrt(np.mean(columns**2, axis=0))
        size[size == 0.0] = 1.0
        found.append(np.linalg.lstsq(columns / size, row[ORDER:], rcond=1e-12)[0] / size)
    return found


def _errors(series: RecordSeries, weights: Sequence[Array]) -> list[Array]:
    """What recursions leave of each output, without its mean."""
    told = [_columns(series, output) @ each for output, each in enumerate(weights)]
    left = [row[ORDER:] - each for row, each in zip(series.outputs, told, strict=True)]
    return [each - each.mean() for each in left]


def _left(series: RecordSeries, weights: Sequence[Array]) -> Array:
    """What recursions leave of the outputs, by its own deviation, large errors cut."""
    rows = []
    for left in _errors(series, weights):
        size = 1.4826 * float(np.median(np.abs(left))) or float(np.sqrt(np.mean(left**2)))
        rows.append(np.clip(left / (size or 1.0), -CLIPPED, CLIPPED))
    return np.array(rows)


def _transforms(left: Sequence[Array]) -> list[NDArray[np.complex128]]:
    longest = sorted(each.shape[1] for each in left)[-2:]
    length = 1 << int(np.ceil(np.log2(max(sum(longest), 2))))
    return [np.fft.rfft(each, length) for each in left]


def _met(
    one: Array,
    other: Array,
    of_one: NDArray[np.complex128],
    of_other: NDArray[np.complex128],
    pairs: float,
) -> tuple[int, float, int] | None:
    """Shift, correlation and samples in common where two errors go together most."""
    n, m = one.shape[1], other.shape[1]
    length = 2 * (of_one.shape[1] - 1)
    products = np.fft.irfft(np.sum(of_one * np.conj(of_other), axis=0), length)
    shifts = np.arange(-(m - LEAST), n - LEAST + 1)
    first, last = np.maximum(shifts, 0), np.minimum(n, m + shifts)
    powers = [np.concatenate(([0.0], np.cumsum(np.sum(each**2, axis=0)))) for each in (one, other)]
    here = powers[0][last] - powers[0][first]
    there = powers[1][last - shifts] - powers[1][first - shifts]
    both = np.sqrt(np.maximum(here * there, np.finfo(float).tiny))
    together = products[shifts % length] / both
    # Overlaps that hold hardly any power tell no correlation.
    known = both > (last - first) * 1e-6
    score = np.where(known, np.abs(together), 0.0) * np.sqrt((last - first) * len(one))
    best = int(np.argmax(score))
    chance = FALSE_ALARM / (2.0 * max(pairs, 1.0) * shifts.size)
    limit = max(float(normal_quantiles([1.0 - chance])[0]), 1.0)
    if score[best] < limit or abs(together[best]) < SUSPECT:
        return None
    return int(shifts[best]), float(abs(together[best])), int(last[best] - first[best] + ORDER)


def _looked_at(one: RecordSeries, other: RecordSeries) -> float | None:
    """Correlation of two errors by one recursion, where it is in bands and in quiet parts too.

    A copy may be in another unit, or lie between samples: the first record is taken as it and its
    neighbours foretell the second. Runs of a model without noise have no noise to share: twice the
    input is twice the output, and what is left of it.
    """
    moves = np.ptp(one.outputs, axis=1) > 0.0
    moves &= np.ptp(other.outputs, axis=1) > 0.0
    if not moves.any():
        return None
    inner = slice(1, one.n_samples - 1)
    rows = []
    for row, its in zip(one.outputs[moves], other.outputs[moves], strict=True):
        near = np.array([row[:-2], row[1:-1], row[2:]]).T
        near -= near.mean(axis=0)
        taps = np.linalg.lstsq(near, its[inner] - its[inner].mean(), rcond=1e-9)[0]
        rows.append(near @ taps)
    plain = replace(one, outputs=one.outputs[moves]).cut(1, one.n_samples - 2)
    first = replace(plain, outputs=np.array(rows))
    second = replace(other, outputs=other.outputs[moves]).cut(1, first.n_samples)
    rests = _rests(plain) | _rests(second)
    if _scaled_throughout(plain, second) and not (_noisy(plain) and _noisy(second)):
        return None
    weights = _recursion(first)
    tried = [
        (_left(first, weights), _left(replace(second, inputs=first.inputs), weights)),
        # A copy that was filtered is whitened by a recursion of its own.
        (_left(plain, _recursion(plain)), _left(second, _recursion(second))),
    ]
    known = [value for each in tried if (value := _everywhere(*each, rests)) is not None]
    return max(known, default=None)


def _factor(rows: Array, its: Array) -> tuple[float, float]:
    """Of the second to the first by least squares, and its standard error."""
    power = max(float(np.sum(rows**2)), np.finfo(float).tiny)
    factor = float(np.sum(rows * its)) / power
    left = float(np.sum((its - factor * rows) ** 2)) / max(rows.size - 1, 1)
    # No factor is known better than the digits of what it is taken of.
    return factor, max(float(np.sqrt(left / power)), abs(factor) * 4.0 * np.finfo(float).eps)


def _levelled(rows: Array) -> Array:
    return np.asarray(rows - rows.mean(axis=1, keepdims=True))


def _scaled_throughout(one: RecordSeries, other: RecordSeries) -> bool:
    """Whether all inputs differ by the factor of the outputs, which is not one."""
    if one.inputs.shape != other.inputs.shape or not np.any(one.inputs):
        return False
    told, deviation = _factor(_levelled(one.outputs), _levelled(other.outputs))
    asked, its = _factor(one.inputs, other.inputs)
    alike = abs(told - asked) <= DEVIATIONS * float(np.hypot(deviation, its))
    return alike and abs(told - 1.0) >= AS_MUCH


def _noisy(series: RecordSeries) -> bool:
    """Whether what a recursion leaves of an output is noise: more than digits, and everywhere."""
    around = np.ones(2 * AROUND + 1) / (2 * AROUND + 1)
    for row, left in zip(series.outputs, _errors(series, _recursion(series)), strict=True):
        size, whole = float(np.std(left)), float(np.std(row))
        if size > NOISE * whole:
            return True
        near = np.sqrt(np.sort(np.convolve(left**2, around, mode="same"))[left.size // 10])
        if size > DIGITS * whole and near >= EVEN * size:
            return True
    return False


def _told_factors(one: RecordSeries, other: RecordSeries) -> tuple[float, ...]:
    """Of outputs that are scaled and little else: a filter or another grid has no factor."""
    noise = _errors(one, _recursion(one))
    found = []
    for row, its, left in zip(_levelled(one.outputs), _levelled(other.outputs), noise, strict=True):
        factor, deviation = _factor(row, its)
        if np.std(its - factor * row) < LITTLE * abs(factor) * np.std(left):
            found.append(1.0 if abs(factor - 1.0) <= DEVIATIONS * deviation else factor)
    return tuple(found)


def _rests(series: RecordSeries) -> NDArray[np.bool_]:
    """Samples about which no output changes: a vehicle at rest gives the same again."""
    still = np.all(np.diff(series.outputs, axis=1) == 0.0, axis=0)
    run = np.convolve(still, np.ones(3), mode="same") >= 3.0
    return np.concatenate((run, run[-1:]))[ORDER:]


def _everywhere(one: Array, other: Array, rests: NDArray[np.bool_]) -> float | None:
    """Correlation of two errors; None where bands, signs or quiet parts do not bear it out."""
    moving = ~rests
    if np.sum(moving) < LEAST:
        return None
    whole = _correlation(one[:, moving], other[:, moving])
    signs = np.sin(0.5 * np.pi * np.mean(np.sign(one[:, moving]) * np.sign(other[:, moving])))
    bands = np.fft.rfft(one, axis=1), np.fft.rfft(other, axis=1)
    ends = np.linspace(1, bands[0].shape[1], BANDS + 1).astype(int)
    by_band = [_correlation(bands[0][:, a:b], bands[1][:, a:b]) for a, b in pairwise(ends)]
    around = np.ones(2 * AROUND + 1)
    local = [np.convolve(row, around, mode="same") for row in np.abs(one * other)]
    size = np.sqrt(np.maximum(local, np.finfo(float).tiny))
    places = np.flatnonzero(moving)
    quiet = places[np.argsort(np.sum(size, axis=0)[places])[: places.size // QUIET]]
    in_quiet = _correlation((one / size)[:, quiet], (other / size)[:, quiet])
    least = min(whole, float(signs), float(np.median(by_band)), in_quiet)
    return whole if least >= SHARED else None


def _correlation(one: NDArray[np.generic], other: NDArray[np.generic]) -> float:
    both = np.sqrt(np.sum(np.abs(one) ** 2) * np.sum(np.abs(other) ** 2))
    return float(np.real(np.sum(one * np.conj(other))) / max(both, np.finfo(float).tiny))
