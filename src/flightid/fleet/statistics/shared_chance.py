"""The chance that vehicles which share nothing would step together as far as they did."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Places = NDArray[np.intp]
ALL_FLIPS = 8
"""Vehicles, up to which every flip is tried; of more as many as of these, drawn."""


def shared_chance(residual: Array, member: Places, day: Places, places: Places) -> float:
    """Chance of the largest common step, by turning the vehicles' own courses over.

    Were nothing shared, each vehicle's flights about its mean would as likely be their negative:
    turned over at will they keep what each does by itself, and lose what all do together. The
    squares that the best common step explains are held beside those of every such fleet (of random
    ones for many vehicles): a test that needs no errors, and counts the search for the date.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    member, day : ndarray of int, shape (n,)
    places : ndarray of int, shape (m,)
        Days before which the step may be.

    Returns
    -------
    float
        Share of the fleets whose best step explains as much, the one that is seen among them.

    Assumes
    -------
    What a vehicle does by itself is as likely to be the other way round.

    Reference
    ---------
    Pesarin & Salmaso, *Permutation Tests for Complex Data*, Wiley 2010, section 1.3 (sign flips).

    Example
    -------
    >>> member, day = np.repeat(np.arange(6), 8), np.tile(np.arange(8), 6)
    >>> shared_chance(np.where(day > 3, 0.1, 0.0), member, day, np.arange(3, 6))
    0.03125
    """
    _, vehicle = np.unique(member, return_inverse=True)
    k, days = int(vehicle.max()) + 1, int(day.max()) + 1
    mean = np.bincount(vehicle, residual) / np.bincount(vehicle)
    sums = np.zeros((k, days))
    np.add.at(sums, (vehicle, day), residual - mean[vehicle])
    # The sign of all together changes nothing: the first vehicle keeps its own.
    if k <= ALL_FLIPS:
        others = np.array(list(product((1.0, -1.0), repeat=k - 1)))
    else:
        others = np.random.default_rng(0).choice([1.0, -1.0], (2 ** (ALL_FLIPS - 1), k - 1))
        others[0] = 1.0
    signs = np.column_stack([np.ones(len(others)), others])
    before = np.cumsum(signs @ sums, axis=1)[:, places - 1]
    behind = np.cumsum(signs @ sums, axis=1)[:, -1:] - before
    counts = np.cumsum(np.bincount(day, minlength=days))
    n = counts[places - 1].astype(np.float64)
    rest = counts[-1] - n
    apart = before / n - behind / rest
    explained = np.max(n * rest / counts[-1] * apart**2, axis=1)
    return float(np.mean(explained >= explained[0] * (1.0 - 1e-9)))
