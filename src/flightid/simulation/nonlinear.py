"""Simulation of equations of motion by Runge-Kutta steps (native: `nonlinear_simulation.rs`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.errors import DataError, ShapeError, UnknownNameError
from flightid.models import StateSpaceModel
from flightid.models.state_space.integration_steps import steps_per_sample
from flightid.models.state_space.measured_states import declared_start

Array = NDArray[np.float64]


def start_of(model: StateSpaceModel, given: ArrayLike | Mapping[str, float] | None) -> Array:
    """Initial state in the model's order: as declared, changed by name or replaced whole.

    Parameters
    ----------
    model : StateSpaceModel
    given : array_like, shape (n_states,), or mapping of str to float, or None
        States in their units; a mapping changes some of the model's declared initial
        values, which are those of the trim where it declares none; None takes them.

    Returns
    -------
    ndarray, shape (n_states,)

    Raises
    ------
    UnknownNameError
        A name that is no state.
    ShapeError
        Another number of states.
    DataError
        A value that is not finite.

    Example
    -------
    >>> from flightid.models import load_model
    >>> float(start_of(load_model("quadrotor_6dof"), {"theta": 0.1})[4])
    0.1
    """
    names = list(model.states)
    if given is None or isinstance(given, Mapping):
        changed = dict(given or {})
        for name in changed:
            if name not in names:
                raise UnknownNameError(
                    "the model has no such state", found=name, needed=", ".join(names)
                )
        point = {**declared_start(model), **changed}
        state = np.array([float(point[name]) for name in names])
    else:
        state = np.array(given, dtype=np.float64)
        if state.shape != (len(names),):
            raise ShapeError(
                "initial_state does not fit the model", found=state.shape, needed=(len(names),)
            )
    if not np.all(np.isfinite(state)):
        raise DataError("the initial state is not finite", found=str(state))
    return state


def run_equations(
    model: StateSpaceModel,
    driven: Array,
    sample_time_s: float,
    *,
    first_order_hold: bool,
    initial_state: ArrayLike | Mapping[str, float] | None,
    substeps: int | None,
) -> tuple[Array, Array]:
    """States and outputs of a model over sampled inputs, by Runge-Kutta steps of fourth order.

    Parameters
    ----------
    model : StateSpaceModel
        Linear or not; factors on the left side are solved for exactly.
    driven : ndarray, shape (n_inputs, n_samples)
        Inputs, in the model's units.
    sample_time_s : float
        Time between samples, s.
    first_order_hold : bool
        Inputs are straight lines between samples, not steps.
    initial_state : array_like or mapping of str to float, optional
        As for `start_of`.
    substeps : int, optional
        As for `steps_per_sample`.

    Returns
    -------
    tuple of ndarray
        States (n_states, n_samples) and outputs (n_outputs, n_samples).

    Raises
    ------
    DataError
        The run diverges, or a formula has no value.
    SingularError
        The equations do not give every state derivative somewhere on the way.
    ModelError
        A state derivative does not enter its equation linearly.

    Reference
    ---------
    Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed., table II.1.2.

    Example
    -------
    >>> from flightid.models import load_model
    >>> hover = np.array([[12.2583125]] + 3 * [[0.0]]) * np.ones((1, 100))
    >>> states, outputs = run_equations(
    ...     load_model("quadrotor_6dof"), hover, 0.01,
    ...     first_order_hold=True, initial_state=None, substeps=None)
    >>> bool(np.abs(outputs).max() < 1e-12)
    True
    """
    steps = steps_per_sample(model, sample_time_s, substeps)
    return _native.simulate_equations(
        model.native,
        model.parameters.independent_values(None),
        np.ascontiguousarray(driven, dtype=np.float64),
        start_of(model, initial_state),
        sample_time_s,
        first_order_hold,
        steps,
    )
