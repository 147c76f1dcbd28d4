"""Steps of Gauss and Newton from one hold of inputs towards the estimates under another.

Shared parameters and the own numbers of records meet in one triangle of each record.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flightid.identification.hold_slopes import RunSlopes
from flightid.uncertainty.triangle import triangle_of_parts, triangle_of_rows

Array = NDArray[np.float64]
ALIKE = 1e-9
"""Share of an own number's effect that others of its record leave, up to which it is rounding."""
AT_ONCE = 1 << 16
"""Rows that are turned into a triangle together."""
SHARED, OWN, LEFT = range(3)
"""Places of squares of a step: changes by shared parameters, by own numbers, and what is left."""
DIGITS = 1e-6
"""Share of squares before a step, below which sums hold fewer than ten digits of what is left."""


def steps_of(
    left: Sequence[Array],
    slopes: Sequence[RunSlopes],
    products: Sequence[Array],
    sizes: Array,
    n_free: int,
    limits: tuple[Array, Array] | None,
) -> list[Array]:
    """Least squares: changes of the shared parameters and of each record's own numbers.

    Parameters
    ----------
    left : sequence of ndarray, shape (n_outputs, n_samples)
        Residuals of each record.
    slopes : sequence of RunSlopes
    products : sequence of ndarray, shape (n_outputs, k, k)
        What these give of the residuals.
    sizes : ndarray, shape (n_outputs,)
        Deviations that residuals are held against.
    n_free : int
        Shared parameters.
    limits : tuple of ndarray, optional
        Least and largest change of each shared parameter.
    """
    weights = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    # Triangles hold all that least squares ask, of as many rows as there are numbers.
    triangles = [
        triangle_of_parts(
            partial(weighed, rest, slope, weights, n_free),
            products_of(product, weights, n_free),
            partial(some_columns, rest, slope, n_free),
        )
        for rest, slope, product in zip(left, slopes, products, strict=True)
    ]
    seen = [_told_apart(each, each.shape[1] - n_free - 1) for each in triangles]
    triangles = [each for each, _ in seen]
    n_own = [each.shape[1] - n_free - 1 for each in triangles]
    inner = [each[m:, m:] for each, m in zip(triangles, n_own, strict=True)]
    whole = triangle_of_rows(np.concatenate(inner))
    shared: Array = np.asarray(np.linalg.lstsq(whole[:, :-1], whole[:, -1])[0], dtype=np.float64)
    if limits is not None:
        shared = _inside(shared, whole, limits)
    found = []
    for each, (_, kept), m in zip(triangles, seen, n_own, strict=True):
        rest = each[:m, -1] - each[:m, m:-1] @ shared
        own = np.zeros(len(kept))
        own[kept] = np.linalg.lstsq(each[:m, :m], rest)[0]
        found.append(np.concatenate([shared, own]))
    return found


def squares_of_steps(
    left: Sequence[Array],
    slopes: Sequence[RunSlopes],
    products: Sequence[Array],
    steps: Sequence[Array],
    n_free: int,
) -> Array:
    """Squares of changes and of what is left, by output of all records: (n_outputs, 3).

    From sums alone where these keep their digits, without a run.

    Parameters
    ----------
    left, slopes, products, n_free
        As for `steps_of`.
    steps : sequence of ndarray
        What that gave.
    """
    found = np.zeros((len(left[0]), 3))
    for rest, slope, product, step in zip(left, slopes, products, steps, strict=True):
        moves = np.zeros((3, step.size + 1))
        moves[SHARED, :n_free], moves[OWN, n_free:-1] = step[:n_free], step[n_free:]
        moves[LEFT] = [*-step, 1.0]
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.sum((moves @ product) * moves, axis=2)
            known = squares[:, LEFT] > DIGITS * (product[:, -1, -1] + squares[:, :LEFT].sum(axis=1))
        if not np.all(known):
            squares[:, LEFT] = np.sum(slope.stepped(rest, step) ** 2, axis=1)
        found += squares
    return found


def _told_apart(triangle: Array, n_own: int) -> tuple[Array, NDArray[np.bool_]]:
    """The triangle without own numbers that do what others of the record do, and which are left.

    A bias of an output that is a state and the state's start may have one effect: rounding would
    decide along what the second of them is eliminated, and take that from the shared parameters.
    """
    size = np.linalg.norm(triangle[:, :n_own], axis=0)
    kept = np.abs(np.diag(triangle)[:n_own]) > ALIKE * size
    if np.all(kept):
        return triangle, kept
    rest = np.ones(triangle.shape[1] - n_own, dtype=bool)
    return triangle_of_rows(triangle[:, np.concatenate([kept, rest])]), kept


def _inside(step: Array, triangle: Array, limits: tuple[Array, Array]) -> Array:
    """The step, what would leave its limits held there and the rest solved again."""
    clipped = np.clip(step, *limits)
    rest = clipped == step
    if np.all(rest):
        return step
    target = triangle[:, -1] - triangle[:, :-1][:, ~rest] @ clipped[~rest]
    clipped[rest] = np.linalg.lstsq(triangle[:, :-1][:, rest], target)[0]
    return np.clip(clipped, *limits)


def products_of(products: Array, weights: Array, n_free: int) -> Array:
    """Products of the columns that `weighed` gives, from those by output."""
    with np.errstate(over="ignore", invalid="ignore"):
        found = np.tensordot(weights**2, products, axes=1)
    places = _order(len(found) - 1, n_free)
    return np.asarray(found[np.ix_(places, places)])


def _order(count: int, n_free: int) -> list[int]:
    """Own numbers' slopes, the shared ones', what is left, as they stand in slopes and left."""
    return [*range(n_free, count), *range(n_free), count]


def some_columns(
    left: Array, slopes: RunSlopes, n_free: int, places: Sequence[int]
) -> Iterator[Array]:
    """Some columns of `weighed`, by output and without its weights."""
    columns = slopes.columns()
    order = _order(columns.shape[2], n_free)
    for rest, slope in zip(left, columns, strict=True):
        whole = [rest if order[k] == slope.shape[1] else slope[:, order[k]] for k in places]
        yield np.column_stack(whole)


def weighed(left: Array, slopes: RunSlopes, weights: Array, n_free: int) -> Iterator[Array]:
    """Rows of a record: own numbers' slopes, the shared ones', what is left."""
    for rest, slope, weight in zip(left, slopes.columns(), weights, strict=True):
        for begin in range(0, len(rest), AT_ONCE):
            rows = slice(begin, begin + AT_ONCE)
            parts = slope[rows, n_free:], slope[rows, :n_free], rest[rows]
            yield weight * np.column_stack(parts)
