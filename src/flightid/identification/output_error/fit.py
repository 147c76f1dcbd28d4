"""Output error: maximum likelihood of records in the time domain (native: `likelihood.rs`).

The model runs free through every record. Minimised is ½ Σ vᵀR⁻¹v + (N/2) ln det R of measured minus
model v, over the model's parameters and each record's initial state, biases and reference shifts.
Its time goes into sensitivities: `linear_sensitivities.rs`, `trajectories/sensitivity.rs`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import (
    judge_correlation,
    judge_parameters,
    judge_search,
)
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.frequency_domain.feedback_findings import judge_feedback
from flightid.identification.multistart import End, cluster, collect, draw_starts, local_minima
from flightid.identification.output_error.beside import WhitenedResponses, WrittenResiduals
from flightid.identification.output_error.distinct import require_distinct, run_with_slopes
from flightid.identification.output_error.equation_records import (
    EquationRuns,
    equation_runs,
    judge_runs,
    segmented_starts,
)
from flightid.identification.output_error.free_runs import (
    keeping_outputs,
    runs_by_record,
    runs_of_own,
)
from flightid.identification.output_error.process_noise import TURBULENT, judge_process_noise
from flightid.identification.records.findings import judge_channels, judge_fit
from flightid.identification.records.options import RecordOptions, chosen
from flightid.identification.records.record_parameters import RecordParameters
from flightid.identification.records.setup import RecordSet, prepare_records
from flightid.identification.records.statistics import (
    HeldStart,
    RecordStatistics,
    record_statistics,
)
from flightid.identification.records.white_noise import explained_percent
from flightid.identification.regression.equation_error import equation_error_start
from flightid.identification.regression.fourier_output_error_fit import fit_fourier_output_error
from flightid.identification.regression.options import FourierOutputErrorOptions
from flightid.identification.rival_fits import judged
from flightid.identification.withheld_intervals import without_intervals
from flightid.models import GreyBoxModel, StateSpaceModel
from flightid.models.state_space.first_sample import first_outputs
from flightid.record import Channel, Record, Step
from flightid.uncertainty.blocks import JointResiduals
from flightid.version import VERSION

Array = NDArray[np.float64]
_NEAR = 0.5 * np.log(1.1)
"""Log-likelihood of a sample whose residual variance is ten percent larger."""
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


def fit_output_error(
    model: GreyBoxModel, data: Record | Sequence[Record], options: RecordOptions
) -> Fit:
    """Fit a model to records by output error; see `flightid.identify`."""
    if options.record_parameters:
        own = RecordParameters.of(model, data, options.record_parameters)
        shifted = chosen(options.input_bias, model.inputs, "input_bias")
        freed = (*(model.inputs[place] for place in shifted), *own.estimated)
        inner = replace(options, record_parameters=(), input_bias=freed)
        return own.restored(fit_output_error(own.model, own.records, inner))
    if options.start_from == "equation_error":
        model = equation_error_start(model, data)
    prepared = prepare_records(model, data, options)
    setup = judge_channels(prepared)
    return conclude(searched(model, prepared, options), options, setup)


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
        return _with_estimates(self.model, self.groups[0][0])


def conclude(
    found: SearchEnd,
    options: RecordOptions,
    setup: Sequence[Finding],
    beside: JointResiduals | None = None,
) -> Fit:
    """The result of a search.

    Parameters
    ----------
    found : SearchEnd
    options : RecordOptions
    setup : sequence of Finding
        Put before those of the fit.
    beside : JointResiduals, optional
        Residuals of unit variance that were fitted together with the records.

    Raises
    ------
    FitError
        The data do not see a parameter, or a combination of parameters.
    """
    model, prepared, runs_of, groups = found.model, found.prepared, found.runs_of, found.groups
    best = groups[0][0]
    fitted = _with_estimates(model, best)
    own = [start.filled(end) for start, end in zip(prepared.own, best.own, strict=True)]
    ran = own
    outputs: list[Array] = []
    runs = keeping_outputs(runs_by_record(fitted, prepared, runs_of, ran), outputs)
    if runs_of is not None:
        own = [runs_of.start(fitted, prepared, k, numbers) for k, numbers in enumerate(own)]
        setup = [*setup, *judge_runs(runs_of)]
    starts = [_held_start(fitted, prepared, runs_of, k, best.noise) for k in range(len(own))]
    known = record_statistics(
        fitted, prepared, own, best.determined, runs, best.noise, options.limit, beside, starts
    )
    setup = [*setup, *judge_feedback(known.names, known.covariance, known.bias)]
    noise = (
        []
        if not judged() or (runs_of is not None and runs_of.is_segmented)
        else judge_process_noise(
            fitted,
            prepared.arrays,
            outputs
            if known.agreement.freedom is None
            else runs_of_own(prepared, runs_by_record(fitted, prepared, runs_of, ran), best.noise),
        )
    )
    fit = _assemble(fitted, prepared, options, groups, outputs, known, setup, noise)
    return without_intervals(fit, TURBULENT) if noise else fit


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
        groups = cluster(search_records(placed, starts, runs_of, responses, written, bounds))
        fitted = _with_estimates(model, groups[0][0])
        after = equation_runs(fitted, prepared)
        if _growing(after) == _growing(runs_of):
            break
        model, starts = _overgrown(model, fitted, after, placed), replace(options, starts=1)
    return SearchEnd(model, placed, runs_of, groups)


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


def _with_estimates(model: GreyBoxModel, end: RecordEnd) -> GreyBoxModel:
    names = [parameter.name for parameter in model.parameters.free]
    return model.with_values(dict(zip(names, map(float, end.x), strict=True)))


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


def _held_start(
    fitted: GreyBoxModel,
    prepared: RecordSet,
    runs_of: EquationRuns | None,
    place: int,
    noise: Array,
) -> HeldStart | None:
    """What noise of a record's measured initial states does to its outputs."""
    own = prepared.own[place]
    if not (own.held and isinstance(fitted, StateSpaceModel)):
        return None
    held = list(own.held)
    moved = replace(own, free_initial=held, free_shift=[], free_bias=[], limits=[])
    slopes = run_with_slopes(fitted, prepared, runs_of, place, moved)[1]
    inputs, outputs, _ = prepared.arrays[place]
    covariance = first_outputs(fitted, inputs, outputs).noise(noise)[np.ix_(held, held)]
    return HeldStart(slopes[:, :, len(fitted.parameters.free) :], covariance)


def _fitted_records(
    prepared: RecordSet,
    runs: Sequence[Array],
    found: RecordStatistics,
) -> tuple[FittedRecord, ...]:
    model = prepared.model
    result = []
    for place, record in enumerate(prepared.records):
        outputs = runs[place] + prepared.offsets[place]
        known = record.channels
        channels = [known[name] for name in model.inputs]
        channels += [
            Channel(name, known[name].unit, known[name].role, "model") for name in model.outputs
        ]
        made = record.replace(
            dict(zip(model.outputs, outputs, strict=True)),
            channels=channels,
            step=Step("identify", {"method": "output error"}),
        )
        result.append(FittedRecord(record, made, model.outputs, *found.own[place]))
    return tuple(result)


def _assemble(
    fitted: GreyBoxModel,
    prepared: RecordSet,
    options: RecordOptions,
    groups: Sequence[Sequence[RecordEnd]],
    runs: Sequence[Array],
    found: RecordStatistics,
    setup: Sequence[Finding],
    noise: Sequence[Finding],
) -> Fit:
    best = groups[0][0]
    records = _fitted_records(replace(prepared, model=fitted), runs, found)
    costs = _costs(records, fitted.outputs)
    findings = (
        *setup,
        *judge_search(groups, best.cost + _NEAR * prepared.n_samples * len(fitted.outputs)),
        *judge_parameters(found.parameters),
        *judge_correlation(found.names, found.correlation, found.parameters),
        *judge_fit(costs, found.colour, explained_percent(prepared.records, fitted.outputs)),
        *noise,
    )
    return Fit(
        model=fitted,
        parameters=found.parameters,
        cost=sum(costs.values()),
        average_cost=sum(costs.values()) / len(costs),
        costs=costs,
        names=found.names,
        covariance=found.covariance,
        correlation=found.correlation,
        responses=(),
        minima=local_minima(groups, [parameter.name for parameter in fitted.parameters.free]),
        objective=best.cost,
        termination=best.termination,
        iterations=best.iterations,
        intervals_from="coloured residuals",
        findings=findings,
        provenance=_provenance(prepared, options),
        records=records,
        noise_covariance=best.noise,
        agreement=found.agreement,
        input_correlations=found.correlations,
    )


def _costs(records: Sequence[FittedRecord], outputs: Sequence[str]) -> dict[str, float]:
    """Percent of each output's variance, about the mean of each record, left in the residuals."""
    result = {}
    for name in outputs:
        left = sum(float(np.sum(each.residual(name) ** 2)) for each in records)
        spread = sum(
            float(np.sum((each.measured[name] - np.mean(each.measured[name])) ** 2))
            for each in records
        )
        result[name] = 100.0 * left / spread
    return result


def _provenance(prepared: RecordSet, options: RecordOptions) -> dict[str, object]:
    return {
        "method": "output error",
        "flightid": VERSION,
        "data_history": [[str(step) for step in record.history] for record in prepared.records],
        "options": options.to_dict(),
    }
