"""How coefficients of a sampled model go with the gain and the speed of the vehicle behind it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CHANGE = 1e-6
"""Relative change of the speed, for derivatives."""


def gain_and_speed(names: Sequence[str], values: Array) -> Array:
    """Derivatives of coefficients by the logarithms of each input's gain and of the speed.

    A vehicle that is faster by a share has poles ``z`` to the power of one and that share.

    Parameters
    ----------
    names : sequence of str
        ``a1``, ``b2`` or ``b2[u]``, as a structure has them.
    values : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n, n_properties)

    Example
    -------
    >>> gain_and_speed(["a1", "b1"], np.array([-0.9, 0.5])).round(4)  # 0.9 ln 0.9
    array([[0.    , 0.0948],
           [0.5   , 0.    ]])
    """
    tails = [name.partition("[")[2] for name in names]
    letters = np.array([name[0] for name in names])
    moves = []
    for tail in dict.fromkeys(tails):
        own = np.array([each == tail for each in tails])
        gain = np.where(own & (letters == "b"), values, 0.0)
        if gain.any():
            moves.append(gain)
    speed = np.zeros(len(values))
    for letter in "af":
        for tail in dict.fromkeys(tails):
            places = np.flatnonzero(
                (letters == letter) & np.array([each == tail for each in tails])
            )
            if len(places):
                speed[places] = _faster(values[places])
    return np.stack([*moves, speed], axis=1)


def _faster(coefficients: Array) -> Array:
    poles = np.roots(np.concatenate([[1.0], coefficients])).astype(np.complex128)
    there = np.zeros(len(coefficients), dtype=np.complex128)
    kept = poles[np.abs(poles) > 0.0]
    there[: len(kept)] = np.poly(kept ** (1.0 + CHANGE))[1:]
    here = np.zeros(len(coefficients), dtype=np.complex128)
    here[: len(kept)] = np.poly(kept)[1:]
    return np.asarray((there - here).real / CHANGE, dtype=np.float64)
