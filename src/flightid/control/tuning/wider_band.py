"""How far, how long and how strongly to sweep, so that gains promise what was asked of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.loop_problem import LoopProblem
from flightid.control.tuning.mode_slacks import clear_from
from flightid.responses.bands import COHERENT
from flightid.responses.windows.defaults import CYCLES_AT_LOWEST, WINDOWS_IN_RECORDS

Array = NDArray[np.float64]
Band = tuple[float, float]
FURTHER = 1.3
"""Ratio to the frequency that a loop needs, by which a band reaches past it and a sweep past that:
gains found anew cross over elsewhere."""
TOLD = 0.3, 0.97
"""Coherence that tells how it falls: less is chance, more is that of windows."""
STEEPEST = 4.0
"""Of the injection's power over that of noise with frequency: a loop holds a vehicle against both,
so the input that is left of an injection falls with 1/(1 + L)²."""
SURE = 5.0
"""Power over what a coherence of `COHERENT` needs: it is read with chance, and falls faster below
the band than at its end, where an integrator sets in; with 2 such sweeps fell short."""
CLEAR, WITHIN = 0.95, 10.0
"""Coherence that bears records which hold nothing there, and how far above the band's low end it is
looked for: every record adds noise where it sweeps nothing."""
LOUDEST = 6.0
"""Times an amplitude that has flown, beyond which none is advised: a vehicle turns as far."""


def wider_band(problem: LoopProblem, gains: Array, band_rad_s: Band | None) -> tuple[str, str]:
    """What brings a band down, and what brings it up, so far that light modes take nothing asked.

    Parameters
    ----------
    problem : LoopProblem
        Of the gains, with what was measured.
    gains : ndarray, shape (n_gains,)
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.
    """
    if band_rad_s is None:
        return "", ""
    least_db = problem.requirements.gain_margin_db
    low = min(clear_from(problem, gains, band_rad_s, "below", least_db).values())
    high = max(clear_from(problem, gains, band_rad_s, "above", least_db).values())
    # Of a rigid vehicle the loop is low enough before its margins are read: those lines say where.
    further = 0.0 if problem.rigid and np.isfinite(high) else high
    return (
        lower_sweep(low, band_rad_s[0], problem.measured),
        higher_sweep(further, band_rad_s[1]),
    )


def higher_sweep(needed_rad_s: float, top_rad_s: float) -> str:
    """How far up to sweep for a band to a frequency, rad/s; infinite: there is none."""
    if np.isinf(needed_rad_s):
        return "lower the loop by filters or less D: it stays near one up to half the loop rate"
    if needed_rad_s <= top_rad_s:
        return "sweep to higher frequencies, until margins are read inside the band"
    return f"sweep to higher frequencies, up to {FURTHER * needed_rad_s:.3g} rad/s"


def lower_sweep(needed_rad_s: float, low_rad_s: float, measured: tuple[Array, Array] | None) -> str:
    """How to sweep for a band from a frequency on, or that no sweep of ordinary size brings it.

    Parameters
    ----------
    needed_rad_s : float
        From where on the model has to be shown, rad/s; zero: there is no such frequency.
    low_rad_s : float
        From where on it was, rad/s.
    measured : tuple of ndarray or None
        Frequencies (rad/s) and coherence of the response that was fitted.

    Example
    -------
    >>> lower_sweep(0.0, 1.0, None)
    'no sweep brings it: the loop stays near one down to rest; add I, or fly the gains ...
    """
    instead = "fly the gains by small steps, and look for slow swings hands off after each"
    if needed_rad_s <= 0.0:
        return f"no sweep brings it: the loop stays near one down to rest; add I, or {instead}"
    target = needed_rad_s / FURTHER
    start, cycle = target / FURTHER, 2.0 * np.pi / target
    each, together = 2.0 * CYCLES_AT_LOWEST * cycle, WINDOWS_IN_RECORDS * CYCLES_AT_LOWEST * cycle
    top = FURTHER * max(_unclear(low_rad_s, measured), 2.0 * target)
    how = (
        f"add records that sweep from {start:.2g} to {top:.2g} rad/s alone, of {_up(each)} s or "
        f"more each and {_up(together)} s or more together"
    )
    louder = None if measured is None else times_louder(target, low_rad_s, *measured)
    if louder is None:
        return f"{how}, with more amplitude than before"
    if louder > LOUDEST:
        return (
            f"no sweep of ordinary size brings it: from {target:.2g} rad/s on the model would have "
            f"to be shown, where the loop leaves so little of what is injected that it takes "
            f"{louder:.0f} times the amplitude; sweep with softer I and angle gains, which leave "
            f"more of it, or {instead}"
        )
    if louder <= 1.0:
        return f"{how}, with the amplitude that flew"
    times = np.ceil(10.0 * louder) / 10.0
    return f"{how}, with {times:g} times the amplitude that flew, if the vehicle may turn as far"


def times_louder(
    target_rad_s: float, low_rad_s: float, omega_rad_s: Array, coherence: Array
) -> float | None:
    """By how much an amplitude has to rise for coherence at a frequency; None where nobody knows.

    Noise and injection stay as they are, so γ²/(1 − γ²) rises with the square of the amplitude. It
    falls below the band as it does about the band's low end.

    Example
    -------
    >>> omega = np.array([1.0, 2.0, 4.0])
    >>> round(times_louder(1.0, 2.0, omega, np.array([0.36, 0.6, 0.8])), 2)
    3.65
    """
    near = (omega_rad_s <= 4.0 * low_rad_s) & (coherence > TOLD[0]) & (coherence < TOLD[1])
    if np.count_nonzero(near) < 2:
        return None
    ratio = coherence[near] / (1.0 - coherence[near])
    slope, _ = np.polyfit(np.log(omega_rad_s[near]), np.log(ratio), 1)
    slope = float(np.clip(slope, 0.0, STEEPEST))
    level = float(np.mean(np.log(ratio) - slope * np.log(omega_rad_s[near])))
    there = np.exp(level + slope * np.log(target_rad_s))
    return float(np.sqrt(SURE * COHERENT / (1.0 - COHERENT) / there))


def _unclear(low_rad_s: float, measured: tuple[Array, Array] | None) -> float:
    """Up to where coherence about the band's low end is not clear, rad/s."""
    if measured is None:
        return float(np.sqrt(WITHIN)) * low_rad_s
    omega, coherence = measured
    weak = omega[(omega < WITHIN * low_rad_s) & (coherence < CLEAR)]
    return float(np.max(weak, initial=low_rad_s))


def _up(seconds: float) -> str:
    return f"{np.ceil(seconds / 5.0) * 5.0:.0f}"
