"""What light modes below the band, where no model was shown to hold, may do to margins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.low_mode_slack import LowModeSlack
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.loop_problem import LoopAssessment, LoopProblem

Band = tuple[float, float]
BELOW_BAND = "at one below the identified band"
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
    below = problem.plants.omega_rad_s < (0.0 if band_rad_s is None else band_rad_s[0])
    if not below.any():
        return {}
    loops = problem.loops(gains[None], problem.plants.take([0]))
    rate = loops.rate[..., below]
    return {
        name: LowModeSlack.below_around(loop[..., below], rate)
        if name == ANGLE
        else LowModeSlack.below(loop[..., below])
        for name, loop in loops.named()
    }


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
