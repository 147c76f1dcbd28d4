"""What modes outside the band of a model may do to the loops of its estimate, by loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.mode_slack import (
    MOST_MOVED_DB,
    ModeSlack,
    Side,
    left_by_frequency,
)
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.loop_problem import LoopProblem

Array = NDArray[np.float64]
Band = tuple[float, float]


def slacks_of(
    problem: LoopProblem, gains: Array, band_rad_s: Band | None, side: Side
) -> dict[str, ModeSlack]:
    """What a light mode on one side of the band leaves of the estimate's loops until they pass one.

    Parameters
    ----------
    problem : LoopProblem
    gains : ndarray, shape (n_gains,)
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.
    side : {"above", "below"}

    Returns
    -------
    dict of str to ModeSlack
        By loop. Empty where no band is known, or the loop's frequencies end inside it.
    """
    if band_rad_s is None:
        return {}
    omega = problem.plants.omega_rad_s
    outside = omega > band_rad_s[1] if side == "above" else omega < band_rad_s[0]
    if not outside.any():
        return {}
    moved = np.full(omega.shape, MOST_MOVED_DB) if problem.moved_db is None else problem.moved_db
    if problem.rigid:
        moved = np.zeros(omega.shape)
    loops = problem.loops(gains[None], problem.plants.take([0]))
    return {
        name: ModeSlack.of(
            side,
            loop[0, 0, outside],
            loops.rate[0, 0, outside] if name == ANGLE and not problem.rigid else None,
            moved[outside],
        )
        for name, loop in loops.named()
    }


def clear_from(
    problem: LoopProblem, gains: Array, band_rad_s: Band, side: Side, least_db: float
) -> dict[str, float]:
    """How far a band must reach so that no mode beyond it leaves a loop less than is asked, rad/s.

    Parameters
    ----------
    problem : LoopProblem
    gains : ndarray, shape (n_gains,)
    band_rad_s : tuple of float
    side : {"above", "below"}
    least_db : float
        What is to be left of a mode of ordinary size, or of the loop itself of a rigid vehicle.

    Returns
    -------
    dict of str to float
        By loop; zero below, or infinite above, where no band is wide enough.
    """
    omega = problem.plants.omega_rad_s
    outside = omega >= band_rad_s[1] if side == "above" else omega <= band_rad_s[0]
    loops = problem.loops(gains[None], problem.plants.take([0]))
    found, moved_db = {}, 0.0 if problem.rigid else MOST_MOVED_DB
    for name, loop in loops.named():
        inner = loops.rate[0, 0] if name == ANGLE and not problem.rigid else None
        left = left_by_frequency(side, loop[0, 0], inner, moved_db)
        short = omega[outside & (left < least_db)]
        if side == "above":
            last = float(short.max(initial=0.0))
            found[name] = last if last < omega[-1] else np.inf
        else:
            first = float(short.min(initial=np.inf))
            found[name] = min(first, band_rad_s[0]) if first > omega[0] else 0.0
    return found
