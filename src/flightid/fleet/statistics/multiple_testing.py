"""Many questions at once: chances corrected for how many were asked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError
from flightid.table import Cell

Array = NDArray[np.float64]
FALSE_SHARE = 0.05
"""Share of false ones among all alarms of a fleet that is allowed."""
LEAST = 1e-4
"""Least chance that is shown as a number."""


def chance_cell(chance: float | None) -> Cell:
    """A chance as tables show it: what no count could tell from zero is no number.

    Example
    -------
    >>> chance_cell(0.03), chance_cell(2e-31)
    (0.03, '< 0.0001')
    """
    return chance if chance is None or chance >= LEAST else f"< {LEAST:.4f}"


def corrected(chances: ArrayLike) -> Array:
    """Chances by Benjamini and Hochberg: alarms at `FALSE_SHARE` or less keep that share.

    Parameters
    ----------
    chances : array_like, shape (n,)
        Chance of each finding were nothing there.

    Returns
    -------
    ndarray, shape (n,)
        Least share of false alarms among all that are as likely or less so, never below the chance.

    Raises
    ------
    DataError
        A chance outside 0 to 1.

    Assumes
    -------
    Tests that are independent, or positively dependent as those of one flight's parameters are.

    Reference
    ---------
    Benjamini & Hochberg, *J. R. Stat. Soc. B* 57 (1995), 289–300; Benjamini & Yekutieli,
    *Ann. Stat.* 29 (2001), 1165–1188 (dependence).

    Example
    -------
    >>> corrected([0.01, 0.04, 0.03, 0.5]).round(4).tolist()
    [0.04, 0.0533, 0.0533, 0.5]
    """
    found = np.asarray(chances, dtype=np.float64)
    if found.ndim != 1 or not np.all((found >= 0.0) & (found <= 1.0)):
        raise DataError("chances lie from 0 to 1", found=str(found)[:80], needed="a list of them")
    order = np.argsort(found)[::-1]
    ranks = np.arange(len(found), 0, -1)
    least = np.minimum.accumulate(found[order] * len(found) / ranks)
    made = np.empty_like(found)
    made[order] = np.minimum(least, 1.0)
    return made
