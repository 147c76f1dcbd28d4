"""Several starts inside the bounds, and the minima that they find."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import FitError, OptionError
from flightid.evidence.gather import CONVERGED
from flightid.frozen import dataclass
from flightid.identification.local_minimum import LocalMinimum
from flightid.models import GreyBoxModel, Parameter

Array = NDArray[np.float64]
NativeEnd = tuple[Array, float, Array, Array, int, str]

_SAME_COST = 1e-6
_SAME_VALUE = 1e-3
_DECADES = 1.0
_NEAR, _WIDE = 0.3, 0.6
"""Shares of a value by which starts differ from it where a bound is open: the first, and more."""
_MANY = 8
"""Starts from which on the wider share counts."""


def require_free(model: GreyBoxModel) -> None:
    """Refuse a model that has nothing to search.

    Raises
    ------
    FitError
    """
    if not model.parameters.free:
        raise FitError(
            "the model has no free parameter",
            needed="at least one",
            action="free a parameter with model.with_free(name)",
        )


@dataclass(frozen=True)
class End:
    """Where one start ended: values, cost, iterations, why."""

    x: Array
    cost: float
    iterations: int
    termination: str

    @property
    def is_converged(self) -> bool:
        """Whether it is a minimum to the tolerances."""
        return self.termination in CONVERGED


@dataclass(frozen=True)
class DenseEnd(End):
    """An end with its residuals and Jacobian, both empty where no slopes were asked for."""

    residuals: Array
    jacobian: Array

    @classmethod
    def of_native(cls, found: NativeEnd) -> DenseEnd:
        """From the native half's order."""
        x, cost, residuals, jacobian, iterations, termination = found
        return cls(x, cost, iterations, termination, residuals, jacobian)

    @classmethod
    def searched(
        cls,
        residuals: Callable[[Array], Array],
        jacobian: Callable[[Array], Array],
        start: Array,
        lower: Array,
        upper: Array,
        n_residuals: int,
        maximum_iterations: int,
        stop: Callable[[float], bool] | None = None,
        triangle: Callable[[Array], Array | None] | None = None,
    ) -> DenseEnd:
        """Of bounded Levenberg–Marquardt on callables, their Jacobian in any order of memory.

        `stop` is asked after each step, with the least cost so far, whether that is near enough.
        `triangle` may make that of the Jacobian and the residuals, a column a row, without them:
        the end then has no Jacobian.
        """

        def by_rows(x: Array) -> Array:
            # The native half reads rows of C order.
            return np.ascontiguousarray(jacobian(x))

        found = _native.least_squares(
            residuals, by_rows, start, lower, upper, n_residuals, maximum_iterations, stop, triangle
        )
        end = cls.of_native(found)
        return replace(end, termination="cost") if end.termination == "interrupted" else end


E = TypeVar("E", bound=End)


def draw_starts(free: Sequence[Parameter], starts: int, seed: int) -> Array:
    """Start values: the model's own first, the others by a Latin hypercube around them.

    Where both bounds are known they are the range, drawn in its logarithm where it has one sign
    and is wider than a decade. Where one is open the value itself is what is known: starts keep
    its sign and stay within 30 % of it, from the ninth start on within 60 %. A value of zero tells
    no scale: its starts lie within one.

    Parameters
    ----------
    free : sequence of Parameter
        Parameters to be fitted.
    starts : int
        Number of starts.
    seed : int
        Seed of the generator.

    Returns
    -------
    ndarray, shape (starts, n_free)

    Raises
    ------
    OptionError
        Fewer than one start.

    Reference
    ---------
    McKay, Beckman & Conover (1979), *Technometrics* 21.

    Example
    -------
    >>> draw_starts([Parameter("T", 0.1, "s", minimum=0.01, maximum=1.0)], 3, seed=0).shape
    (3, 1)
    """
    if starts < 1:
        raise OptionError("starts is too small", found=starts, needed="at least 1")
    own = np.array([[parameter.value or 0.0 for parameter in free]])
    if starts == 1 or not free:
        return own
    shares = _latin_hypercube(len(free), starts - 1, seed)
    reach = np.where(np.arange(1, starts) < _MANY, _NEAR, _WIDE)
    columns = [_spread(parameter, shares[:, k], reach) for k, parameter in enumerate(free)]
    return np.ascontiguousarray(np.vstack([own, np.column_stack(columns)]))


def _latin_hypercube(dimensions: int, count: int, seed: int) -> Array:
    """Points of which each has a row and a column of its own: those of ``scipy.stats.qmc``.

    That module is not asked: loading it takes longer than most fits.

    Example
    -------
    >>> np.sort(_latin_hypercube(2, 4, seed=0) // 0.25, axis=0).T
    array([[0., 1., 2., 3.],
           [0., 1., 2., 3.]])
    """
    (random,) = np.random.default_rng(seed).spawn(1)
    inside = random.uniform(size=(count, dimensions))
    places = np.tile(np.arange(1, count + 1), (dimensions, 1))
    for row in places:
        random.shuffle(row)
    return np.asarray((places.T - inside) / count)


def _spread(parameter: Parameter, share: Array, reach: Array) -> Array:
    value, low, high = parameter.value or 0.0, parameter.minimum, parameter.maximum
    if np.isfinite(low) and np.isfinite(high):
        if low > 0.0 and np.log10(high / low) > _DECADES:
            return np.asarray(low * (high / low) ** share)
        return np.asarray(low + (high - low) * share)
    around = (2.0 * share - 1.0) * reach
    drawn = value * (1.0 + around) if value else around / _WIDE
    return np.asarray(np.clip(drawn, low, high))


def collect(outcomes: Sequence[E | str]) -> list[E]:
    """Ends of the starts that ended, best first; a text is why a start did not.

    Of minima that cost the same, as twins do whose poles are exchanged, the one that the earliest
    start found goes first: rounding shall not choose, and the user's own start is the first.

    Raises
    ------
    FitError
        No start led anywhere.
    """
    ends = [end for end in outcomes if not isinstance(end, str) and np.isfinite(end.cost)]
    if not ends:
        reasons = sorted({outcome for outcome in outcomes if isinstance(outcome, str)})
        raise FitError(
            "the fit diverged from every start",
            found="; ".join(reasons),
            needed="a model with a finite response at its start values",
            action="check start values and bounds, or the structure of the model",
        )
    return best_first(ends)


def best_first(ends: Sequence[E]) -> list[E]:
    """Ends by their cost; of those that cost the same as the best, the earliest goes first.

    Example
    -------
    >>> ends = [End(np.ones(1), cost, 1, "step") for cost in (3.0, 1.0 + 1e-9, 1.0)]
    >>> [ends.index(end) for end in best_first(ends)]
    [1, 2, 0]
    """
    ranked = sorted(ends, key=lambda end: end.cost)
    limit = ranked[0].cost + _SAME_COST * (1.0 + abs(ranked[0].cost))
    alike = [end for end in ends if end.cost <= limit and end.is_converged]
    first = alike[0] if alike else ranked[0]
    return [first, *(end for end in ranked if end is not first)]


def cluster(ends: Sequence[E]) -> list[list[E]]:
    """Group ends that are the same minimum, best group first."""
    groups: list[list[E]] = []
    for end in ends:
        for group in groups:
            if _same(group[0], end):
                group.append(end)
                break
        else:
            groups.append([end])
    return groups


def _same(first: End, second: End) -> bool:
    scale = np.maximum(np.abs(first.x), np.abs(second.x))
    near = np.all(np.abs(first.x - second.x) <= _SAME_VALUE * np.maximum(scale, 1e-12))
    return bool(near) and abs(second.cost - first.cost) <= _SAME_COST * (1.0 + abs(first.cost))


def local_minima(groups: Sequence[Sequence[End]], names: Sequence[str]) -> tuple[LocalMinimum, ...]:
    """What a fit reports of its groups of ends."""
    return tuple(
        LocalMinimum(
            group[0].cost,
            len(group),
            dict(zip(names, map(float, group[0].x), strict=True)),
            group[0].termination,
        )
        for group in groups
    )
