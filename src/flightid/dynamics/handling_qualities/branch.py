"""On which branch of 360° the phase of an attitude lies, and whether its control pulls back."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

POINTS = 120
"""Points over log frequency at which the phase is compared with what the gain asks for."""
ENDS = 12
"""Of these points, those at either end whose slope goes on beyond the band: one pair is noise."""
NEAREST = 1e-3
"""Distance in log frequency at which the weight of Bode's relation is cut."""
WEAK = 0.1
"""Gain of the rate, over that of three quarters of the band, below which phase tells no sign."""
MOST_LEAD_DEG = 75.0
"""Lead over the phase of the gain beyond which a control pulls the other way."""
RISE_DEG = 180.0
"""Rise of that lead that only an unstable pair makes."""
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Branch:
    """Where a phase lies.

    Attributes
    ----------
    turn : float
        Degrees to add.
    lead : float
        Phase ahead of that of the gain, deg, in (−105, 255]: about 0 for a control of positive
        effect, about 180 for one that pulls the other way.
    above : float
        Frequency above the unstable pairs of the band, rad/s; 0 where it has none.
    """

    turn: float
    lead: float
    above: float

    @property
    def reversed(self) -> bool:
        """Whether the control pulls the other way."""
        return self.lead > MOST_LEAD_DEG


def branch_of(omega: Array, decibels: Array, degrees: Array) -> Branch:
    """Branch of an attitude's phase near crossover, whatever slow modes do below.

    The gain of a system without delay, unstable poles and right-half-plane zeros tells its phase.
    What a phase has beyond that falls with delay and rises by 360° over each unstable pair: where
    it is largest, slow modes are over and delay has not begun. There it is a multiple of 360° for a
    control of positive effect, and half a turn off for the other sign.

    Parameters
    ----------
    omega : ndarray, shape (n,)
        rad/s, ascending.
    decibels, degrees : ndarray, shape (n,)
        Gain and unwrapped phase.

    Assumes
    -------
    A band that reaches above the slow modes and begins before delay has cost 105°. Beyond the band
    the gain goes on with the slope of its ends: biased there by some tens of degrees, which no sign
    turns on.

    Reference
    ---------
    Bode, *Network Analysis and Feedback Amplifier Design*, ch. XIV; Franklin, Powell &
    Emami-Naeini, *Feedback Control of Dynamic Systems*, section 6.5.

    Example
    -------
    >>> omega = np.geomspace(0.1, 30.0, 400)
    >>> pair = 1 / (1 - 0.1j * omega - omega**2)  # unstable, then a lag and half a turn
    >>> h = -(1.0 - omega**2 + 0.2j * omega) * pair / (1j * omega * (0.1j * omega + 1))
    >>> found = branch_of(omega, 20 * np.log10(abs(h)), np.degrees(np.unwrap(np.angle(h))))
    >>> found.reversed, found.above > 0.9
    (True, True)
    """
    logs = np.log(omega)
    grid = np.linspace(logs[0], logs[-1], POINTS)
    gain = np.interp(grid, logs, decibels) * np.log(10.0) / 20.0
    lead = np.interp(grid, logs, degrees) - np.degrees(_phase_of_gain(grid, gain))
    rate = gain + grid
    strong = np.flatnonzero(rate >= _upper_quartile(rate) + np.log(WEAK))
    place = int(strong[np.argmax(lead[strong])])
    over = 360.0 * np.ceil((lead[place] - MOST_LEAD_DEG - 180.0) / 360.0)
    low = np.flatnonzero(lead[:place] < lead[place] - RISE_DEG)
    above = float(np.exp(grid[low[-1] + 1])) if len(low) else 0.0
    return Branch(-float(over), float(lead[place] - over), above)


def _upper_quartile(values: Array) -> float:
    """As `numpy.quantile` has it, which takes as long as all else here."""
    ordered, place = np.sort(values), 0.75 * (len(values) - 1)
    below = int(place)
    above = min(below + 1, len(values) - 1)
    return float(ordered[below] + (ordered[above] - ordered[below]) * (place - below))


def _phase_of_gain(logs: Array, gain: Array) -> Array:
    """Bode's relation, rad: the slope of the gain, weighted by ln coth |u/2| about each point."""
    width = logs[1] - logs[0]
    reach = np.arange(1, len(logs) + 1) * width
    before = gain[0] - (gain[ENDS] - gain[0]) / ENDS * reach[::-1] / width
    after = gain[-1] + (gain[-1] - gain[-1 - ENDS]) / ENDS * reach / width
    slope = np.diff(np.concatenate([before, gain, after])) / width
    return np.asarray(0.5 * np.pi * _weights(len(logs), float(width)) @ slope)


@lru_cache(maxsize=4)
def _weights(count: int, width: float) -> Array:
    """Of the slopes between points that reach as far again to both sides, rows of sum one."""
    middles = np.arange(3 * count - 1) - count + 0.5
    away = np.maximum(width * np.abs(middles - np.arange(count)[:, None]), NEAREST)
    weights = -np.log(np.tanh(0.5 * away))
    weights /= weights.sum(axis=1, keepdims=True)
    weights.setflags(write=False)
    return np.asarray(weights)
