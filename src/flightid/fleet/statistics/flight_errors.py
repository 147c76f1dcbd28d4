"""What stated errors of flights are taken for: as the flights themselves scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.neighbours import histories_in_time
from flightid.fleet.statistics.repeats import days_of
from flightid.frozen import dataclass

Array = NDArray[np.float64]
FEWEST_STEPS = 8
"""From flight to flight, below which their scatter says nothing."""
NORMAL_MEDIAN = 0.6744897501960817
"""Of the size of a standard normal number."""
NOTABLE = 1.1
"""Of the typical factor: below it errors count as stated in words."""
DAYS_NOTABLE = 0.5
"""What days differ by, in errors of a flight, below which it is not said."""
REPEATS, STEPS = "flights of one day", "flights in a row"


@dataclass(frozen=True)
class ErrorScale:
    """Variances that stated ones s² are taken for: max(f² s², s² + q).

    Errors that are understated are so by a factor; flights that differ (payload, air, wear that no
    covariate tells) add the same to a flight with small errors as to one with large ones. Which of
    the two it is few flights tell, so the larger counts: cautious, by up to the other's share.

    Attributes
    ----------
    factor : float
        f, of standard errors; 1 at least.
    added : float
        √q, in the unit of the parameter.
    typical : float
        Median over flights of the error that is used, in stated errors.
    source : str
        What told it: ``"flights of one day"`` or ``"flights in a row"``; empty where nothing did.
    days : float
        What days differ by beside that, which flights of one day share, in typical stated errors.

    Example
    -------
    >>> ErrorScale(2.0, 0.3, 2.0, STEPS).variances(np.array([0.01, 1.0])).round(12).tolist()
    [0.1, 4.0]
    """

    factor: float
    added: float
    typical: float
    source: str
    days: float = 0.0

    def words(self) -> str:
        """What was done, in words."""
        return self._own_words() + self.days_words()

    def days_words(self) -> str:
        """What days differ by, as the end of a sentence; empty where that is little."""
        if self.days < DAYS_NOTABLE:
            return ""
        return f"; days differ by {self.days:.2f} errors of a flight"

    def _own_words(self) -> str:
        if not self.source:
            return "its errors are taken as stated: too few flights tell"
        if self.typical < NOTABLE:
            return f"{self.source} scatter as its errors say"
        return (
            f"its errors count {self.typical:.2f} times as stated: {self.source} scatter by so much"
        )

    def beside_days(self, shared: Array, stated: Array) -> ErrorScale:
        """The same with what days differ by: variances that flights of one share."""
        ratios = np.sqrt(shared / stated)
        return replace(self, days=float(np.median(ratios)) if len(ratios) else 0.0)

    def variances(self, stated: Array) -> Array:
        """What stated variances are taken for, in the square of the unit."""
        return np.maximum(self.factor**2 * stated, stated + self.added**2)


def error_scale(data: FlightEstimates, i: int, repeated: float | None) -> ErrorScale:
    """Find what stated errors of one parameter are taken for.

    From flight to flight of a vehicle the median size of standardised steps, over the fleet, is
    that of normal ones (0.6745): a step or a slow drift moves few of them, an odd flight two. Eight
    steps or more between flights of one day count alone: days may differ by more (`shared_by_day`).

        f = median |Δ| / √(s₁² + s₂²) / 0.6745,   q: median |Δ| / √(s₁² + s₂² + 2 q) = 0.6745

    Parameters
    ----------
    data : FlightEstimates
        What covariates explain, and what all vehicles share, taken out.
    i : int
        Place of the parameter.
    repeated : float or None
        Variances that flights of one day show, in stated ones; None where none flew twice on a day.

    Returns
    -------
    ErrorScale
        As stated, too, with fewer than 8 steps and no repeats.

    Assumes
    -------
    Changes from one flight to the next small beside errors; where every flight differs that counts
    as error, and real changes are found later. Of few steps, which share a flight each with the
    next, the median scatters: of 11 by a fifth.
    """
    stated = data.covariances[data.known[:, i], i, i]
    steps, variances = _steps(data, i, within=True)
    apart = len(steps) < FEWEST_STEPS
    if apart:
        steps, variances = _steps(data, i)
    factor, added = 1.0, 0.0
    if len(steps) >= FEWEST_STEPS:
        factor = max(1.0, float(np.median(steps / np.sqrt(variances))) / NORMAL_MEDIAN)
        added = added_spread(steps, variances)
    told = len(steps) >= FEWEST_STEPS
    source = (STEPS if apart else REPEATS) if told else ""
    if repeated is not None and (not told or np.sqrt(repeated) >= factor):
        factor, source = max(1.0, float(np.sqrt(repeated))), REPEATS
    bare = ErrorScale(factor, added, 1.0, source)
    ratios = np.sqrt(bare.variances(stated) / stated)
    return ErrorScale(factor, added, float(np.median(ratios)) if len(ratios) else 1.0, source)


def _steps(data: FlightEstimates, i: int, *, within: bool = False) -> tuple[Array, Array]:
    """Sizes of steps between neighbouring flights of a vehicle, and their stated variances.

    Where `within`, those between flights of one day alone.
    """
    steps, variances = [np.zeros(0)], [np.zeros(0)]
    for rows in histories_in_time(data, i):
        own = data.covariances[rows, i, i]
        kept = np.diff(days_of(data.time_s[rows])) <= (0 if within else np.inf)
        steps.append(np.abs(np.diff(data.values[rows, i]))[kept])
        variances.append((own[1:] + own[:-1])[kept])
    return np.concatenate(steps), np.concatenate(variances)


def added_spread(steps: Array, variances: Array) -> float:
    """Standard deviation beside the stated errors that makes the median step a normal one."""

    def beyond(q: float) -> float:
        return float(np.median(steps / np.sqrt(variances + 2.0 * q))) - NORMAL_MEDIAN

    if beyond(0.0) <= 0.0:
        return 0.0
    # At this q every step is below one standard error, over √2 above the median's 0.6745.
    most = float(np.max(steps**2)) / NORMAL_MEDIAN**2
    return float(np.sqrt(brentq(beyond, 0.0, most, xtol=1e-9 * most)))
