"""Intervals of margins that a loop can have: crossovers above zero, peaks above one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from flightid.control.margins.margins import Margins
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate, Interval, Reading
from flightid.uncertainty.quantiles import LEVEL
from flightid.uncertainty.uneven import Reaching

LONGEST = 1.0
"""Half of an even interval over what the number has above its least, from which none is told."""
UNTOLD = "to first order its interval reaches values that no loop has"


@dataclass(frozen=True)
class AboveLeast:
    """Ends that are even about the logarithm of what a number has above its least.

    Attributes
    ----------
    ends : callable
        Ends that are even about the number.
    value, least : float

    Example
    -------
    >>> low, high = AboveLeast(Estimate("peak", 1.4, "1", 0.1).interval, 1.4, 1.0)(0.95)
    >>> round(low, 3), round(high, 3)
    (1.245, 1.653)
    """

    ends: Callable[[float], Interval | None]
    value: float
    least: float

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        found = self.ends(level)
        if found is None:
            return None
        above = self.value - self.least
        times = float(np.exp(0.5 * (found[1] - found[0]) / above))
        return self.least + above / times, self.least + above * times


def possible(found: Margins) -> Margins:
    """Margins without intervals that no loop can have.

    Parameters
    ----------
    found : Margins
        With intervals by propagation to first order.
    """
    return replace(
        found,
        crossover=_above(found.crossover, 0.0),
        phase_crossover=_above(found.phase_crossover, 0.0),
        gain_reduction_crossing=_above(found.gain_reduction_crossing, 0.0),
        modulus_margin=_above(found.modulus_margin, 0.0),
        sensitivity_peak=_above(found.sensitivity_peak, 1.0),
    )


def _above(number: Reading, least: float) -> Reading:
    value, reach = number.value, number.ends
    even = reach.ends if isinstance(reach, Reaching) else number.interval
    around = even(LEVEL)
    if value is None or around is None:
        return number
    if value <= least or around[1] - around[0] > 2.0 * LONGEST * (value - least):
        return Estimate(number.name, value, number.unit, None, UNTOLD)
    ends = AboveLeast(even, value, least)
    reaching = Reaching(ends, reach.value) if isinstance(reach, Reaching) else ends
    return replace(number, stderr=None, ends=reaching)
