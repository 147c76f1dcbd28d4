"""Fits of black boxes from what their estimators leave: records, errors, costs, provenance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.details import Details
from flightid.identification.fit import Fit
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.local_minimum import LocalMinimum
from flightid.models import Model
from flightid.record import Channel, Record, Step
from flightid.uncertainty import correlation
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.fitted_correlation import FittedCorrelation
from flightid.version import VERSION

Array = NDArray[np.float64]
WHITE, COLOURED = "white prediction errors", "coloured residuals"


@dataclass(frozen=True, eq=False)
class BlackBoxRuns:
    """What a model makes of the records of its fit.

    Attributes
    ----------
    records : tuple of Record
    free : tuple of ndarray, shape (p, n_samples)
        Outputs in free run, operating point included.
    errors : tuple of ndarray, shape (p, n_counted)
        Prediction errors one step ahead, those of each start left out.
    white : bool
        Whether a good model leaves these errors white.
    """

    records: tuple[Record, ...]
    free: tuple[Array, ...]
    errors: tuple[Array, ...]
    white: bool = True


@dataclass(frozen=True, eq=False)
class BlackBoxEstimates:
    """Estimates of a model with their covariance, what it rests on, and whether parts agree."""

    parameters: Mapping[str, Estimate]
    names: tuple[str, ...]
    covariance: Array | None
    source: str = WHITE
    agreement: Agreement | None = None
    correlations: tuple[FittedCorrelation, ...] = ()


def black_box_fit(
    model: Model,
    runs: BlackBoxRuns,
    estimates: BlackBoxEstimates,
    minima: tuple[LocalMinimum, ...],
    *,
    iterations: int,
    noise_covariance: Array,
    findings: Sequence[Finding],
    provenance: Mapping[str, object],
    details: Details,
) -> Fit:
    """The fit of a black box."""
    covariance, agreement = estimates.covariance, estimates.agreement
    if covariance is None:
        agreement = agreement and agreement.without_bars()
    costs = _costs(runs, model.outputs)
    return Fit(
        model=model,
        parameters=estimates.parameters,
        cost=sum(costs.values()),
        average_cost=sum(costs.values()) / len(costs),
        costs=costs,
        names=() if covariance is None else estimates.names,
        covariance=covariance,
        correlation=np.zeros((0, 0)) if covariance is None else correlation(covariance),
        responses=(),
        minima=minima,
        objective=minima[0].objective,
        termination=minima[0].termination,
        iterations=iterations,
        intervals_from="nothing" if covariance is None else estimates.source,
        findings=tuple(findings),
        provenance=provenance,
        records=tuple(
            FittedRecord(record, _modelled(record, model, rows), tuple(model.outputs))
            for record, rows in zip(runs.records, runs.free, strict=True)
        ),
        noise_covariance=noise_covariance,
        prediction_errors=tuple(
            _in_place(record, model.outputs, rows)
            for record, rows in zip(runs.records, runs.errors, strict=True)
            if rows.shape[1] > 1
        ),
        residual_horizon=1 if runs.white else "free_run",
        details=details,
        agreement=agreement,
        input_correlations=estimates.correlations,
    )


def provenance_of(
    method: str,
    records: Sequence[Record],
    offsets: Sequence[Mapping[str, float]],
    options: Mapping[str, object],
) -> dict[str, object]:
    """Where a fit comes from: the method, what was done to the data, and all options."""
    return {
        "method": method,
        "flightid": VERSION,
        "data_history": [str(step) for record in records for step in record.history],
        "records": [record.name for record in records],
        "offsets": [dict(row) for row in offsets],
        "options": dict(options),
    }


def _costs(runs: BlackBoxRuns, outputs: Sequence[str]) -> dict[str, float]:
    """Percent of each output's variance, about the mean of each record, left in the errors."""
    found = {}
    for place, name in enumerate(outputs):
        left = sum(float(rows[place] @ rows[place]) for rows in runs.errors)
        about = [
            record[name][record.n_samples - rows.shape[1] :]
            for record, rows in zip(runs.records, runs.errors, strict=True)
        ]
        spread = sum(float(np.sum((row - row.mean()) ** 2)) for row in about if row.size)
        if not spread > 0.0:
            raise DataError(
                "an output does not change where it is predicted",
                found=f"{name} constant after the first samples of each record",
                needed="an output that moves after as many samples as the model has lags",
                action="give longer records, or leave that output out",
            )
        found[name] = 100.0 * left / spread
    return found


def _modelled(record: Record, model: Model, rows: Array) -> Record:
    known = record.channels
    channels = [known[name] for name in model.inputs]
    channels += [
        Channel(name, known[name].unit, known[name].role, "model") for name in model.outputs
    ]
    outputs = dict(zip(model.outputs, rows, strict=True))
    return record.replace(outputs, channels=channels, step=Step("identify", {}))


def _in_place(record: Record, outputs: Sequence[str], errors: Array) -> Record:
    """The last samples of a record with errors in place of its outputs."""
    skip = record.n_samples - errors.shape[1]
    if skip:
        time_s, half = record.time_s, 0.5 * record.sample_time_s
        record = record.segment(time_s[skip] - half, time_s[-1] + half, name=record.name)
    return record.replace(dict(zip(outputs, errors, strict=True)))
