"""What light modes below the band, where no model was shown to hold, leave of a loop's numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.control.margins.resonance_slack import MOST_RAISED_DB
from flightid.frozen import dataclass

MOST_LOWERED_DB = MOST_RAISED_DB
"""By which no mode lowers a response between its pole and its zero, as none raises it by more."""
LEAST_DAMPING = 0.02
"""Damping ratio of a zero below the band that none has less of: a load on a line, a bare frame."""
TAKEN_BELOW = "a light mode below the identified band may leave less"
AT_ONE = "phase_margin_deg", "delay_margin_s", "gain_margin_db"
"""Numbers that a loop leaves as they are until it passes one."""
AT_BANDWIDTH_DB = float(20.0 * np.log10(1.0 + 2.0**0.5))
"""Least gain at which the sensitivity lies below −3 dB, whatever the phase."""


@dataclass(frozen=True)
class LowModeSlack:
    """By how much a loop may still be lowered where a light mode below the band has lowered it.

    A pendulum or a slung load is a pole beside a zero: the response falls towards the zero and
    turns by half a circle between the two. Where it falls through one, every margin may be lost.

    Assumes
    -------
    No mode lowers the response by more than `MOST_LOWERED_DB` under that of the model, nor by more
    than `most_lowered_db`.

    Attributes
    ----------
    left_db : float
        Until the loop passes one; at most 0 where a mode may make it unstable, infinite where
        nothing lies below the band.
    own_db : float
        Least gain of the loop itself there.

    Example
    -------
    >>> LowModeSlack.below([-100.0j, 1000.0]).edge("gain_reduction_margin_db")
    20.0
    """

    left_db: float = np.inf
    own_db: float = np.inf

    @classmethod
    def below(cls, loop: ArrayLike, lowered_db: ArrayLike = MOST_LOWERED_DB) -> LowModeSlack:
        """Of a loop's response below the band.

        Parameters
        ----------
        loop : array_like of complex, shape (…, n_f)
        lowered_db : array_like, shape (n_f,)
            By which a mode may lower it at most, dB.
        """
        gain = np.abs(loop)
        return cls(_least_db(gain * _factor(lowered_db)), _least_db(gain))

    @classmethod
    def below_around(
        cls, loop: ArrayLike, inner: ArrayLike, lowered_db: ArrayLike = MOST_LOWERED_DB
    ) -> LowModeSlack:
        """Of a loop around a closed one, which makes up for what its vehicle loses.

        Parameters
        ----------
        loop, inner : array_like of complex, shape (…, n_f)
            Outer loop, and the loop closed inside it, below the band.
        lowered_db : array_like, shape (n_f,)
            By which a mode may lower the inner one at most, dB.
        """
        inner = np.asarray(inner)
        low = np.abs(inner) * _factor(lowered_db)
        share = np.abs((1.0 + inner) / inner) * low / (1.0 + low)
        return cls(_least_db(np.abs(loop) * share), _least_db(np.abs(loop)))

    def edge(self, field: str) -> float | None:
        """What a mode may make of a number of `LoopMetrics`; None where it does not touch it.

        A loop that is lowered to m dB may fall by m more, and comes as near to −1 as
        10^(m/20) − 1.
        """
        if np.isinf(self.left_db):
            return None
        nearest = max(10.0 ** (self.left_db / 20.0) - 1.0, 0.0)
        peak = np.inf if nearest == 0.0 else 1.0 / nearest
        return {
            "gain_reduction_margin_db": self.left_db,
            "modulus_margin": nearest,
            "sensitivity_peak": peak,
            "disturbance_peak_db": float(20.0 * np.log10(peak)),
        }.get(field)

    def takes(self, field: str, least_db: float) -> bool:
        """Whether it may leave a number less than is asked: a gain margin of so many dB.

        Lowered through one it passes one there with any phase, and may pass −180° at any gain
        below one, too.
        """
        if field in AT_ONE:
            return self.left_db < 0.0
        if field == "disturbance_bandwidth_rad_s":
            return self.left_db < AT_BANDWIDTH_DB
        return self.edge(field) is not None and self.left_db < least_db

    def takes_all(self, least_db: float) -> bool:
        """Whether the loop itself is at one below the band, or nearer to it than is asked."""
        return self.own_db < least_db


def most_lowered_db(ratio: ArrayLike, error: float) -> NDArray[np.float64]:
    """By which a mode that the low end of a band hardly shows may lower a response below it, dB.

    Parameters
    ----------
    ratio : array_like
        Low end of the band over a frequency below it, at least 1.
    error : float
        Largest relative error of the model at that end.

    Notes
    -----
    A mode makes the response N/D of what the model has, N = ζ-damped zeros, D = poles. With
    a(ω) = |N − D|, which rises with ω, it lowers by 1 + a/|N| at most, and at the band's end
    a ≤ ε |N|/(1 − ε): together 1 + ε/(1 − ε) √((ρ² − 1)² + (2ζρ)²)/(2ζ) with zeros at ω and ρ the
    ratio. The nearer to the band, the more a mode would have shown in it.

    Example
    -------
    >>> most_lowered_db([1.0, 1.25, 2.0], 0.1).round(1).tolist()
    [0.9, 8.2, 19.4]
    """
    at = np.asarray(ratio, dtype=np.float64)
    if not error < 1.0:
        return np.full(at.shape, MOST_LOWERED_DB)
    nearness = np.hypot(at**2 - 1.0, 2.0 * LEAST_DAMPING * at) / (2.0 * LEAST_DAMPING)
    lowered = 20.0 * np.log10(1.0 + error / (1.0 - error) * nearness)
    return np.asarray(np.minimum(lowered, MOST_LOWERED_DB))


def _factor(lowered_db: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(10.0 ** (-np.asarray(lowered_db, dtype=np.float64) / 20.0))


def _least_db(gain: NDArray[np.float64]) -> float:
    return float(20.0 * np.log10(np.min(gain)))
