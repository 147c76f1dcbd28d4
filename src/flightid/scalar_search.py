"""A root and a minimum of one number, without what loads beside SciPy's optimisers.

Step for step those of ``scipy.optimize.brentq`` and of ``minimize_scalar(method="bounded")``, so
that they end at the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from flightid.errors import DataError

CLOSE = 1e-12
RELATIVE = 4.0 * 2.0**-52
MOST_STEPS = 100
GOLDEN = 0.5 * (3.0 - math.sqrt(5.0))
ROUNDED = math.sqrt(2.2e-16)


def root_between(
    function: Callable[[float], float],
    low: float,
    high: float,
    *,
    ends: tuple[float, float] | None = None,
) -> float:
    """Root of a continuous function between two places where it has unlike signs.

    Parameters
    ----------
    function : callable
    low, high : float
    ends : tuple of float, optional
        Values there, where they are known.

    Returns
    -------
    float
        To 1e-12, or where 100 steps lead.

    Raises
    ------
    DataError
        Both values have one sign.

    Reference
    ---------
    Brent, *Algorithms for Minimization Without Derivatives* (1973), ch. 3-4.

    Example
    -------
    >>> round(root_between(lambda x: x**2 - 2.0, 0.0, 2.0), 12)
    1.414213562373
    """
    before, here = low, high
    f_before, f_here = ends or (function(before), function(here))
    if f_before == 0.0 or f_here == 0.0:
        return before if f_before == 0.0 else here
    if (f_before < 0.0) == (f_here < 0.0):
        raise DataError(
            "a root is not bracketed",
            found=f"{f_before:g} at {low:g}, {f_here:g} at {high:g}",
            needed="values of unlike sign",
        )
    beyond, f_beyond, last, step = 0.0, 0.0, 0.0, 0.0
    for _ in range(MOST_STEPS):
        if f_before != 0.0 and f_here != 0.0 and (f_before < 0.0) != (f_here < 0.0):
            beyond, f_beyond, last, step = before, f_before, here - before, here - before
        if abs(f_beyond) < abs(f_here):
            before, here, beyond = here, beyond, here
            f_before, f_here, f_beyond = f_here, f_beyond, f_here
        near = (CLOSE + RELATIVE * abs(here)) / 2.0
        half = (beyond - here) / 2.0
        if f_here == 0.0 or abs(half) < near:
            return here
        tried = _tried(before, here, beyond, f_before, f_here, f_beyond)
        is_falling = abs(last) > near and abs(f_here) < abs(f_before)
        if is_falling and 2.0 * abs(tried) < min(abs(last), 3.0 * abs(half) - near):
            last, step = step, tried
        else:
            last = step = half
        before, f_before = here, f_here
        here += step if abs(step) > near else math.copysign(near, half)
        f_here = function(here)
    return here


def _tried(
    before: float, here: float, beyond: float, f_before: float, f_here: float, f_beyond: float
) -> float:
    """Step by a secant, or by the inverse parabola through three places."""
    if abs(f_here) >= abs(f_before):
        return math.inf
    if before == beyond:
        return -f_here * (here - before) / (f_here - f_before)
    one = (f_before - f_here) / (before - here)
    two = (f_beyond - f_here) / (beyond - here)
    under = two * one * (f_beyond - f_before)
    return -f_here * (f_beyond * two - f_before * one) / under if under else math.inf


def minimum_between(
    function: Callable[[float], float], low: float, high: float, close: float = 1e-5
) -> float:
    """Place of a minimum between two places: golden sections and parabolas.

    Parameters
    ----------
    function : callable
    low, high : float
    close : float
        How near it is to come, absolutely.

    Returns
    -------
    float

    Reference
    ---------
    Forsythe, Malcolm & Moler, *Computer Methods for Mathematical Computations* (1977), ``fmin``.

    Example
    -------
    >>> round(minimum_between(lambda x: (x - 0.3) ** 2, 0.0, 1.0), 6)
    0.3
    """
    a, b = low, high
    best = second = third = a + GOLDEN * (b - a)
    f_best = f_second = f_third = function(best)
    step = last = 0.0
    for _ in range(5 * MOST_STEPS - 1):
        middle = 0.5 * (a + b)
        near = ROUNDED * abs(best) + close / 3.0
        if abs(best - middle) <= 2.0 * near - 0.5 * (b - a):
            break
        before, is_parabola = last, abs(last) > near
        if is_parabola:
            r = (best - second) * (f_best - f_third)
            q = (best - third) * (f_best - f_second)
            p = (best - third) * q - (best - second) * r
            q = 2.0 * (q - r)
            p, q = (-p if q > 0.0 else p), abs(q)
            last = step
            is_parabola = abs(p) < abs(0.5 * q * before) and q * (a - best) < p < q * (b - best)
            if is_parabola:
                step = p / q
                x = best + step
                if x - a < 2.0 * near or b - x < 2.0 * near:
                    step = near if middle >= best else -near
        if not is_parabola:
            last = a - best if best >= middle else b - best
            step = GOLDEN * last
        x = best + (1.0 if step >= 0.0 else -1.0) * max(abs(step), near)
        f_x = function(x)
        if f_x <= f_best:
            a, b = (best, b) if x >= best else (a, best)
            third, f_third, second, f_second = second, f_second, best, f_best
            best, f_best = x, f_x
        else:
            a, b = (x, b) if x < best else (a, x)
            if f_x <= f_second or second == best:
                third, f_third, second, f_second = second, f_second, x, f_x
            elif f_x <= f_third or third in (best, second):
                third, f_third = x, f_x
    return best
