"""Why a correlation test cannot be made of a residual and an input."""

from __future__ import annotations

import numpy as np

from flightid.uncertainty.residual_correlation import Series, centred
from flightid.validation.residuals.correlation_result import NEEDS_ONE_STEP, Kind

VOID = "the input has two levels, so its square is constant or a copy of the input"
"""There is nothing that such a test could find: no light, where others that count are made."""
TWO_LEVELS = 1e-6
"""Variance of u² beyond what u itself explains, over its squared mean, of a two-level input."""
ROUNDING = 1e-9
"""A residual below this share of the output is rounding noise."""


def obstacle(kind: Kind, e: Series, u: Series, *, scale: float, open_loop: bool) -> str:
    """What stands against a test; empty where nothing does.

    Parameters
    ----------
    kind : Kind
    e : tuple of ndarray
        Residual.
    u : tuple of ndarray
        Input, or the residual of another output.
    scale : float
        Size of the measured output; zero where it is not known.
    open_loop : bool
        False for a free run around which a loop was closed.
    """
    if _is_constant(e, scale * ROUNDING):
        return "the residual does not change beyond rounding"
    if kind is Kind.CROSS:
        return "the other residual does not change" if _is_constant(u, 0.0) else ""
    return "" if kind is Kind.WHITENESS else _of_input(kind, e, u, open_loop)


def _of_input(kind: Kind, e: Series, u: Series, open_loop: bool) -> str:
    if _is_constant(u, 0.0):
        return "the input does not change"
    if not open_loop and kind not in NEEDS_ONE_STEP:
        return (
            "a closed loop brings the coloured residual of a free run into the input, whatever "
            "the model; test against the injected excitation"
        )
    if kind in (Kind.EVEN, Kind.EVEN_SQUARED) and is_two_level(u):
        return VOID
    if kind is Kind.EVEN_SQUARED and is_two_level(e):
        return "the residual has two levels, so its square is constant"
    return ""


def is_two_level(series: Series) -> bool:
    """Whether a signal's square holds nothing that the signal itself does not.

    A signal of two levels has a square that is constant about its midpoint, and about any other
    value a copy of the signal: an unbalanced sequence must not pass for one with a usable square.

    Example
    -------
    >>> is_two_level((np.array([0.0, 1.0, 1.0, 0.0, 1.0]),))
    True
    """
    u = np.concatenate(centred(series))
    square = u**2
    about = square - np.mean(square)
    left = about - u * (u @ about) / (u @ u)
    return bool(np.var(left) < TWO_LEVELS * np.mean(square) ** 2)


def _is_constant(series: Series, floor: float) -> bool:
    spread = float(np.std(np.concatenate(centred(series))))
    size = max(float(np.max(np.abs(record))) for record in series)
    return spread <= max(floor, 1e-12 * size)
