"""The states of a record that its outputs measure: what equation error starts from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError
from flightid.frozen import dataclass
from flightid.models import StateSpaceModel
from flightid.models.state_space.measured_states import StateOutputs
from flightid.record import Record

Array = NDArray[np.float64]
_SAME = 1e-9


@dataclass(frozen=True)
class StateMeasurements:
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

    def measured(self, record: Record) -> StateMeasurements:
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
        return StateMeasurements(record.name, record.sample_time_s, states, inputs, others)


def _require_states(model: StateSpaceModel, matrix: Array) -> None:
    n = len(model.states)
    if not n:
        return
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


def require_length(motion: StateMeasurements, needed: int) -> None:
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
