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

from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.fit_findings import (
    judge_correlation,
    judge_parameters,
    judge_search,
)
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.frequency_domain.feedback_findings import judge_feedback
from flightid.identification.multistart import local_minima
from flightid.identification.output_error.distinct import run_with_slopes
from flightid.identification.output_error.equation_records import (
    EquationRuns,
    judge_runs,
)
from flightid.identification.output_error.free_runs import (
    keeping_outputs,
    runs_by_record,
    runs_of_own,
)
from flightid.identification.output_error.process_noise import TURBULENT, judge_process_noise
from flightid.identification.output_error.search import (
    RecordEnd,
    SearchEnd,
    searched,
    with_estimates,
)
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
    fitted = with_estimates(model, best)
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
        if not judged()
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
        *judge_fit(
            costs, found.colour, lambda: explained_percent(prepared.records, fitted.outputs)
        ),
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
