"""Ratios and differences of two estimates with their intervals."""

from __future__ import annotations

import math

import numpy as np

from flightid.dynamics.modes.modes import UNFITTED
from flightid.frozen import dataclass
from flightid.identification.uncertain_of import NO_COVARIANCE
from flightid.uncertainty.estimate import Estimate, Interval, Reading
from flightid.uncertainty.quantiles import half_width, two_sided_chance
from flightid.uncertainty.several_tests import holm_adjusted

EXACT = ("", "exact", "fixed", "same fit", UNFITTED, NO_COVARIANCE)
"""Reasons of a number without an interval that was declared, so that it counts as exact."""
SHARED_ERRORS = "both models are of one record, and their errors hang together"
UNBOUNDED = "the interval of the denominator holds zero: no bound"


@dataclass(frozen=True)
class RatioEnds:
    """Ends of a ratio of two independent estimates; none where the denominator may be zero.

    Reference
    ---------
    Fieller, "Some problems in interval estimation", *J. Royal Statistical Society B* 16 (1954).

    Example
    -------
    >>> low, high = RatioEnds(3.0, 0.1, 2.0, 0.05)(0.95)
    >>> round(low, 3), round(high, 3)
    (1.381, 1.626)
    """

    above: float
    error_above: float
    below: float
    error_below: float

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        wide = half_width(level)
        apart = self.below**2 - (wide * self.error_below) ** 2
        if apart <= 0.0:
            return None
        middle = self.below * self.above
        root = math.sqrt(middle**2 - apart * (self.above**2 - (wide * self.error_above) ** 2))
        low, high = sorted(((middle - root) / apart, (middle + root) / apart))
        return low, high


def even_error(estimate: Reading) -> float | None:
    """Standard error of a normal distribution with the 95 % interval of an estimate.

    Of Student's distribution with few degrees of freedom it is larger than the estimate's own.

    Example
    -------
    >>> round(even_error(Estimate("a", 2.0, "1", 0.05)), 12)
    0.05
    """
    half = estimate.half_width95
    return None if half is None else half / half_width()


def withheld(*estimates: Reading) -> str:
    """Why there is no interval of what is estimated, not declared; empty where there is one.

    Example
    -------
    >>> withheld(Estimate("a", 2.0, "1", None, "fixed"))
    ''
    >>> withheld(Estimate("a", 2.0, "1", None, "errors are not white"))
    'errors are not white'
    """
    bare = (each.reason for each in estimates if each.interval95 is None)
    return "; ".join(dict.fromkeys(reason for reason in bare if reason not in EXACT))


def ratio_of(above: Reading, below: Reading, name: str = "ratio") -> Reading:
    """Ratio of two independent estimates with its 95 % interval.

    Parameters
    ----------
    above, below : Estimate
        In the same unit; one that was declared counts as exact where the other has an interval.
    name : str

    Returns
    -------
    Estimate
        Without an interval where that of the denominator holds zero, or where either was withheld.

    Example
    -------
    >>> ratio_of(Estimate("b", 3.0, "1", 0.1), Estimate("a", 2.0, "1", 0.05))
    Estimate(ratio = 1.5 (1.381 to 1.626))
    """
    a, b = below.value, above.value
    if a is None or b is None:
        return Estimate(name, None, "1", None, below.reason if a is None else above.reason)
    if a == 0.0:
        return Estimate(name, None, "1", None, "the denominator is zero")
    errors = even_error(above), even_error(below)
    reason = withheld(above, below)
    if reason:
        return Estimate(name, b / a, "1", None, reason)
    if errors == (None, None):
        return Estimate(name, b / a, "1", None, above.reason or below.reason)
    ends = RatioEnds(b, errors[0] or 0.0, a, errors[1] or 0.0)
    if ends(0.95) is None:
        return Estimate(name, b / a, "1", None, UNBOUNDED)
    return Estimate(name, b / a, "1", ends=ends)


@dataclass(frozen=True)
class DifferenceEnds:
    """Ends of a difference of two independent estimates, by the ends of both.

    Of even intervals of normal errors it is the usual root of the sum of squares.

    Reference
    ---------
    Zou & Donner, "Construction of confidence limits about effect measures", *Statistics in
    Medicine* 27 (2008).

    Example
    -------
    >>> one, other = Estimate("a", 1.0, "1", 0.3), Estimate("b", 2.0, "1", 0.4)
    >>> low, high = DifferenceEnds(other, one)(0.95)
    >>> round(low, 3), round(high, 3)
    (0.02, 1.98)
    """

    above: Reading
    below: Reading

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        a, b = self.above.value, self.below.value
        if a is None or b is None:
            return None
        least, most = self.above.interval(level) or (a, a)
        lower, upper = self.below.interval(level) or (b, b)
        return a - b - math.hypot(a - least, upper - b), a - b + math.hypot(most - a, b - lower)


def difference_of(above: Reading, below: Reading, name: str = "difference") -> Reading:
    """Difference of two independent estimates with its interval.

    Parameters
    ----------
    above, below : Estimate
        In the same unit; one that was declared counts as exact where the other has an interval.
    name : str

    Returns
    -------
    Estimate
        Without an interval where that of either was withheld.

    Example
    -------
    >>> difference_of(Estimate("b", 3.0, "s", 0.3), Estimate("a", 2.0, "s", 0.4))
    Estimate(difference = 1 (0.02002 to 1.98) s)
    """
    a, b = below.value, above.value
    if a is None or b is None:
        return Estimate(name, None, above.unit, None, below.reason if a is None else above.reason)
    reason = withheld(above, below)
    if reason or (above.interval95 is None and below.interval95 is None):
        return Estimate(name, b - a, above.unit, None, reason or above.reason or below.reason)
    return Estimate(name, b - a, above.unit, ends=DifferenceEnds(above, below))


def chance_of(first: Reading, second: Reading) -> float | None:
    """Two-sided probability of a difference as large as this between equal independent truths.

    Parameters
    ----------
    first, second : Estimate

    Returns
    -------
    float or None
        None where neither has an error, or where that of either was withheld.

    Example
    -------
    >>> one, other = Estimate("a", 1.0, "1", 0.1), Estimate("b", 1.4, "1", 0.1)
    >>> round(chance_of(one, other), 4)
    0.0047
    """
    errors = [even_error(first), even_error(second)]
    if first.value is None or second.value is None or errors == [None, None]:
        return None
    if withheld(first, second):
        return None
    total = math.hypot(*(error or 0.0 for error in errors))
    if total == 0.0:
        return None
    return two_sided_chance((first.value - second.value) / total)


def holm(chances: dict[str, float], level: float = 0.05) -> set[str]:
    """Names whose differences stand when all are judged together.

    Parameters
    ----------
    chances : dict of str to float
        Probability by name.
    level : float
        Chance of one false verdict among all.

    Reference
    ---------
    Holm, "A simple sequentially rejective multiple test procedure", *Scandinavian Journal of
    Statistics* 6 (1979).

    Example
    -------
    >>> sorted(holm({"a": 0.001, "b": 0.03, "c": 0.2}))
    ['a']
    """
    adjusted = holm_adjusted(np.array(list(chances.values())))
    return {name for name, chance in zip(chances, adjusted, strict=True) if chance <= level}
