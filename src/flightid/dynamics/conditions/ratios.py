"""Ratios and differences of two estimates with their intervals."""

from __future__ import annotations

import math

from scipy.stats import norm

from flightid.uncertainty.quantity import Quantity
from flightid.uncertainty.spread import NORMAL_95


def stderr_of(quantity: Quantity) -> float | None:
    """Standard error behind an even 95 % interval."""
    if quantity.interval95 is None:
        return None
    return (quantity.interval95[1] - quantity.interval95[0]) / (2.0 * NORMAL_95)


def ratio_of(above: Quantity, below: Quantity, name: str = "ratio") -> Quantity:
    """Ratio of two independent estimates with its 95 % interval.

    Parameters
    ----------
    above, below : Quantity
        In the same unit; one without an interval counts as exact where the other has one.
    name : str

    Returns
    -------
    Quantity
        Without an interval where that of the denominator holds zero.

    Reference
    ---------
    Fieller, "Some problems in interval estimation", *J. Royal Statistical Society B* 16 (1954).

    Example
    -------
    >>> ratio_of(Quantity("b", 3.0, "1", (2.8, 3.2)), Quantity("a", 2.0, "1", (1.9, 2.1)))
    Quantity(ratio = 1.5 (1.379 to 1.629))
    """
    a, b = below.value, above.value
    if a is None or b is None:
        return Quantity(name, None, "1", None, below.reason if a is None else above.reason)
    if a == 0.0:
        return Quantity(name, None, "1", None, "the denominator is zero")
    errors = stderr_of(below), stderr_of(above)
    if errors == (None, None):
        return Quantity(name, b / a, "1", None, above.reason or below.reason)
    first, second = ((NORMAL_95 * (e or 0.0)) ** 2 for e in errors)
    apart = a * a - first
    if apart <= 0.0:
        return Quantity(
            name, b / a, "1", None, "the interval of the denominator holds zero: no bound"
        )
    root = math.sqrt((a * b) ** 2 - apart * (b * b - second))
    low, high = sorted(((a * b - root) / apart, (a * b + root) / apart))
    return Quantity(name, b / a, "1", (low, high))


def chance_of(first: Quantity, second: Quantity) -> float | None:
    """Two-sided probability of a difference as large as this between equal independent truths.

    Parameters
    ----------
    first, second : Quantity

    Returns
    -------
    float or None
        None where neither has an error.

    Example
    -------
    >>> one, other = Quantity("a", 1.0, "1", (0.8, 1.2)), Quantity("b", 1.4, "1", (1.2, 1.6))
    >>> round(chance_of(one, other), 4)
    0.0056
    """
    errors = [stderr_of(first), stderr_of(second)]
    if first.value is None or second.value is None or errors == [None, None]:
        return None
    total = math.hypot(*(error or 0.0 for error in errors))
    if total == 0.0:
        return None
    return float(2.0 * norm.sf(abs(first.value - second.value) / total))


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
    found: set[str] = set()
    order = sorted(chances, key=lambda name: chances[name])
    for place, name in enumerate(order):
        if chances[name] > level / (len(order) - place):
            break
        found.add(name)
    return found
