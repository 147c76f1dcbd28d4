"""Days that go on as the days before them did: correlated errors that no step should be held by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.day_series import (
    DaySeries,
    day_variances,
    grouped,
    typical_variance,
)
from flightid.fleet.statistics.memory_evidence import evidence
from flightid.fleet.statistics.parameter_history import AskedHistory
from flightid.fleet.statistics.repeats import days_of
from flightid.frozen import dataclass

Array = NDArray[np.float64]
CORRELATIONS = (0.35, 0.6, 0.8, 0.9, 0.97)
"""From one day to the next of the part that goes on, which are tried."""
SHARES = (0.2, 0.4, 0.6, 0.8, 0.95)
"""Of the variance of a day that goes on, which are tried."""
INDEPENDENT = 0.3
"""Chance of independent days before any is seen; the rest is that of each memory alike. What is
wrongly called a change costs more than one missed."""
TOLD, SURE = 0.9, 0.97
"""Chance that days go on, from which they may, and from which they do."""
NEGLIGIBLE = 0.01
"""The same, below which days are independent."""
MOST_VOICES = 60
"""Vehicles that are asked for the memory of all."""
PARTS = 3
"""Of the memories, of which chances are averaged: in one the longest, of a tenth, hardly count."""
FURTHEST = 40
"""Days, over which what one more tells is worked out."""


@dataclass(frozen=True)
class Memory:
    """One memory of days, and how likely it is among those that go on.

    Attributes
    ----------
    weight : float
    share : float
        Of the variance of a typical day's mean that goes on.
    correlation : float
        Of that part, from one day to the next.
    factor : float
        Of the variances that errors and days were taken to have; 1 at least.
    """

    weight: float
    share: float
    correlation: float
    factor: float

    @property
    def long_run(self) -> float:
        """Variance of the mean of many days, in that of independent ones."""
        rest = self.share * self.correlation / (1.0 - self.correlation)
        return self.factor * (1.0 + 2.0 * rest)


@dataclass(frozen=True)
class Persistence:
    """How days of all vehicles go on, in one parameter.

    Attributes
    ----------
    chance : float
        That they go on at all.
    typical : float
        Variance of a day's mean, the median of all, in the square of the unit: what goes on has
        the same size whatever a flight's own error.
    memories : tuple of Memory
        How they may go on.
    vehicles : int
        That were asked.
    """

    chance: float
    typical: float
    memories: tuple[Memory, ...]
    vehicles: int

    @property
    def is_told(self) -> bool:
        """Whether days go on, or may well do."""
        return self.chance >= TOLD

    @property
    def is_sure(self) -> bool:
        """Whether days go on."""
        return self.chance >= SURE

    @property
    def share(self) -> float:
        """Of the variance of a day's mean that goes on, the mean over the memories."""
        return sum(each.weight * each.share for each in self.memories)

    @property
    def correlation(self) -> float:
        """Of that part, from one day to the next, the mean over the memories."""
        return sum(each.weight * each.correlation for each in self.memories)

    @property
    def more_days(self) -> int:
        """Days of each vehicle after which independent ones would be sure to be independent."""
        lag = np.abs(np.subtract.outer(np.arange(FURTHEST), np.arange(FURTHEST)))
        whole = replace(self, typical=1.0).of_days(np.ones((FURTHEST, FURTHEST)), lag)
        told = [_told_by(whole[:n, :n]) for n in (FURTHEST // 2, FURTHEST)]
        each = (told[1] - told[0]) / (FURTHEST - FURTHEST // 2) * self.vehicles
        lacking = np.log(self.chance / (1.0 - self.chance)) + np.log(SURE / (1.0 - SURE))
        return max(1, int(np.ceil(lacking / each)))

    @property
    def parts(self) -> tuple[Persistence, ...]:
        """Short, middling and long memories, each part with its chance that days go on so."""
        order = sorted(self.memories, key=lambda each: each.long_run)
        ends = np.cumsum([each.weight for each in order])
        part = np.minimum((ends - 1e-9) * PARTS, PARTS - 1).astype(int)
        held = [
            [each for each, own in zip(order, part, strict=True) if own == k] for k in range(PARTS)
        ]
        return tuple(self._of(each) for each in held if each)

    def _of(self, memories: Sequence[Memory]) -> Persistence:
        weight = sum(each.weight for each in memories)
        own = tuple(replace(each, weight=each.weight / weight) for each in memories)
        return replace(self, chance=self.chance * weight, memories=own)

    def of_days(self, variances: Array, lag: NDArray[np.intp]) -> Array:
        """Covariance of days' means, where they go on, by their own variances and the days between.

        What goes on is in units of `typical`; variances are covariances of independent means.
        """
        apart = sum(each.weight * each.factor * (1.0 - each.share) for each in self.memories)
        lags = np.arange(float(lag.max()) + 1.0)
        going_on = sum(
            each.weight * each.factor * each.share * each.correlation**lags
            for each in self.memories
        )
        going_on = np.asarray(going_on * self.typical)[lag]
        return np.asarray(apart * np.where(lag == 0, variances, 0.0) + going_on)

    def words(self, name: str) -> str:
        """What is seen, and what it does to changes."""
        verb = "go" if self.is_sure else "may go"
        return (
            f"{name}: flights {verb} on as their neighbours did (some {100.0 * self.share:.0f} % "
            f"of what days differ by, correlated {self.correlation:.2g} from one day to the "
            "next): what lasts as long is no change"
        )


def _told_by(covariance: Array) -> float:
    """Log likelihood ratio that independent days are expected to have over some that go on."""
    n = len(covariance)
    factor = float(np.trace(np.linalg.inv(covariance))) / n
    return 0.5 * (n * float(np.log(factor)) + float(np.linalg.slogdet(covariance)[1]))


def persistence(
    series: Sequence[DaySeries], *, independent: float = INDEPENDENT
) -> Persistence | None:
    """Hold days that go on beside independent ones, by the likelihood over all vehicles.

    Days' means have the covariance f ((1 − c) v δ + c v̄ ρ^|lag|) with the variance v of each, the
    median v̄ of all and lags in days that were flown; f is common. Changes are averaged over
    (`evidence`): each memory is as likely as it is whatever changed.

    Parameters
    ----------
    series : sequence of DaySeries
        Of one parameter.
    independent : float
        Chance of independent days before any is seen.

    Returns
    -------
    Persistence or None
        None where no vehicle has six days, or none scatters at all.

    Assumes
    -------
    The same memory for all vehicles; days in a row are as far apart as others.
    """
    if not series:
        return None
    typical = typical_variance(series)
    asked = series[:: -(-len(series) // MOST_VOICES)]
    groups = grouped(asked, typical)
    tried = list(product(SHARES, CORRELATIONS))
    found = [evidence(groups, *each) for each in ((0.0, 0.0), *tried)]
    logs = np.array([log for log, _ in found])
    if not np.all(np.isfinite(logs)):
        return None
    before = np.append(independent, np.full(len(tried), (1.0 - independent) / len(tried)))
    weights = before * np.exp(logs - logs.max())
    beside, weights = float(weights[0] / weights.sum()), weights[1:] / weights[1:].sum()
    memories = tuple(
        Memory(float(weight), *each, max(1.0, factor))
        for weight, each, (_, factor) in zip(weights, tried, found[1:], strict=True)
    )
    return Persistence(1.0 - beside, typical, memories, len(asked))


def persisting(asked: AskedHistory, found: Persistence) -> Array:
    """Covariance of the flights of a vehicle whose days go on, shape (n, n).

    Days' means have that of `persistence`, and no less than were they independent: errors of one
    that is told worse than others are its own. Flights of a day scatter about theirs as before.
    """
    day = days_of(asked.history.time_s)
    same = (day[:, None] == day).astype(np.float64)
    own, of_day = np.diag(asked.own_variances), day_variances(asked)
    before = own + same * asked.by_day
    means = found.of_days(same * of_day, np.abs(np.subtract.outer(day, day)))
    means += same * np.maximum(of_day - np.diag(means), 0.0)
    return np.asarray(asked.errors - before + own + means - same * (of_day - asked.by_day))
