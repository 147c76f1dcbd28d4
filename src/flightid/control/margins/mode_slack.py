"""What light modes outside the band of a model leave of the numbers of its loop."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Interval, Reading
from flightid.uncertainty.uneven import Reaching

MOST_MOVED_DB = 20.0
"""By which no mode raises or lowers a response that damping and share leave ordinary: ten times."""
AT_BANDWIDTH_DB = float(20.0 * np.log10(1.0 + 2.0**0.5))
"""Least gain at which the sensitivity lies below −3 dB, whatever the phase."""
MORE_IS_BETTER = {
    "gain_margin_db": True,
    "gain_reduction_margin_db": True,
    "modulus_margin": True,
    "sensitivity_peak": False,
    "disturbance_peak_db": False,
}
"""Numbers that a mode moves even where the loop does not pass one at it."""
OWN_MARGIN = {"above": "gain_margin_db", "below": "gain_reduction_margin_db"}
"""The gain margin that a mode moves without passing one: the other is moved on the other side."""
AT_ONE = "phase_margin_deg", "delay_margin_s", *OWN_MARGIN.values()
"""Numbers that a mode leaves as they are until the loop passes one at it: with any phase."""
TAKEN = {
    "above": "a resonance above the identified band may leave less",
    "below": "a light mode below the identified band may leave less",
}
NEAR_ONE = {
    "above": "near one above the identified band",
    "below": "near one below the identified band",
}
"""Why a number is not promised of a loop that no mode moves."""
Side = Literal["above", "below"]


@dataclass(frozen=True)
class ModeSlack:
    """How far from one a loop stays on one side of the band where a light mode has moved it.

    Above the band, where the loop is small, a resonance raises it; below, where it is large, a
    pendulum or a slung load, a pole beside a zero, lowers it. Either turns by half a circle there:
    where the loop passes one, every margin may be lost.

    Assumes
    -------
    No mode moves the response by more than `MOST_MOVED_DB` from that of the model, nor by more
    than is told for each frequency (`hidden_modes`).

    Attributes
    ----------
    side : {"above", "below"}
    left_db : float
        Until the loop passes one; at most 0 where a mode may make it unstable, infinite where
        nothing lies on that side of the band.
    own_db : float
        What the loop itself has there, without a mode.
    room_db : float
        By how much the loop itself may be moved where least is left.
    moved_db : float
        By how much a mode may move it there; 0 where the vehicle was declared rigid.

    Example
    -------
    >>> ModeSlack.above([0.01j, 0.001]).edge("gain_margin_db")
    20.0
    >>> ModeSlack.below([-100.0j, 1000.0]).edge("gain_reduction_margin_db")
    20.0
    """

    side: Side
    left_db: float = np.inf
    own_db: float = np.inf
    room_db: float = np.inf
    moved_db: float = MOST_MOVED_DB

    @classmethod
    def above(cls, loop: ArrayLike, moved_db: ArrayLike = MOST_MOVED_DB) -> ModeSlack:
        """Of a loop's response above the band.

        Parameters
        ----------
        loop : array_like of complex, shape (…, n_f)
        moved_db : array_like, shape (n_f,)
            By which a mode may raise it at most, dB.
        """
        return cls.of("above", loop, None, moved_db)

    @classmethod
    def below(cls, loop: ArrayLike, moved_db: ArrayLike = MOST_MOVED_DB) -> ModeSlack:
        """Of a loop's response below the band, which modes lower; see `above`."""
        return cls.of("below", loop, None, moved_db)

    @classmethod
    def of(
        cls, side: Side, loop: ArrayLike, inner: ArrayLike | None, moved_db: ArrayLike
    ) -> ModeSlack:
        """Of a loop's response on a side, alone or around a closed one; see `left_by_frequency`."""
        left = left_by_frequency(side, loop, inner, moved_db)
        away = -_db(loop) if side == "above" else _db(loop)
        moved = np.broadcast_to(np.asarray(moved_db, dtype=np.float64), left.shape)
        at = int(np.argmin(left))
        least = (left.flat[at], np.min(away), away.flat[at], moved.flat[at])
        return cls(side, *map(float, least))

    @property
    def passes_one(self) -> bool:
        """Whether a mode may make the loop pass one, where it takes stability, too."""
        return self.left_db < 0.0

    @property
    def has_mode(self) -> bool:
        """Whether a mode is allowed for, and it is not the loop itself that is near one."""
        return self.moved_db > 0.0

    @property
    def reason(self) -> str:
        """Why a number that is taken is not promised."""
        return TAKEN[self.side] if self.has_mode else NEAR_ONE[self.side]

    def edge(self, field: str) -> float | None:
        """What a mode may make of a number of `LoopMetrics`; None where it does not touch it.

        A loop that is raised to −m dB has a gain margin of m there, and comes as near to −1 as
        1 − 10^(−m/20); one that is lowered to m dB may fall by m, and comes as near as
        10^(m/20) − 1.
        """
        if field not in MORE_IS_BETTER or (np.isinf(self.left_db) and self.left_db > 0.0):
            return None
        if field in OWN_MARGIN.values():
            return self.left_db if field == OWN_MARGIN[self.side] else None
        nearest = max(abs(10.0 ** (self._outwards / 20.0) - 1.0), 0.0) * (self.left_db > 0.0)
        if field == "modulus_margin":
            return float(nearest)
        peak = np.inf if nearest == 0.0 else 1.0 / nearest
        return float(peak if field == "sensitivity_peak" else 20.0 * np.log10(peak))

    @property
    def _outwards(self) -> float:
        """Gain of the moved loop, dB."""
        return -self.left_db if self.side == "above" else self.left_db

    def takes(self, field: str, least_db: float) -> bool:
        """Whether it may leave a number less than is asked: a gain margin of so many dB.

        Moved through one it passes one there with any phase, and may pass −180° at any gain on
        the other side, too.
        """
        if field in AT_ONE and field != OWN_MARGIN[self.side]:
            return self.passes_one
        if field == "disturbance_bandwidth_rad_s":
            return self.side == "below" and self.has_mode and self.left_db < AT_BANDWIDTH_DB
        return field in MORE_IS_BETTER and self.left_db < least_db

    def takes_all(self, least_db: float) -> bool:
        """Whether the loop itself is at one outside the band, or nearer to it than is asked."""
        return self.own_db < least_db

    def reached(self, number: Reading, field: str, least_db: float) -> Reading:
        """A number whose interval reaches what a mode may make of it; none where it is taken.

        Those at one are left as they are: their intervals rest on no mode passing one.

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
            return Estimate(number.name, number.value, number.unit, None, self.reason)
        low, high = number.interval95
        if edge >= low if MORE_IS_BETTER[field] else edge <= high:
            return number
        return replace(number, stderr=None, ends=Reaching(number.ends or _Even(number), edge))


def left_by_frequency(
    side: Side, loop: ArrayLike, inner: ArrayLike | None, moved_db: ArrayLike
) -> NDArray[np.float64]:
    """How far from one a loop stays at each frequency where a mode has moved its vehicle, dB.

    A loop around a closed one moves as that one lets it: raised by r, with any phase, A₀/(1 + R)
    becomes at most |A₀| r/(1 − r |R|); lowered, the closed one makes up for what it loses.

    Parameters
    ----------
    side : {"above", "below"}
    loop : array_like of complex, shape (…, n_f)
    inner : array_like of complex, shape (…, n_f), or None
        The loop closed inside it; None where there is none.
    moved_db : array_like, shape (n_f,)
        By which a mode may move the vehicle at most, dB.

    Returns
    -------
    ndarray, shape (…, n_f)
        Negative where it may pass one.

    Example
    -------
    >>> left_by_frequency("below", [1000.0, 100.0], None, 20.0).tolist()
    [40.0, 20.0]
    """
    gain, most = np.abs(loop), 10.0 ** (np.asarray(moved_db, dtype=np.float64) / 20.0)
    if inner is None:
        return np.asarray(_db(gain / most) if side == "below" else -_db(gain * most))
    own = np.abs(inner)
    closed = gain * np.abs(1.0 + np.asarray(inner))
    if side == "below":
        low = own / most
        return _db(closed / own * low / (1.0 + low))
    stays = 1.0 - most * own
    left = -_db(closed * most / np.where(stays > 0.0, stays, 1.0))
    return np.where(stays > 0.0, left, -np.inf)


@dataclass(frozen=True)
class _Even:
    """Ends of a number whose interval is even about its value."""

    number: Reading

    def __call__(self, level: float) -> Interval | None:
        return self.number.interval(level)


def _db(loop: ArrayLike) -> NDArray[np.float64]:
    return np.asarray(20.0 * np.log10(np.abs(loop)))
