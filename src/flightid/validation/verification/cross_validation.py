"""The verb `cross_validate`: black-box models on records that their fit has not seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.prediction.predict import predict
from flightid.models import NarxModel
from flightid.record import Record
from flightid.validation.verification.cross_validation_result import (
    LINEAR,
    MODEL,
    CrossRun,
    CrossValidation,
    horizon_words,
)

THEIL_GOOD, THEIL_USABLE = 0.25, 0.30
FREE_RUN = "free_run"


def cross_validate(
    fit: Fit,
    records: Record | Sequence[Record],
    *,
    horizons: Sequence[int | str] = (FREE_RUN, 1),
) -> CrossValidation:
    """Predict records and say how well, with horizon and initial state beside every number.

    Of a NARX model the linear model of the same lags runs beside it. Polynomial models take
    offsets as in their fit, and an initial state that is solved for in each record; NARX models
    start from the first measured outputs, which are not scored.

    Assumes records that neither fit nor choice of structure has used. Biased upwards where a
    record is short against the slowest mode: a free initial state can then imitate a response.

    Parameters
    ----------
    fit : Fit
    records : Record or sequence of Record
        With the model's channels, units and sample time.
    horizons : sequence of int or "free_run"
        Samples ahead; free runs are judged, others shown.

    Returns
    -------
    CrossValidation

    Raises
    ------
    OptionError
        No record or no horizon, or a horizon that is not known.
    DataError
        Another sample time, an output that does not change, or a record shorter than the lags.
    UnitError
        A channel in another unit.
    UnknownNameError
        A channel is missing.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 16.5; Billings, *Nonlinear System
    Identification*, Wiley 2013, section 5.5; guide for Theil's coefficient: Tischler & Remple,
    *Aircraft and Rotorcraft System Identification*, 2nd ed., section 14.4.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> truth = fid.PolynomialModel("y", ("u",), 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
    >>> def fly(seed):
    ...     u = np.random.default_rng(seed).standard_normal(300)
    ...     record = fid.Record.from_arrays(np.arange(300) / 10, inputs={"u": u},
    ...                                     outputs={"y": np.zeros(300)})
    ...     return record.replace({"y": truth.simulate(record)})
    >>> fit = fid.identify(fid.PolynomialModel.arx("u", "y", na=2, nb=2), fly(0))
    >>> cross_validate(fit, fly(1)).runs[0].theil < 0.01
    True
    """
    flown = [records] if isinstance(records, Record) else list(records)
    if not flown or not horizons:
        raise OptionError("there is nothing to validate on", needed="a record and a horizon")
    for record in flown:
        name = fit.model.output
        if np.ptp(record[name]) == 0.0:
            raise DataError(
                f"output {name!r} of record {record.name!r} does not change",
                action="choose another record",
            )
    runs = tuple(
        run for record in flown for horizon in horizons for run in _runs(fit, record, horizon)
    )
    return CrossValidation(fit.model.output, runs, tuple(_findings(runs)))


def _runs(fit: Fit, record: Record, horizon: int | str) -> list[CrossRun]:
    output, words = fit.model.output, horizon_words(horizon)
    named: list[tuple[str, object]] = [(MODEL, fit.model)]
    if isinstance(fit.model, NarxModel):
        named.append((LINEAR, fit.details.baseline))
    runs = []
    for name, model in named:
        made = predict(model, record, horizon)
        held = made.diverged_at is not None
        values = made.predicted[output]
        runs.append(
            CrossRun(record, output, name, words, made.initial_state, values, made.start, held)
        )
    return runs


def _findings(runs: Sequence[CrossRun]) -> list[Finding]:
    found = []
    judged = [run for run in runs if run.horizon == horizon_words(FREE_RUN)]
    for run in (each for each in judged if each.model == MODEL):
        light = Light.GREEN if run.theil <= THEIL_GOOD else Light.AMBER
        light = light if run.theil <= THEIL_USABLE else Light.RED
        message = (
            f"{run.record.name}: Theil's coefficient {run.theil:.2f} in free run "
            f"(guide: at most 0.25 to 0.30), fit {run.fit_percent:.0f} %"
        )
        action = "" if light is Light.GREEN else "look at residual tests and coherence"
        found.append(Finding("free-run", light, message, action))
        if run.held:
            found.append(
                Finding(
                    "free-run-unstable",
                    Light.RED,
                    f"{run.record.name}: the free run left the range of training and was held",
                    "use fewer terms, or records that cover the manoeuvre",
                )
            )
        linear = [each for each in judged if each.record is run.record and each.model == LINEAR]
        if linear and run.rms > linear[0].rms * (1 + 1e-9):
            found.append(
                Finding(
                    "loses-to-linear",
                    Light.AMBER,
                    f"{run.record.name}: the linear model of the same lags runs better (rms "
                    f"{linear[0].rms:.4g} against {run.rms:.4g})",
                    "use the linear model, or train on records that cover the manoeuvre",
                )
            )
    return found
