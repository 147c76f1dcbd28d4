"""What a response's estimator makes of a model: the leakage and finite resolution that it adds.

An estimate is linear in the outputs, Ĥ = L[y]. For a model that gives y* on the measured inputs the
estimator's bias is L[y*] − H, and the estimate without it is H + L[y − y*]: no error where the
model is right, whatever the windows. The model that this needs comes from the fit, in rounds.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from flightid.errors import DataError
from flightid.identification.frequency_domain.model_residuals import ModelResiduals
from flightid.models import GreyBoxModel
from flightid.responses import FrequencyResponse
from flightid.responses.errors.linear_estimate import Functional, LinearEstimate
from flightid.responses.errors.random_error import CovarianceSource


def why_unknown(data: FrequencyResponse) -> str:
    """Why the weights of a response's estimator are not known; empty where they are.

    Parameters
    ----------
    data : FrequencyResponse

    Returns
    -------
    str
    """
    if data.linear is not None:
        return ""
    if data.estimator.endswith("arithmetic"):
        return "the response is a result of arithmetic"
    if data.estimator == "given":
        return "the response was given as values"
    return "the response was read from a file or estimated with covariance=False"


@dataclass(frozen=True)
class Correction:
    """Takes the estimator's bias out of one response for model after model.

    Weights and transforms belong to the records, not to the model: they are made once.

    Attributes
    ----------
    data : FrequencyResponse
        As it was measured.
    hold : {"band_limited", "first", "zero"}
        What the inputs do between their samples.
    """

    data: FrequencyResponse
    hold: str

    def apply(self, model: GreyBoxModel) -> FrequencyResponse:
        """The measured response without the bias that its estimator has for this model.

        Unknown initial states and trims of each record are fitted to its outputs, so that a record
        may begin in motion. Unstable modes are followed from the end of a record backwards, so that
        its length is no limit. Coherence and covariance stay; responses that the model lacks stay.

        Raises
        ------
        ModelError
            More zeros than poles, or a negative delay.
        SingularError
            The equations do not give every state derivative.
        DataError
            The weights are not known, or the model diverges on the records.
        """
        data = self.data
        left = self._weights(self._records.of(model))
        values = np.array(data.response)
        curves = model.frequency_response(data.omega_rad_s)
        for each in model.responses:
            row, column = data.outputs.index(each.output), data.inputs.index(each.input)
            place = model.outputs.index(each.output), model.inputs.index(each.input)
            values[row, column] = curves[place] + left[row, column]
        return replace(data, response=values)

    def errors(self, model: GreyBoxModel) -> CovarianceSource | None:
        """Errors of a corrected response: their noise is what the model leaves.

        The noise of the estimate itself holds the leakage that the correction has removed.

        Returns
        -------
        CovarianceSource or None
            None where the errors of the response stand as they are.
        """
        if self.data.errors is None:
            return None
        return self._linear.errors_of(self._records.of(model))

    @property
    def _linear(self) -> LinearEstimate:
        if self.data.linear is None:
            reason = why_unknown(self.data)
            raise DataError("the estimator's weights are not known", found=reason)
        return self.data.linear

    @cached_property
    def _weights(self) -> Functional:
        return self._linear.functional()

    @cached_property
    def _records(self) -> ModelResiduals:
        return ModelResiduals(self._linear, self.data.outputs, self.hold)
