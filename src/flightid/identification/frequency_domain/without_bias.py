"""A fit with the estimator inside: its starts, the better end, errors from what is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from flightid.errors import FitError
from flightid.identification.frequency_domain.bias_findings import (
    TOLERABLE,
    BiasOutcome,
    sizes,
    variances,
)
from flightid.identification.frequency_domain.bias_objective import Curves, Objective
from flightid.identification.frequency_domain.bias_search import Settled, search
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

NOISE = 1.1
"""Ratio of the cost with the estimator inside to that without, up to which it may be noise."""
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
    ends : list of DenseEnd
        Best first.
    """

    outcome: BiasOutcome
    model: GreyBoxModel
    selected: Sequence[SelectedResponse]
    errors: ErrorModel
    estimates: Curves
    ends: list[DenseEnd]


def take_out(
    objective: Objective,
    plain: DenseEnd,
    select: Select,
) -> WithoutBias:
    """Search with the estimator inside, from the fit without and, where it matters, the model.

    Parameters
    ----------
    objective : Objective
        With the model at its own start values.
    plain : DenseEnd
        Of the fit to the response as measured.
    select : callable
        Chooses the fitted points of a response.
    """
    fitted = objective.at(plain.x)

    def not_done(reason: str, *, possible: bool = True) -> WithoutBias:
        outcome = BiasOutcome(reason, possible)
        return WithoutBias(outcome, fitted, objective.selected, objective.errors, [], [plain])

    reason = why_unknown(objective.correction.data)
    if reason:
        return not_done(reason, possible=False)
    try:
        ends = _searches(objective, plain)
    except (FitError, *OUTSIDE) as error:
        return not_done(str(error))
    best = ends[0]
    if best.found.end.cost > NOISE * plain.cost:
        return not_done(
            f"it would raise the cost from {plain.cost:.3g} to {best.found.end.cost:.3g}: the "
            "model does not hold what the records do, or the search met a wrong minimum"
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
    rest = [other.found.end for other in ends[1:] if not other.found.reason]
    return WithoutBias(outcome, model, selected, best.errors, found.estimates, [found.end, *rest])


@dataclass(frozen=True)
class _Judged:
    """An end of the search, the errors of the points there, and the mean square of misfits."""

    found: Settled
    errors: ErrorModel
    misfit: float

    @classmethod
    def of(cls, objective: Objective, found: Settled) -> _Judged:
        """Errors are those of what the model leaves of the outputs, where that is known."""
        correction, selected = objective.correction, objective.selected
        known = correction.errors(objective.at(found.end.x))
        errors = objective.errors
        if known is not None:
            errors = error_model(replace(correction.data, errors=known), selected)
        shares = [
            np.abs(estimate - each.response) ** 2 / np.maximum(variance, TINY)
            for estimate, each, variance in zip(
                found.estimates, selected, variances(selected, errors), strict=True
            )
            if variance is not None
        ]
        misfit = float(np.mean(np.concatenate(shares))) if shares else np.inf
        return cls(found, errors, misfit)


def _searches(objective: Objective, plain: DenseEnd) -> list[_Judged]:
    """From the fit without correction and from the model's values, one alone if that is enough.

    Leakage can bend the first beyond the reach of the right minimum, which two starts tell.
    """
    first = _Judged.of(objective, search(objective, plain.x))
    lower = first.found.end.cost <= NOISE * plain.cost
    settled = lower and first.found.step <= TOLERABLE and first.misfit <= MISFIT
    bent = first.found.begun > BENT * first.found.end.cost
    if settled and not (bent and objective.size <= FEW):
        return [first]
    own = np.array([parameter.value or 0.0 for parameter in objective.model.parameters.free])
    try:
        other = search(objective, own)
    except (FitError, *OUTSIDE):
        return [first]
    if (other.step > TOLERABLE, other.end.cost) < (
        first.found.step > TOLERABLE,
        first.found.end.cost,
    ):
        return [_Judged.of(objective, other), first]
    return [first, replace(first, found=other)]
