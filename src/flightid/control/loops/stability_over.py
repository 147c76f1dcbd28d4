"""Poles followed, and unstable ones counted, while the parts of a loop vary."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.control.loops.delayed_roots import count_right, line_right_of_axis, newton_roots
from flightid.control.loops.interconnection import Interconnection

Complex = NDArray[np.complex128]


def followed_poles(loops: Interconnection, known: Complex) -> Complex:
    """Poles of loops that are near those of others: each is followed from where it was.

    Parameters
    ----------
    loops : Interconnection
    known : ndarray of complex
        Poles of nearby loops, in the plane of `Interconnection.poles`.

    Returns
    -------
    ndarray of complex
        In the order of `known`; NaN where one was lost.
    """
    parts = loops.delayed_parts()
    if parts is None:
        poles = loops.poles()
        distance = np.abs(known[:, None] - poles[None, :])
        rows, columns = scipy.optimize.linear_sum_assignment(distance)
        found = np.full(len(known), np.nan, dtype=np.complex128)
        found[rows] = poles[columns]
        return found
    roots = newton_roots(*parts, known)
    return np.array([np.nan if each is None else each for each in roots], dtype=np.complex128)


def unstable_count(loops: Interconnection) -> int:
    """Number of poles that grow, by the argument principle where there are delays inside."""
    parts = loops.delayed_parts()
    if parts is None:
        return loops.stability().n_unstable
    counted = count_right(*parts, line_right_of_axis(parts[0], parts[4]))
    return loops.stability().n_unstable if counted is None else counted
