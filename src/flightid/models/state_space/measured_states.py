"""What measured outputs say of states: where runs begin, and where equations are probed.

Outputs that are fixed combinations of states alone, y = H x + h, give states by least squares. The
equations are probed near measured samples, since a model that divides by a speed has no value at
rest.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, SingularError
from flightid.frozen import dataclass
from flightid.models.state_space.model import StateSpaceModel

Array = NDArray[np.float64]
_SAME = 1e-9
_PROBES = 4


@dataclass(frozen=True, eq=False)
class StateOutputs:
    """Outputs that are fixed combinations of states: y = H x + h.

    Attributes
    ----------
    places : tuple of int
        Of these outputs among the model's.
    matrix : ndarray, shape (n_direct, n_states)
        H.
    offset : ndarray, shape (n_direct,)
        h.
    trim : ndarray, shape (n_states,)
        Where states that nothing measures stay: as declared, else at trim.
    """

    places: tuple[int, ...]
    matrix: Array
    offset: Array
    trim: Array

    @cached_property
    def weights(self) -> Array:
        """Least-squares inverse of H, shape (n_states, n_direct)."""
        return np.asarray(np.linalg.pinv(self.matrix))

    def states(self, outputs: Array) -> Array:
        """States at samples, (n_states, n_samples), from all outputs, (n_outputs, n_samples).

        Nearest to the trim where outputs leave a choice.
        """
        rows = list(self.places)
        direct = outputs[rows] - (self.offset + self.matrix @ self.trim)[:, None]
        return np.asarray(self.trim[:, None] + self.weights @ direct)

    def noise(self, covariance: Array) -> Array:
        """Covariance of measured states (n_states, n_states) from that of all outputs' noise."""
        rows = list(self.places)
        return np.asarray(self.weights @ covariance[np.ix_(rows, rows)] @ self.weights.T)

    @classmethod
    def of(cls, model: StateSpaceModel, inputs: Array, outputs: Array) -> StateOutputs:
        """Find them, from samples of inputs (n_inputs, n) and outputs (n_outputs, n).

        A row of outputs that was not measured is NaN.

        Raises
        ------
        DataError
            The equations have no value near the samples.
        SingularError
            The equations do not give every state derivative.
        """
        n, width = len(model.states), 2 * len(model.states) + len(model.inputs)
        values = model.parameters.independent_values()
        places = [*range(width), *(width + place for place in model.parameters.free_indices)]
        probes = _probes(model, inputs, outputs)
        found, slopes = model.native.sample(values, probes, places)
        rows = slopes[:, n:, :]
        scale = np.abs(rows).max(axis=(0, 2)) + 1e-300
        spread = np.abs(rows[:, :, n : 2 * n] - rows[0, :, n : 2 * n]).max(axis=(0, 2), initial=0.0)
        elsewhere = np.abs(rows[:, :, [*range(n), *range(2 * n, len(places))]])
        strange = elsewhere.max(axis=(0, 2), initial=0.0) + spread > _SAME * scale
        strange |= ~np.all(np.isfinite(outputs), axis=1)
        direct = tuple(int(place) for place in np.flatnonzero(~strange))
        matrix = rows[0][list(direct), n : 2 * n].reshape(len(direct), n)
        offset = found[0, n:][list(direct)] - matrix @ probes[0, n : 2 * n]
        return cls(direct, matrix, offset, _start(model))


def state_outputs(model: StateSpaceModel, inputs: Array, outputs: Array) -> StateOutputs:
    """Outputs that tell states; those that are one by name where the equations have no value.

    Parameters
    ----------
    model : StateSpaceModel
    inputs, outputs : ndarray, shapes (n_inputs, n_samples) and (n_outputs, n_samples)
        All of the model's, whole or as departures, as the model is run; outputs that were not
        measured are NaN.

    Example
    -------
    >>> import flightid as fid
    >>> yaw = fid.load_model("quadrotor_yaw")
    >>> outputs = np.full((len(yaw.outputs), 9), 0.5)
    >>> state_outputs(yaw, np.zeros((1, 9)), outputs).states(outputs)[:, 0]
    array([0.5, 0.5])
    """
    plain = _by_name(model, outputs)
    if np.all(np.any(plain.matrix, axis=0)):
        return plain
    try:
        return StateOutputs.of(model, inputs, outputs)
    except (DataError, SingularError):
        return plain


def declared_start(model: StateSpaceModel) -> dict[str, float]:
    """Where each state begins when nothing measures it: its declared initial value, else its trim.

    Example
    -------
    >>> import flightid as fid
    >>> declared_start(fid.load_model("quadrotor_yaw"))
    {'r': 0.0, 'psi': 0.0}
    """
    begun = {name: item.value for name, item in model.initial.items()}
    return {name: float(begun.get(name, model.trim.get(name, 0.0))) for name in model.states}


def _start(model: StateSpaceModel) -> Array:
    return np.array([*declared_start(model).values()])


def _by_name(model: StateSpaceModel, outputs: Array) -> StateOutputs:
    names = list(model.states)
    shown = [output.expression.strip() for output in model.measurements.values()]
    places = [
        row
        for row, formula in enumerate(shown)
        if formula in names and np.all(np.isfinite(outputs[row]))
    ]
    matrix = np.zeros((len(places), len(names)))
    matrix[range(len(places)), [names.index(shown[row]) for row in places]] = 1.0
    return StateOutputs(tuple(places), matrix, np.zeros(len(places)), _start(model))


def _probes(model: StateSpaceModel, inputs: Array, outputs: Array) -> Array:
    """Points near measured samples, at which a linear output shows the same slopes."""
    n, width = len(model.states), 2 * len(model.states) + len(model.inputs)
    samples = np.linspace(0, inputs.shape[1] - 1, _PROBES + 1).astype(int)
    states = _by_name(model, outputs).states(outputs[:, samples])
    rates = np.array([float(model.trim.get(f"{name}'", 0.0)) for name in model.states])
    moving = np.tile(rates[:, None], len(samples))
    points = np.vstack([moving, states, inputs[:, samples]]).T
    shifts = np.random.default_rng(0).uniform(0.05, 0.15, (_PROBES, width))
    shifts[:, :n] *= 2.0
    points[1:] += shifts
    return np.ascontiguousarray(points)
