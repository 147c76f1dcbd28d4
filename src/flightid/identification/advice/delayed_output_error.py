"""Output error with one denominator and given delays, searched on whitened signals."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.prediction_error.linear_regression import reflected
from flightid.recursive_filter import filtered

Array = NDArray[np.float64]
ROUNDS = 8
"""Of the Steiglitz-McBride iteration."""
STEPS = 6
"""Of Gauss and Newton, from where that iteration ends."""
SHORTER = (1.0, 0.5, 0.25, 0.1)
"""Shares of such a step that are tried."""
SETTLED = 1.0
"""Change of twice the log likelihood below which a search ends."""
Ended = tuple[float, Array]
"""Criterion and denominator of a search."""


@dataclass(frozen=True, eq=False)
class DelayedSignals:
    """The output above the inputs, records end to end."""

    rows: Array
    lengths: tuple[int, ...]
    levels: bool

    @property
    def spans(self) -> list[slice]:
        """Samples of each record."""
        ends = np.cumsum([0, *self.lengths])
        return [slice(first, last) for first, last in pairwise(ends.tolist())]

    def filtered(self, top: Array, below: Array) -> Array:
        """Output and inputs of every record through one filter."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.hstack([filtered(top, below, self.rows[:, span]) for span in self.spans])


def criterion(squares: float, n: int, numbers: int) -> float:
    """Of Bayes and Schwarz: the sum of squares of n samples, by so many numbers."""
    return n * float(np.log(max(squares, np.finfo(float).tiny) / n)) + numbers * float(np.log(n))


def output_error(
    data: DelayedSignals, delays: Sequence[int], order: int, skip: int, below: Array
) -> Ended:
    """Criterion of output error with one denominator of this order, and that denominator.

    The iteration of Steiglitz and McBride: quick, but its ends are no minima where the order or the
    delay is too small, and may lie far above them where the input moves in a narrow band.
    """
    reached = np.inf
    for _ in range(ROUNDS):
        rows = data.filtered(np.ones(1), below)
        if not np.isfinite(rows).all():
            break
        parts = [
            _triangle(rows[:, span], delays, order, skip, levels=data.levels) for span in data.spans
        ]
        triangle = parts[0]
        if len(parts) > 1:
            triangle = np.asarray(np.linalg.qr(np.concatenate(parts), mode="r"))
        before = reached
        n = sum(data.lengths) - skip * len(parts)
        reached = criterion(triangle[-1, -1] ** 2, n, len(triangle) - 1)
        if abs(reached - before) < SETTLED:
            break
        found = np.linalg.lstsq(triangle[:-1, :-1], triangle[:-1, -1])[0]
        below = reflected(np.concatenate([[1.0], found[:order]]))
    return reached, below


def refined(
    data: DelayedSignals, delays: Sequence[int], order: int, skip: int, end: Ended
) -> Ended:
    """The minimum that Gauss-Newton steps find from where `output_error` ended.

    Numerators, starts and levels are those of least squares at every denominator, whose steps take
    them along (Kaufman's variant of variable projection).

    Reference
    ---------
    Golub & Pereyra, "Separable nonlinear least squares: the variable projection method and its
    applications", *Inverse Problems* 19 (2003), R1–R26.
    """
    below = end[1]
    if len(below) != order + 1:
        return end
    now = _Profile.of(data, delays, order, skip, below)
    for _ in range(STEPS):
        step = now.step(order, skip)
        before = now
        for share in SHORTER:
            moved = reflected(np.concatenate([[1.0], before.below[1:] + share * step]))
            tried = _Profile.of(data, delays, order, skip, moved)
            if tried.criterion < now.criterion:
                now = tried
                break
        if before.criterion - now.criterion < SETTLED:
            break
    return min(end, (now.criterion, now.below), key=lambda each: each[0])


@dataclass(frozen=True, eq=False)
class _Profile:
    """Output error at one denominator, all other numbers by least squares."""

    below: Array
    criterion: float
    own: list[Array]
    shared: list[Array]
    residuals: list[Array]
    simulated: list[Array]

    @classmethod
    def of(
        cls, data: DelayedSignals, delays: Sequence[int], order: int, skip: int, below: Array
    ) -> _Profile:
        rows = data.filtered(np.ones(1), below)
        if not np.isfinite(rows).all():
            return cls(below, np.inf, [], [], [], [])
        lags = range(1, order + 1)
        own, shared, targets = [], [], []
        for span in data.spans:
            _, *inputs, pulse = rows[:, span]
            target = data.rows[0, span][skip:]
            starts = [_late(pulse, lag - 1, skip) for lag in lags]
            own.append(np.array([*starts, *([np.ones(target.size)] if data.levels else [])]).T)
            pairs = zip(inputs, delays, strict=True)
            shared.append(
                np.array([_late(u, late + lag - 1, skip) for u, late in pairs for lag in lags]).T
            )
            targets.append(target)
        found, residuals = _solved(own, shared, targets)
        simulated = []
        for span, columns, wide, target in zip(data.spans, own, shared, targets, strict=True):
            mine = np.linalg.lstsq(columns, target - wide @ found)[0][:order]
            simulated.append(_simulated(rows[:, span], delays, found, mine))
        squares = sum(float(each @ each) for each in residuals)
        n = sum(each.size for each in residuals)
        reached = criterion(squares, n, order + found.size)
        return cls(below, reached, own, shared, residuals, simulated)

    def step(self, order: int, skip: int) -> Array:
        """Change of the denominator by one linearisation."""
        wide = []
        for simulated, shared in zip(self.simulated, self.shared, strict=True):
            slope = filtered([1.0], self.below, simulated)
            moved = np.array([-_late(slope, lag, skip) for lag in range(1, order + 1)]).T
            wide.append(np.hstack([moved, shared]))
        return _solved(self.own, wide, self.residuals)[0][:order]


def _late(row: Array, lag: int, skip: int) -> Array:
    return row[skip - lag : row.size - lag]


def _simulated(rows: Array, delays: Sequence[int], above: Array, start: Array) -> Array:
    """Output of a record from its inputs and pulse, all behind the denominator."""
    _, *inputs, pulse = rows
    made = filtered(start, [1.0], pulse)
    for row, late, b in zip(inputs, delays, np.split(above, len(delays)), strict=True):
        made = made + filtered(np.pad(b, (late, 0)), [1.0], row)
    return np.asarray(made)


def _solved(
    own: Sequence[Array], shared: Sequence[Array], targets: Sequence[Array]
) -> tuple[Array, list[Array]]:
    """Numbers that records share, each record's own taken out, and what is left."""
    left, aims = [], []
    for columns, wide, target in zip(own, shared, targets, strict=True):
        basis = np.linalg.qr(columns)[0]
        left.append(wide - basis @ (basis.T @ wide))
        aims.append(target - basis @ (basis.T @ target))
    both = np.column_stack([np.concatenate(left), np.concatenate(aims)])
    triangle = np.asarray(np.linalg.qr(both, mode="r"))
    found = np.linalg.lstsq(triangle[:, :-1], triangle[:, -1])[0]
    return found, [aim - wide @ found for aim, wide in zip(aims, left, strict=True)]


def _triangle(rows: Array, delays: Sequence[int], order: int, skip: int, *, levels: bool) -> Array:
    """Triangle of one record's regressors and output, whatever state it began in taken out.

    Filtering from rest leaves 1/F of what was before: free responses of that denominator, which
    follow a pulse at the start. A level is a direction too.
    """
    output, *inputs, pulse = rows
    lags = range(1, order + 1)
    shifted = [(pulse, lag - 1) for lag in lags]
    shifted += [(output, lag) for lag in lags]
    shifted += [
        (row, delay + lag - 1) for row, delay in zip(inputs, delays, strict=True) for lag in lags
    ]
    own = order + int(levels)
    columns = np.ones((own + len(shifted) - order + 1, output.size - skip))
    places = [*range(order), *range(own, len(columns) - 1)]
    for place, (row, lag) in zip(places, shifted, strict=True):
        columns[place] = row[skip - lag : row.size - lag]
    columns[-1] = output[skip:]
    columns[own : own + order] *= -1.0
    # Directions that rounding leaves of responses that are over cost a sample each, no more.
    return np.asarray(np.linalg.qr(columns.T, mode="r"))[own:, own:]
