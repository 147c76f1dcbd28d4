"""Histories judged together: what is an alarm among all of them, and of which kind and size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.change_kind import DRIFT, STEP, change_kind
from flightid.fleet.statistics.largest_step import (
    SHORTEST,
    StepScan,
    scan_changes,
    scan_drifts,
    scan_steps,
)
from flightid.fleet.statistics.least_step import least_step
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE, corrected
from flightid.fleet.statistics.parameter_history import (
    TESTS,
    AskedHistory,
    ParameterHistory,
    StepEnds,
)
from flightid.uncertainty.estimate import Estimate, Reading

Array = NDArray[np.float64]
SPOKEN = 10.0
"""By which a step makes a memory likelier that explains it: as likely as flights without one leave
it, of 40 steps of the least size 21 were found in six vehicles of 12 flights, so 28."""


def judged_histories(asked: Sequence[AskedHistory]) -> tuple[ParameterHistory, ...]:
    """Every history with its share of false alarms among all."""
    histories = [each.history for each in asked]
    shares = _shares([each.chance for each in histories])
    apart = _shares([
        each.chance if each.apart_chance is None else each.apart_chance for each in histories
    ])  # fmt: skip
    alarms, every = _counts(shares)
    judged = (
        replace(
            each,
            false_share=share,
            apart_share=None if each.apart_chance is None else beside,
            least_step=_least_step(of, alarms, every),
        )
        for each, of, share, beside in zip(histories, asked, shares, apart, strict=True)
    )
    return tuple(
        _named(each, of) if each.is_alarm else each for each, of in zip(judged, asked, strict=True)
    )


def _counts(shares: Sequence[float | None]) -> tuple[int, int]:
    """Alarms, and histories that were asked."""
    asked = [share for share in shares if share is not None]
    return sum(share <= FALSE_SHARE for share in asked), len(asked)


def _least_step(of: AskedHistory, alarms: int, every: int) -> Reading | None:
    """Of a history that was asked, at the level at which one more of the fleet is an alarm."""
    history = of.history
    if history.chance is None:
        return None
    # Benjamini and Hochberg's for the next one, or for this one among those that are.
    rank = max(alarms + (history.chance > FALSE_SHARE * alarms / every), 1)
    chance = FALSE_SHARE * rank / (every * TESTS)
    size = max(
        least_step(_of_errors(of, errors), min(chance / min(1.0, SPOKEN * weight), 0.5))
        for weight, errors in of.rivals or ((1.0, of.errors),)
        if SPOKEN * weight > chance
    )
    if history.change_percent.value is None:
        return Estimate(history.name, size, history.unit)
    level = np.average(of.values, weights=1.0 / history.variances)
    return Estimate(history.name, 100.0 * size / abs(float(level)), "%")


def _of_errors(of: AskedHistory, errors: Array) -> StepScan:
    """Steps of a history by other errors of its flights."""
    one = replace(of, errors=errors)
    return replace(scan_steps(one.values, one.covariance, one.known), freedom=one.freedom)


def _shares(chances: Sequence[float | None]) -> list[float | None]:
    """Shares of false alarms of those that have a chance."""
    shares = iter(corrected([chance for chance in chances if chance is not None]))
    return [None if chance is None else float(next(shares)) for chance in chances]


def _named(history: ParameterHistory, of: AskedHistory) -> ParameterHistory:
    """An alarm as a step or drift, as far as its flights tell, with the size of that."""
    values, covariance = of.values, of.covariance
    kind = change_kind(values, covariance, history.time_s)
    named = replace(history, kind=kind)
    change = history.change_percent
    if kind == STEP or change.value is None or history.time_s[0] >= history.time_s[-SHORTEST]:
        return named
    drift = scan_drifts(values, covariance, history.time_s)
    scan = drift if kind == DRIFT else scan_changes(values, covariance, history.time_s, of.known)
    scan = replace(scan, freedom=of.freedom)
    percent = 100.0 * scan.size / abs(scan.level)
    size = Estimate(history.name, percent, "%", ends=StepEnds(scan))
    if kind != DRIFT:
        return replace(named, change_percent=size)
    began = drift.place_ends()[0]
    spanned = (float(history.time_s[began]), float(history.time_s[-1]))
    return replace(named, change_percent=size, changed_s=spanned)
