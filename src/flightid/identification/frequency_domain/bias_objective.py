"""What a fit with the estimator inside minimises: residuals, derivatives, and their weights.

The data stay as they were measured. They are compared with L[y*(θ)], the weights of the estimate on
the model's outputs; derivatives are the same weights on the model's sensitivities.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification.frequency_domain.error_model import ErrorModel, whitening
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.identification.frequency_domain.model_curves import slopes_of
from flightid.identification.frequency_domain.selection import SelectedResponse
from flightid.models import GreyBoxModel
from flightid.uncertainty.response_errors import DECIBEL, DEGREE

Array = NDArray[np.float64]
Curves = list[NDArray[np.complex128]]
Whitening = list[tuple[int, int, Array]]
"""First response, number and matrix of each run, as `whitening` gives them."""


@dataclass(frozen=True)
class Objective:
    """Residuals of what an estimator makes of a model.

    Attributes
    ----------
    model : GreyBoxModel
    correction : Correction
    selected : sequence of SelectedResponse
        As measured.
    errors : ErrorModel
    cost : {"coherence", "likelihood"}
    """

    model: GreyBoxModel
    correction: Correction
    selected: Sequence[SelectedResponse]
    errors: ErrorModel
    cost: str

    @property
    def size(self) -> int:
        """Samples of one evaluation of the derivatives."""
        return len(self.model.parameters.free) * self.correction.n_samples

    def at(self, x: Array) -> GreyBoxModel:
        """The model with these values of its free parameters."""
        names = (parameter.name for parameter in self.model.parameters.free)
        return self.model.with_values(dict(zip(names, map(float, x), strict=True)))

    def estimates(self, x: Array) -> Curves:
        """What the estimator makes of the model at each response's fitted frequencies."""
        left = self.correction.left(self.at(x), self._frequencies)
        return [
            each.response - part
            for each, part in zip(self.selected, self._parts(left), strict=True)
        ]

    def slopes(self, x: Array) -> Curves:
        """Derivatives of `estimates`, each shape (n_free, n)."""
        return self._parts(self.correction.slopes(self.at(x), self._frequencies))

    def model_slopes(self, x: Array) -> Curves:
        """Derivatives of the model's own responses, each shape (n_free, n)."""
        grids = [each.omega_rad_s for each in self.selected]
        return [slope.T for slope in slopes_of(self.at(x), grids)]

    def residuals(self, estimates: Curves) -> Array:
        """Weighted decibels and degrees, or whitened errors."""
        if self.cost == "likelihood":
            errors = [q - each.response for q, each in zip(estimates, self.selected, strict=True)]
            return whitened(errors, self._matrices)
        logs = [np.log(q / each.response) for q, each in zip(estimates, self.selected, strict=True)]
        return self._weighted(logs)

    def jacobian(self, estimates: Curves, slopes: Curves) -> Array:
        """Derivatives of the residuals, shape (n_residuals, n_free)."""
        if self.cost == "likelihood":
            return whitened(slopes, self._matrices).T
        logs = [slope / q for q, slope in zip(estimates, slopes, strict=True)]
        return self._weighted(logs).T

    def _weighted(self, logs: Curves) -> Array:
        """Decibels and degrees of each frequency in turn, along the last axis."""
        parts = []
        for each, log in zip(self.selected, logs, strict=True):
            both = np.empty((*log.shape[:-1], 2 * log.shape[-1]))
            both[..., 0::2] = DECIBEL * np.sqrt(each.weight_db) * log.real
            both[..., 1::2] = DEGREE * np.sqrt(each.weight_deg) * log.imag
            parts.append(both)
        return np.concatenate(parts, axis=-1)

    @cached_property
    def _matrices(self) -> Whitening:
        return whitening(self.errors)

    @property
    def _frequencies(self) -> NDArray[np.intp]:
        return np.unique(np.concatenate([each.places for each in self.selected]))

    def _parts(self, values: NDArray[np.complex128]) -> Curves:
        """By response, from values of shape (…, n_out, n_in, n_f)."""
        data, known = self.correction.data, self._frequencies
        return [
            values[
                ...,
                data.outputs.index(each.measured.output),
                data.inputs.index(each.measured.input),
                np.searchsorted(known, each.places),
            ]
            for each in self.selected
        ]


def whitened(curves: Curves, matrices: Whitening) -> Array:
    """Complex values by response as residuals of unit variance, along the last axis."""
    parts = []
    for first, count, matrix in matrices:
        run = np.concatenate(curves[first : first + count], axis=-1)
        parts.append(np.concatenate([run.real, run.imag], axis=-1) @ matrix.T)
    return np.concatenate(parts, axis=-1)
