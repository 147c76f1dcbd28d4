"""Nodes and weights of integrals, worked out once."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@cache
def gauss_legendre(count: int) -> tuple[Array, Array]:
    """Nodes and weights of an integral from -1 to 1; nobody may write to them.

    Parameters
    ----------
    count : int
        Exact for polynomials of twice the order, less one.

    Reference
    ---------
    Golub & Welsch (1969), *Mathematics of Computation* 23, p. 221.

    Example
    -------
    >>> nodes, weights = gauss_legendre(3)
    >>> round(float(weights @ nodes**4), 12)
    0.4
    """
    nodes, weights = np.polynomial.legendre.leggauss(count)
    for each in (nodes, weights):
        each.setflags(write=False)
    return nodes, weights
