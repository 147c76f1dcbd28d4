"""What resonances above the band, where no model was shown to hold, may do to margins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.outside_band import MarginBeyond
from flightid.control.margins.resonance_slack import MOST_RAISED_DB, ResonanceSlack
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.loop_problem import LoopProblem

PLACES = "phase_crossover_rad_s", "sensitivity_peak_rad_s", "delay_crossover_rad_s"
"""Where gain margin, sensitivity peak and delay margin are read."""
NONE_PROMISED = "no margin or peak is promised"


def rooms_left(
    problem: LoopProblem, gains: NDArray[np.float64], band_rad_s: tuple[float, float] | None
) -> dict[str, ResonanceSlack]:
    """What a resonance above the band leaves of the estimate's loops until they pass one.

    Parameters
    ----------
    problem : LoopProblem
    gains : ndarray, shape (n_gains,)
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.

    Returns
    -------
    dict of str to ResonanceSlack
        By loop. Empty where no band is known, or the loop's frequencies end inside it.
    """
    above = problem.plants.omega_rad_s > (np.inf if band_rad_s is None else band_rad_s[1])
    if not above.any():
        return {}
    loops = problem.loops(gains[None], problem.plants.take([0]))
    rate = loops.rate[..., above]
    return {
        name: ResonanceSlack.above_around(loop[..., above], rate)
        if name == ANGLE
        else ResonanceSlack.above(loop[..., above])
        for name, loop in loops.named()
    }


def margins_beyond(
    problem: LoopProblem, gains: NDArray[np.float64], band_rad_s: tuple[float, float] | None
) -> tuple[MarginBeyond, ...]:
    """Loops broken at the output whose margins what lies above the band may take.

    They are read above it, or a resonance there may leave less of them than is required.

    Parameters
    ----------
    problem : LoopProblem
    gains : ndarray, shape (n_gains,)
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s; nothing is said where that is not known.
    """
    left = rooms_left(problem, gains, band_rad_s)
    if band_rad_s is None or not left:
        return ()
    judged = problem.judge(gains[None])
    if not judged.stable.all():
        return ()
    found, least_db = [], problem.requirements.gain_margin_db
    loops = dict(problem.loops(gains[None], problem.plants.take([0])).named())
    for name, metrics in judged.metrics.items():
        highest = max(float(np.nanmax(getattr(metrics, at), initial=0.0)) for at in PLACES)
        if name != ANGLE and (left[name].left_db < least_db or highest > band_rad_s[1]):
            asked = 10.0 ** (-(MOST_RAISED_DB + least_db) / 20.0)
            reaching = problem.plants.omega_rad_s[np.abs(loops[name][0, 0]) > asked]
            clear = float(reaching.max(initial=0.0))
            found.append(MarginBeyond(name, highest, left[name].room_db, clear, NONE_PROMISED))
    return tuple(found)
