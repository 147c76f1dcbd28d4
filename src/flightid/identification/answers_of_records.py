"""Whether what a model fitted to records in time leaves hangs on the size of the motion.

The score test of responses (`frequency_domain/answer_by_size.py`), asked of a free run through the
records themselves: output error, equation error and filter error fit a mean over the sizes that
they were given as responses do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FlightidError
from flightid.evidence.feedback import loop_seen
from flightid.identification.fit import Fit
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.frequency_domain.answer_by_size import size_terms
from flightid.identification.frequency_domain.estimator_bias import LEAK, MEMORY, slowest_decay
from flightid.identification.frequency_domain.left_by_model import AnswerBySize
from flightid.identification.model_error import BySize, left_of_records, response_of
from flightid.models import GreyBoxModel
from flightid.models.model import linear_system
from flightid.record import Record
from flightid.uncertainty.feedback_result import unless_logged

Array = NDArray[np.float64]
KEPT = 2
"""Fits whose answers are kept: gains ask for them, and then say them."""


@lru_cache(maxsize=KEPT)
def by_size_of(fit: Fit) -> Mapping[str, BySize]:
    """Answers of a fit that hang on the size of the motion beyond chance, by ``"output/input"``.

    Parameters
    ----------
    fit : Fit
        Of responses (`Fit.left`) or of records in time; empty of others, and where nobody can tell.
    """
    if fit.left is not None:
        return fit.left.by_size
    if fit.responses or fit.details is not None or not fit.records:
        return {}
    filtered = fit.residual_horizon != "free_run" and not fit.prediction_errors
    try:
        left = left_of_records(fit.model, fit.records, filtered=filtered)
        return _answers(fit.model, fit.records, left)
    except FlightidError:
        return {}


def _answers(
    model: GreyBoxModel, records: Sequence[FittedRecord], left: Sequence[Record]
) -> dict[str, AnswerBySize]:
    """Of records, and what a free run of the model leaves of them."""
    instruments = _instruments(model, records, left)
    if instruments is None:
        return {}
    seen = response_of(left, model)
    measured = [
        np.array([each.measured[name][-rest.n_samples :] for name in model.outputs])
        for each, rest in zip(records, left, strict=True)
    ]
    found = size_terms(
        [_about_mean(rows) for rows in instruments],
        [_about_mean(rows) for rows in measured],
        [_about_mean(each.matrix(model.outputs)) for each in left],
        1.0 / left[0].sample_rate_hz,
        max(seen.window_s) * MEMORY,
        max(LEAK * float(seen.omega_rad_s[0]), slowest_decay(model)),
    )
    if found is None or not any(each.stands_out for each in found):
        return {}
    terms = {name: each.answers for name, each in zip(model.outputs, found, strict=True)}
    moved = [
        each.replace({name: rows[k] for name, rows in terms.items()}) for k, each in enumerate(left)
    ]
    answered = response_of(moved, model)
    known = linear_system(model).frequency_response(answered.omega_rad_s)
    made = {}
    for i, (output, term) in enumerate(zip(model.outputs, found, strict=True)):
        for j, name in enumerate(model.inputs):
            if term.stands_out and np.all(known[i, j] != 0.0):
                share = term.most * np.abs(answered.response[i, j] / known[i, j])
                made[f"{output}/{name}"] = AnswerBySize(answered.omega_rad_s, share, term.ratio)
    return made


def _instruments(
    model: GreyBoxModel, records: Sequence[FittedRecord], left: Sequence[Record]
) -> list[Array] | None:
    """What no noise of the outputs reaches: excitations, else inputs of an open loop."""
    if min(len(each.excitations) for each in left) >= len(model.inputs):
        return [each.matrix(each.excitations) for each in left]
    measured = tuple(each.measured for each in records)
    seen = loop_seen(measured, tuple(model.inputs), tuple(model.outputs))
    loop = unless_logged(seen, [each.history for each in measured])
    return [each.matrix(model.inputs) for each in left] if loop.loop == "open" else None


def _about_mean(rows: Array) -> Array:
    return np.asarray(rows - rows.mean(axis=1, keepdims=True))
