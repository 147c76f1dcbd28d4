"""A fit with the estimator inside: its starts, the better end, errors from what is left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from flightid.errors import FitError
from flightid.frozen import dataclass
from flightid.identification.frequency_domain.bias_findings import (
    TOLERABLE,
    BiasOutcome,
    sizes,
    variances,
)
from flightid.identification.frequency_domain.bias_objective import Curves, Objective
from flightid.identification.frequency_domain.bias_search import SearchOutcome, search
from flightid.identification.frequency_domain.bias_starts import further_starts
from flightid.identification.frequency_domain.error_model import ErrorModel, error_model
from flightid.identification.frequency_domain.estimator_bias import (
    OUTSIDE,
    why_unknown,
)
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.identification.multistart import DenseEnd
from flightid.models import GreyBoxModel
from flightid.responses import FrequencyResponse

Select = Callable[[FrequencyResponse], list[SelectedResponse]]
BENT, FEW = 4.0, 20_000
"""Fall of the cost from which leakage counts as larger than noise, and samples of derivatives up to
which another start is then tried in any case."""
TINY = float(np.finfo(float).tiny)

RIVAL, MOST_RIVALS = 4.0, 4
"""Cost over the best one's up to which other minima are searched again, and how many at most."""
SAME_COST, SAME_VALUE = 1e-3, 1e-3
"""Relative differences of cost and values that searches leave by ending where steps are small."""
RISEN = 1.1
"""Ratio of the cost with the estimator inside to that without, from which on the search is made
again from further starts. A rise alone says nothing of the minimum: without the estimator leakage
and what the structure lacks take each other's place, and 22 of 33 wrong minima cost less."""
MOVED, LEFT, UNMOVED = 1.15, 1.0, 0.1
"""Fall of the cost from its begin that tells leakage, average cost (of a likelihood: a residual's
square), and share of the cost without the estimator inside, from which on a search that takes
little time is made again so. Of 194 records of a light mode 31 of 33 wrong minima lay above."""
CHANCE = 4.0
"""Mean square of misfits over their errors up to which a cost that rose is chance: neighbouring
points share their errors, so few of them are independent. Errors are those that the response was
measured with: those of what the model leaves are large where it is wrong."""
AGAIN = 2
"""Starts that have to lead to a minimum whose cost rose, so that it counts as the lowest."""
MISFIT = 10.0
"""Mean square of misfits over their errors from which on another start is tried."""


@dataclass(frozen=True)
class WithoutBias:
    """A fit whose estimator's bias is taken out, or why it is not.

    Attributes
    ----------
    outcome : BiasOutcome
    model : GreyBoxModel
    selected : sequence of SelectedResponse
        Corrected points.
    errors : ErrorModel
    estimates : list of ndarray
        What the estimator makes of the model, by response.
    groups : list of list of DenseEnd
        Minima, best first, each with as many ends as starts that led there.
    """

    outcome: BiasOutcome
    model: GreyBoxModel
    selected: Sequence[SelectedResponse]
    errors: ErrorModel
    estimates: Curves
    groups: list[list[DenseEnd]]


def take_out(
    objective: Objective,
    minima: Sequence[list[DenseEnd]],
    select: Select,
) -> WithoutBias:
    """Search with the estimator inside, from the fit without and, where it matters, the model.

    Parameters
    ----------
    objective : Objective
        With the model at its own start values.
    minima : sequence of sequence of DenseEnd
        Of the fit to the response as measured, best first; rivals of the best are searched too.
    select : callable
        Chooses the fitted points of a response.
    """
    plain = minima[0][0]

    def not_done(reason: str, *, possible: bool = True) -> WithoutBias:
        outcome = BiasOutcome(reason, possible)
        model = objective.model
        return WithoutBias(outcome, model, objective.selected, objective.errors, [], [[plain]])

    reason = why_unknown(objective.correction.data)
    if reason:
        return not_done(reason, possible=False)
    try:
        ends = _ranked([*_searches(objective, minima[0]), *_rivals(objective, minima)])
    except (FitError, *OUTSIDE) as error:
        return not_done(str(error))
    if _is_doubtful(objective, ends, plain):
        ends = _ranked([*ends, *_searched_again(objective, plain)])
    best = ends[0].judged or _Judgement.of(objective, ends[0].found)
    risen = best.found.end.cost > RISEN * plain.cost
    if risen and ends[0].met < AGAIN and not best.is_chance:
        return not_done(
            f"it would raise the cost from {plain.cost:.3g} to {best.found.end.cost:.3g}, at a "
            "minimum that no further start meets: there may be lower ones"
        )
    if best.found.step > TOLERABLE:
        return not_done(best.found.reason)
    if objective.cost == "likelihood":
        # The last search weighs the points by the errors that the intervals come from.
        again = search(replace(objective, errors=best.errors), best.found.end.x)
        best = replace(best, found=again)
    found, model = best.found, objective.at(best.found.end.x)
    selected = select(objective.correction.apply(model))
    changes = sizes(objective.selected, selected, best.errors)
    outcome = BiasOutcome("", steps=found.end.iterations, last=found.step, sizes=changes)
    groups = [[found.end] * ends[0].count]
    groups += [[other.found.end] * other.count for other in ends[1:] if not other.found.reason]
    return WithoutBias(outcome, model, selected, best.errors, found.estimates, groups)


@dataclass(frozen=True)
class _Judgement:
    """An end of the search, the errors of the points there, and the mean square of misfits.

    Misfits count by those errors, and by what the response was measured with.
    """

    found: SearchOutcome
    errors: ErrorModel
    misfit: float
    as_measured: float

    @property
    def is_chance(self) -> bool:
        """Whether errors that do not come from this model explain its misfits."""
        return self.as_measured <= CHANCE

    @classmethod
    def of(cls, objective: Objective, found: SearchOutcome) -> _Judgement:
        """Errors are those of what the model leaves of the outputs, where that is known."""
        correction, selected = objective.correction, objective.selected
        known = correction.errors(objective.at(found.end.x))
        errors = objective.errors
        if known is not None:
            errors = error_model(replace(correction.data, errors=known), selected)
        misfits = (_misfit(objective, found, each) for each in (errors, objective.errors))
        return cls(found, errors, *misfits)


@dataclass(frozen=True)
class _Minimum:
    """A minimum with the estimator inside, how many starts led there, and what it was judged as.

    `count` is of starts of the fit without the estimator, `met` of searches with it.
    """

    found: SearchOutcome
    count: int = 1
    judged: _Judgement | None = None
    met: int = 1


def _misfit(objective: Objective, found: SearchOutcome, errors: ErrorModel) -> float:
    """Mean square of what the estimator makes of the model less the response, over errors."""
    selected = objective.selected
    shares = [
        np.abs(estimate - each.response) ** 2 / np.maximum(variance, TINY)
        for estimate, each, variance in zip(
            found.estimates, selected, variances(selected, errors), strict=True
        )
        if variance is not None
    ]
    return float(np.mean(np.concatenate(shares))) if shares else np.inf


def _searches(objective: Objective, minimum: Sequence[DenseEnd]) -> list[_Minimum]:
    """From the fit without correction and from the model's values, one alone if that is enough.

    Leakage can bend the first beyond the reach of the right minimum, which two starts tell.
    """
    plain, count = minimum[0], len(minimum)
    own = np.array([parameter.value or 0.0 for parameter in objective.model.parameters.free])
    try:
        first = search(objective, plain.x)
    except (FitError, *OUTSIDE):
        # What leakage bent may not be followed over the records where the model's values can be.
        return [_Minimum(search(objective, own))]
    lower = first.end.cost <= RISEN * plain.cost
    judged = _Judgement.of(objective, first) if lower and first.step <= TOLERABLE else None
    settled = judged is not None and judged.misfit <= MISFIT
    bent = first.begun > BENT * first.end.cost
    begun = _Minimum(first, count, judged)
    if settled and not (bent and objective.size <= FEW):
        return [begun]
    try:
        return [begun, _Minimum(search(objective, own))]
    except (FitError, *OUTSIDE):
        return [begun]


def _is_doubtful(objective: Objective, ends: Sequence[_Minimum], plain: DenseEnd) -> bool:
    """Whether there may be a lower minimum than the best of these."""
    best = ends[0].found.end
    if best.cost > RISEN * plain.cost:
        return True
    likelihood = objective.cost == "likelihood"
    parts = len(best.residuals) if likelihood else len(objective.selected)
    bent = max(each.found.begun for each in ends) > MOVED * best.cost
    left = best.cost > max(LEFT * parts, UNMOVED * plain.cost)
    return objective.size <= FEW and bent and left


def _searched_again(objective: Objective, plain: DenseEnd) -> Iterator[_Minimum]:
    """From further starts."""
    for start in further_starts(objective, plain.x):
        with suppress(FitError, *OUTSIDE):
            yield _Minimum(search(objective, start))


def far_from_best(minima: Sequence[list[DenseEnd]]) -> list[list[DenseEnd]]:
    """Minima that are not searched again: far above the best, or behind too many others."""
    limit = RIVAL * minima[0][0].cost
    near = sum(group[0].cost <= limit for group in minima[1:])
    return list(minima[1 + min(near, MOST_RIVALS) :])


def _rivals(objective: Objective, minima: Sequence[list[DenseEnd]]) -> list[_Minimum]:
    """Other minima of the fit without correction that are near its best, by the same cost."""
    rivals = minima[1 : len(minima) - len(far_from_best(minima))]
    found = []
    for group in rivals:
        with suppress(FitError, *OUTSIDE):
            found.append(_Minimum(search(objective, group[0].x), len(group)))
    return found


def _ranked(ends: Sequence[_Minimum]) -> list[_Minimum]:
    """Distinct minima, best first; of those that cost the same the earliest goes first."""
    distinct: list[_Minimum] = []
    for each in ends:
        for place, known in enumerate(distinct):
            if _same(known.found, each.found):
                better = min((known, each), key=_worth)
                count, met = max(known.count, each.count), known.met + each.met
                distinct[place] = replace(better, count=count, met=met)
                break
        else:
            distinct.append(each)
    ranked = sorted(distinct, key=_worth)
    stalled, cost = _worth(ranked[0])
    alike = (each for each in distinct if _worth(each) <= (stalled, cost * (1.0 + SAME_COST)))
    first = next(each for each in alike if _worth(each)[0] == stalled)
    return [first, *(each for each in ranked if each is not first)]


def _worth(end: _Minimum) -> tuple[bool, float]:
    return end.found.step > TOLERABLE, end.found.end.cost


def _same(one: SearchOutcome, other: SearchOutcome) -> bool:
    """Whether the way between two ends is within what a search that settled leaves undone."""
    way = other.end.x - one.end.x
    if np.all(np.abs(way) <= SAME_VALUE * np.abs(one.end.x)):
        return True
    effect = float(np.linalg.norm(one.end.jacobian @ way))
    return effect <= TOLERABLE * float(np.sqrt(one.end.cost / one.end.residuals.size))
