"""What a fit hands over to the gate: its data, bands, findings, end, and declared signs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.evidence import Evidence, gather_evidence
from flightid.evidence.explained import ExplainedRun
from flightid.evidence.gather import FitFacts
from flightid.evidence.parameter_checks import Signed
from flightid.evidence.spans import Span
from flightid.identification.fit import Fit
from flightid.identification.fitted_response import FittedResponse
from flightid.identification.prediction.continuous import predict_continuous
from flightid.identification.prediction.remembered import of_record
from flightid.identification.prediction.request import FREE_RUN, Request
from flightid.identification.records.options import ESTIMATE
from flightid.models import StateSpaceModel
from flightid.models.innovations.model import InnovationsModel
from flightid.models.narx.model import NarxModel
from flightid.models.parameters import Parameters
from flightid.models.polynomial.gain_and_speed import gain_and_speed
from flightid.models.polynomial.model import PolynomialModel
from flightid.record.hold import Loop
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.unseen_scatter import UnseenScatter

FILTER_ERROR = "filter_error"
"""The method whose records hold predictions one sample ahead."""
NOT_NEGATIVE_BY_NATURE = "s"
"""Delays and time constants: a bound at zero declares no sign."""


def evidence_of(fit: Fit, data: Sequence[Any], loop: Loop | None = None) -> Evidence:
    """Examine a fit as far as its own data and end allow.

    Parameters
    ----------
    fit : Fit
    data : sequence of FrequencyResponse or Record
        What it was made from.
    loop : {"open", "closed"}, optional
        The caller's word.
    """
    asked = getattr(fit.structure, "parameters", None)
    return gather_evidence(
        FitFacts(
            data,
            tuple(fit.model.inputs),
            tuple(fit.model.outputs),
            [_span(each) for each in fit.responses],
            fit.findings,
            fit.termination,
            _signs(asked, fit.parameters) if isinstance(asked, Parameters) else {},
            loop,
            fit.agreement,
            _compared(fit),
            _at_once(fit.model),
            _free_runs(fit),
            _unseen(fit),
        )
    )


def _free_runs(fit: Fit) -> list[ExplainedRun]:
    """Runs of equations through records; black boxes are judged by what they foretell."""
    if fit.details is None and fit.method == FILTER_ERROR:
        return _unfiltered(fit)
    if fit.details is not None or fit.residual_horizon != "free_run":
        return []
    return [
        ExplainedRun(
            each.measured.matrix(each.outputs),
            each.modelled.matrix(each.outputs),
            each.measured.sample_time_s,
        )
        for each in fit.records
        if tuple(each.outputs) == tuple(fit.model.outputs)
    ]


def _unfiltered(fit: Fit) -> list[ExplainedRun]:
    """Runs that inputs alone drive: what a filter foretells from outputs explains no band."""
    told = fit.provenance.get("options")
    told = told if isinstance(told, Mapping) else {}
    request = Request(
        FREE_RUN,
        ESTIMATE,
        0.0,
        bool(told.get("input_bias")),
        bool(told.get("output_bias")),
        told.get("hold", "first"),
    )
    found = []
    for each in fit.records:
        try:
            model, outputs = of_record(fit, fit.model, each.measured), tuple(each.outputs)
            assert isinstance(model, StateSpaceModel)
            run = predict_continuous(model, each.measured, outputs, request)
        except FlightidError:
            return []
        measured, modelled = (side.matrix(outputs) for side in (run.measured, run.predicted))
        found.append(ExplainedRun(measured, modelled, each.measured.sample_time_s))
    return found


def _at_once(model: object) -> tuple[str, ...]:
    """Inputs of a sampled model that its outputs answer within the same sample."""
    if isinstance(model, PolynomialModel):
        return tuple(name for name, k in zip(model.inputs, model.nk, strict=True) if k == 0)
    if isinstance(model, NarxModel):
        return tuple(dict.fromkeys(lag.channel for lag in model.structure.lags if lag.lag == 0))
    if isinstance(model, InnovationsModel):
        return tuple(np.asarray(model.inputs)[np.any(model.d != 0.0, axis=0)].tolist())
    return ()


def _compared(fit: Fit) -> NDArray[np.float64] | None:
    """Estimates whose parts were compared; None where it is not known which those are."""
    compared = _estimates(fit)
    return None if compared is None else np.array([each.value for each in compared.values()])


def _unseen(fit: Fit) -> UnseenScatter | None:
    """What records that agree cannot exclude, beside the bars that are shown."""
    compared = _estimates(fit)
    if compared is None or fit.agreement is None or fit.agreement.compared is None:
        return None
    values = np.array([each.value for each in compared.values()])
    stderr = np.array([each.stderr or 0.0 for each in compared.values()])
    if isinstance(fit.model, PolynomialModel):
        # Speed moves whole polynomials, of which a fit may compare the plant's terms alone.
        every = fit.model.structure.names
        moves = gain_and_speed(every, np.array([fit.parameters[name].value for name in every]))
        moves = moves[[every.index(name) for name in compared]]
    elif isinstance(getattr(fit.structure, "parameters", None), Parameters):
        moves = np.diag(values)
    else:
        return None
    return fit.agreement.compared.unseen(moves, stderr)


def _estimates(fit: Fit) -> dict[str, Estimate] | None:
    if fit.agreement is None:
        return None
    free = tuple(name for name, each in fit.parameters.items() if each.status == "free")
    # Of a polynomial with noise of its own, parts are compared in the vehicle's terms alone.
    vehicle = tuple(name for name in fit.parameters if name[0] in "bf")
    for names in (fit.names, free, *([vehicle] if isinstance(fit.model, PolynomialModel) else [])):
        if len(names) == fit.agreement.by_noise.size:
            return {name: fit.parameters[name] for name in names}
    return None


def _span(response: FittedResponse) -> Span:
    low, high = response.band_rad_s
    measured = response.measured
    inside = (measured.omega_rad_s >= low) & (measured.omega_rad_s <= high)
    return Span(response.name, (low, high), float(np.mean(measured.coherence[inside])))


def _signs(asked: Parameters, found: Mapping[str, Estimate]) -> dict[str, Signed]:
    """Free parameters whose bounds leave one sign."""
    signs: dict[str, Signed] = {}
    for parameter in asked.free:
        estimate = found.get(parameter.name)
        if estimate is None or estimate.unit == NOT_NEGATIVE_BY_NATURE:
            continue
        sign = (parameter.minimum >= 0.0) - (parameter.maximum <= 0.0)
        if sign:
            status = estimate.status or ""
            signs[parameter.name] = (sign, estimate.value, estimate.interval95, status)
    return signs
