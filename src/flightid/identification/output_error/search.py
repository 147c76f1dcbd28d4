"""The search of output error: starts, growing modes, whole samples of delays (`likelihood.rs`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError, FlightidError
from flightid.frozen import dataclass
from flightid.identification.delay_cells import DelayCells, beyond_jumps
from flightid.identification.multistart import End, cluster, collect, draw_starts
from flightid.identification.output_error.beside import WhitenedResponses, WrittenResiduals
from flightid.identification.output_error.distinct import require_distinct
from flightid.identification.output_error.equation_records import (
    EquationRuns,
    equation_runs,
    segmented_starts,
)
from flightid.identification.records.options import RecordOptions
from flightid.identification.records.setup import RecordSet
from flightid.identification.regression.fourier_output_error_fit import fit_fourier_output_error
from flightid.identification.regression.options import FourierOutputErrorOptions
from flightid.models import GreyBoxModel, StateSpaceModel

Array = NDArray[np.float64]
ROUNDS = 3
"""Most searches with a new choice of the modes that are set at the end of a record."""
NativeEnd = tuple[Array, float, Array, list[Array], list[list[bool]], int, str]


@dataclass(frozen=True)
class RecordEnd(End):
    """Where one start ended: also R, each record's own numbers and which are determined."""

    noise: Array
    own: list[Array]
    determined: list[list[bool]]

    @classmethod
    def of_native(cls, found: NativeEnd) -> RecordEnd:
        """From the native half's order."""
        x, cost, noise, own, determined, iterations, termination = found
        return cls(x, cost, iterations, termination, noise, own, determined)


@dataclass(frozen=True)
class SearchEnd:
    """Where a search over records ended.

    Attributes
    ----------
    model : TransferFunctionModel or StateSpaceModel
        From which the last round started.
    prepared : RecordSet
    runs_of : EquationRuns or None
    groups : list of list of RecordEnd
        Ends of all starts, best group first.
    """

    model: GreyBoxModel
    prepared: RecordSet
    runs_of: EquationRuns | None
    groups: list[list[RecordEnd]]

    @property
    def fitted(self) -> GreyBoxModel:
        """The model at the best end."""
        return with_estimates(self.model, self.groups[0][0])


def searched(
    model: GreyBoxModel,
    prepared: RecordSet,
    options: RecordOptions,
    responses: WhitenedResponses | None = None,
    written: WrittenResiduals | None = None,
    bounds: tuple[Array, Array] | None = None,
) -> SearchEnd:
    """Search, again where the estimates have other growing modes than their start.

    Parameters
    ----------
    model : TransferFunctionModel or StateSpaceModel
    prepared : RecordSet
    options : RecordOptions
    responses : WhitenedResponses, optional
        Fitted together with the records.
    written : WrittenResiduals, optional
        The same, of other data.
    bounds : tuple of ndarray, optional
        Of the free parameters, lower and upper; default: the model's.

    Raises
    ------
    FitError
        No start led anywhere.
    """
    starts = options
    for turn in range(ROUNDS):
        runs_of = equation_runs(model, prepared)
        placed = prepared if runs_of is None else segmented_starts(prepared, runs_of)
        placed = replace(placed, model=model)
        if turn == 0 and responses is None and written is None:
            require_distinct(model, placed, runs_of)
        ends = search_records(placed, starts, runs_of, responses, written, bounds)
        fitted = with_estimates(model, ends[0])
        after = equation_runs(fitted, prepared)
        if _growing(after) == _growing(runs_of) or turn == ROUNDS - 1:
            break
        # Transforms start from where they ended: a second time they say the same.
        model = fitted if turn else _overgrown(model, fitted, after, placed)
        starts = replace(options, starts=1)
    if bounds is None and written is None:
        ends = _beyond_jumps(ends, placed, starts, runs_of, responses)
    return SearchEnd(model, placed, runs_of, cluster(ends))


def _beyond_jumps(
    ends: list[RecordEnd],
    prepared: RecordSet,
    options: RecordOptions,
    runs_of: EquationRuns | None,
    responses: WhitenedResponses | None,
) -> list[RecordEnd]:
    """Ends of all starts, the best of them followed across whole samples of delays."""

    def search(
        end: RecordEnd, x: Array, bounds: tuple[Array, Array], iterations: int | None
    ) -> RecordEnd | None:
        own = [start.filled(found) for start, found in zip(prepared.own, end.own, strict=True)]
        placed = replace(prepared, own=own, model=with_estimates(prepared.model, end, x))
        steps = iterations or options.maximum_iterations
        once = replace(options, starts=1, maximum_iterations=steps)
        try:
            return search_records(placed, once, runs_of, responses, bounds=bounds)[0]
        except FitError:
            return None

    free = prepared.model.parameters.free
    limits = np.array([p.minimum for p in free]), np.array([p.maximum for p in free])
    cells = DelayCells(tuple({dt for _, _, dt in prepared.arrays}), prepared.hold)
    best = beyond_jumps(ends[0], prepared.model, cells, limits, search)
    return [best, *ends[1:]]


def _overgrown(
    model: GreyBoxModel, fitted: GreyBoxModel, after: EquationRuns | None, prepared: RecordSet
) -> GreyBoxModel:
    """Where to search from, once the estimates grow otherwise than the model that was run.

    A run from the first sample to the last of a vehicle that turns out unstable tells nothing, and
    its estimates may grow without bound. Transforms of the records do not care which modes grow.
    """
    if not (after is not None and after.is_segmented and isinstance(model, StateSpaceModel)):
        return fitted
    options = FourierOutputErrorOptions(hold=prepared.hold)
    try:
        found: GreyBoxModel = fit_fourier_output_error(model, prepared.records, options).model
        return found
    except FlightidError:
        # A nonlinear model, or records too short to transform: what was found is all there is.
        return fitted


def _growing(runs: EquationRuns | None) -> list[int]:
    return [] if runs is None or not runs.is_segmented else runs.n_growing


def with_estimates(model: GreyBoxModel, end: RecordEnd, x: Array | None = None) -> GreyBoxModel:
    """The model with an end's values, or with others, of its free parameters."""
    names = [parameter.name for parameter in model.parameters.free]
    values = end.x if x is None else x
    return model.with_values(dict(zip(names, map(float, values), strict=True)))


def search_records(
    prepared: RecordSet,
    options: RecordOptions,
    runs_of: EquationRuns | None = None,
    responses: WhitenedResponses | None = None,
    written: WrittenResiduals | None = None,
    bounds: tuple[Array, Array] | None = None,
) -> list[RecordEnd]:
    """Ends of all starts, best first; no statistics."""
    model = prepared.model
    free = model.parameters.free
    native = model.native if runs_of is None else runs_of.native
    if bounds is None:
        bounds = np.array([p.minimum for p in free]), np.array([p.maximum for p in free])
    beside = (responses,) if written is None else (responses, written)
    found = native.fit_records(
        model.parameters.independent_values(),
        model.parameters.free_indices,
        prepared.arrays,
        [numbers.native for numbers in prepared.own],
        prepared.hold,
        (options.noise_covariance == "full", options.limit, options.consistency),
        (draw_starts(free, options.starts, options.seed), *bounds, options.maximum_iterations),
        *beside,
    )
    return collect([each if isinstance(each, str) else RecordEnd.of_native(each) for each in found])
