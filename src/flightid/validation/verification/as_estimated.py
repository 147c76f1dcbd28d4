"""A measured response as a model's own leakage would leave it: what envelopes are held against."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.identification.frequency_domain.estimator_bias import OUTSIDE, Correction
from flightid.models import StateSpaceModel, TransferFunctionModel
from flightid.responses import FrequencyResponse


def without_leakage(
    model: object, responses: FrequencyResponse, names: Sequence[str]
) -> FrequencyResponse | None:
    """The measured response less the bias that its estimator has for this model.

    What windows make of the model on the measured inputs is taken off as a fit does, so that a
    right model meets the measurement whatever the windows; a wrong one does not.

    Parameters
    ----------
    model : object
        Of equations; others cannot be put through the estimator.
    responses : FrequencyResponse
        Measured.
    names : sequence of str
        ``"output/input"`` of the pairs that are compared.

    Returns
    -------
    FrequencyResponse or None
        None where the weights are gone, or the model cannot be followed over the records.
    """
    if not isinstance(model, StateSpaceModel | TransferFunctionModel) or responses.linear is None:
        return None
    hold = responses.input_shape.hold or "band_limited"
    if isinstance(model, StateSpaceModel):
        model = model.with_responses(*names)
    elif set(model.response_names) != set(names):
        return None
    try:
        return Correction(responses, hold).apply(model)
    except OUTSIDE:
        return None
