"""A linear system written as equations, so that each entry of its matrices is a parameter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.export.names import identifiers
from flightid.models import LinearSystem, Output, Parameter, Parameters, StateSpaceModel

_Rows = NDArray[np.float64]


def equations_of(system: LinearSystem) -> StateSpaceModel:
    """The equations x' = A x + B u, y = C x + D u with a parameter for each entry that is not zero.

    Parameters
    ----------
    system : LinearSystem
        Continuous.

    Returns
    -------
    StateSpaceModel
        Names of channels become identifiers; states and all units are dimensionless numbers in the
        units of the system, for its matrices have no names of their own.

    Raises
    ------
    ModelError
        The system has no states or more than a model can have.

    Example
    -------
    >>> lag = LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",), [0.1])
    >>> print(equations_of(lag))
    x1' = a_1_1*x1 + b_1_1*u
    output y = c_1_1*x1 [1]
    u acts after delay_1 s
    """
    a, b, c, d, delays = system.state_space()
    if not system.order:
        # Equations need a state: one that nothing moves and nobody sees.
        a, b, c = np.zeros((1, 1)), np.zeros((1, b.shape[1])), np.zeros((c.shape[0], 1))
    names = identifiers((*system.inputs, *(system.states or ("rest",))), "signal")
    inputs, states = names[: len(system.inputs)], names[len(system.inputs) :]
    outputs = identifiers((*inputs, *system.outputs), "output")[len(inputs) :]
    parameters: list[Parameter] = []

    def row(letter: str, place: int, values: _Rows, signals: Sequence[str], unit: str) -> list[str]:
        terms = []
        for column, value in enumerate(values):
            if value != 0.0:
                name = f"{letter}_{place + 1}_{column + 1}"
                parameters.append(Parameter(name, float(value), unit))
                terms.append(f"{name}*{signals[column]}")
        return terms

    equations = {}
    for k, state in enumerate(states):
        terms = [*row("a", k, a[k], states, "1/s"), *row("b", k, b[k], inputs, "1/s")]
        equations[f"{state}'"] = " + ".join(terms) or f"0*{state}'"
    measured = {}
    for k, output in enumerate(outputs):
        terms = [*row("c", k, c[k], states, "1"), *row("d", k, d[k], inputs, "1")]
        measured[output] = Output(" + ".join(terms) or f"0*{states[0]}", "1")
    late = {}
    for k, (name, delay) in enumerate(zip(inputs, delays, strict=True)):
        if delay:
            parameters.append(Parameter(f"delay_{k + 1}", float(delay), "s", minimum=0.0))
            late[name] = f"delay_{k + 1}"
    return StateSpaceModel(
        states=dict.fromkeys(states, "1"),
        input_units=dict.fromkeys(inputs, "1"),
        measurements=measured,
        equations=equations,
        parameters=Parameters(parameters),
        delays=late,
        name="linear system",
    )
