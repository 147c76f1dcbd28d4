"""The histories of one parameter, made and tested: by independent errors, then as days go on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.covariates import (
    CovariateDesign,
    CovariateSlopes,
    fit_covariates,
    own_slopes,
)
from flightid.fleet.statistics.days import SharedByDay, covariance_by_day
from flightid.fleet.statistics.events import (
    FleetEvent,
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
from flightid.fleet.statistics.neighbours import histories_in_time
from flightid.fleet.statistics.parameter_history import AskedHistory, ParameterHistory, StepEnds
from flightid.fleet.statistics.persistence import (
    DaySeries,
    Persistence,
    changed_vehicles,
    changes,
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


def asked_histories(
    data: FlightEstimates,
    i: int,
    design: CovariateDesign,
    errors: Array,
    by_day: SharedByDay,
    events: Sequence[FleetEvent],
    moved: Array,
) -> tuple[CovariateSlopes, list[AskedHistory]]:
    """One parameter of all vehicles with its tests by independent days, and the slopes taken out.

    A change of many vehicles bends the slope of what came at about the same time, such as a new
    firmware: slopes are fitted beside the changes that are found, and these are sought anew, until
    the same vehicles change.

    Parameters
    ----------
    data : FlightEstimates
        What all vehicles share taken out.
    i : int
        Place of the parameter.
    design : CovariateDesign
    errors, moved : ndarray, shape (n,)
        Of every flight: variance, and what all vehicles share, which events of all keep.
    by_day : SharedByDay
        What flights of a day share of their variances.
    events : sequence of FleetEvent
    """
    changed: frozenset[str] = frozenset()
    histories = list(histories_in_time(data, i))
    happened = [
        [each for each in events if each.concerns(data.vehicles[rows[0]])] for rows in histories
    ]
    known = {
        data.vehicles[rows[0]]: event_steps(own, data.time_s[rows])
        for rows, own in zip(histories, happened, strict=True)
    }
    beside = known
    for _ in range(ROUNDS):
        fitted = fit_covariates(data, i, design, errors, beside)
        asked = [
            _asked_history(data, i, rows, design, fitted, errors, by_day, own, moved)
            for rows, own in zip(histories, happened, strict=True)
        ]
        now = changed_vehicles(asked) if design.names else changed
        if now == changed:
            break
        changed = now
        shapes = {e.history.vehicle: changes(e) for e in asked if e.history.vehicle in now}
        beside = {v: np.column_stack([x, *shapes.get(v, ())]) for v, x in known.items()}
    return fitted, asked


def _asked_history(
    data: FlightEstimates,
    i: int,
    rows: NDArray[np.intp],
    design: CovariateDesign,
    fitted: CovariateSlopes,
    errors: Array,
    by_day: SharedByDay,
    events: Sequence[FleetEvent],
    moved: Array,
) -> AskedHistory:
    """One parameter of one vehicle with its tests; its own flights and events alone."""
    name, unit, vehicle = data.names[i], data.units[i], data.vehicles[rows[0]]
    time_s, together = data.time_s[rows], by_day.variances[rows]
    values, variances = data.values[rows, i], errors[rows]
    covariance, tested = covariance_by_day(variances, time_s, together), values
    if design.names:
        slope, error = fitted.without[vehicle]
        x = design.columns[rows]
        # An error of the slopes that is common to all flights moves the level alone.
        apart = x - x.mean(axis=0)
        covariance = covariance + apart @ error @ apart.T
        own = own_slopes(values, variances, apart, slope, error)
        tested, values = values - apart @ slope, values - apart @ own
    track = follow_level(values, variances, time_s)
    bare = ParameterHistory(
        *(vehicle, name, unit, time_s, values, variances, track, None, None),
        Estimate(name, None, "%", reason=TOO_FEW),
        None,
    )
    return _tested(
        AskedHistory(bare, tested, covariance, tuple(events), moved[rows], together, by_day.freedom)
    )


def persisting_together(
    asked: Sequence[Sequence[AskedHistory]],
) -> list[tuple[Persistence | None, list[AskedHistory]]]:
    """`beside_persistence` of all parameters of one model, each suspected where another's goes on.

    Parameters
    ----------
    asked : sequence of sequence of AskedHistory
        By parameter.

    Returns
    -------
    list of (Persistence or None, list of AskedHistory)
        By parameter.
    """
    apart = [beside_persistence(each) for each in asked]
    if not any(found is not None and found.is_sure for found, _ in apart):
        return apart
    return [
        beside_persistence(each, suspected=True) if found[0] is None else found
        for each, found in zip(asked, apart, strict=True)
    ]


def beside_persistence(
    asked: Sequence[AskedHistory], *, suspected: bool = False
) -> tuple[Persistence | None, list[AskedHistory]]:
    """Histories of one parameter, by errors that go on where days do.

    Days go on where they do beside all changes that independent days would show; or where they
    explain these changes better than as many vehicles that happened to change. In a large fleet
    they go on in vehicles without a change as well, or nowhere.

    Parameters
    ----------
    asked : sequence of AskedHistory
        By independent days.
    suspected : bool
        Whether days of another parameter of the same fits go on: air, battery and payload move all.
        Then these count as going on as far as they may.

    Returns
    -------
    persistence : Persistence or None
        None where days are independent.
    histories : list of AskedHistory
    """
    changed = changed_vehicles(asked)
    series = day_series(asked, changed)
    found = persistence(series, changed)
    is_told = found is not None and (found.is_told or suspected)
    if found is None or not (found.is_told or changed):
        return None, list(asked)
    rivals = [_settled(series, changed, frozenset())]
    if is_told:
        rivals.append(_settled(series, changed, changed))
    elif rivals[0].fitness < found.apart + MARGIN:
        return None, list(asked)
    best = max(rivals, key=lambda each: each.fitness)
    if not is_shared(series, changed, best):
        own = persistence([each for each in series if each.vehicle not in changed], frozenset())
        if own is None or not own.is_told:
            return None, list(asked)
        best = own
    if best.share == 0.0:
        return None, list(asked)
    if is_told:  # As sure as those are that did not change: a step looks like days that go on.
        best = replace(best, likelier=found.likelier)
    return best, [_persisting(each, best) for each in asked]


def _settled(
    series: Sequence[DaySeries], most: frozenset[str], changed: frozenset[str]
) -> Persistence:
    """Days that go on beside just those changes, of `most`, that explain more than they cost."""
    for _ in range(ROUNDS):
        now = explained(series, most, _known(persistence(series, changed, caution=0.0)))
        if now == changed:
            break
        changed = now
    return _known(persistence(series, changed))


def _known(found: Persistence | None) -> Persistence:
    """What days tell, where some do."""
    assert found is not None
    return found


def _persisting(asked: AskedHistory, found: Persistence) -> AskedHistory:
    """The same judged by errors that go on from day to day."""
    wider = replace(asked, errors=persisting(asked, found))
    return _tested(
        replace(wider, history=replace(asked.history, apart_chance=asked.history.chance))
    )


def _tested(asked: AskedHistory) -> AskedHistory:
    history = asked.history
    effects = event_effects(
        *(asked.events, history.name, history.unit, asked.measured, asked.errors),
        *(history.time_s, asked.shared, asked.freedom),
    )
    history = replace(history, events=effects)
    if not len(step_places(len(asked.values), asked.known)):
        return replace(asked, history=history)
    # A step is looked for with three flights behind it; where one is, it may be of the last two.
    values, covariance = asked.values, asked.covariance
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
