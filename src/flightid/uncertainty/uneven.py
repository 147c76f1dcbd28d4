"""Ends of intervals that are not even about their value, at any level."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Interval, Reading
from flightid.uncertainty.quantiles import half_width, tails


@dataclass(frozen=True, eq=False)
class DrawnEnds:
    """Quantiles of draws; none where an end does not exist.

    Attributes
    ----------
    draws : ndarray, shape (n,)
    method : {"linear", "inverted_cdf"}
        How a quantile lies between two draws. The second takes one of them, so that draws without
        end (infinite) stay among themselves.

    Example
    -------
    >>> DrawnEnds(np.arange(201.0))(0.95)
    (5.0, 195.0)
    """

    draws: NDArray[np.float64] = field(repr=False)
    method: Literal["linear", "inverted_cdf"] = "linear"

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        low, high = map(float, np.quantile(self.draws, tails(level), method=self.method))
        return (low, high) if np.isfinite(low) and np.isfinite(high) else None


@dataclass(frozen=True)
class Reaching:
    """Ends that reach as far as a value that no draw holds.

    Example
    -------
    >>> Reaching(DrawnEnds(np.arange(201.0)), -3.0)(0.95)
    (-3.0, 195.0)
    """

    ends: Callable[[float], Interval | None]
    value: float

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        found = self.ends(level)
        return found and (min(found[0], self.value), max(found[1], self.value))


def drawn_estimate(
    name: str,
    value: float,
    unit: str,
    draws: ArrayLike,
    without: str,
    method: Literal["linear", "inverted_cdf"] = "linear",
) -> Estimate:
    """An estimate with an interval from draws.

    Parameters
    ----------
    name : str
    value : float
    unit : str
    draws : array_like, shape (n,)
    without : str
        Reason where the 95 % interval has no end.
    method : {"linear", "inverted_cdf"}
        See `DrawnEnds`.

    Example
    -------
    >>> drawn_estimate("x", 5.0, "s", np.linspace(0.0, 10.0, 101), "")
    Estimate(x = 5 (0.25 to 9.75) s)
    """
    ends = DrawnEnds(np.asarray(draws, dtype=np.float64), method)
    if ends(0.95) is None:
        return Estimate(name, value, unit, None, without)
    return Estimate(name, value, unit, ends=ends)


@dataclass(frozen=True)
class TurnedEnds:
    """Ends of ``factor / rate`` from those of a rate; none where these enclose zero.

    Example
    -------
    >>> low, high = TurnedEnds(1.0, Estimate("rate", 2.0, "1/s", 0.1))(0.95)
    >>> round(low, 4), round(high, 4)
    (0.4554, 0.5543)
    """

    factor: float
    rate: Reading

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        ends = self.rate.interval(level)
        if ends is None or ends[0] <= 0.0 <= ends[1]:
            return None
        low, high = sorted((self.factor / ends[0], self.factor / ends[1]))
        return low, high


def turned(name: str, unit: str, factor: float, rate: Reading, unsigned: str) -> Estimate:
    """``factor / rate`` with the rate's interval turned over: a time from a rate.

    Parameters
    ----------
    name, unit : str
    factor : float
    rate : Estimate
        Not zero.
    unsigned : str
        Reason where the rate's 95 % interval holds zero.

    Example
    -------
    >>> turned("time constant", "s", 1.0, Estimate("rate", 2.0, "1/s", 0.1), "")
    Estimate(time constant = 0.5 (0.4554 to 0.5543) s)
    """
    assert rate.value is not None
    value = factor / rate.value
    if rate.interval95 is None:
        return Estimate(name, value, unit, None, rate.reason)
    ends = TurnedEnds(factor, rate)
    if ends(0.95) is None:
        return Estimate(name, value, unit, None, unsigned)
    stderr = None if rate.stderr is None else abs(value / rate.value) * rate.stderr
    return Estimate(name, value, unit, stderr, freedom=rate.freedom, ends=ends)


@dataclass(frozen=True)
class LogarithmicEnds:
    """Ends even on a logarithmic scale, about what is positive.

    Attributes
    ----------
    value : float
    relative : float
        Standard error of the logarithm.

    Example
    -------
    >>> low, high = LogarithmicEnds(2.0, 0.1)(0.95)
    >>> round(low, 3), round(high, 3)
    (1.644, 2.433)
    """

    value: float
    relative: float

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        factor = float(np.exp(half_width(level) * self.relative))
        return self.value / factor, self.value * factor


@dataclass(frozen=True)
class FromZero:
    """Ends of a number that cannot be negative: the lower one is zero at the least.

    Example
    -------
    >>> FromZero(DrawnEnds(np.arange(-100.0, 101.0)))(0.95)
    (0.0, 95.0)
    """

    ends: Callable[[float], Interval | None]

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        found = self.ends(level)
        return found and (max(found[0], 0.0), found[1])


def frequency_from_zero(number: Reading) -> Reading:
    """A frequency whose interval holds no negative one; other numbers as they are.

    Clipped, not bent: the truth is positive, so that the interval holds it as often as before.

    Example
    -------
    >>> frequency_from_zero(Estimate("crossover", 8.0, "rad/s", 5.0))
    Estimate(crossover = 8 (0 to 17.8) rad/s)
    """
    if number.unit != "rad/s" or number.value is None or number.stderr is None:
        return number
    return replace(number, ends=FromZero(number.interval))
