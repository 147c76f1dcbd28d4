"""Steps of Gauss and Newton from one hold of inputs towards the estimates under another.

Shared parameters and the own numbers of records meet in one triangle of each record.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flightid.uncertainty.triangle import triangle_of_parts, triangle_of_rows

Array = NDArray[np.float64]
ALIKE = 1e-9
"""Share of an own number's effect that others of its record leave, up to which it is rounding."""
AT_ONCE = 1 << 16
"""Rows that are turned into a triangle together."""


def squares_of(slopes: Array) -> Array:
    """Products of slopes by all numbers with all, of each output, (n_outputs, k, k)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.array([slope.T @ slope for slope in slopes])


def changes_of(slopes: Array, step: Array, n_free: int) -> tuple[Array, Array]:
    """What a step changes of outputs by the shared parameters, and by the record's own numbers."""
    apart = np.zeros((len(step), 2))
    apart[:n_free, 0], apart[n_free:, 1] = step[:n_free], step[n_free:]
    found = slopes @ apart
    return found[:, :, 0], found[:, :, 1]


def squares_over(changes: Sequence[Array], sizes: Array) -> float:
    """Sum of squares of changes of outputs, each over what is left of it."""
    total = np.sum([np.sum(each**2, axis=1) for each in changes], axis=0)
    return float(np.sum(total / np.where(sizes > 0.0, sizes, 1.0) ** 2))


def steps_of(
    left: Sequence[Array],
    slopes: Sequence[Array],
    squares: Sequence[Array],
    sizes: Array,
    n_free: int,
    limits: tuple[Array, Array] | None,
) -> list[Array]:
    """Least squares: changes of the shared parameters and of each record's own numbers."""
    weights = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    # Triangles hold all that least squares ask, of as many rows as there are numbers.
    triangles = [
        triangle_of_parts(
            partial(weighed, rest, slope, weights, n_free),
            products_of(rest, slope, square, weights, n_free),
            partial(some_columns, rest, slope, n_free),
        )
        for rest, slope, square in zip(left, slopes, squares, strict=True)
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


def products_of(left: Array, slopes: Array, squares: Array, weights: Array, n_free: int) -> Array:
    """Products of the columns that `weighed` gives, without a copy of long slopes.

    Those of slopes, `squares` by output, are the same in steps that keep them.
    """
    count = slopes.shape[2]
    found = np.zeros((count + 1, count + 1))
    with np.errstate(over="ignore", invalid="ignore"):
        for rest, slope, square, weight in zip(left, slopes, squares, weights, strict=True):
            found[:count, :count] += weight**2 * square
            found[:count, count] += weight**2 * (slope.T @ rest)
            found[count, count] += weight**2 * (rest @ rest)
    found[count, :count] = found[:count, count]
    places = _order(count, n_free)
    return np.asarray(found[np.ix_(places, places)])


def _order(count: int, n_free: int) -> list[int]:
    """Own numbers' slopes, the shared ones', what is left, as they stand in slopes and left."""
    return [*range(n_free, count), *range(n_free), count]


def some_columns(left: Array, slopes: Array, n_free: int, places: Sequence[int]) -> Iterator[Array]:
    """Some columns of `weighed`, by output and without its weights."""
    order = _order(slopes.shape[2], n_free)
    for rest, slope in zip(left, slopes, strict=True):
        whole = [rest if order[k] == slope.shape[1] else slope[:, order[k]] for k in places]
        yield np.column_stack(whole)


def weighed(left: Array, slopes: Array, weights: Array, n_free: int) -> Iterator[Array]:
    """Rows of a record: own numbers' slopes, the shared ones', what is left."""
    for rest, slope, weight in zip(left, slopes, weights, strict=True):
        for begin in range(0, len(rest), AT_ONCE):
            rows = slice(begin, begin + AT_ONCE)
            parts = slope[rows, n_free:], slope[rows, :n_free], rest[rows]
            yield weight * np.column_stack(parts)
