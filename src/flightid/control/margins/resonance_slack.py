"""What resonances above the band, where no model was shown to hold, leave of a loop's numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Interval, Reading
from flightid.uncertainty.uneven import Reaching

MOST_RAISED_DB = 20.0
"""By which no mode raises a response that damping and share leave ordinary: ten times."""
MORE_IS_BETTER = {
    "gain_margin_db": True,
    "modulus_margin": True,
    "sensitivity_peak": False,
    "disturbance_peak_db": False,
}
"""Numbers that a resonance moves even where the loop does not pass one at it."""
AT_ONE = "phase_margin_deg", "delay_margin_s", "gain_reduction_margin_db"
"""Numbers that a resonance leaves as they are until the loop passes one at it: with any phase."""
TAKEN = "a resonance above the identified band may leave less"


@dataclass(frozen=True)
class ResonanceSlack:
    """By how much a loop may still be raised where a resonance above the band has raised it.

    Assumes
    -------
    No resonance raises the response by more than `MOST_RAISED_DB` over that of the model.

    Attributes
    ----------
    left_db : float
        Until the loop passes one; at most 0 where a resonance may make it unstable, infinite where
        nothing lies above the band.

    Example
    -------
    >>> ResonanceSlack.above([0.01j, 0.001]).edge("gain_margin_db")
    20.0
    """

    left_db: float = np.inf

    @classmethod
    def above(cls, loop: ArrayLike) -> ResonanceSlack:
        """Of a loop's response above the band, of any shape."""
        return cls(room_above(loop) - MOST_RAISED_DB)

    @classmethod
    def above_around(cls, loop: ArrayLike, inner: ArrayLike) -> ResonanceSlack:
        """Of a loop around a closed one, whose resonance that one raises further.

        Raised by r, with any phase, the outer loop A₀/(1 + R) becomes at most |A₀| r/(1 − r |R|).

        Parameters
        ----------
        loop, inner : array_like of complex, shape (…, n_f)
            Outer loop, and the loop closed inside it, above the band.
        """
        most = 10.0 ** (MOST_RAISED_DB / 20.0)
        left = 1.0 - most * np.abs(inner)
        if np.any(left <= 0.0):
            return cls(-np.inf)
        return cls(room_above(np.abs(loop) * np.abs(1.0 + np.asarray(inner)) * most / left))

    @property
    def passes_one(self) -> bool:
        """Whether a resonance may make the loop pass one, where it takes stability, too."""
        return self.left_db < 0.0

    @property
    def room_db(self) -> float:
        """By how much a resonance may raise the response before the loop passes one, dB."""
        return self.left_db + MOST_RAISED_DB

    def edge(self, field: str) -> float | None:
        """What a resonance may make of a number of `LoopMetrics`; None where it does not touch it.

        A loop that is raised to −m dB has a gain margin of m there, and comes as near to −1 as
        1 − 10^(−m/20).
        """
        if field not in MORE_IS_BETTER or np.isinf(self.left_db):
            return None
        if field == "gain_margin_db":
            return self.left_db
        nearest = max(1.0 - 10.0 ** (-self.left_db / 20.0), 0.0)
        if field == "modulus_margin":
            return float(nearest)
        peak = np.inf if nearest == 0.0 else 1.0 / nearest
        return float(peak if field == "sensitivity_peak" else 20.0 * np.log10(peak))

    def takes(self, field: str, least_db: float) -> bool:
        """Whether it may leave a number less than is asked: a gain margin of so many dB."""
        if field in AT_ONE:
            return self.passes_one
        return field in MORE_IS_BETTER and self.left_db < least_db

    def reached(self, number: Reading, field: str, least_db: float) -> Reading:
        """A number whose interval reaches what a resonance may make of it; none where it is taken.

        Those at one are left as they are: their intervals rest on no resonance passing one.

        Parameters
        ----------
        number : Estimate
        field : str
            Of `LoopMetrics`.
        least_db : float
            Gain margin that is asked for.
        """
        edge = self.edge(field)
        if number.value is None or edge is None or number.interval95 is None:
            return number
        if self.takes(field, least_db):
            return Estimate(number.name, number.value, number.unit, None, TAKEN)
        low, high = number.interval95
        if edge >= low if MORE_IS_BETTER[field] else edge <= high:
            return number
        return replace(number, stderr=None, ends=Reaching(number.ends or _Even(number), edge))


@dataclass(frozen=True)
class _Even:
    """Ends of a number whose interval is even about its value."""

    number: Reading

    def __call__(self, level: float) -> Interval | None:
        return self.number.interval(level)


def room_above(loop: ArrayLike) -> float:
    """By how much a resonance may raise a loop's response, of any shape, before it passes one, dB.

    Example
    -------
    >>> room_above([0.1j, 0.01])
    20.0
    """
    return float(-20.0 * np.log10(np.max(np.abs(loop))))
