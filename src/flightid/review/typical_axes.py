"""Lags and delays of rate axes of middle-sized vehicles, and how far others lie from them."""

from __future__ import annotations

from flightid.frozen import dataclass


@dataclass(frozen=True)
class TypicalAxis:
    """Lags and delay of an axis behind its command.

    Attributes
    ----------
    time_constant_s, delay_s, motor_lag_s : float

    Example
    -------
    >>> TYPICAL["helicopter"].time_constant_s
    0.1
    """

    time_constant_s: float
    delay_s: float
    motor_lag_s: float

    def ends(self, way: float) -> tuple[float, float, float]:
        """Least (-1) or most (1) of each that a vehicle of this kind has."""
        share = FACTOR**way
        return share * self.time_constant_s, share * self.delay_s, share * self.motor_lag_s


FACTOR = 3.0
"""How far vehicles lie from the typical one, either way: from a racer to a freighter (ours)."""
TYPICAL = {
    "multirotor": TypicalAxis(0.5, 0.012, 0.05),
    "small multirotor": TypicalAxis(0.5, 0.008, 0.025),
    "helicopter": TypicalAxis(0.1, 0.02, 0.05),
    "aeroplane": TypicalAxis(0.15, 0.03, 0.05),
}
"""Time constant, delay and motor lag, s; the gain follows from the gains that fly."""
