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
from flightid.record import Record

Array = NDArray[np.float64]
_SAME = 1e-9
_PROBES = 4


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
    """How measured outputs give the states: x = W (y − y₀).

    Attributes
    ----------
    model : StateSpaceModel
    direct : tuple of int
        Outputs that are fixed combinations of states alone.
    others : tuple of int
        All other outputs.
    weights : ndarray, shape (n_states, n_direct)
    offset : ndarray, shape (n_direct,)
    """

    model: StateSpaceModel
    direct: tuple[int, ...]
    others: tuple[int, ...]
    weights: Array
    offset: Array

    @classmethod
    def of(cls, model: StateSpaceModel) -> Reconstruction:
        """Find the outputs that give the states.

        Raises
        ------
        FitError
            Some states are not measured.
        """
        n, p = len(model.states), len(model.outputs)
        values = model.parameters.independent_values()
        width = 2 * n + len(model.inputs)
        probes = np.vstack([np.zeros(width), _probes(model, width)])
        places = [*range(width), *(width + place for place in model.parameters.free_indices)]
        found, slopes = model.native.sample(values, probes, places)
        rows, offset = slopes[:, n:, :], found[0, n:]
        scale = np.abs(rows).max(axis=(0, 2)) + 1e-300
        spread = np.abs(rows[:, :, n : 2 * n] - rows[0, :, n : 2 * n]).max(axis=(0, 2))
        elsewhere = np.abs(rows[:, :, [*range(n), *range(2 * n, len(places))]])
        strange = elsewhere.max(axis=(0, 2), initial=0.0) + spread > _SAME * scale
        direct = tuple(int(place) for place in np.flatnonzero(~strange))
        matrix = rows[0][list(direct), n : 2 * n].reshape(len(direct), n)
        _require_states(model, matrix)
        others = tuple(place for place in range(p) if place not in direct)
        return cls(model, direct, others, np.linalg.pinv(matrix), offset[list(direct)])

    def measured(self, record: Record) -> MeasuredMotion:
        """States, inputs and remaining outputs of a record.

        Raises
        ------
        UnknownNameError
            The record lacks a channel of the model.
        """
        outputs = record.matrix(self.model.outputs)
        states = self.weights @ (outputs[list(self.direct)] - self.offset[:, None])
        inputs = record.matrix(self.model.inputs)
        others = outputs[list(self.others)]
        return MeasuredMotion(record.name, record.sample_time_s, states, inputs, others)


def _probes(model: StateSpaceModel, width: int) -> Array:
    """Points near the trim at which a linear output shows the same slopes."""
    n = len(model.states)
    trim = np.array([model.trim.get(name, 0.0) for name in model.point_names])
    shifts = np.random.default_rng(0).uniform(0.05, 0.15, (_PROBES, width))
    shifts[:, :n] *= 2.0
    return np.asarray(trim + shifts)


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
