"""Margins that are read where no model was shown to hold: above the identified band."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.limits import ANGLE
from flightid.control.tuning.loop_problem import LoopProblem
from flightid.conventions import Light
from flightid.findings import Finding

Array = NDArray[np.float64]
MOST_RAISED_DB = 20.0
"""By which no mode raises a response that damping and share leave ordinary: ten times."""
TO_SEE_IT = 1.3
"""Band beyond the frequency of a margin from which the model is known about it."""


@dataclass(frozen=True)
class MarginBeyond:
    """One loop whose gain margin or sensitivity peak lies above the band.

    Attributes
    ----------
    loop : str
    omega_rad_s : float
        Highest frequency at which a plant takes one of them, rad/s.
    room_db : float
        By how much a resonance above the band may raise the response before the loop passes one.
    """

    loop: str
    omega_rad_s: float
    room_db: float

    @property
    def words(self) -> str:
        """What may go wrong there."""
        if self.room_db <= 0.0:
            return f"there the loop passes one again, by {-self.room_db:.2g} dB in the model alone"
        return (
            f"a resonance there that raises the response by {self.room_db:.2g} dB may make it "
            "unstable"
        )


def margins_beyond(
    problem: LoopProblem, gains: Array, band_rad_s: tuple[float, float] | None
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
        places = np.concatenate(
            [metrics.phase_crossover_rad_s.ravel(), metrics.sensitivity_peak_rad_s.ravel()]
        )
        highest = float(np.nanmax(places))
        if name != ANGLE and highest > band_rad_s[1]:
            found.append(MarginBeyond(name, highest, room_above(loop[..., above])))
    return tuple(found)


def room_above(loop: NDArray[np.complex128]) -> float:
    """By how much a resonance may raise a loop's response, of any shape, before it passes one, dB.

    Example
    -------
    >>> room_above(np.array([0.1j, 0.01]))
    20.0
    """
    return float(-20.0 * np.log10(np.max(np.abs(loop))))


def beyond_findings(
    found: Iterable[MarginBeyond], band_rad_s: tuple[float, float] | None
) -> list[Finding]:
    """Amber for each that a resonance may pass: what stands there is the model's word alone."""
    top_rad_s = np.inf if band_rad_s is None else band_rad_s[1]
    return [
        Finding(
            "margin-beyond-band",
            Light.AMBER if each.room_db < MOST_RAISED_DB else Light.GREEN,
            f"{each.loop}: margins are read up to {each.omega_rad_s:.3g} rad/s, above the "
            f"{top_rad_s:.3g} rad/s to which the model was shown to hold: {each.words}, and "
            "nothing is promised of those margins",
            f"identify up to {TO_SEE_IT * each.omega_rad_s:.3g} rad/s, and sweep that far",
        )
        for each in found
    ]
