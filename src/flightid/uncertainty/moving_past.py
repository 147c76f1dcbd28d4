"""Whether past noise moves an input beyond what its own past tells with weights that change.

What is new in a sweep is not what one autoregression leaves of it: its frequency moves, and so do
the weights of the past that foretell it. What remains is no noise, and a model of the outputs that
misses how modes stiffen leaves harmonics of the same sweep, which foretell it: an open loop looks
closed. A sweep is foretold by its past with weights that are smooth in time, and those take it out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.uncertainty.triangle import triangle_of_rows

Array = NDArray[np.float64]
Pair = tuple[Array, Array]
MOVING_LAGS = 8
"""Past samples of the input whose weights change."""
DEGREE = 4
"""Of the polynomials in time that they follow, by record."""
ROWS_PER_COLUMN = 5
"""Rows of a regression for each of its columns, at least."""
ENOUGH = 4000
"""Samples that are asked first."""
SMALLEST = 1e-10
"""Of the largest singular value: directions below it are rounding."""


def moving_chance(
    pairs: Sequence[Pair], noise: Sequence[Array], place: int, order: int, lags: range, level: float
) -> float | None:
    """F probability that past noise explains so much of what is new in an input by chance.

    Parameters
    ----------
    pairs : sequence of tuple of ndarray
        Inputs, shape (n_inputs, n_samples), and outputs of each record.
    noise : sequence of ndarray, shape (n_outputs, n_samples - order)
        What a model of the outputs leaves of them.
    place : int
        Of the input.
    order : int
        Past samples of the inputs.
    lags : range
        Samples by which the noise is earlier.
    level : float
        Below it the first samples are enough, for most loops show in few.

    Returns
    -------
    float or None
        None where most samples lie in records that are too short for so many weights.

    Reference
    ---------
    Niedzwiecki, *Identification of Time-varying Processes* (2000), chapter 6 (basis functions).
    """
    begun = _begun(pairs, noise)
    if len(begun[0]) < len(pairs) or begun[0][-1][0].shape[1] < pairs[-1][0].shape[1]:
        found = _chance(*begun, place, order, lags)
        if found is not None and found < level:
            return found
    return _chance(pairs, noise, place, order, lags)


def _begun(pairs: Sequence[Pair], noise: Sequence[Array]) -> tuple[list[Pair], list[Array]]:
    """The first `ENOUGH` samples of records and of their noise."""
    room, kept, heard = ENOUGH, [], []
    for (u, y), left in zip(pairs, noise, strict=True):
        if room <= 0:
            break
        late = u.shape[1] - left.shape[1]
        kept.append((u[:, :room], y[:, :room]))
        heard.append(left[:, : max(room - late, 0)])
        room -= u.shape[1]
    return kept, heard


def _chance(
    pairs: Sequence[Pair], noise: Sequence[Array], place: int, order: int, lags: range
) -> float | None:
    count = sum(u.shape[1] for u, _ in pairs)
    used = free = 0
    width = len(lags) * len(noise[0])
    products = np.zeros((width + 1, width + 1))
    for (u, _), left in zip(pairs, noise, strict=True):
        known = _known(u, place, order, lags[-1])
        if known is None:
            continue
        first = u.shape[1] - len(known)
        rows = np.pad(left, ((0, 0), (order, 0)))
        past = np.concatenate([_lagged(row, first, lags) for row in rows]).T
        triangle = triangle_of_rows(np.hstack([known, past, u[place, first:, None]]))
        # What is left of the last columns without the others stands below them.
        below = triangle[known.shape[1] :, known.shape[1] :]
        products += below.T @ below
        used, free = used + u.shape[1], free + len(known) - known.shape[1]
    whole = float(products[-1, -1])
    if 2 * used < count or free <= width or not whole > 0.0:
        return None
    cross = products[:-1, -1]
    weights = np.linalg.lstsq(products[:-1, :-1], cross, rcond=SMALLEST)[0]
    share = float(np.clip(cross @ weights / whole, 0.0, 1.0))
    f = share / width / max((1.0 - share) / (free - width), np.finfo(float).tiny)
    return float(scipy.special.fdtrc(width, free - width, f))


def _known(inputs: Array, place: int, order: int, late: int) -> Array | None:
    """Columns of the inputs' past, that of one of them also with weights that follow polynomials.

    None where a record is too short for them.
    """
    first = order + late
    rows = inputs.shape[1] - first
    moving = min(MOVING_LAGS, order)
    if rows < ROWS_PER_COLUMN * (order * len(inputs) + moving * DEGREE):
        return None
    own = np.concatenate([_lagged(row, first, range(1, order + 1)) for row in inputs]).T
    time = np.linspace(-1.0, 1.0, rows)
    powers = [np.polynomial.legendre.Legendre.basis(k)(time) for k in range(1, DEGREE + 1)]
    near = _lagged(inputs[place], first, range(1, moving + 1)).T
    return np.hstack([own, *(near * power[:, None] for power in powers)])


def _lagged(row: Array, first: int, lags: range) -> Array:
    """Earlier samples of a channel from sample `first` on, (lags, n - first)."""
    return np.stack([row[first - lag : row.size - lag] for lag in lags])
