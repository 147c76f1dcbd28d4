"""One parameter of one vehicle over time, with the chance that nothing changed."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.events import (
    EventEffect,
    FleetEvent,
    beside_steps,
    event_steps,
)
from flightid.fleet.statistics.largest_step import StepScan
from flightid.fleet.statistics.local_level import LocalLevel
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Reading

Array = NDArray[np.float64]
TESTS = 2
"""Tests of a series, a step and a walk, of which the less likely counts times this."""


@dataclass(frozen=True)
class StepEnds:
    """Ends of the interval of a step whose place is not known, percent of the level before."""

    scan: StepScan

    def __call__(self, level: float) -> tuple[float, float]:
        """Lower and upper end at a level."""
        return self.scan.percent_ends(level)


@dataclass(frozen=True, eq=False)
class ParameterHistory:
    """One parameter of one vehicle over time, what covariates explain taken out.

    Attributes
    ----------
    vehicle, name, unit : str
    time_s : ndarray, shape (n,)
    values, variances : ndarray, shape (n,)
        What covariates explain is out, by the slopes of all flights; errors as repeats show them.
    track : LocalLevel
        The level behind them.
    step_chance, walk_chance : float or None
        Chance of a largest step, and of wandering, as large were there none; None with too few
        flights.
    change_percent : Estimate
        Largest step, percent of the level before it, with its interval over all places it may have.
        Of an alarm that is drift: the last flight beside the level before it began, of a movement
        that is steady from then on; where flights do not tell which: of both, as well as each fits.
    changed_s : tuple of float or None
        Last flight before the step and first behind it at the earliest and latest place, s.
    false_share : float or None
        Benjamini–Hochberg over all vehicles and parameters; an alarm at 0.05 or less.
    events : tuple of EventEffect
        Of each event, and of those together between which few flights lie.
    kind : str
        Of an alarm: ``"a step"``, ``"drift"``, or ``"changed"`` where its flights do not tell.
    least_step : Estimate or None
        The step of which four of five would be an alarm, at any place: percent of the level, or in
        the parameter's unit where that may be zero. None with too few flights.
    apart_chance, apart_share : float or None
        As `chance` and `false_share` were days independent, where they may go on (`persistence`).
    more_days : int
        Days of each vehicle after which independent ones would be told from those that go on; 0
        where they are told.
    """

    vehicle: str
    name: str
    unit: str
    time_s: Array
    values: Array
    variances: Array
    track: LocalLevel
    step_chance: float | None
    walk_chance: float | None
    change_percent: Reading
    changed_s: tuple[float, float] | None
    false_share: float | None = None
    events: tuple[EventEffect, ...] = ()
    kind: str = ""
    least_step: Reading | None = None
    apart_chance: float | None = None
    apart_share: float | None = None
    more_days: int = 0

    @property
    def chance(self) -> float | None:
        """Chance of either were there neither; None with too few flights."""
        if self.step_chance is None or self.walk_chance is None:
            return None
        return min(1.0, TESTS * min(self.step_chance, self.walk_chance))

    @property
    def happened(self) -> tuple[FleetEvent, ...]:
        """Events that concern it, each once."""
        return tuple(dict.fromkeys(one for each in self.events for one in each.events))

    @property
    def is_alarm(self) -> bool:
        """Whether it changed, false alarms of the whole fleet accounted for."""
        return self.false_share is not None and self.false_share <= FALSE_SHARE

    @property
    def goes_on(self) -> bool:
        """Whether it would have changed, but days of the type go on as those before them did."""
        told = self.apart_share is not None and self.apart_share <= FALSE_SHARE
        return told and not self.is_alarm


@dataclass(frozen=True, eq=False)
class AskedHistory:
    """A history with what is tested of it.

    Attributes
    ----------
    history : ParameterHistory
    measured : ndarray, shape (n,)
        Slopes are those of other vehicles; steps of events are in.
    errors : ndarray, shape (n, n)
        Covariance of `measured`.
    events : tuple of FleetEvent
        That concern the vehicle.
    shared : ndarray, shape (n,)
        What all vehicles share, which `measured` lacks.
    by_day : ndarray, shape (n,)
        Variances that flights of one day share, a part of those of the history.
    freedom : float
        Of these variances, where days told them; infinite else.
    rivals : tuple of (float, ndarray)
        How likely days are independent, and go on, and `errors` then; empty where one is sure.
    """

    history: ParameterHistory
    measured: Array
    errors: Array
    events: tuple[FleetEvent, ...]
    shared: Array
    by_day: Array
    freedom: float = np.inf
    rivals: tuple[tuple[float, Array], ...] = ()

    @cached_property
    def known(self) -> Array:
        """Flights behind each event, shape (n, e)."""
        return event_steps(self.events, self.history.time_s)

    @cached_property
    def _beside(self) -> tuple[Array, Array]:
        return beside_steps(self.measured, self.errors, self.known)

    @property
    def values(self) -> Array:
        """What events explain is out, shape (n,)."""
        return self._beside[0]

    @property
    def covariance(self) -> Array:
        """Of their errors, shape (n, n); sizes of the steps of events are left open."""
        return self._beside[1]

    @property
    def own_variances(self) -> Array:
        """Variances of the flights without what those of one day share, shape (n,)."""
        return np.asarray(self.history.variances - self.by_day)
