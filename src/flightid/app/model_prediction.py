"""What a worker does while a slider of a parameter moves: measured against predicted."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.app.model_schemas import ModelPrediction, PredictedCurve, PredictedResponse
from flightid.app.study_edits import KeyEdit, edited
from flightid.app.study_reach import draft_inside
from flightid.app.work import KEPT
from flightid.errors import DataError, FlightidError, StudyError
from flightid.models import GreyBoxModel
from flightid.record.hold import InputHold
from flightid.responses import FrequencyResponse
from flightid.study.model_preview import ModelPreview, preview_model
from flightid.validation import Verification, verify

COLUMNS = 400
"""Of a time history on the page: each keeps its least and its largest value."""


def predict_model(
    study: Path, text: str, edits: Sequence[KeyEdit], name: str, values: Mapping[str, float]
) -> dict[str, Any]:
    """Predict with other values of free parameters; what does not depend on them is kept.

    Raises
    ------
    StudyError
        The model has no equations.
    ModelError
        A value lies outside its bounds.
    """
    begun = time.process_time()
    seen, holds = _prepared(study, text, edits, name)
    if seen.model is None:
        raise StudyError("this model has no equations", found=name, needed="a template")
    model = seen.model.with_values(dict(values)) if values else seen.model
    refusal, curves = "", []
    try:
        curves = _curves(model, seen, holds)
    except FlightidError as error:
        refusal = str(error)
    responses = [] if seen.response is None else _responses(model, seen.response)
    told = ModelPrediction(curves=curves, responses=responses, refusal=refusal).model_dump()
    return {"prediction": told, "processor_s": time.process_time() - begun}


def _prepared(
    study: Path, text: str, edits: Sequence[KeyEdit], name: str
) -> tuple[ModelPreview, dict[str, InputHold]]:
    """What is predicted, and how inputs were taken between samples, by record, once one was."""
    now = edited(text, edits) if edits else text
    key = f"prediction: {study} {name} {now}"
    found = KEPT.get(key)
    if not isinstance(found, ModelPreview) or KEPT.get(f"{key} file") != _written(found):
        with draft_inside(study, now) as draft:
            found = preview_model(draft, name, data=True, cache=KEPT)
        KEPT[key], KEPT[f"{key} file"] = found, _written(found)
        KEPT[f"{key} holds"] = {}
    return found, KEPT.setdefault(f"{key} holds", {})


def _written(seen: ModelPreview) -> int:
    """When the model file was written; 0 for a model of the library."""
    template = str(seen.settings.template)
    return Path(template).stat().st_mtime_ns if template.endswith(".toml") else 0


def _curves(
    model: GreyBoxModel, seen: ModelPreview, holds: dict[str, InputHold]
) -> list[PredictedCurve]:
    outputs = seen.settings.outputs or model.outputs
    made: list[PredictedCurve] = []
    for name, records in (seen.records or {}).items():
        held = [each for each in outputs if all(each in record for record in records)]
        if not held:
            continue
        options = {**seen.settings.check.options}
        if options.get("hold") is None and name in holds:
            # Told, what the first prediction assumed is not weighed against other holds again.
            options["hold"] = holds[name]
        found = verify(model, records, outputs=held, **options)
        assert isinstance(found, Verification)
        if found.hold is not None:
            holds[name] = found.hold
        if not all(np.isfinite(found.predicted[each]).all() for each in held):
            raise DataError("the prediction grows without bound", needed="a stable model")
        made += [_curve(name, output, found) for output in held]
    return made


def _curve(record: str, output: str, found: Verification) -> PredictedCurve:
    measured, predicted = found.measured, found.predicted
    drawn = (measured[output], predicted[output])
    time_s, *rows = _thinned(measured.time_s, *drawn)
    return PredictedCurve(
        record=record,
        output=output,
        unit=measured.unit(output),
        time_s=time_s,
        measured=rows[0],
        predicted=rows[1],
        theil=found.theil[output],
        rms_error=found.rms_error[output],
    )


def _thinned(time_s: NDArray[np.float64], *rows: NDArray[np.float64]) -> list[list[float]]:
    """Least and largest value of each column, so that no spike is lost."""
    if len(time_s) <= 2 * COLUMNS:
        return [each.tolist() for each in (time_s, *rows)]
    starts = np.linspace(0, len(time_s), COLUMNS, endpoint=False).astype(int)
    middles = np.append(starts[1:], len(time_s)) + starts
    times = np.column_stack([time_s[starts], time_s[middles // 2]]).ravel()
    ends = [(np.minimum.reduceat(row, starts), np.maximum.reduceat(row, starts)) for row in rows]
    return [times.tolist(), *(np.column_stack(each).ravel().tolist() for each in ends)]


def _responses(model: GreyBoxModel, measured: FrequencyResponse) -> list[PredictedResponse]:
    made = []
    for name in model.response_names:
        output, source = name.split("/")
        if output not in measured.outputs or source not in measured.inputs:
            continue
        pair = measured.pair(output, source)
        try:
            whole = model.frequency_response(pair.omega_rad_s)
        except FlightidError:
            continue  # a pole on the axis: no finite response there
        of_pair = whole[model.outputs.index(output), model.inputs.index(source)]
        phase = np.unwrap(np.angle(of_pair))
        phase += 2.0 * np.pi * np.round((pair.phase_rad[0] - phase[0]) / (2.0 * np.pi))
        made.append(
            PredictedResponse(
                output=output,
                input=source,
                unit=pair.unit,
                omega_rad_s=pair.omega_rad_s.tolist(),
                gain=np.abs(of_pair).tolist(),
                phase_rad=phase.tolist(),
                measured_gain=np.abs(pair.response).tolist(),
                measured_phase_rad=pair.phase_rad.tolist(),
                coherence=pair.coherence.tolist(),
            )
        )
    return made
