"""Delays as states: rational all-pass functions, or registers of samples."""

from __future__ import annotations

from functools import lru_cache
from math import comb, factorial

import numpy as np
from numpy.typing import NDArray

from flightid.models.linear.realisation import Block, block_of, side_by_side

Array = NDArray[np.float64]


def pade_delay(delay_s: float, order: int) -> tuple[Array, Array]:
    """Numerator and denominator of the diagonal Padé approximation of e^(−delay s).

    Parameters
    ----------
    delay_s : float
        s.
    order : int
        Degree of both.

    Returns
    -------
    tuple of ndarray, shapes (order + 1,)
        Highest power of s first.

    Reference
    ---------
    Golub & Van Loan, *Matrix Computations*, 4th ed., eq. 9.3.2.

    Example
    -------
    >>> [part.tolist() for part in pade_delay(2.0, 1)]
    [[-1.0, 1.0], [1.0, 1.0]]
    """
    powers = np.arange(order, -1, -1)
    weights = np.array(
        [comb(order, k) * factorial(2 * order - k) / factorial(2 * order) for k in powers]
    )
    return weights * (-delay_s) ** powers, weights * delay_s**powers


def delays_as_states(
    matrices: tuple[Array, Array, Array, Array, Array], order: int
) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D with the approximation of each delay in series with its input.

    The system's states come first.
    """
    a, b, c, d, delays_s = matrices
    m = len(delays_s)
    late = [(j, j, _realised(float(delay), order)) for j, delay in enumerate(delays_s)]
    fa, fb, fc, fd = side_by_side((m, m), late)
    whole = np.block([[a, b @ fc], [np.zeros((len(fa), len(a))), fa]])
    return whole, np.vstack([b @ fd, fb]), np.hstack([c, d @ fc]), d @ fd


@lru_cache(maxsize=256)
def _realised(delay_s: float, order: int) -> Block:
    """One delay: loops ask for the same ones again and again."""
    above, below = pade_delay(delay_s, order) if delay_s else (np.ones(1), np.ones(1))
    # Leading coefficients out of the way: a delay of a millisecond to the third is 1e-9.
    return block_of(float(above[0] / below[0]), [above / above[0]], [below / below[0]])


def shift_registers(
    matrices: tuple[Array, Array, Array, Array], samples: NDArray[np.intp]
) -> tuple[Array, Array, Array, Array]:
    """Whole samples of delay at the inputs as states that pass their value on."""
    a, b, c, d = matrices
    n, total = len(a), int(samples.sum())
    whole_a, whole_b = np.zeros((n + total, n + total)), np.zeros((n + total, b.shape[1]))
    whole_c, whole_d = np.zeros((len(c), n + total)), d.copy()
    whole_a[:n, :n], whole_b[:n], whole_c[:, :n] = a, b, c
    start = n
    for j, count in enumerate(samples):
        if not count:
            continue
        last = start + count - 1
        whole_a[:n, last], whole_c[:, last] = b[:, j], d[:, j]
        whole_b[:, j], whole_d[:, j] = 0.0, 0.0
        whole_b[start, j] = 1.0
        whole_a[start + 1 : last + 1, start:last] += np.eye(count - 1)
        start += count
    return whole_a, whole_b, whole_c, whole_d
