"""Models that a search could have given: what it holds inside the unit circle lies there.

What grows is far from the data however close its pole is to a zero; the normal distribution of
coefficients around an estimate does not know that.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from flightid.models import InnovationsModel, PolynomialModel
from flightid.models.sampled.discrete_modes import polynomial_roots
from flightid.models.sampled.recursion import spectral_radius


def held_stable(estimate: object) -> Callable[[object], bool] | None:
    """What tells whether a model near an estimate is as stable as searches hold it; None: nothing.

    Parameters
    ----------
    estimate : Model

    Returns
    -------
    callable or None
        Of polynomials C and F; of innovations models the predictor, and the system where that of
        the estimate is stable.

    Example
    -------
    >>> from flightid.models import PolynomialModel
    >>> near = [PolynomialModel(("u",), "y", 0.1, b=[[1.0]], f=[[1.0, f]]) for f in (-0.9, -1.1)]
    >>> allowed = held_stable(near[0])
    >>> [allowed(each) for each in near]
    [True, False]
    """
    sizes: tuple[Callable[[Any], float], ...] = ()
    if isinstance(estimate, PolynomialModel):
        sizes = (_filters,)
    elif isinstance(estimate, InnovationsModel):
        sizes = (_predictor, _system)
    held = [size for size in sizes if size(estimate) < 1.0]
    return (lambda made: all(size(made) < 1.0 for size in held)) if held else None


def _filters(model: PolynomialModel) -> float:
    rows = (np.asarray(row) for row in (model.c, *model.f))
    return max(float(np.max(np.abs(polynomial_roots(row)), initial=0.0)) for row in rows)


def _predictor(model: InnovationsModel) -> float:
    a, _, c, _, k = model.matrices
    return spectral_radius(a - k @ c)


def _system(model: InnovationsModel) -> float:
    return spectral_radius(model.matrices[0])
