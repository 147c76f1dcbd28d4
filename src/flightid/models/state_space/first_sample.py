"""States at the first sample, also where outputs are curved functions of them.

An airspeed ``sqrt(u^2 + w^2)`` has no slope at rest, so equations that measure one have to be begun
where the record is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, SingularError
from flightid.models.state_space.measured_states import StateOutputs, state_outputs
from flightid.models.state_space.model import StateSpaceModel
from flightid.record import Record

Array = NDArray[np.float64]
_MOST_STEPS = 50
_HALVINGS = 20
_SETTLED = 1e-10
_AWAY = 1.0
"""How far from a point without slopes the search begins, in the unit of each state."""


def first_outputs(model: StateSpaceModel, inputs: Array, outputs: Array) -> StateOutputs:
    """Outputs that tell the state at the first sample: `state_outputs`, and curved ones there.

    States that no fixed combination of outputs tells are solved for from outputs that are curved
    functions of states and inputs alone (an airspeed, a flow angle), by Gauss-Newton steps from the
    declared start. Of two states that measure alike (a speed of either sign) comes the positive.

    Parameters
    ----------
    model : StateSpaceModel
    inputs, outputs : ndarray, shapes (n_inputs, n_samples) and (n_outputs, n_samples)
        As for `state_outputs`.

    Returns
    -------
    StateOutputs
        Of linear models and where nothing curved tells more, those of `state_outputs`; else
        linear about the first sample.

    Example
    -------
    >>> import flightid as fid
    >>> speed = fid.StateSpaceModel(
    ...     states={"u": "m/s"}, input_units={"d": "m/s^2"},
    ...     measurements={"V": fid.Output("sqrt(u^2)", "m/s")}, equations={"u'": "X*u + d"},
    ...     parameters=fid.Parameters([fid.Parameter("X", -0.1, "1/s")]))
    >>> outputs = np.full((1, 9), 30.0)
    >>> first_outputs(speed, np.zeros((1, 9)), outputs).states(outputs[:, :1]).round(6)
    array([[30.]])
    """
    seen = state_outputs(model, inputs, outputs)
    unseen = [int(k) for k in np.flatnonzero(~np.any(seen.matrix, axis=0))]
    if model.is_linear or not unseen:
        return seen
    curved = _FirstSample(model, inputs[:, 0], outputs[:, 0], seen, unseen)
    found = curved.solved(seen.states(outputs[:, :1])[:, 0])
    if found is None:
        return seen
    point, rows, values, slopes = found
    matrix = np.vstack([seen.matrix, slopes])
    offset = np.concatenate([seen.offset, values - slopes @ point])
    return replace(seen, places=(*seen.places, *rows), matrix=matrix, offset=offset, trim=point)


def measured_start(model: StateSpaceModel, record: Record) -> Array:
    """State at a record's first sample as its outputs tell it, shape (n_states,).

    Of a linear model departures from the record's declared trim, of a nonlinear one whole values.
    The record may lack outputs.

    Example
    -------
    >>> import flightid as fid
    >>> yaw = fid.load_model("quadrotor_yaw")
    >>> record = fid.Record.from_arrays(
    ...     np.arange(9) / 50, inputs={"tau_psi": np.zeros(9)},
    ...     outputs={"r": np.full(9, 0.5)}, units={"r": "rad/s"})
    >>> measured_start(yaw, record)
    array([0.5, 0. ])
    """
    departs = record.trim if model.is_linear else {}
    blank = np.full(record.n_samples, np.nan)

    def rows(names: tuple[str, ...]) -> Array:
        return np.array([record[n] - departs.get(n, 0.0) if n in record else blank for n in names])

    outputs = rows(model.outputs)
    seen = first_outputs(model, rows(model.inputs), outputs)
    if model.is_linear and (departs or any(model.trim.values())):
        trim = np.array([float(model.trim.get(name, 0.0)) for name in model.states])
        seen = replace(seen, offset=0.0 * seen.offset, trim=seen.trim - trim)
    return np.asarray(seen.states(outputs[:, :1])[:, 0])


def measured_point(model: StateSpaceModel, records: Sequence[Record]) -> dict[str, float]:
    """Where the model is looked at: its trim, or without one the first measured sample.

    Returns
    -------
    dict of str to float
        States and inputs; empty where the model declares a trim or is linear.
    """
    if model.is_linear or any(name in model.trim for name in model.states):
        return {}
    inputs, outputs = records[0].matrix(model.inputs), records[0].matrix(model.outputs)
    start = first_outputs(model, inputs, outputs).states(outputs[:, :1])[:, 0]
    values = (*map(float, start), *map(float, inputs[:, 0]))
    return dict(zip((*model.states, *model.inputs), values, strict=True))


class _FirstSample:
    """Outputs at the first sample, as functions of the states that nothing else tells."""

    def __init__(
        self, model: StateSpaceModel, inputs: Array, measured: Array, seen: StateOutputs,
        unseen: list[int],
    ) -> None:  # fmt: skip
        n, width = len(model.states), 2 * len(model.states) + len(model.inputs)
        self.model, self.inputs, self.measured = model, inputs, measured
        self.seen, self.unseen, self.n = seen, unseen, n
        self.columns = [n + k for k in unseen]
        self.places = [*range(2 * n), *(width + k for k in model.parameters.free_indices)]
        self.values = model.parameters.independent_values()

    def at(self, states: Array) -> tuple[Array, Array] | None:
        """Outputs and their slopes by rates, states and free parameters; None without a value."""
        rates = [float(self.model.trim.get(f"{name}'", 0.0)) for name in self.model.states]
        point = np.concatenate([rates, states, self.inputs])[None]
        try:
            found, slopes = self.model.native.sample(self.values, point, self.places)
        except (DataError, SingularError):
            return None
        return found[0, self.n :], slopes[0, self.n :]

    def solved(self, begin: Array) -> tuple[Array, list[int], Array, Array] | None:
        """State, the outputs that told it, their values there and their slopes by the states."""
        states, here = begin.copy(), self.at(begin)
        if here is None:
            states[self.unseen] += _AWAY
            here = self.at(states)
        if here is None:
            return None
        n = self.n
        elsewhere = np.any(np.delete(here[1], np.s_[n : 2 * n], axis=1), axis=1)
        told = ~elsewhere & np.isfinite(self.measured)
        told &= np.any(here[1][:, self.columns], axis=1)
        rows = [int(k) for k in np.flatnonzero(told) if k not in self.seen.places]
        if not rows:
            return None
        weight = 1.0 / np.abs(here[1][rows, n : 2 * n]).max(axis=1)
        for _ in range(_MOST_STEPS):
            error = weight * (self.measured[rows] - here[0][rows])
            slopes = weight[:, None] * here[1][rows][:, self.columns]
            step = np.linalg.lstsq(slopes, error, rcond=1e-9)[0]
            if np.linalg.norm(step) <= _SETTLED * (1.0 + np.linalg.norm(states[self.unseen])):
                break
            moved = self._moved(states, step, rows, weight, float(np.linalg.norm(error)))
            if moved is None:
                break
            states, here = moved
        return states, rows, here[0][rows], here[1][rows, n : 2 * n]

    def _moved(
        self, states: Array, step: Array, rows: list[int], weight: Array, before: float
    ) -> tuple[Array, tuple[Array, Array]] | None:
        for halving in range(_HALVINGS):
            tried = states.copy()
            tried[self.unseen] += step * 0.5**halving
            here = self.at(tried)
            if here is not None:
                error = weight * (self.measured[rows] - here[0][rows])
                if np.linalg.norm(error) < before:
                    return tried, here
        return None
