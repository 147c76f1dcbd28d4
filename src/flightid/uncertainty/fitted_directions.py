"""Directions along which a fit takes noise out of residuals, and sums over these span by span."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.own_directions import OwnDirections

Array = NDArray[np.float64]
TURN, TERMS = 0.5, 12
"""Largest phase (rad) over half of a span of samples, and terms of its series: 5e-13 is left."""


@dataclass(frozen=True, eq=False)
class FittedDirections:
    """Orthonormal directions along which a fit takes noise out of one record's residuals.

    Attributes
    ----------
    own : ndarray, shape (n_outputs, n, n_own)
        Of numbers that belong to this record.
    shared : ndarray, shape (n_outputs, n, n_shared)
        Of parameters; orthonormal over all records together.
    known : OwnDirections, optional
        What is known of `own` already.
    products : sequence of ndarray, shape (w, w), optional
        By output, products of [own directions that reach it, shared ones, residual].
    """

    own: Array
    shared: Array
    known: OwnDirections | None = None
    products: Sequence[Array] | None = None

    @cached_property
    def reaching(self) -> OwnDirections:
        """Of each output, the own directions that reach it."""
        return OwnDirections(self.own) if self.known is None else self.known

    def squares(self, output: int) -> Array:
        """Products of the directions that reach an output."""
        if self.products is not None:
            return self.products[output][:-1, :-1]
        own, shared = self.reaching.columns[output], self.shared[output]
        beside = own.T @ shared
        return np.block([[own.T @ own, beside], [beside.T, shared.T @ shared]])

    def places(self, output: int) -> NDArray[np.intp]:
        """Which of all directions, the own ones first, reach an output."""
        return self.reaching.within(output, self.shared.shape[2])


def slow_transforms(columns: Array, length: int, n_bins: int) -> NDArray[np.complex128]:
    """Transforms of columns, padded with zeros to `length`, at the first bins.

    Within a span of samples the phase of a slow bin turns little: moments of each span carry it.

    Parameters
    ----------
    columns : ndarray, shape (n, m)
    length : int
        Of the transform.
    n_bins : int
        Bins 0 to ``n_bins - 1``.

    Returns
    -------
    ndarray of complex, shape (n_bins, m)

    Example
    -------
    >>> rows = np.arange(6.0)[:, None]
    >>> bool(np.allclose(slow_transforms(rows, 16, 3)[:, 0], np.fft.rfft(rows[:, 0], 16)[:3]))
    True
    """
    n, m = columns.shape
    omega = 2.0 * np.pi * np.arange(n_bins) / length
    span = int(np.clip(2.0 * TURN / max(omega[-1], 1e-300), 1, n))
    whole = n // span * span
    place = np.arange(span) - 0.5 * (span - 1)
    powers = np.array([(place / span) ** k for k in range(TERMS if span > 1 else 1)])
    moments = powers @ columns[:whole].reshape(n // span, span, m)
    if whole < n:
        last = np.zeros((1, span, m))
        last[0, : n - whole] = columns[whole:]
        moments = np.concatenate([moments, powers @ last])
    # One product serves cosines and sines of all moments: (2, n_bins, terms, m).
    sums = _turns(length, n_bins, span, len(moments)) @ moments.reshape(len(moments), -1)
    even, odd = sums.reshape(2, n_bins, len(powers), m)
    series = np.ones((n_bins, len(powers)), complex)
    for k in range(1, len(powers)):
        series[:, k] = series[:, k - 1] * (-1j * omega * span) / k
    return np.asarray(np.sum(series[:, :, None] * (even - 1j * odd), axis=1))


@lru_cache(maxsize=2)
def _turns(length: int, n_bins: int, span: int, count: int) -> Array:
    """Cosines, then sines, of bins' phases at the middles of spans, (2 n_bins, n_spans)."""
    middles = np.arange(count) * span + 0.5 * (span - 1)
    turns = np.outer(2.0 * np.pi * np.arange(n_bins) / length, middles)
    found = np.concatenate([np.cos(turns), np.sin(turns)])
    found.flags.writeable = False
    return found
