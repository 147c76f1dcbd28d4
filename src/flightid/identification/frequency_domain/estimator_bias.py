"""What a response's estimator makes of a model: the leakage and finite resolution that it adds.

An estimate is linear in the outputs, Ĥ = L[y]. For a model that gives y* on the measured inputs the
estimator's bias is L[y*] − H, and the estimate without it is H + L[y − y*]: no error where the
model is right, whatever the windows. A fit compares L[y*] with Ĥ, and its steps take the weights
of the estimate to the model's sensitivities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, ModelError, OptionError, SingularError
from flightid.frozen import dataclass
from flightid.identification.delay_cells import DIFFERENCE, DelayCells
from flightid.identification.frequency_domain.answer_by_size import SizeTerm, size_terms
from flightid.identification.frequency_domain.model_residuals import ModelResiduals
from flightid.models import GreyBoxModel, Parameter
from flightid.responses import FrequencyResponse
from flightid.responses.errors.functional import Functional
from flightid.responses.errors.linear_estimate import LinearEstimate, WindowedWeights
from flightid.responses.errors.random_error import CovarianceSource
from flightid.responses.estimators.by_window import WindowResidual, residuals_by_window
from flightid.responses.estimators.prewhitened import PREWHITENED
from flightid.responses.windows.local_fit import bins_needed
from flightid.simulation.model_outputs import systems_of
from flightid.uncertainty.blocks import middle_of

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Places = NDArray[np.intp]

OUTSIDE = (DataError, ModelError, OptionError, SingularError)
"""Ends of models that cannot be followed over the records, delays without bounds among them."""
OCTAVE = 2.0
LEAK = 0.1
"""Of a term's integral, over the lowest frequency, at least: a mean would drift away."""
WINDOWS_IN_RECORD = 5.0
"""Least number of windows of a record (Tischler & Remple: at most a fifth of it each)."""
MEMORY = 0.5
"""Of the longest window, within which a closed loop has answered."""
TOGETHER = 64
"""Outputs of moved models that are transformed at once: more leave the caches."""


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
    if data.estimator == PREWHITENED:
        return "outputs were left out of a response by a noise model, or it came without covariance"
    if data.estimator == "given":
        return "the response was given as values"
    return "the response was read from a file or estimated with covariance=False"


@dataclass(frozen=True)
class Correction:
    """What the estimator of one response makes of model after model.

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

    @property
    def n_samples(self) -> int:
        """Samples of all outputs of all records."""
        return sum(each.size for each in self._linear.output_records)

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
        left = self.left(model, np.arange(len(data.omega_rad_s)))
        values = np.array(data.response)
        curves = model.frequency_response(data.omega_rad_s)
        for each in model.responses:
            row, column = data.outputs.index(each.output), data.inputs.index(each.input)
            place = model.outputs.index(each.output), model.inputs.index(each.input)
            values[row, column] = curves[place] + left[row, column]
        return replace(data, response=values)

    def left(self, model: GreyBoxModel, frequencies: Places) -> Complex:
        """The estimate of what the model leaves of the outputs, shape (n_out, n_in, n_f).

        The measured response less this is what the estimator makes of the model. Raises as
        `apply`.
        """
        return self._weights(frequencies)(self._records.of(model))

    def slopes(self, model: GreyBoxModel, frequencies: Places) -> Complex:
        """Derivatives of what the estimator makes of the model, (n_free, n_out, n_in, n_f).

        Raises as `apply`.
        """
        moved = [self._moved(model, parameter) for parameter in model.parameters.free]
        weights, records = self._weights(frequencies), self._records
        at_once = max(1, TOGETHER // len(self.data.outputs))
        starts = range(0, len(moved), at_once)
        parts = [weights(records.slopes(model, moved[at : at + at_once])) for at in starts]
        return np.concatenate(parts)

    def halves(self, model: GreyBoxModel, frequencies: Places) -> tuple[Complex, Complex]:
        """Estimates of what the model leaves, and makes, of each half of each record.

        Raises as `apply`.

        Returns
        -------
        tuple of ndarray, shape (n_records, 2, n_out, n_in, n_f)
        """
        weights = self._weights(frequencies)
        left = self._records.of(model)
        measured = self._linear.output_records
        made = [one - rest for one, rest in zip(measured, left, strict=True)]
        nothing = [np.zeros_like(one) for one in measured]
        middles = [_middle(rows) for rows in made]

        def halved(place: int, rows: Array) -> list[Complex]:
            half = middles[place]
            found = []
            for span in (slice(0, half), slice(half, None)):
                alone = list(nothing)
                alone[place] = np.zeros_like(rows)
                alone[place][:, span] = rows[:, span]
                found.append(weights(alone))
            return found

        return (
            np.array([halved(place, rows) for place, rows in enumerate(left)]),
            np.array([halved(place, rows) for place, rows in enumerate(made)]),
        )

    def left_by_window(
        self, model: GreyBoxModel, band_rad_s: tuple[float, float]
    ) -> list[WindowResidual]:
        """What each window length of the estimate makes of what the model leaves, in a band.

        Raises as `apply`.
        """
        left, linear = self._records.of(model), self._linear
        resonant = resonant_up_to(model, self._width)
        omega = self.data.omega_rad_s
        return [*residuals_by_window(linear, omega, left, band_rad_s, resonant)]

    def size_terms(self, model: GreyBoxModel, low_rad_s: float) -> list[SizeTerm]:
        """Of each output, whether its answer depends on its size; none where nobody can tell.

        Nobody can of a direct response in a loop: noise reaches its instruments, the inputs.

        Raises as `apply`.
        """
        linear, loop = self._linear, self.data.loop
        instruments = self._instruments
        if instruments is None or loop is None:
            return []
        if not (loop.is_taken_care_of or loop.loop == "open"):
            return []
        found = size_terms(
            instruments,
            linear.output_records,
            self._records.of(model),
            linear.sample_time_s,
            self._longest_s * MEMORY,
            max(LEAK * low_rad_s, slowest_decay(model)),
        )
        return found or []

    @property
    def _longest_s(self) -> float:
        """The longest window; of an estimate without any, what its records would take."""
        rows = self._linear.output_records
        whole = max(each.shape[1] for each in rows) * self._linear.sample_time_s
        return max(self.data.window_s, default=whole / WINDOWS_IN_RECORD)

    @property
    def _instruments(self) -> Sequence[Array] | None:
        """Of windows their own; of a noise model, which has none, what the records hold."""
        weights, excited = self._linear.weights, self._linear.excited
        if isinstance(weights, WindowedWeights):
            return weights.errors.windows.instruments
        return [each.matrix(each.excitations) for each in excited] or None

    def estimated(self, terms: Sequence[Sequence[Array]]) -> Complex:
        """The estimate of outputs, by output and record, as of those that were measured."""
        records = [np.array(each) for each in zip(*terms, strict=True)]
        return self._weights(np.arange(len(self.data.omega_rad_s)))(records)

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
        return self._linear.errors_of(self._records.of(model), resonant_up_to(model, self._width))

    @property
    def _width(self) -> float:
        """Over which the noise of a model's residuals is averaged, rad/s."""
        linear = self._linear
        longest = max(each.shape[1] for each in linear.input_records)
        bins = bins_needed(len(linear.inputs), len(linear.input_records))
        return float(2.0 * np.pi * bins / (longest * linear.sample_time_s))

    def _moved(self, model: GreyBoxModel, parameter: Parameter) -> tuple[GreyBoxModel, float]:
        """The model a small step away, on the side where no held input reaches another sample."""
        value = parameter.value or 0.0
        step = DIFFERENCE * (abs(value) or 1.0)
        ways = [
            way for way in (step, -step) if parameter.minimum <= value + way <= parameter.maximum
        ]
        for way in ways:
            moved = model.with_values({parameter.name: value + way})
            if np.array_equal(self.cells.lags(moved), self.cells.lags(model)):
                return moved, way
        way = (ways or [step])[0]
        return model.with_values({parameter.name: value + way}), way

    @property
    def cells(self) -> DelayCells:
        """Where delays may move without a held input reaching another sample."""
        return DelayCells((self._linear.sample_time_s,), self.hold)

    def _weights(self, frequencies: Places) -> Functional:
        key = frequencies.tobytes()
        if key not in self._made:
            linear = self._linear
            rows, columns, points = linear.places
            made = linear.weights.functional(rows, columns, points[frequencies])
            self._made[key] = made
        return self._made[key]

    @property
    def _linear(self) -> LinearEstimate:
        if self.data.linear is None:
            reason = why_unknown(self.data)
            raise DataError("the estimator's weights are not known", found=reason)
        return self.data.linear

    @cached_property
    def _made(self) -> dict[bytes, Functional]:
        return {}

    @cached_property
    def _records(self) -> ModelResiduals:
        return ModelResiduals(self._linear, self.data.outputs, self.hold)


def resonant_up_to(model: GreyBoxModel, width_rad_s: float) -> float:
    """Twice the frequency of the fastest oscillation that narrows its gusts, rad/s; 0 of none.

    Gusts pass through a mode in a band as narrow as its growth or twice its decay, which a loop
    does not widen in what the model leaves of the outputs: a mean over `width_rad_s` holds a third
    of the noise at a slow mode of damping ratio .2 in records of 80 s.

    Parameters
    ----------
    model : GreyBoxModel
    width_rad_s : float
        Over which noise is averaged: modes that decay across a wider band show in the mean.
    """
    poles = [np.linalg.eigvals(each.matrices[0]) for each in systems_of(model)]
    every = np.concatenate(poles)
    narrow = every[(every.imag > 0.0) & (-2.0 * every.real < width_rad_s)]
    return OCTAVE * float(np.max(np.abs(narrow), initial=0.0))


def slowest_decay(model: GreyBoxModel) -> float:
    """Of the real poles of a model the slowest stable one, rad/s; 0 without any."""
    every = np.concatenate([np.linalg.eigvals(each.matrices[0]) for each in systems_of(model)])
    real = -every[(every.imag == 0.0) & (every.real < 0.0)].real
    return float(np.min(real, initial=np.inf)) if real.size else 0.0


def _middle(rows: Array) -> int:
    """Where half of what the model makes of each output, about its mean, is over."""
    power = (rows - rows.mean(axis=1, keepdims=True)) ** 2
    whole = np.maximum(power.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    return middle_of((power / whole).sum(axis=0))
