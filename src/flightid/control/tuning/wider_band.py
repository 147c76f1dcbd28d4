"""How far, how long and how strongly to sweep, so that gains promise what was asked of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.outside_band import LOWER, SAMPLES_IN_CYCLE, held_by
from flightid.control.tuning.loop_problem import LoopProblem
from flightid.control.tuning.mode_slacks import clear_from
from flightid.responses.bands import COHERENT
from flightid.responses.pair import PairResponse
from flightid.responses.windows.defaults import (
    CYCLES_AT_LOWEST,
    HIGHEST_FRACTION,
    WINDOWS_IN_RECORDS,
)

Array = NDArray[np.float64]
Band = tuple[float, float]
FURTHER = 1.3
"""Ratio to the frequency that a loop needs, by which a band reaches past it and a sweep past that:
gains found anew cross over elsewhere."""
TOLD = 0.3, 0.97
"""Coherence that tells how it falls: less is chance, more is that of windows."""
STEEPEST = 4.0
"""Of what a loop leaves of an injection's power over that of noise, with frequency: it holds a
vehicle against both, and the input that is left of an injection falls with 1/(1 + L)²."""
NEAR, BESIDE, FEWEST, SPREAD = 4.0, 1.3, 4, 1.3
"""How far above the band's low end coherence tells how it falls, and how far above the start of a
sweep, which few windows hold; how many frequencies are to tell it, and the ratio of the highest to
the lowest: of fewer the slope is chance."""
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
        higher_sweep(further, band_rad_s[1], float(problem.plants.omega_rad_s[-1])),
    )


def higher_sweep(needed_rad_s: float, top_rad_s: float, half_rate_rad_s: float) -> str:
    """How far up to sweep for a band to a frequency, and with which log, or that none reaches it.

    Parameters
    ----------
    needed_rad_s : float
        Up to where the model has to be shown, rad/s; infinite: there is no such frequency.
    top_rad_s : float
        Up to where it was, rad/s.
    half_rate_rad_s : float
        Half the loop's rate, rad/s: responses are trusted up to two fifths of it at most.

    Example
    -------
    >>> higher_sweep(100.0, 50.0, 1257.0)
    'sweep to higher frequencies, up to 130 rad/s (a log of 340 rows a second or more holds it)'
    """
    if np.isinf(needed_rad_s):
        return "lower the loop by filters or less D: it stays near one up to half the loop rate"
    if needed_rad_s <= top_rad_s:
        return "sweep to higher frequencies, until margins are read inside the band"
    reach, rate_hz = FURTHER * needed_rad_s, half_rate_rad_s / np.pi
    if reach > HIGHEST_FRACTION * 2.0 * half_rate_rad_s:
        return (
            f"{LOWER}: only a band up to {held_by(reach)} would show it, and the loop runs at "
            f"{rate_hz:.0f} Hz"
        )
    if SAMPLES_IN_CYCLE * reach > 2.0 * half_rate_rad_s:
        said = f"{float(f'{reach:.3g}'):g} rad/s, and log at the loop's {rate_hz:.0f} Hz"
        return f"sweep to higher frequencies, up to {said}"
    return f"sweep to higher frequencies, up to {held_by(reach)}"


def lower_sweep(needed_rad_s: float, low_rad_s: float, measured: PairResponse | None) -> str:
    """How to sweep for a band from a frequency on, or that none brings it.

    Parameters
    ----------
    needed_rad_s : float
        From where on the model has to be shown, rad/s; zero: there is no such frequency.
    low_rad_s : float
        From where on it was, rad/s.
    measured : PairResponse or None
        The response that was fitted.

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
    louder = None if measured is None else times_louder(low_rad_s, measured, target, start, top)
    if louder is None:
        return f"{how}, with the amplitude that flew, then see: what flew does not tell how much"
    if louder > LOUDEST:
        return (
            f"{how}, with as much amplitude as the vehicle may turn with: by how its coherence "
            f"falls about {louder:.0f} times the largest that flew, which may not fly; softer I "
            f"and angle gains may leave more of a sweep, or {instead}"
        )
    if louder <= 1.0:
        return f"{how}, with the largest amplitude that flew"
    times = np.ceil(10.0 * louder) / 10.0
    return f"{how}, with {times:g} times the largest amplitude that flew, if it may turn as far"


def times_louder(
    low_rad_s: float,
    measured: PairResponse,
    target_rad_s: float,
    start_rad_s: float,
    top_rad_s: float,
) -> float | None:
    """By how much an amplitude has to rise for coherence at a frequency of a new sweep.

    Noise stays as it is, so γ²/(1 − γ²) is the power injected times what the loop leaves of it over
    noise, which falls below the band as it does about the band's low end. Power of a logarithmic
    sweep at a frequency goes with its length and the inverse of ω ln(ω₂/ω₁).

    Parameters
    ----------
    low_rad_s : float
        Low end of the band, rad/s.
    measured : PairResponse
        The response that was fitted, with what was injected.
    target_rad_s : float
        Where coherence is needed, rad/s.
    start_rad_s, top_rad_s : float
        Ends of the new sweep, rad/s.

    Returns
    -------
    float or None
        Over the largest amplitude that flew; None where what flew does not tell.
    """
    omega, coherence, power = measured.omega_rad_s, measured.coherence, measured.injected
    if power is None:
        return None
    near = (omega <= NEAR * low_rad_s) & (coherence > TOLD[0]) & (coherence < TOLD[1])
    near &= power.is_swept(omega) & power.is_swept(omega / BESIDE)
    if np.count_nonzero(near) < FEWEST or np.ptp(np.log(omega[near])) < np.log(SPREAD):
        return None
    logs = np.log(omega[near])
    left = np.log(coherence[near] / (1.0 - coherence[near]) / power.at(omega[near]))
    slope = float(np.clip(np.polyfit(logs, left, 1)[0], 0.0, STEEPEST))
    there = np.exp(np.mean(left - slope * logs) + slope * np.log(target_rad_s))
    lasting = WINDOWS_IN_RECORDS * CYCLES_AT_LOWEST * 2.0 * np.pi / target_rad_s
    share = lasting / (lasting + power.seconds)
    density = share * 2.0 * np.pi / (target_rad_s * np.log(top_rad_s / start_rad_s))
    return float(np.sqrt(SURE * COHERENT / (1.0 - COHERENT) / (there * density)))


def _unclear(low_rad_s: float, measured: PairResponse | None) -> float:
    """Up to where coherence about the band's low end is not clear, rad/s."""
    if measured is None:
        return float(np.sqrt(WITHIN)) * low_rad_s
    omega, coherence = measured.omega_rad_s, measured.coherence
    weak = omega[(omega < WITHIN * low_rad_s) & (coherence < CLEAR)]
    return float(np.max(weak, initial=low_rad_s))


def _up(seconds: float) -> str:
    return f"{np.ceil(seconds / 5.0) * 5.0:.0f}"
