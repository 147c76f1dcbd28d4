"""The newest flight of each vehicle beside those before it: too new to be called a change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE, corrected
from flightid.fleet.statistics.neighbours import histories_in_time
from flightid.fleet.statistics.persistence import Persistence
from flightid.fleet.statistics.repeats import days_of
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
BEFORE = 8
"""Flights before the newest whose mean it is held against, at most."""
FEWEST = 3
"""Of them, below which nothing is said."""


@dataclass(frozen=True)
class NewestFlight:
    """A vehicle's newest flight beside the mean of up to eight before it.

    Attributes
    ----------
    vehicle, name : str
    off : Estimate
        Distance from that mean: percent of it, or in the parameter's unit where it may be zero.
    chance : float
        Of a distance as large were nothing there.
    false_share : float
        Benjamini–Hochberg over all newest flights and parameters.
    """

    vehicle: str
    name: str
    off: Estimate
    chance: float
    false_share: float = 1.0

    @property
    def is_off(self) -> bool:
        """Whether it is off, false alarms of the whole fleet accounted for."""
        return self.false_share <= FALSE_SHARE

    def words(self, labels: Mapping[str, str]) -> str:
        """By how much it is off, and what would tell whether that stays."""
        name = labels.get(self.name, self.name)
        unit = "" if self.off.unit == "1" else f" {self.off.unit}"
        off = f"{name} of the newest flight is off those before by {self.off.value:+.2g}{unit}"
        return f"{off}: fly again to see whether it stays"


def newest_flights(
    data: FlightEstimates,
    i: int,
    variances: Array,
    before: Array,
    memory: Persistence | None = None,
) -> list[NewestFlight]:
    """Hold the newest flight of each vehicle beside those before it.

    z = (y_n − m) / √(v_n + var m),  m the mean of up to eight flights before, weighed by 1 / v.

    Parameters
    ----------
    data : FlightEstimates
        What covariates explain taken out.
    i : int
        Place of the parameter.
    variances, before : ndarray, shape (n,)
        Of a flight as the newest one, and as one of those before, where odd ones count for less.
    memory : Persistence, optional
        How days go on: then a newest flight is further off by chance.

    Returns
    -------
    list of NewestFlight
        Of vehicles with four flights or more; chances not yet corrected: `judged_newest`.

    Assumes
    -------
    A level that stays over these eight flights: where it drifts, the distance holds the drift too.
    """
    found = []
    for rows in histories_in_time(data, i):
        *earlier, last = rows
        beside = np.array(earlier[-BEFORE:], dtype=np.intp)
        if len(beside) < FEWEST:
            continue
        weights = 1.0 / before[beside]
        mean = float(weights @ data.values[beside, i] / weights.sum())
        off = float(data.values[last, i]) - mean
        shares = np.append(-weights / weights.sum(), 1.0)
        own = np.append(before[beside], variances[last])
        around = _covariance(own, data.time_s[np.append(beside, last)], memory)
        stderr = float(np.sqrt(shares @ around @ shares))
        sure = abs(mean) > 3.0 / np.sqrt(weights.sum())
        scale, unit = (100.0 / abs(mean), "%") if sure else (1.0, data.units[i])
        size = Estimate(data.names[i], scale * off, unit, scale * stderr)
        chance = float(2.0 * ndtr(-abs(off) / stderr))
        found.append(NewestFlight(data.vehicles[last], data.names[i], size, chance))
    return found


def _covariance(variances: Array, time_s: Array, memory: Persistence | None) -> Array:
    """Of flights, those of several days correlated where days go on."""
    if memory is None:
        return np.diag(variances)
    day = days_of(time_s)
    lag = np.abs(np.subtract.outer(day, day))
    apart = (lag > 0) | np.eye(len(day), dtype=bool)
    around = np.where(apart, memory.of_days(np.diag(variances), lag), 0.0)
    return np.asarray(around + np.diag(np.maximum(variances - np.diag(around), 0.0)))


def judged_newest(asked: Sequence[NewestFlight]) -> tuple[NewestFlight, ...]:
    """Every newest flight with its share of false alarms among all."""
    shares = corrected([each.chance for each in asked])
    return tuple(
        replace(each, false_share=float(share)) for each, share in zip(asked, shares, strict=True)
    )
