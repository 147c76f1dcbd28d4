"""The size of a complex number that was measured with noise: noise alone makes it larger."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.uncertainty.quadrature import gauss_legendre
from flightid.uncertainty.quantiles import LEVEL, half_width, tails

Real = NDArray[np.float64]
NODES = 40
"""Points of the sum over noise across the number."""
REACH = 6.0
"""Standard errors beyond which noise across it has no chance."""
HALVINGS = 30
"""Of the interval in which a limit lies."""


def magnitude_interval(size: Real, along: Real, across: Real, *, level: float = LEVEL) -> Real:
    """Interval of the size of a complex number that was measured with normal errors.

    The measured size is too large on average: noise across the number lengthens it whatever its
    sign. The lower end is the size that noise would exceed the measured one from with half of the
    chance of a miss, zero where noise alone would do that more often. The upper end is that of
    noise along the number, which such lengthening can only make longer than it need be.

    Parameters
    ----------
    size : ndarray, shape (n,)
        Measured.
    along, across : ndarray, shape (n,)
        Standard errors in the number's own direction and at a right angle to it, above zero.
    level : float
        Probability that one interval holds the truth.

    Returns
    -------
    ndarray, shape (2, n)
        Ends, in the unit of `size`.

    Raises
    ------
    OptionError
        A level that is no probability.

    Reference
    ---------
    Rice, "Mathematical analysis of random noise", *Bell System Technical Journal* 24 (1945), §3.10:
    the distribution of the size; Casella & Berger, *Statistical Inference*, 2nd ed., §9.2.3: an
    interval by inverting it.

    Example
    -------
    >>> one = np.ones(3)
    >>> magnitude_interval(np.array([2.0, 3.0, 100.0]), one, one)[0].round(2)
    array([ 0.  ,  0.7 , 98.03])
    """
    above = tails(level)[1]
    upper = size + half_width(level) * along
    low, high = np.zeros_like(size), np.array(size, dtype=np.float64)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        within = chance_within(size, middle, along, across) > above
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    none = chance_within(size, np.zeros_like(size), along, across) <= above
    return np.stack([np.where(none, 0.0, low), upper])


def chance_within(radius: Real, size: Real, along: Real, across: Real) -> Real:
    """Probability that a number of a true size is measured within a radius, each shape (n,).

    Example
    -------
    >>> found = chance_within(np.array([2.0]), np.zeros(1), np.ones(1), np.ones(1))
    >>> bool(abs(found[0] - (1.0 - np.exp(-2.0))) < 1e-9)
    True
    """
    nodes, weights = gauss_legendre(NODES)
    turn = 0.5 * np.pi * nodes[:, None]
    # A sine of the angle: the chord's root has no finite slope at the radius.
    reach = np.minimum(radius, REACH * across)
    aside = reach * np.sin(turn)
    step = 0.5 * np.pi * weights[:, None] * reach * np.cos(turn)
    chord = np.sqrt(np.maximum(radius**2 - aside**2, 0.0))
    density = np.exp(-0.5 * (aside / across) ** 2) / (np.sqrt(2.0 * np.pi) * across)
    ends = [scipy.special.ndtr((sign * chord - size) / along) for sign in (1.0, -1.0)]
    return np.asarray(np.sum(step * density * (ends[0] - ends[1]), axis=0))
