"""Weighted least squares in rounds: parameters for the weights, weights from the residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.multistart import DenseEnd

Array = NDArray[np.float64]
Weigh = Callable[[Sequence[Array]], list[Array]]
ROUNDS = 25
SETTLED = 1e-3
_EXACT = 1e-9
_LINEAR = 1e-10


@dataclass(frozen=True)
class Rows:
    """Residuals of one record and their slopes.

    Attributes
    ----------
    residuals : ndarray, shape (n_equations, n_rows)
        Measured minus computed, in the unit of the equation.
    slopes : ndarray, shape (n_equations, n_rows, n_free)
        Derivatives of the residuals.
    own : ndarray, shape (n_equations, n_rows, n_own)
        Orthonormal directions, weighed, along which numbers of the record alone are taken out.
    """

    residuals: Array
    slopes: Array
    own: Array


class Regression(Protocol):
    """Residuals of several records as functions of the free parameters."""

    def rows(self, theta: Array, weights: Sequence[Array]) -> list[Rows]:
        """Residuals and slopes of each record; nuisances are taken out under the weights."""

    def left(self, place: int) -> Array:
        """What is measured of one record, (n_equations, n_rows)."""

    def renewed(self, theta: Array) -> Regression:
        """The same after what a round holds is computed anew; itself where nothing is held."""

    def reach(self) -> Array:
        """Size of each equation's measured side over all records, (n_equations,)."""


@dataclass(frozen=True)
class SearchBounds:
    """Bounds of the free parameters and the most iterations."""

    lower: Array
    upper: Array
    maximum_iterations: int


@dataclass(frozen=True)
class SettledRounds:
    """Where the rounds ended.

    Attributes
    ----------
    end : DenseEnd
        Of the last weighted least squares.
    rows : list of Rows
        Residuals and slopes there, by record, not weighed.
    weights : list of ndarray, shape (n_equations, n_rows)
    rounds : int
    """

    end: DenseEnd
    rows: list[Rows]
    weights: list[Array]
    rounds: int


def stack(slopes: Sequence[Array]) -> Array:
    """Slopes (n_equations, n_rows, n) of all records as one Jacobian."""
    return np.concatenate([each.reshape(-1, each.shape[2]) for each in slopes])


def solve(
    problem: Regression, start: Array, weights: Sequence[Array], limits: SearchBounds
) -> tuple[DenseEnd, list[Rows]]:
    """Best parameters under these weights, and the rows there: in one step where all is linear."""
    kept: dict[bytes, tuple[list[Rows], Array, Array]] = {}

    def stacked(theta: Array) -> tuple[list[Rows], Array, Array]:
        key = theta.tobytes()
        if key not in kept:
            kept.clear()
            rows = problem.rows(theta, weights)
            pairs = list(zip(rows, weights, strict=True))
            residuals = [(each.residuals * weight).ravel() for each, weight in pairs]
            slopes = stack([each.slopes * weight[:, :, None] for each, weight in pairs])
            kept[key] = rows, np.concatenate(residuals), slopes
        return kept[key]

    _, residuals, slopes = stacked(start)
    step = np.linalg.lstsq(slopes, -residuals, rcond=None)[0]
    direct = start + step
    if np.all((direct >= limits.lower) & (direct <= limits.upper)):
        rows, after, jacobian = stacked(direct)
        size = np.linalg.norm(residuals) + np.linalg.norm(slopes @ step)
        if np.linalg.norm(after - residuals - slopes @ step) <= _LINEAR * size:
            return DenseEnd(direct, float(after @ after), 1, "gradient", after, jacobian), rows
    end = DenseEnd.searched(
        lambda theta: stacked(theta)[1],
        lambda theta: stacked(theta)[2],
        start,
        limits.lower,
        limits.upper,
        len(residuals),
        limits.maximum_iterations,
    )
    return end, stacked(end.x)[0]


def stepped(
    problem: Regression, start: Array, weights: Sequence[Array], limits: SearchBounds
) -> Array:
    """Parameters after one Gauss–Newton step: the best ones of rows that hardly differ.

    Where the step leaves the bounds the search goes the whole way.
    """
    rows = problem.rows(start, weights)
    pairs = list(zip(rows, weights, strict=True))
    slopes = stack([each.slopes * weight[:, :, None] for each, weight in pairs])
    residuals = np.concatenate([(each.residuals * weight).ravel() for each, weight in pairs])
    ended = start - np.linalg.lstsq(slopes, residuals, rcond=None)[0]
    if np.all((ended >= limits.lower) & (ended <= limits.upper)):
        return np.asarray(ended)
    return solve(problem, start, weights, limits)[0].x


def settle(
    problem: Regression, start: Array, weigh: Weigh, limits: SearchBounds, count: int
) -> SettledRounds:
    """Alternate weights and parameters until the weights stay.

    Parameters
    ----------
    problem : Regression
    start : ndarray, shape (n_free,)
    weigh : callable
        Residuals by record to weights (inverse standard deviations) of the same shapes.
    limits : SearchBounds
    count : int
        Number of records.
    """
    reach = problem.reach()[:, None]
    weights = [np.ones(problem.left(place).shape) / reach for place in range(count)]
    end, rows = solve(problem, start, weights, limits)
    used = 0
    while used < ROUNDS:
        used += 1
        # The floor keeps an equation that fits to rounding from taking all the weight.
        fresh = [
            np.minimum(weight, 1.0 / (_EXACT * reach))
            for weight in weigh([each.residuals for each in rows])
        ]
        pairs = zip(weights, fresh, strict=True)
        change = max(float(np.max(np.abs(after / before - 1.0))) for before, after in pairs)
        weights = fresh
        problem = problem.renewed(end.x)
        end, rows = solve(problem, end.x, weights, limits)
        if change < SETTLED:
            break
    return SettledRounds(end, rows, weights, used)
