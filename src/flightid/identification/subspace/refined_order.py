"""The order of a refined model: states that neither predictions nor free runs need are let go."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.prediction.request import usual_stretch
from flightid.identification.subspace.data import SubspaceData
from flightid.identification.subspace.determinant import log_determinant
from flightid.identification.subspace.estimate import Matrices, Subspace, realise
from flightid.identification.subspace.order import (
    STRETCHES,
    OrderChoice,
    free_run_errors,
)
from flightid.identification.subspace.prediction_errors import RefinementResult, refine
from flightid.models.innovations.structure import SubspaceStructure

Array = NDArray[np.float64]
LOOK_AHEAD = 2
"""States that are tried above an order: a pair of poles may pay where one does not."""


def refined_order(
    structure: SubspaceStructure,
    data: SubspaceData,
    decomposed: Subspace,
    chosen: tuple[OrderChoice, int],
    start: Matrices,
) -> tuple[OrderChoice, RefinementResult, str]:
    """Refined model, the choice with the order that it has, and why it has states to spare.

    Orders from the chosen one to a limit are open: chance may have told their free runs apart.
    States are added there as long as refined predictions or free runs pay for them. Where a state
    is not there, its pole is anywhere and the information near singular: where a criterion asks
    for fewer, those are tried, and a model that has states to spare says so.

    Reference
    ---------
    Schwarz (1978), Estimating the dimension of a model, *Annals of Statistics* 6.
    """
    choice, limit = chosen
    trials = _Trials(structure, data, decomposed)
    found = trials.refined(start)
    if structure.order is None:
        found = trials.more_states(found, limit)
        choice = replace(choice, chosen=_order(found))
    fewer = [order for order in choice.rivals.values() if order < choice.chosen]
    if found.covariance is not None and fewer:
        for order in sorted({min(fewer), choice.chosen - 1}):
            if trials.rival(found, order)[1]:
                spare = f"{order} states foretell the outputs as well as {choice.chosen}"
                return choice, found, spare
    return choice, found, ""


def scaled(matrices: Matrices, size: Array) -> Matrices:
    """The model with its outputs multiplied by `size`."""
    a, b, c, d, k = matrices
    return a, b, size[:, None] * c, size[:, None] * d, k / size


def _order(found: RefinementResult) -> int:
    return len(found.matrices[0])


@dataclass(frozen=True, eq=False)
class _Trials:
    """Refined models of several orders of the same records."""

    structure: SubspaceStructure
    data: SubspaceData
    decomposed: Subspace

    def refined(self, start: Matrices, *, enough: float | None = None) -> RefinementResult:
        """From a start in the channels' units; no further than it takes to be below `enough`."""
        return refine(
            self.data,
            scaled(start, 1.0 / self.data.scales),
            direct=bool(self.structure.direct),
            initial_state=self.structure.initial_state,
            maximum_iterations=self.structure.maximum_iterations,
            enough=enough,
        )

    def rival(self, found: RefinementResult, order: int) -> tuple[RefinementResult, bool]:
        """Another order, and whether it does as well by the Bayesian criterion."""
        goal = log_determinant(found.errors) + self._saved(found, order)
        start = realise(self.structure, self.data, self.decomposed, order)
        other = self.refined(start, enough=goal)
        level = log_determinant(other.errors)
        return other, bool(np.isfinite(level - goal) and level < goal)

    def more_states(self, found: RefinementResult, limit: int) -> RefinementResult:
        """With as many states more, up to a limit, as pay in predictions or in free runs."""
        order = _order(found) + 1
        while order <= min(limit, _order(found) + LOOK_AHEAD):
            higher, is_better = self.rival(found, order)
            if is_better or self._runs_better(higher, found):
                found = self.refined(scaled(higher.matrices, self.data.scales))
            order += 1
        return found

    def _runs_better(self, more: RefinementResult, found: RefinementResult) -> bool:
        """Whether the free run gains more by more states than they cost; not where it is short."""
        data = self.data
        skip = usual_stretch(min(y.shape[1] for y in data.outputs), _order(more))
        if min(y.shape[1] for y in data.outputs) < skip + STRETCHES:
            return False
        few, many = (
            free_run_errors(self.structure, data, data, scaled(each.matrices, data.scales), skip)
            for each in (found, more)
        )
        cost = self._saved(more, _order(found))
        return bool(np.mean(few) > math.exp(cost) * np.mean(many))

    def _saved(self, found: RefinementResult, order: int) -> float:
        """What an order may leave more in the log determinant, by the Bayesian criterion."""
        numbers = 2 * len(self.structure.outputs) + len(self.structure.inputs)
        samples = sum(each.shape[1] for each in found.errors)
        saved = (_order(found) - order) * numbers
        penalty: float = saved * math.log(samples) / samples
        return penalty
