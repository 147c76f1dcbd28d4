"""What changed on each vehicle and when: covariates first, then known events, steps and drift."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.asked_histories import asked_histories, persisting_together
from flightid.fleet.statistics.covariates import (
    Covariate,
    design_covariates,
    fit_covariates,
    without_covariates,
)
from flightid.fleet.statistics.days import shared_by_day
from flightid.fleet.statistics.errors_by_value import errors_at_each_vehicle
from flightid.fleet.statistics.event_families import told_effects
from flightid.fleet.statistics.events import (
    EventEffect,
    FleetEvent,
    without_events,
)
from flightid.fleet.statistics.flight_errors import NOTABLE, ErrorScale, error_scale
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.judged_histories import judged_histories
from flightid.fleet.statistics.largest_step import (
    FEWEST,
)
from flightid.fleet.statistics.moved_alike import MovedAlike, moved_alike
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE, chance_cell
from flightid.fleet.statistics.neighbours import variances_with_odd_ones
from flightid.fleet.statistics.newest_flight import NewestFlight, judged_newest, newest_flights
from flightid.fleet.statistics.parameter_history import AskedHistory, ParameterHistory
from flightid.fleet.statistics.persistence import (
    Persistence,
)
from flightid.fleet.statistics.repeats import RepeatScatter, repeat_scatter
from flightid.fleet.statistics.shared_level import SharedLevel, shared_level, without_shared
from flightid.fleet.statistics.vehicle_errors import (
    VehicleScale,
    judged_scales,
    own_scales,
    variance_factors,
)
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.threads import on_one_thread
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import LEVEL, half_width, interval_words, shown

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FleetDrift(Result, schema="flightid.fleet_drift/1"):
    """Histories of every parameter of every vehicle, with what changed.

    Attributes
    ----------
    histories : tuple of ParameterHistory
    repeats : tuple of RepeatScatter
        Whether flights of one day scatter as their errors say.
    slopes : mapping of str to tuple of Estimate
        By parameter: what covariates do.
    covariates_missing : mapping of str to int
        Flights that do not tell a covariate.
    odd_flights : mapping of str to int
        By parameter: flights so far off those before and after them that they count for less.
    errors : mapping of str to ErrorScale
        By parameter: what stated errors were taken for.
    shared : tuple of SharedLevel
        What all vehicles did together, which no history holds.
    newest : tuple of NewestFlight
        The newest flight of each vehicle beside those before it; of no change.
    scales : tuple of VehicleScale
        Vehicles whose own flights scatter further than the fleet's.
    persistent : mapping of str to Persistence
        Parameters whose days go on as those before them did.

    Example
    -------
    >>> rng = np.random.default_rng(2)
    >>> values = 10.0 + 0.3 * rng.normal(size=60)
    >>> values[45:] += 2.0
    >>> data = FlightEstimates.of(["gain"], ["a"] * 30 + ["b"] * 30, values[:, None],
    ...                           np.full((60, 1, 1), 0.09), time_s=86400.0 * np.arange(60.0))
    >>> found = find_drift(data)
    >>> found, [each.vehicle for each in found.alarms]
    (FleetDrift(2 histories, 1 changed), ['b'])
    """

    histories: tuple[ParameterHistory, ...]
    repeats: tuple[RepeatScatter, ...]
    slopes: Mapping[str, tuple[Reading, ...]]
    covariates_missing: Mapping[str, int]
    odd_flights: Mapping[str, int]
    errors: Mapping[str, ErrorScale]
    shared: tuple[SharedLevel, ...]
    newest: tuple[NewestFlight, ...]
    scales: tuple[VehicleScale, ...]
    persistent: Mapping[str, Persistence] = field(default_factory=dict)

    @cached_property
    def alarms(self) -> tuple[ParameterHistory, ...]:
        """Histories that changed, the surest first."""
        found = [each for each in self.histories if each.is_alarm]
        return tuple(sorted(found, key=lambda each: each.chance or 0.0))

    def apart(self, shared: SharedLevel) -> tuple[str, ...]:
        """Vehicles that changed by a shared step the other way: they may not have changed."""
        if not shared.is_step:
            return ()
        mine = (one for one in (*self.alarms, *self.going_on) if one.name == shared.name)
        return tuple(one.vehicle for one in mine if _is_the_other_way(one, shared))

    @property
    def going_on(self) -> tuple[ParameterHistory, ...]:
        """Histories that would have changed, were it not for days that go on."""
        return tuple(each for each in self.histories if each.goes_on)

    @cached_property
    def alike(self) -> tuple[MovedAlike, ...]:
        """Parameters of too few vehicles that moved alike, of all or of each."""
        return moved_alike(self.histories)

    @cached_property
    def by_event(self) -> tuple[tuple[ParameterHistory, EventEffect], ...]:
        """What events changed, false ones among all of them accounted for."""
        asked = [(h, e) for h in self.histories for e in h.events]
        told = told_effects([(h.vehicle, e) for h, e in asked])
        return tuple(each for each, is_told in zip(asked, told, strict=True) if is_told)

    @property
    def judged(self) -> tuple[ParameterHistory, ...]:
        """Histories long enough to be asked, the least likely first."""
        found = [each for each in self.histories if each.chance is not None]
        return tuple(sorted(found, key=lambda each: each.chance or 0.0))

    @cached_property
    def cited(self) -> frozenset[tuple[str, str]]:
        """Vehicle and parameter of all that a light of a vehicle speaks of."""
        said = (*self.alarms, *self.going_on, *(each for each, _ in self.by_event))
        found = {(each.vehicle, each.name) for each in said}
        return frozenset(found | {(each.vehicle, each.name) for each in self.newest_off})

    @property
    def drawn(self) -> tuple[ParameterHistory, ...]:
        """Histories for pictures: what a light speaks of, then the least likely of the others."""
        every = [each for each in self.histories if self.place_drawn(each)[1] < math.inf]
        return tuple(sorted(every, key=self.place_drawn))

    def place_drawn(self, each: ParameterHistory) -> tuple[bool, float]:
        """Where a picture of a history stands among others; at infinity it says nothing."""
        is_cited = (each.vehicle, each.name) in self.cited
        chance = each.chance if each.chance is not None else 1.0 if is_cited else math.inf
        return not is_cited, chance

    @property
    def newest_off(self) -> tuple[NewestFlight, ...]:
        """Newest flights that are off those before them, of what did not change."""
        changed = {(each.vehicle, each.name) for each in self.alarms}
        found = [each for each in self.newest if each.is_off]
        return tuple(each for each in found if (each.vehicle, each.name) not in changed)

    @property
    def reason(self) -> str:
        """Why no history was asked; empty where one was."""
        if self.judged:
            return ""
        most = max((len(each.values) for each in self.histories), default=0)
        return (
            f"whether a vehicle changed: that takes {FEWEST} flights of it with a date and an "
            f"interval, and the most is {most}"
        )

    def __repr__(self) -> str:
        """Histories and alarms."""
        return f"FleetDrift({len(self.histories)} histories, {len(self.alarms)} changed)"

    def summary(
        self, *, level: float | None = None, labels: Mapping[str, str] | None = None
    ) -> Table:
        """One row an alarm, its parameter in words where there are any."""
        named = labels or {}
        level = shown(level)
        words = interval_words(level)
        columns = (
            Column("vehicle"),
            Column("parameter"),
            Column("change", "%", digits=3),
            Column(f"{words} low", "%", digits=3),
            Column(f"{words} high", "%", digits=3),
            Column("share of false alarms", digits=2),
            Column("how"),
        )
        rows: list[tuple[Cell, ...]] = []
        for each in self.alarms:
            low, high = each.change_percent.interval(level) or (None, None)
            rows.append(
                (
                    each.vehicle,
                    named.get(each.name, each.name),
                    each.change_percent.value,
                    low,
                    high,
                    chance_cell(each.false_share),
                    each.kind,
                )
            )
        asked = len(self.judged)
        beside = "go on alike on all vehicles" if self.persistent else "are independent"
        note = (
            f"{asked} {'history' if asked == 1 else 'histories'} asked, at most "
            f"{100 * FALSE_SHARE:.0f} % of the alarms false (Benjamini and Hochberg), where "
            f"flights {beside} beside the days they share"
            f"{'; beside a real change some 6 %, the mean of fleets' if self.persistent else ''}."
        )
        odd = ", ".join(
            f"{n} of {named.get(name, name)}" for name, n in self.odd_flights.items() if n
        )
        notes = (
            note,
            *((f"Flights far off those beside them count for less: {odd}.",) if odd else ()),
            *(f"{each.words(named, self.apart(each))}; no change of one." for each in self.shared),
            *(f"{each.words(named)}." for each in self.alike),
            *(f"{e.words(named.get(name, name))}." for name, e in self.persistent.items()),
            *(f"{each.vehicle}: {each.words(named)}." for each in self.newest_off),
            *(
                f"{named.get(name, name)}: {each.words()}."
                for name, each in self.errors.items()
                if each.typical >= NOTABLE or each.days_words()
            ),
            *(f"{each.words(named)}." for each in self.scales if each.is_sure),
        )
        return Table("What changed", columns, tuple(rows), notes)


@on_one_thread
def find_drift(
    data: FlightEstimates,
    covariates: Mapping[str, Covariate] | None = None,
    events: Sequence[FleetEvent] = (),
) -> FleetDrift:
    """Find what changed: steps and drift at unknown times, and events at known ones.

    Parameters
    ----------
    data : FlightEstimates
        Flights of one type.
    covariates : mapping of str to sequence, optional
        One value a flight: number, word or None.
    events : sequence of FleetEvent

    Returns
    -------
    FleetDrift

    Raises
    ------
    ShapeError
        Covariates of another number of flights.

    Assumes
    -------
    Errors of flights are independent and normal, with the variances of `error_scale`, and of a
    vehicle whose own flights scatter further, as these do (`own_scales`). What nearly
    all vehicles share by date is no change of one (`shared_level`). Flights far off those before
    and those after them count for less; the newest flight alone is no change (`newest_flights`).

    Reference
    ---------
    The modules of `flightid.fleet.statistics` name those of each test.
    """
    design = design_covariates(covariates or {})
    histories: list[AskedHistory] = []
    every_asked: list[list[AskedHistory]] = []
    newest_of: list[tuple[FlightEstimates, int, Array, Array]] = []
    persistent: dict[str, Persistence] = {}
    slopes: dict[str, tuple[Reading, ...]] = {}
    odd: dict[str, int] = {}
    errors: dict[str, ErrorScale] = {}
    newest: list[NewestFlight] = []
    scales: list[VehicleScale] = []
    data = errors_at_each_vehicle(data)
    every, parameters = data, range(len(data.names))
    bare = [fit_covariates(data, i, design, _variances(data, i)) for i in parameters]
    explained = without_covariates(data, design, bare)
    shared = [shared_level(explained, i) for i in parameters]
    for i, one in enumerate(shared):
        data, explained = without_shared(data, i, one), without_shared(explained, i, one)
    repeats = repeat_scatter(explained)
    for i, name in enumerate(data.names):
        repeated = repeats[i].variance_factor if repeats[i].freedom else None
        errors[name] = error_scale(explained, i, repeated)
        usual = errors[name].variances(_variances(data, i))
        level = without_events(explained, i, usual, events)
        by_day = shared_by_day(level, i, usual, events)
        usual = usual + by_day.variances
        errors[name] = errors[name].beside_days(by_day.variances, _variances(data, i))
        _, off = variances_with_odd_ones(level, i, usual)
        own = own_scales(level, i, usual, off)
        scales += own
        usual = usual * variance_factors(own, data.vehicles)
        variances, off = variances_with_odd_ones(level, i, usual)
        odd[name] = int(off.sum())
        moved = every.values[:, i] - data.values[:, i]
        fitted, mine = asked_histories(data, i, design, variances, by_day, events, moved)
        slopes[name] = fitted.effects
        every_asked.append(mine)
        newest_of.append((level, i, usual, variances))
    for name, newest_one, (goes_on, mine) in zip(
        data.names, newest_of, persisting_together(every_asked), strict=True
    ):
        if goes_on is not None:
            persistent[name] = goes_on
        newest += newest_flights(*newest_one, goes_on)
        histories += mine
    return FleetDrift(
        *(judged_histories(histories), repeats, slopes, design.missing, odd, errors),
        *(tuple(each for each in shared if each is not None), judged_newest(newest)),
        judged_scales(scales),
        persistent,
    )


def _is_the_other_way(history: ParameterHistory, shared: SharedLevel) -> bool:
    """Whether its change is what is left where a shared step is taken out of what stayed."""
    change, (step, stderr) = history.change_percent, (shared.change.value, shared.change.stderr)
    ends = change.interval(LEVEL)
    if stderr is None or ends is None or step * (change.value or 0.0) >= 0.0:
        return False
    wide = half_width(LEVEL) * stderr
    return ends[0] - wide <= -step <= ends[1] + wide


def _variances(data: FlightEstimates, i: int) -> Array:
    return np.where(data.known[:, i], data.covariances[:, i, i], 1.0)
