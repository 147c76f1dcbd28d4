"""What modes outside the band, where no model was shown to hold, leave of the numbers of loops."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.control.margins.mode_slack import NEAR_ONE, TAKEN, ModeSlack
from flightid.control.tuning.loop_problem import LoopAssessment, LoopProblem
from flightid.control.tuning.mode_slacks import slacks_of
from flightid.frozen import dataclass

Band = tuple[float, float]
ABOVE_BAND = "read above the identified band"
BELOW_BAND = "at one below the identified band"
OF_ABOVE = ABOVE_BAND, NEAR_ONE["above"], TAKEN["above"]
"""Why a number is not promised for what lies above the band."""
CROSSINGS = "crossover_rad_s", "delay_crossover_rad_s"
"""Where a loop passes one."""


@dataclass(frozen=True)
class Place:
    """Where a number stands.

    Attributes
    ----------
    loop, field : str
        Of `LoopMetrics`.
    read_at : str
        Field of the frequency at which it is read, where that may lie above the band; or empty.
    more : bool
        Whether more of it is better.
    """

    loop: str
    field: str
    read_at: str
    more: bool


def beside_modes(
    judged: LoopAssessment,
    problem: LoopProblem,
    gains: NDArray[np.float64],
    band_rad_s: Band | None,
) -> LoopAssessment:
    """Judged gains with what light modes on either side of the band leave of their loops.

    Parameters
    ----------
    judged : LoopAssessment
        Of these gains by the problem, new ones or those that flew.
    problem : LoopProblem
    gains : ndarray, shape (n_gains,)
    band_rad_s : tuple of float or None
        Where the model was shown to hold, rad/s.
    """
    return replace(
        judged,
        lows=slacks_of(problem, gains, band_rad_s, "below"),
        rooms=slacks_of(problem, gains, band_rad_s, "above"),
    )


def modes_outside(
    judged: LoopAssessment, place: Place, band_rad_s: Band | None, least_db: float
) -> tuple[str, float]:
    """Why a number is not promised, if so, and the worst that modes outside the band leave of it.

    Parameters
    ----------
    judged : LoopAssessment
        One candidate, from `beside_modes`.
    place : Place
    band_rad_s : tuple of float or None
    least_db : float
        Gain margin that is asked for.

    Returns
    -------
    str
        Empty where it is promised.
    float
        Infinite, on the side that sets no bound, where they touch nothing.
    """
    low = judged.lows.get(place.loop, ModeSlack("below"))
    room = judged.rooms.get(place.loop, ModeSlack("above"))
    there = np.isfinite(getattr(judged.metrics[place.loop], place.field)[0]).any()
    edges = (room.edge(place.field), low.edge(place.field) if there else None)
    known = [each for each in edges if each is not None]
    bound = min(known, default=np.inf) if place.more else max(known, default=-np.inf)
    return _unpromised(judged, place, band_rad_s, least_db, low, room), bound


def _unpromised(
    judged: LoopAssessment,
    place: Place,
    band_rad_s: Band | None,
    least_db: float,
    low: ModeSlack,
    room: ModeSlack,
) -> str:
    """A plant reads it above the band, or a mode outside it may take it: one rule on both sides."""
    if band_rad_s is None:
        return ""
    metrics = judged.metrics[place.loop]
    at = getattr(metrics, place.read_at)[0] if place.read_at else 0.0
    crossings = np.array([getattr(metrics, each)[0] for each in CROSSINGS])
    if np.any(at > band_rad_s[1]) or np.any(crossings > band_rad_s[1]):
        return ABOVE_BAND
    if low.takes_all(least_db) or np.any(crossings < band_rad_s[0]):
        return BELOW_BAND
    if low.takes(place.field, least_db):
        return low.reason
    return room.reason if room.takes(place.field, least_db) else ""
