"""The histories of one parameter, made and tested: by independent errors, then as days go on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.covariates import CovariateDesign, CovariateSlopes, own_slopes
from flightid.fleet.statistics.days import SharedByDay, covariance_by_day
from flightid.fleet.statistics.events import (
    FleetEvent,
    beside_steps,
    event_effects,
    event_steps,
)
from flightid.fleet.statistics.few_days import beside_spread
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.largest_step import (
    FEWEST,
    NEWEST,
    SHORTEST,
    scan_steps,
    step_places,
)
from flightid.fleet.statistics.local_level import follow_level
from flightid.fleet.statistics.parameter_history import AskedHistory, ParameterHistory, StepEnds
from flightid.fleet.statistics.persistence import (
    DaySeries,
    Persistence,
    changed_vehicles,
    day_series,
    explained,
    is_shared,
    persistence,
    persisting,
)
from flightid.fleet.statistics.wandering import wandering_chance
from flightid.uncertainty.estimate import Estimate, Reading

Array = NDArray[np.float64]
MARGIN = 3.0
"""Log likelihood by which days that go on explain more than changes, from which they count."""
ROUNDS = 4
"""In which changes are sought beside errors that go on; each leaves fewer of them."""
TOO_FEW = f"fewer than {FEWEST} flights"


def asked_history(
    data: FlightEstimates,
    i: int,
    vehicle: str,
    design: CovariateDesign,
    fitted: CovariateSlopes,
    errors: Array,
    by_day: SharedByDay,
    events: Sequence[FleetEvent],
    moved: Array,
) -> AskedHistory | None:
    """One parameter of one vehicle with its tests by independent days; None where it tells none.

    Parameters
    ----------
    data : FlightEstimates
        What all vehicles share taken out.
    i : int
        Place of the parameter.
    vehicle : str
    design : CovariateDesign
    fitted : CovariateSlopes
    errors, moved : ndarray, shape (n,)
        Of every flight: variance, and what all vehicles share, which events of all keep.
    by_day : SharedByDay
        What flights of a day share of their variances.
    events : sequence of FleetEvent
    """
    rows = np.flatnonzero((data.member_of == data.members.index(vehicle)) & data.known[:, i])
    if not len(rows):
        return None
    rows = rows[np.argsort(data.time_s[rows], kind="stable")]
    name, unit, time_s = data.names[i], data.units[i], data.time_s[rows]
    values, variances = data.values[rows, i], errors[rows]
    covariance, tested = covariance_by_day(variances, time_s, by_day.variances[rows]), values
    if design.names:
        slope, error = fitted.without[vehicle]
        x = design.columns[rows]
        # An error of the slopes that is common to all flights moves the level alone.
        apart = x - x.mean(axis=0)
        covariance = covariance + apart @ error @ apart.T
        own = own_slopes(values, variances, apart, slope, error)
        tested, values = values - apart @ slope, values - apart @ own
    track = follow_level(values, variances, time_s)
    happened = [event for event in events if event.concerns(vehicle)]
    bare = ParameterHistory(
        *(vehicle, name, unit, time_s, values, variances, track, None, None),
        Estimate(name, None, "%", reason=TOO_FEW),
        None,
        events=event_effects(happened, name, unit, tested, covariance, time_s, moved[rows]),
    )
    known = event_steps(happened, time_s)
    tested, covariance = beside_steps(tested, covariance, known)
    together = by_day.variances[rows]
    asked = AskedHistory(bare, tested, covariance, known, together, by_day.freedom)
    few = not len(step_places(len(rows), known))
    return asked if few else _tested(asked)


def beside_persistence(
    asked: Sequence[AskedHistory],
) -> tuple[Persistence | None, list[AskedHistory]]:
    """Histories of one parameter, by errors that go on where days do.

    Days go on where they do beside all changes that independent days would show; or where they
    explain these changes better than as many vehicles that happened to change. In a large fleet
    they go on in vehicles without a change as well, or nowhere.

    Parameters
    ----------
    asked : sequence of AskedHistory
        By independent days.

    Returns
    -------
    persistence : Persistence or None
        None where days are independent.
    histories : list of AskedHistory
    """
    changed = changed_vehicles(asked)
    series = day_series(asked, changed)
    found = persistence(series, changed)
    if found is None or not (found.is_told or changed):
        return None, list(asked)
    rivals = [_settled(series, changed, frozenset())]
    if found.is_told:
        rivals.append(_settled(series, changed, changed))
    elif rivals[0].fitness < found.apart + MARGIN:
        return None, list(asked)
    best = max(rivals, key=lambda each: each.fitness)
    if not is_shared(series, changed, best):
        own = persistence([each for each in series if each.vehicle not in changed], frozenset())
        if own is None or not own.is_told:
            return None, list(asked)
        best = own
    return best, [_persisting(each, best) for each in asked]


def _settled(
    series: Sequence[DaySeries], most: frozenset[str], changed: frozenset[str]
) -> Persistence:
    """Days that go on beside just those changes, of `most`, that explain more than they cost."""
    found = _known(persistence(series, changed))
    for _ in range(ROUNDS):
        now = explained(series, most, found)
        if now == changed:
            break
        changed, found = now, _known(persistence(series, now))
    return found


def _known(found: Persistence | None) -> Persistence:
    """What days tell, where some do."""
    assert found is not None
    return found


def _persisting(asked: AskedHistory, found: Persistence) -> AskedHistory:
    """The same judged by errors that go on from day to day."""
    if asked.history.chance is None:
        return asked
    wider = replace(asked, covariance=persisting(asked, found))
    history = replace(asked.history, apart_chance=asked.history.chance)
    return _tested(replace(wider, history=history))


def _tested(asked: AskedHistory) -> AskedHistory:
    # A step is looked for with three flights behind it; where one is, it may be of the last two.
    history, values, covariance = asked.history, asked.values, asked.covariance
    scan = scan_steps(values, covariance, asked.known, newest=NEWEST)
    scan = replace(scan, freedom=asked.freedom)
    old = scan.up_to(len(values) - SHORTEST - 1)
    first, last = scan.place_ends()
    base = scan.level
    change: Reading = Estimate(history.name, None, "%", reason="the level before it may be zero")
    if np.all(np.abs(scan.before) > 3.0 * np.sqrt(scan.before_variances)):
        percent = 100.0 * scan.size / abs(base)
        change = Estimate(history.name, percent, "%", ends=StepEnds(scan))
    tested = replace(
        history,
        step_chance=old.chance,
        walk_chance=beside_spread(
            wandering_chance(values, covariance, history.time_s), asked.freedom
        ),
        change_percent=change,
        changed_s=(float(history.time_s[first]), float(history.time_s[last + 1])),
    )
    return replace(asked, history=tested)
