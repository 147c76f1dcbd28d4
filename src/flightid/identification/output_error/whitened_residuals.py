"""Residuals without what neighbouring inputs foretell of them, without colour and apart.

By pieces of samples: of long records nothing but a triangle is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from flightid._native import left_of_neighbours
from flightid.uncertainty.lagged_products import lagged_products, products_with_past
from flightid.uncertainty.triangle import triangle_of_parts

Array = NDArray[np.float64]
LAGS = 12
"""Of the filters that take the colour of each output off."""
REACH = 25
"""Samples of the past of inputs whose answer is taken out of residuals."""
SAMPLES_A_NUMBER = 5
"""Of all records, for each number of that answer."""
AT_ONCE = 2048
"""Samples or frequencies that are worked on at a time: long records need no more memory."""
EVEN = 0.8
"""Smallest power of a channel over its largest at any lag, from which products are differences."""
ROUNDING = 1e-6
"""Of the largest direction of inputs, below which one tells nothing."""


def unforetold(rows: Sequence[Array], inputs: Sequence[Array]) -> list[Array]:
    """Residuals less what a response of `REACH` samples to the inputs makes of them.

    Parameters
    ----------
    rows : sequence of ndarray, shape (n_outputs, n_samples)
        Of each record.
    inputs : sequence of ndarray, shape (n_inputs, n_samples)
        None of no record: residuals stay.
    """
    moved = [k for k in range(len(inputs[0]) if inputs else 0) if any(np.ptp(u[k]) for u in inputs)]
    samples = sum(each.shape[1] for each in rows)
    reach = min(REACH, samples // (SAMPLES_A_NUMBER * max(len(moved), 1)))
    if not moved or reach < 2:
        return list(rows)
    about = [u[moved] - u[moved].mean(axis=1, keepdims=True) for u in inputs]
    padded = [np.pad(u, ((0, 0), (reach, 1)), mode="edge") for u in about]

    def pieces() -> Iterator[tuple[int, slice, Array]]:
        for k, each in enumerate(rows):
            for part in parts(each.shape[1]):
                yield k, part, _lagged(padded[k], part, reach + 2)

    def beside() -> Iterator[Array]:
        return (np.concatenate([lags, rows[k][:, part]]) for k, part, lags in pieces())

    count = len(moved) * (reach + 2)
    products = _even_products(padded, reach + 1)
    if products is not None:
        crossed = products_with_past(rows, padded, reach + 1)[::-1].reshape(count, -1)
        own = np.sum([each @ each.T for each in rows], axis=0)
        products = np.block([[products, crossed], [crossed.T, own]])
    if products is None:
        weights, _ = _regressed(beside, None, count, ROUNDING)
    else:
        weights = _of_directions(products, count)
    return [left_of_neighbours(*pair, weights) for pair in zip(rows, padded, strict=True)]


def colour_filters(rows: Sequence[Array]) -> list[Array] | None:
    """Of each output, the filter that takes its colour off; None where there is rounding alone.

    By least squares on the past: equations of Yule and Walker, which the noise models of intervals
    solve (`residual_noise`), give filters whose inverse is stable and bend poles near the circle.
    """
    found = []
    of_all = lagged_products(rows, LAGS, LAGS)
    for output in range(rows[0].shape[0]):
        own = [each[output : output + 1] for each in rows]
        products = _if_even(of_all[:, output : output + 1, :, output : output + 1])
        weights, left = _regressed(partial(_pasts, own), products, LAGS, None)
        if not np.all(np.isfinite(weights)) or left[0] <= 0.0:
            return None
        found.append(np.concatenate([[1.0], -weights[0, ::-1]]))
    return found


def apart(white: Sequence[Array]) -> Array:
    """Inverse root of the covariance at one instant: sensors may share that (a supply, a mount)."""
    whole = np.concatenate(white, axis=1)
    size = np.sqrt(np.mean(whole**2, axis=1))
    whole = whole / size[:, None]
    values, vectors = np.linalg.eigh(whole @ whole.T / whole.shape[1])
    root = vectors / np.sqrt(np.maximum(values, np.finfo(float).eps))
    return np.asarray(root @ vectors.T / size)


def parts(count: int) -> Iterator[slice]:
    """Of so many samples or frequencies, what is held in memory at a time."""
    for start in range(0, count, AT_ONCE):
        yield slice(start, min(start + AT_ONCE, count))


def _lagged(rows: Array, part: slice, count: int) -> Array:
    """So many neighbouring samples of each row, the oldest first: (count · rows, samples)."""
    return np.concatenate([rows[:, part.start + k : part.stop + k] for k in range(count)])


def _pasts(outputs: Sequence[Array]) -> Iterator[Array]:
    """Each sample of one output of all records below those before it, by pieces."""
    for each in outputs:
        for part in parts(each.shape[1] - LAGS):
            yield _lagged(each, part, LAGS + 1)


def _regressed(
    pieces: Callable[[], Iterable[Array]],
    products: Array | None,
    count: int,
    rounding: float | None,
) -> tuple[Array, Array]:
    """Weights in the first `count` of so many rows that foretell the others, and squares left.

    Rows come by pieces of samples, where their products are not known or keep too few digits;
    weights (rows - count, count).
    """
    root = triangle_of_parts(lambda: (piece.T for piece in pieces()), products)
    weights = np.linalg.lstsq(root[:count, :count], root[:count, count:], rcond=rounding)[0]
    return np.asarray(weights.T), np.asarray(np.sum(root[count:, count:] ** 2, axis=0))


def _of_directions(products: Array, count: int) -> Array:
    """The same weights from products alone, along directions of inputs above `ROUNDING`.

    Squares of these keep three digits, and what a direction so small answers for is smaller still.
    Smooth inputs have others below it, which a triangle of all samples would be built for.
    """
    sizes, axes = np.linalg.eigh(products[:count, :count])
    told = sizes > ROUNDING**2 * sizes[-1]
    along = axes[:, told]
    return np.asarray((along @ ((along.T @ products[:count, count:]) / sizes[told, None])).T)


def _even_products(records: Sequence[Array], longest: int) -> Array | None:
    """Products of all lags of all channels, the oldest first; None where they may lack digits.

    They come as differences, which keep all digits where no channel's power changes much from lag
    to lag: one that grows does all at its end.
    """
    return _if_even(lagged_products(records, longest, longest))


def _if_even(found: Array) -> Array | None:
    """Products of lags, (n_lags, n_channels, n_lags, n_channels), where no power changes much."""
    power = np.einsum("iaia->ia", found)
    if not np.all(power.min(axis=0) > EVEN * power.max(axis=0)):
        return None
    size = found.shape[0] * found.shape[1]
    return np.asarray(found[::-1, :, ::-1].reshape(size, size))
