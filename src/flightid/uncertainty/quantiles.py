"""Quantiles behind every printed interval: of the normal distribution and of Student's."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from flightid.errors import OptionError
from flightid.uncertainty.student import normal_quantile, student_quantile

LEVEL = 0.95
"""Level of an interval unless told; verdicts always rest on it."""
_shown: ContextVar[float] = ContextVar("shown", default=LEVEL)


@contextmanager
def showing(level: float | None) -> Iterator[None]:
    """Let tables and pictures that are made inside show intervals of a level.

    Verdicts keep `LEVEL`. None changes nothing.

    Raises
    ------
    OptionError
        A level that is no probability.
    """
    before = _shown.set(shown(level))
    try:
        yield
    finally:
        _shown.reset(before)


def shown(level: float | None = None) -> float:
    """The level that a table or a picture shows: the one given, else that of `showing`.

    Raises
    ------
    OptionError
        A level that is no probability.

    Example
    -------
    >>> with showing(0.9):
    ...     shown(), shown(0.5)
    (0.9, 0.5)
    """
    return _shown.get() if level is None else checked_level(level)


def ellipse_radius(level: float) -> float:
    """Semi-axis of the region of two normal numbers together, in standard deviations.

    χ² with two degrees of freedom is exponential: χ²(level) = −2 ln(1 − level).

    Example
    -------
    >>> round(ellipse_radius(0.95) ** 2, 6)
    5.991465
    """
    return math.sqrt(-2.0 * math.log1p(-checked_level(level)))


def half_width(level: float = LEVEL, freedom: float | None = None) -> float:
    """Half the width of a two-sided interval about an estimate, in standard errors.

    Parameters
    ----------
    level : float
        Probability that the interval holds the truth, above 0 and below 1.
    freedom : float, optional
        Degrees of freedom of Student's distribution, where the standard error itself is
        estimated; None or infinite: normal distribution.

    Returns
    -------
    float

    Raises
    ------
    OptionError
        A level that is no probability, or degrees of freedom that are not positive.

    Reference
    ---------
    Student, "The probable error of a mean", *Biometrika* 6 (1908); z(0.975) = 1.95996.

    Example
    -------
    >>> round(half_width(), 5), round(half_width(0.95, 10.0), 4)
    (1.95996, 2.2281)
    """
    upper = 0.5 + 0.5 * checked_level(level)
    if freedom is None or math.isinf(freedom):
        return normal_quantile(upper)
    if not freedom > 0.0:
        raise OptionError("degrees of freedom must be positive", found=freedom, needed="above 0")
    return student_quantile(upper, float(freedom))


def checked_level(level: float) -> float:
    """The level itself, if it is one.

    Raises
    ------
    OptionError
        A level that is no probability.

    Example
    -------
    >>> checked_level(0.9)
    0.9
    """
    if not 0.0 < level < 1.0:
        raise OptionError(
            "the level of an interval is a probability", found=level, needed="above 0 and below 1"
        )
    return float(level)


def tails(level: float = LEVEL) -> tuple[float, float]:
    """Probabilities below the lower and below the upper end of a two-sided interval.

    Example
    -------
    >>> tails(0.95)
    (0.025, 0.975)
    """
    # Rounded, so that a quantile of draws falls on the draw that the level says.
    outside = round(0.5 * (1.0 - checked_level(level)), 12)
    return outside, 1.0 - outside


def student_quantiles(shares: ArrayLike, freedom: float) -> NDArray[np.float64]:
    """Quantiles of Student's distribution.

    Parameters
    ----------
    shares : array_like, shape (n,)
        Probabilities below, above 0 and below 1.
    freedom : float
        Degrees of freedom.

    Example
    -------
    >>> student_quantiles([0.5, 0.975], 10.0).round(4).tolist()
    [0.0, 2.2281]
    """
    return np.asarray(scipy.special.stdtrit(freedom, np.asarray(shares, dtype=np.float64)))


def normal_quantiles(shares: ArrayLike) -> NDArray[np.float64]:
    """Quantiles of the normal distribution.

    Parameters
    ----------
    shares : array_like, shape (n,)
        Probabilities below, above 0 and below 1.

    Example
    -------
    >>> normal_quantiles([0.5, 0.975]).round(4).tolist()
    [0.0, 1.96]
    """
    return np.asarray(scipy.special.ndtri(np.asarray(shares, dtype=np.float64)))


def chi_squared_quantile(share: float, freedom: float) -> float:
    """Value below which a χ² of some degrees of freedom lies with a probability.

    Example
    -------
    >>> round(chi_squared_quantile(0.95, 2.0), 4)
    5.9915
    """
    return 2.0 * float(scipy.special.gammaincinv(freedom / 2.0, share))


def two_sided_chance(deviations: float) -> float:
    """Probability that a normal error is as large as this, in standard errors, to either side.

    Example
    -------
    >>> round(two_sided_chance(1.959964), 3)
    0.05
    """
    return math.erfc(abs(deviations) / math.sqrt(2.0))


def interval_words(level: float) -> str:
    """The level for a heading.

    Example
    -------
    >>> interval_words(0.95)
    '95 %'
    """
    return f"{100.0 * checked_level(level):.4g} %"
