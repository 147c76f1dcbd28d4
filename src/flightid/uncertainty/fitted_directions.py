"""Directions along which a fit takes noise out of residuals, and what of white noise they hold.

A white noise model of an output is judged by the first lags of its periodogram and by the power of
its slowest bins. Both follow from sums over the columns themselves, span by span: of long records
the transforms of all sensitivities would be most of the time and of the memory.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.frozen import dataclass

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
    """

    own: Array
    shared: Array

    @property
    def together(self) -> list[Array]:
        """Own and shared directions side by side, by output: each (n, n_own + n_shared)."""
        if not self.own.shape[2]:
            return list(self.shared)
        pairs = zip(self.own, self.shared, strict=True)
        return [np.concatenate(pair, axis=1) for pair in pairs]


@dataclass(frozen=True, eq=False)
class WhiteNoiseLoss:
    """What fits take of white noise of each output, at the first lags and the slowest bins.

    Attributes
    ----------
    parts : list of list of ndarray, shape (n, k)
        Directions by record and output.
    n_own : list of int
        How many of them belong to each record alone.
    squares : list of ndarray, shape (n_outputs, k, k)
        Their products.
    slow : list of list of ndarray, shape (n_bins, k)
        Their transforms at the slowest bins.
    n_lags : int
    """

    parts: list[list[Array]]
    n_own: list[int]
    squares: list[Array]
    slow: list[list[NDArray[np.complex128]]]
    n_lags: int

    @classmethod
    def of(
        cls, taken: Sequence[FittedDirections], length: int, n_lags: int, n_bins: int
    ) -> WhiteNoiseLoss:
        """Of directions by record, for periodograms of transforms of one length."""
        parts = [each.together for each in taken]
        return cls(
            parts,
            [each.own.shape[2] for each in taken],
            [np.array([part.T @ part for part in each]) for each in parts],
            [[slow_transforms(part, length, n_bins) for part in each] for each in parts],
            n_lags,
        )

    def of_levels(self, levels: Array) -> tuple[Array, Array]:
        """Autocovariance and power that are lost, summed over all samples.

        Parameters
        ----------
        levels : ndarray, shape (n_outputs,)
            Variances of the noise.

        Returns
        -------
        tuple of ndarray, shapes (n_outputs, n_lags) and (n_outputs, n_bins)
            Of 2 Re F(Ω q) F(q)* - F(q) Qᵀ Ω Q F(q)*, see `residual_noise`.
        """
        inner = [np.tensordot(levels, square, axes=1) for square in self.squares]
        shared = sum(each[m:, m:] for each, m in zip(inner, self.n_own, strict=True))
        lags = np.zeros((len(levels), self.n_lags))
        power = np.zeros((len(levels), len(self.slow[0][0])))
        for parts, slow, each, m in zip(self.parts, self.slow, inner, self.n_own, strict=True):
            each[m:, m:] = shared
            for o, (part, turned, level) in enumerate(zip(parts, slow, levels, strict=True)):
                form = 2.0 * level * np.eye(len(each)) - each
                lags[o] += lags_of_form(part, form, self.n_lags)
                power[o] += np.einsum("bk,kl,bl->b", turned, form, turned.conj()).real
        return lags, power


def lags_of_form(columns: Array, form: Array, n_lags: int) -> Array:
    """Sums over a record of q(t)ᵀ M q(t + k), for lags k from zero on.

    Parameters
    ----------
    columns : ndarray, shape (n, m)
        Rows q(t).
    form : ndarray, shape (m, m)
        M, symmetric.
    n_lags : int

    Returns
    -------
    ndarray, shape (n_lags,)

    Example
    -------
    >>> lags_of_form(np.array([[1.0], [2.0], [3.0]]), np.eye(1), 2)
    array([14.,  8.])
    """
    return _native.lags_of_form(columns, form, n_lags)


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
    middles = np.arange(len(moments)) * span + 0.5 * (span - 1)
    turns = np.outer(omega, middles)
    cosines, sines = np.cos(turns), np.sin(turns)
    found, series = np.zeros((n_bins, m), complex), np.ones(n_bins, complex)
    for k, rows in enumerate(np.ascontiguousarray(moments.transpose(1, 0, 2))):
        found += series[:, None] * (cosines @ rows - 1j * (sines @ rows))
        series = series * (-1j * omega * span) / (k + 1)
    return found
