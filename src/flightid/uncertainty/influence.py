"""Refusal of parameters that residuals do not answer to, with their names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import SingularError

Array = NDArray[np.float64]
SMALLEST = 1e-14
"""Diagonal of a triangle of columns of one length, over the largest, that counts as zero."""
NEXT = "fix it, tie it, or leave it out; or excite what it acts on and widen the band"


def require_influence(scale: Array, names: Sequence[str] = ()) -> None:
    """Refuse columns of a Jacobian without length.

    Parameters
    ----------
    scale : ndarray, shape (n,)
        Lengths of the columns.
    names : sequence of str
        Of the parameters; left out: their places are told.

    Raises
    ------
    SingularError
        A parameter has no influence on the residuals.

    Example
    -------
    >>> require_influence(np.array([1.0, 2.0]), ["Lp", "La"])
    """
    _refuse("a parameter has no influence on the residuals", scale == 0.0, names)


def require_apart(diagonal: Array, names: Sequence[str] = ()) -> None:
    """Refuse columns that the ones before them make, by the diagonal of their triangle.

    Raises
    ------
    SingularError
        A combination of parameters has no influence.

    Example
    -------
    >>> require_apart(np.array([1.0, 0.5]))
    """
    size = np.abs(diagonal)
    lost = size <= SMALLEST * size.max(initial=0.0)
    _refuse("the Hessian of the cost is singular to working precision", lost, names)


def _refuse(problem: str, lost: NDArray[np.bool_], names: Sequence[str]) -> None:
    places = np.flatnonzero(lost)
    if not len(places):
        return
    known = [names[int(k)] if len(names) else f"parameter {k + 1} of {len(lost)}" for k in places]
    raise SingularError(
        problem,
        found=", ".join(known),
        needed="an effect of each, and another than that of the others",
        action=NEXT,
    )
