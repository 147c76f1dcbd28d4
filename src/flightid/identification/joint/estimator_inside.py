"""A joint fit's search with the estimator of its response inside (native: `joint_objective.rs`).

There is one cost, of what the estimator makes of the model and of the records together, and no step
raises it. The slopes that the estimator adds are worked out at the start of each turn and learned
on the way; the fit has settled where a turn with the slopes of its own start moves next to nothing.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.frequency_domain.bias_findings import ENOUGH
from flightid.identification.frequency_domain.bias_objective import Curves, Objective
from flightid.identification.frequency_domain.bias_search import (
    SearchPoint,
    added_slopes,
    jacobian_at,
    learned_slopes,
)
from flightid.identification.joint.options import JointOptions
from flightid.identification.output_error.beside import WrittenResiduals
from flightid.identification.output_error.search import SearchEnd, searched
from flightid.identification.records.setup import RecordSet
from flightid.models import GreyBoxModel

Array = NDArray[np.float64]
MOST_TURNS = 12
ACROSS = 0.01
"""Share of a sample by which the other side of a jump is tried."""
CURVED = 0.5
"""Share of a step's effect that slopes missed, from which on they are worked out anew."""
NEARBY = 1.0
"""Scatter of the residuals by which a turn may move them while its first slopes still serve."""


@dataclass
class InsideResiduals:
    """Whitened errors of what an estimator makes of model after model, as a search asks for them.

    Attributes
    ----------
    objective : Objective
    extra : list of ndarray
        Slopes that the estimator adds, (n_free, n) by response; steps make them better.
    here, tried : SearchPoint or None
        Where the search linearised last, and what it asked for last.
    """

    objective: Objective
    extra: Curves
    here: SearchPoint | None = None
    tried: SearchPoint | None = None
    jacobian: Array | None = None

    @property
    def written(self) -> WrittenResiduals:
        """As the native half takes them."""
        return self._residuals, self._slopes, self.n_residuals

    @cached_property
    def n_residuals(self) -> int:
        """Rows of the whitened errors."""
        return len(self.objective.residuals([each.response for each in self.objective.selected]))

    def _at(self, x: Array) -> SearchPoint | None:
        for known in (self.tried, self.here):
            if known is not None and np.array_equal(known.x, x):
                return known
        return SearchPoint.of(self.objective, x.copy())

    def _residuals(self, x: Array) -> Array:
        found = self._at(x)
        if found is None:
            # The search shortens its step.
            return np.full(self.n_residuals, np.nan)
        self.tried = found
        return found.residuals

    def _slopes(self, x: Array) -> Array:
        there = self._at(x)
        if there is None:
            return np.full((self.n_residuals, len(x)), np.nan)
        if self.here is not None and self.jacobian is not None and there is not self.here:
            self.extra = self._improved(self.here, there, self.jacobian)
        self.here = there
        self.jacobian = np.ascontiguousarray(jacobian_at(self.objective, there, self.extra))
        return self.jacobian

    def _improved(self, here: SearchPoint, there: SearchPoint, jacobian: Array) -> Curves:
        """Learned from a step, or worked out anew where the slopes missed what it did."""
        effect = jacobian @ (there.x - here.x)
        missed = np.linalg.norm(there.residuals - here.residuals - effect)
        if missed > CURVED * np.linalg.norm(effect):
            return added_slopes(self.objective, there.x)
        scale = np.linalg.norm(jacobian, axis=0)
        return learned_slopes(self.objective, self.extra, here, there, scale)


@dataclass(frozen=True)
class InsideEnd:
    """Where a joint search with the estimator inside ended.

    Attributes
    ----------
    found : SearchEnd
    extra : list of ndarray
        Slopes that the estimator adds there.
    misfit : float
        Mean square of the response's whitened errors.
    steps : int
        Of all turns.
    step : float
        What the last turn moved the residuals by, a parameter, over their scatter.
    """

    found: SearchEnd
    extra: Curves
    misfit: float
    steps: int
    step: float

    @property
    def cost(self) -> float:
        """Negative log-likelihood of records and response."""
        return self.found.groups[0][0].cost

    @property
    def is_converged(self) -> bool:
        """Whether the last turn's own search ended at a minimum."""
        return self.found.groups[0][0].is_converged

    @property
    def settled(self) -> InsideEnd:
        """The same, which a turn from here with the slopes of its own start did not better."""
        (best, *others), *rest = self.found.groups
        if best.is_converged:
            return self
        groups = [[replace(best, termination="step"), *others], *rest]
        return replace(self, found=replace(self.found, groups=groups))

    @property
    def reason(self) -> str:
        """What to say of a search that did not settle."""
        return f"the search stopped {self.step:.2g} of the residuals' scatter away from a minimum"


def search_inside(
    start: GreyBoxModel,
    prepared: RecordSet,
    options: JointOptions,
    objective: Objective,
    known: Curves | None = None,
) -> InsideEnd:
    """Minimise records and response together from one start.

    Parameters
    ----------
    start : TransferFunctionModel or StateSpaceModel
    prepared : RecordSet
    options : JointOptions
    objective : Objective
        Of the response, with ``cost="likelihood"``.
    known : list of ndarray, optional
        Slopes that the estimator adds there: a search that ends nearby is then not repeated.

    Raises
    ------
    DataError, ModelError, OptionError, SingularError
        The model cannot be followed over the records of the response.
    FitError
        The search led nowhere.

    Reference
    ---------
    Madsen, Nielsen & Tingleff, *Methods for Non-linear Least Squares Problems* (2004), §3.2; the
    slopes on the way: Broyden, *Mathematics of Computation* 19 (1965).
    """
    model, before, steps = start, np.inf, 0
    objective.estimates(_values(start))  # says why, if it is a simulation that cannot be
    celled = known is not None and objective.correction.cells.around(start) is not None
    extra = known or _none(objective)
    for _ in range(MOST_TURNS):
        end = _turn(model, prepared, options, objective, extra, celled=celled)
        steps += end.steps
        if known is not None and end.is_converged and end.step <= NEARBY:
            return replace(end, step=0.0, steps=steps)
        model, known = end.found.fitted, None
        gained = max(0.0, before - end.cost)
        step = float(np.sqrt(2.0 * gained / (len(_values(model)) * max(1.0, end.misfit))))
        end = replace(end, step=step, steps=steps)
        if step <= ENOUGH:
            beyond = _beyond(end, prepared, options, objective) if celled else None
            if beyond is None:
                return end.settled
            model, end = beyond.found.fitted, replace(beyond, step=np.inf, steps=steps)
        before = end.cost
        celled = objective.correction.cells.around(model) is not None
        extra = added_slopes(objective, _values(model))
    return end


def again(
    end: InsideEnd, prepared: RecordSet, options: JointOptions, objective: Objective
) -> InsideEnd:
    """From an end once more, by other errors of the response; raises as `search_inside`."""
    moved = search_inside(end.found.fitted, prepared, options, objective, end.extra)
    return replace(moved, step=max(end.step, moved.step), steps=end.steps + moved.steps)


def _none(objective: Objective) -> Curves:
    n_free = len(objective.model.parameters.free)
    return [np.zeros((n_free, len(each.places)), complex) for each in objective.selected]


def _values(model: GreyBoxModel) -> Array:
    return np.array([parameter.value or 0.0 for parameter in model.parameters.free])


def _turn(
    model: GreyBoxModel,
    prepared: RecordSet,
    options: JointOptions,
    objective: Objective,
    extra: Curves,
    *,
    celled: bool,
) -> InsideEnd:
    """One search; its step is how far the response's residuals went, a parameter."""
    inside = InsideResiduals(objective, extra)
    free = model.parameters.free
    bounds = objective.correction.cells.around(model) if celled else None
    if bounds is not None:
        low = np.maximum(bounds[0], [parameter.minimum for parameter in free])
        bounds = low, np.minimum(bounds[1], [parameter.maximum for parameter in free])
    found = searched(model, prepared, options, written=inside.written, bounds=bounds)
    last = inside.here
    assert last is not None
    assert inside.jacobian is not None
    moved = inside.jacobian @ (last.x - _values(model))
    misfit = last.cost / len(last.residuals)
    size = float(np.linalg.norm(moved) / np.sqrt(len(free) * max(1.0, misfit)))
    return InsideEnd(found, inside.extra, misfit, found.groups[0][0].iterations, size)


def _beyond(
    end: InsideEnd, prepared: RecordSet, options: JointOptions, objective: Objective
) -> InsideEnd | None:
    """A lower cost across a jump at which the search stands."""
    model = end.found.fitted
    bounds = objective.correction.cells.around(model)
    if bounds is None:
        return None
    x, best = _values(model), None
    for edge, way in zip(bounds, (-1.0, 1.0), strict=True):
        for place in np.flatnonzero(np.isclose(x, edge, rtol=1e-9, atol=0.0)):
            there = x.copy()
            there[place] += way * ACROSS * (bounds[1][place] - bounds[0][place])
            parameter = model.parameters.free[place]
            if not parameter.minimum <= there[place] <= parameter.maximum:
                continue
            if SearchPoint.of(objective, there) is None:
                continue
            other = _turn(objective.at(there), prepared, options, objective, end.extra, celled=True)
            if other.cost < (best or end).cost:
                best = other
    return best
