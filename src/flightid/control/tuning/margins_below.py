"""What light modes below the band, where no model was shown to hold, may do to margins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.low_mode_slack import LowModeSlack, most_lowered_db
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.loop_problem import LoopAssessment, LoopProblem, Plants

Band = tuple[float, float]
BELOW_BAND = "at one below the identified band"
FEWEST = 3
"""A spread needs more than the estimate and one other."""
CROSSINGS = "crossover_rad_s", "delay_crossover_rad_s"
"""Where a loop passes one."""


def lows_left(
    problem: LoopProblem, gains: NDArray[np.float64], band_rad_s: Band | None
) -> dict[str, LowModeSlack]:
    """What a light mode below the band leaves of the estimate's loops until they pass one.

    Parameters
    ----------
    problem : LoopProblem
    gains : ndarray, shape (n_gains,)
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.

    Returns
    -------
    dict of str to LowModeSlack
        By loop. Empty where no band is known, or the loop's frequencies begin inside it.
    """
    omega = problem.plants.omega_rad_s
    below = omega < (0.0 if band_rad_s is None else band_rad_s[0])
    if band_rad_s is None or not below.any():
        return {}
    error = _error_at(problem.plants, band_rad_s[0])
    lowered_db = most_lowered_db(band_rad_s[0] / omega[below], error)
    loops = problem.loops(gains[None], problem.plants.take([0]))
    rate = loops.rate[..., below]
    return {
        name: LowModeSlack.below_around(loop[..., below], rate, lowered_db)
        if name == ANGLE
        else LowModeSlack.below(loop[..., below], lowered_db)
        for name, loop in loops.named()
    }


def _error_at(plants: Plants, omega_rad_s: float) -> float:
    """Largest relative error of the estimate at a frequency; unknown where plants are few."""
    if len(plants) < FEWEST:
        return np.inf
    at = min(int(np.searchsorted(plants.omega_rad_s, omega_rad_s)), len(plants.omega_rad_s) - 1)
    return float(np.abs(plants.rate[:, at] / plants.rate[0, at] - 1.0).max())


def passes_below(judged: LoopAssessment, loop: str, band_rad_s: Band | None) -> bool:
    """Whether a plant's loop passes one below the band.

    Parameters
    ----------
    judged : LoopAssessment
        One candidate.
    loop : str
    band_rad_s : tuple of float or None
    """
    if band_rad_s is None:
        return False
    metrics = judged.metrics[loop]
    return any(bool(np.any(getattr(metrics, at)[0] < band_rad_s[0])) for at in CROSSINGS)
