"""Equations of motion at every sample of a record whose states are measured (`model_samples.rs`).

The model's state derivatives and its remaining outputs are computed from measured states and
inputs, with exact derivatives by the free parameters: what equation error, in the time or in the
frequency domain, compares with the measurement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError, ModelError, SingularError
from flightid.identification.records.delayed_inputs import delayed_inputs
from flightid.models import StateSpaceModel
from flightid.models.state_space.measured_states import StateOutputs
from flightid.record import Record

Array = NDArray[np.float64]
_SAME = 1e-9


@dataclass(frozen=True)
class MeasuredMotion:
    """What one record says about a model's states.

    Attributes
    ----------
    name : str
    sample_time_s : float
    states : ndarray, shape (n_states, n_samples)
    inputs : ndarray, shape (n_inputs, n_samples)
    others : ndarray, shape (n_others, n_samples)
        Measured outputs that are no states: each is one more equation.
    """

    name: str
    sample_time_s: float
    states: Array
    inputs: Array
    others: Array

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return int(self.states.shape[1])


@dataclass(frozen=True)
class Reconstruction:
    """How measured outputs give the states: x = H⁺ (y − h).

    Attributes
    ----------
    model : StateSpaceModel
    seen : StateOutputs
        Outputs that are fixed combinations of states alone.
    others : tuple of int
        All other outputs.
    """

    model: StateSpaceModel
    seen: StateOutputs
    others: tuple[int, ...]

    @classmethod
    def of(cls, model: StateSpaceModel, record: Record) -> Reconstruction:
        """Find the outputs that give the states, near the samples of a record.

        Raises
        ------
        FitError
            Some states are not measured.
        """
        seen = StateOutputs.of(model, record.matrix(model.inputs), record.matrix(model.outputs))
        _require_states(model, seen.matrix)
        others = tuple(k for k in range(len(model.outputs)) if k not in seen.places)
        return cls(model, seen, others)

    def measured(self, record: Record) -> MeasuredMotion:
        """States, inputs and remaining outputs of a record.

        Raises
        ------
        UnknownNameError
            The record lacks a channel of the model.
        """
        outputs = record.matrix(self.model.outputs)
        states = self.seen.states(outputs)
        inputs = record.matrix(self.model.inputs)
        others = outputs[list(self.others)]
        return MeasuredMotion(record.name, record.sample_time_s, states, inputs, others)


def _require_states(model: StateSpaceModel, matrix: Array) -> None:
    n = len(model.states)
    if len(matrix) and np.linalg.matrix_rank(matrix) == n:
        return
    _, sizes, right = np.linalg.svd(np.vstack([matrix, np.zeros((n, n))]))
    blind = np.abs(right[sizes <= _SAME * max(sizes.max(initial=0.0), 1e-300)]).max(axis=0)
    names = [name for name, part in zip(model.states, blind, strict=True) if part > _SAME]
    raise FitError(
        "equation error needs every state measured",
        found=f"no output for {', '.join(names)}",
        needed="outputs that are fixed combinations of all states",
        action="use method='output_error' or 'fourier_output_error', which need no states",
    )


@dataclass(frozen=True)
class RightSide:
    """State derivatives and remaining outputs that a model computes from measured motion.

    Attributes
    ----------
    reconstruction : Reconstruction
    hold : str
        What the inputs do between samples; ``"zero"`` adds half a sample of delay.
    """

    reconstruction: Reconstruction
    hold: str = "band_limited"

    @property
    def model(self) -> StateSpaceModel:
        """Model of the equations."""
        return self.reconstruction.model

    def at(self, theta: Array, motion: MeasuredMotion) -> tuple[Array, Array]:
        """Values and exact derivatives at free parameters.

        Parameters
        ----------
        theta : ndarray, shape (n_free,)
        motion : MeasuredMotion

        Returns
        -------
        values : ndarray, shape (n_states + n_others, n_samples)
        slopes : ndarray, shape (n_states + n_others, n_samples, n_free)

        Raises
        ------
        DataError
            An equation has no value at a sample.
        SingularError
            The equations do not give every state derivative.
        ModelError
            State derivatives enter an equation other than linearly.
        """
        parameters = self.model.parameters
        free = parameters.free_indices
        values = parameters.independent_values()
        values[free] = theta
        inputs, rates, late = delayed_inputs(
            self.model, values, motion.inputs, motion.sample_time_s, self.hold
        )
        n, m = len(self.model.states), len(self.model.inputs)
        still = np.zeros((motion.n_samples, n))
        rest = np.hstack([motion.states.T, inputs.T])
        found, slopes = self.model.native.sample(values, np.hstack([still, rest]), list(range(n)))
        moving = -_solve(slopes[:, :n], found[:, :n, None])[:, :, 0]
        directions = [*range(n), *range(2 * n, 2 * n + m), *(2 * n + m + k for k in free)]
        found, slopes = self.model.native.sample(values, np.hstack([moving, rest]), directions)
        _require_affine(found[:, :n], slopes[:, :n, :n], moving)
        by_theta = slopes[:, :, n + m :] - (slopes[:, :, n : n + m] * rates.T[:, None]) @ late
        by_motion = -_solve(slopes[:, :n, :n], by_theta[:, :n])
        others = [n + place for place in self.reconstruction.others]
        output_slopes = by_theta[:, others] + slopes[:, others, :n] @ by_motion
        result = np.hstack([moving, found[:, others]]).T
        return result, np.concatenate([by_motion, output_slopes], axis=1).transpose(1, 0, 2)


def _solve(matrix: Array, right: Array) -> Array:
    """M⁻¹ of each sample times its right side; one factorisation where M never changes."""
    try:
        if np.array_equal(matrix, np.broadcast_to(matrix[:1], matrix.shape)):
            return np.asarray(np.linalg.inv(matrix[0]) @ right)
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError as error:
        raise SingularError(
            "the equations do not give every state derivative",
            found="a singular matrix M of their factors",
            needed="one independent equation for each state derivative",
        ) from error


def _require_affine(residuals: Array, factors: Array, moving: Array) -> None:
    size = (np.abs(factors) @ np.abs(moving)[:, :, None])[:, :, 0]
    worst = float(np.max(np.abs(residuals) - 1e-6 * size, initial=0.0))
    if worst > 1e-9 * (1.0 + float(size.max(initial=0.0))):
        raise ModelError(
            "state derivatives enter an equation other than linearly",
            found=f"a remainder of {worst:.3g}",
            needed="equations linear in the state derivatives",
        )


def require_length(motion: MeasuredMotion, needed: int) -> None:
    """Refuse a record that is too short.

    Raises
    ------
    DataError
        Fewer samples than `needed`.
    """
    if motion.n_samples < needed:
        raise DataError(
            f"record {motion.name} is too short for this method",
            found=f"{motion.n_samples} samples",
            needed=f"at least {needed}",
        )
