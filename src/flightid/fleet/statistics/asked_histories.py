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
from flightid.fleet.statistics.day_series import day_series
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
    StepScan,
    scan_drifts,
    scan_steps,
    step_places,
)
from flightid.fleet.statistics.local_level import follow_level
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE, corrected
from flightid.fleet.statistics.neighbours import histories_in_time
from flightid.fleet.statistics.parameter_history import AskedHistory, ParameterHistory, StepEnds
from flightid.fleet.statistics.persistence import (
    INDEPENDENT,
    NEGLIGIBLE,
    Persistence,
    persistence,
    persisting,
)
from flightid.fleet.statistics.wandering import wandering_chance
from flightid.uncertainty.estimate import Estimate, Reading

Array = NDArray[np.float64]
SUSPECTED = 0.05
"""Chance of independent days where those of another parameter of the same fits go on: air, battery
and payload move all."""
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
        now = _changed_vehicles(asked) if design.names else changed
        if now == changed:
            break
        changed = now
        shapes = {e.history.vehicle: _changes(e) for e in asked if e.history.vehicle in now}
        beside = {v: np.column_stack([x, *shapes.get(v, ())]) for v, x in known.items()}
    return fitted, asked


def _changed_vehicles(asked: Sequence[AskedHistory]) -> frozenset[str]:
    """Vehicles whose history of one parameter would be an alarm by itself among those asked."""
    judged = [each.history for each in asked if each.history.chance is not None]
    shares = corrected([each.chance or 0.0 for each in judged])
    told = zip(judged, shares, strict=True)
    return frozenset(each.vehicle for each, share in told if share <= FALSE_SHARE)


def _changes(asked: AskedHistory) -> list[Array]:
    """The step and the steady movement that explain most of a history."""
    n, time_s = len(asked.values), asked.history.time_s
    place = scan_steps(asked.values, asked.covariance, asked.known).place
    found = [(np.arange(n) > place).astype(np.float64)[:, None]]
    if time_s[0] < time_s[-3]:
        start = scan_drifts(asked.values, asked.covariance, time_s).place
        found.append(np.maximum(time_s - time_s[start], 0.0)[:, None] / (time_s[-1] - time_s[0]))
    return found


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
        found if found[0] is not None else beside_persistence(each, independent=SUSPECTED)
        for each, found in zip(asked, apart, strict=True)
    ]


def beside_persistence(
    asked: Sequence[AskedHistory], *, independent: float = INDEPENDENT
) -> tuple[Persistence | None, list[AskedHistory]]:
    """Histories of one parameter, judged as days may go on: each way as likely as it is.

    Chances are those of independent days and of days that go on, averaged; errors are, too.

    Parameters
    ----------
    asked : sequence of AskedHistory
        By independent days.
    independent : float
        Chance that they are, before any is seen.

    Returns
    -------
    persistence : Persistence or None
        None where days are not told to go on.
    histories : list of AskedHistory
    """
    found = persistence(day_series(asked), independent=independent)
    if found is None or found.chance < NEGLIGIBLE:
        return None, list(asked)
    return found if found.is_told else None, [_persisting(each, found) for each in asked]


def _persisting(asked: AskedHistory, found: Persistence) -> AskedHistory:
    """The same judged by errors that may go on from day to day."""
    history, apart = asked.history, 1.0 - found.chance
    step, walk = history.step_chance, history.walk_chance
    if history.chance is None or step is None or walk is None:
        return asked
    going_on = [(each.chance, persisting(asked, each)) for each in found.parts]
    rivals = ((apart, asked.errors), *going_on)
    mixed = replace(
        asked,
        errors=np.sum([weight * errors for weight, errors in rivals], axis=0),
        rivals=rivals,
    )
    # Where independent days alone leave enough chance the others add nothing that would be seen.
    if apart * history.chance <= FALSE_SHARE:
        beside = [(weight, replace(asked, errors=errors)) for weight, errors in going_on]
        step = apart * step + sum(weight * _step_chance(each) for weight, each in beside)
        walk = apart * walk + sum(weight * _walk_chance(each) for weight, each in beside)
    sized = _sized(mixed)
    more = 0 if found.is_told else found.more_days
    return replace(
        sized,
        history=replace(
            sized.history,
            step_chance=step,
            walk_chance=walk,
            apart_chance=history.chance,
            more_days=more,
        ),
    )


def _scanned(asked: AskedHistory) -> StepScan:
    """Steps with two flights behind them at the least."""
    scan = scan_steps(asked.values, asked.covariance, asked.known, newest=NEWEST)
    return replace(scan, freedom=asked.freedom)


def _step_chance(asked: AskedHistory) -> float:
    """Of the largest step with three flights behind it."""
    return _scanned(asked).up_to(len(asked.values) - SHORTEST - 1).chance


def _walk_chance(asked: AskedHistory) -> float:
    chance = wandering_chance(asked.values, asked.covariance, asked.history.time_s)
    return beside_spread(chance, asked.freedom)


def _tested(asked: AskedHistory) -> AskedHistory:
    """With its chances, where it is long enough, and sizes."""
    sized = _sized(asked)
    if sized.history.changed_s is None:
        return sized
    history = replace(
        sized.history, step_chance=_step_chance(asked), walk_chance=_walk_chance(asked)
    )
    return replace(sized, history=history)


def _sized(asked: AskedHistory) -> AskedHistory:
    """With the effects of its events, and the largest step beside them."""
    history = asked.history
    effects = event_effects(
        *(asked.events, history.name, history.unit, asked.measured, asked.errors),
        *(history.time_s, asked.shared, asked.freedom),
    )
    history = replace(history, events=effects)
    if not len(step_places(len(asked.values), asked.known)):
        return replace(asked, history=history)
    # A step is looked for with three flights behind it; where one is, it may be of the last two.
    scan = _scanned(asked)
    first, last = scan.place_ends()
    base = scan.level
    change: Reading = Estimate(history.name, None, "%", reason="the level before it may be zero")
    if np.all(np.abs(scan.before) > 3.0 * np.sqrt(scan.before_variances)):
        percent = 100.0 * scan.size / abs(base)
        change = Estimate(history.name, percent, "%", ends=StepEnds(scan))
    sized = replace(
        history,
        change_percent=change,
        changed_s=(float(history.time_s[first]), float(history.time_s[last + 1])),
    )
    return replace(asked, history=sized)
