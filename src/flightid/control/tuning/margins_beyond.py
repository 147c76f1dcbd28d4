"""What resonances above the band, where no model was shown to hold, may do to margins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.outside_band import LESS, MarginBeyond
from flightid.control.margins.rigid_vehicle import RIGID
from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.loop_problem import LoopProblem
from flightid.control.tuning.mode_slacks import clear_from, slacks_of

PLACES = "phase_crossover_rad_s", "sensitivity_peak_rad_s", "delay_crossover_rad_s"
"""Where gain margin, sensitivity peak and delay margin are read."""
NONE_PROMISED = "no margin or peak is promised"


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
    left = slacks_of(problem, gains, band_rad_s, "above")
    if band_rad_s is None or not left:
        return ()
    judged = problem.judge(gains[None])
    if not judged.stable.all():
        return ()
    found, least_db = [], problem.requirements.gain_margin_db
    clear = clear_from(problem, gains, band_rad_s, "above", least_db)
    for name, metrics in judged.metrics.items():
        highest = max(float(np.nanmax(getattr(metrics, at), initial=0.0)) for at in PLACES)
        if name != ANGLE and (left[name].left_db < least_db or highest > band_rad_s[1]):
            near = left[name].own_db < least_db
            instead = f"or {LESS}" if near and problem.rigid else ""
            if not near and highest <= band_rad_s[1]:
                instead = RIGID
            told = {"taken": NONE_PROMISED, "instead": instead}
            found.append(MarginBeyond(name, highest, left[name], clear[name], asked=True, **told))
    return tuple(found)
