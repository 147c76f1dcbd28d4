"""Margins of tuned gains that are read where no model was shown to hold: above the band."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.outside_band import MarginBeyond, room_above
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.loop_problem import LoopProblem

PLACES = "phase_crossover_rad_s", "sensitivity_peak_rad_s", "delay_crossover_rad_s"
"""Where gain margin, sensitivity peak and delay margin are read."""


def margins_beyond(
    problem: LoopProblem, gains: NDArray[np.float64], band_rad_s: tuple[float, float] | None
) -> tuple[MarginBeyond, ...]:
    """Loops broken at the output whose margins are read above the band.

    Parameters
    ----------
    problem : LoopProblem
    gains : ndarray, shape (n_gains,)
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s; nothing is said where that is not known.
    """
    if band_rad_s is None:
        return ()
    judged, loops = problem.judge(gains[None]), problem.loops(gains[None], problem.plants)
    above = problem.plants.omega_rad_s > band_rad_s[1]
    if not above.any() or not judged.stable.all():
        return ()
    found = []
    for name, loop in loops.named():
        metrics = judged.metrics[name]
        highest = max(float(np.nanmax(getattr(metrics, at), initial=0.0)) for at in PLACES)
        if name != ANGLE and highest > band_rad_s[1]:
            found.append(MarginBeyond(name, highest, room_above(loop[..., above])))
    return tuple(found)
