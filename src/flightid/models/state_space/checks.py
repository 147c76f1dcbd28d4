"""Checks of a state-space model: names, grammar and units of every formula."""

from __future__ import annotations

import math
from collections.abc import Mapping

from flightid.dimensions import require_balance, require_unit
from flightid.errors import ModelError
from flightid.formula import NAME, formula_names, require_name
from flightid.models.language.tables import check_tables
from flightid.models.state_space.linear import Linearisation
from flightid.models.state_space.parts import derivative

MAXIMUM_STATES = 200
MAXIMUM_CHANNELS = 100
MAXIMUM_DEFINITIONS = 1_000


def check_model(model: Linearisation) -> None:
    """Refuse a model that contradicts itself.

    Parameters
    ----------
    model : Linearisation

    Raises
    ------
    ModelError
        Names the equation, output or delay at fault.
    """
    check_tables(model.tables)
    _check_names(model)
    _check_sizes(model)
    rates = {derivative(name): f"({unit})/(s)" for name, unit in model.states.items()}
    constant = model.parameters.units
    auxiliary = {name: output.unit for name, output in model.definitions.items()}
    units = {**constant, **model.states, **model.input_units, **rates, **auxiliary}
    mentioned: set[str] = set()
    for left, right in model.equations.items():
        subject = f"equation {left!r}"
        mentioned |= _defined(left, units, subject, model) | _defined(right, units, subject, model)
        require_balance(left, right, units, subject=subject, tables=model.tables)
    for kind in ("definitions", "measurements"):
        for name, output in getattr(model, kind).items():
            subject = f"{'output' if kind == 'measurements' else 'definition'} {name}"
            found = _defined(output.expression, units, subject, model)
            mentioned |= found if kind == "definitions" else set()
            require_unit(
                output.expression, output.unit, units, subject=subject, tables=model.tables
            )
    for state in model.states:
        if derivative(state) not in mentioned:
            raise ModelError(
                f"no equation gives the derivative of state {state}",
                found=", ".join(model.equations),
                needed=f"an equation with {derivative(state)}",
            )
    for name, delay in model.delays.items():
        subject = f"delay of input {name}"
        _defined(delay, constant, subject, None)
        require_unit(delay, "s", constant, subject=subject)
    _check_record_values(model)


def _check_record_values(model: Linearisation) -> None:
    for kind, known in (("initial", tuple(model.states)), ("biases", tuple(model.units))):
        for name in getattr(model, kind):
            if name not in known:
                raise ModelError(
                    f"[{kind}] names what is not there",
                    found=repr(name),
                    needed=f"one of {', '.join(known)}",
                )


def _check_sizes(model: Linearisation) -> None:
    limits = {"states": MAXIMUM_STATES, "inputs": MAXIMUM_CHANNELS, "outputs": MAXIMUM_CHANNELS}
    if len(model.definitions) > MAXIMUM_DEFINITIONS:
        raise ModelError(
            "too many definitions", found=len(model.definitions), needed=MAXIMUM_DEFINITIONS
        )
    for kind, limit in limits.items():
        count = len(getattr(model, kind))
        least = 0 if kind == "states" else 1
        if not least <= count <= limit:
            raise ModelError(f"number of {kind}", found=count, needed=f"{least} to {limit}")
    if len(model.equations) != len(model.states):
        raise ModelError(
            "a model needs one equation for each state",
            found=f"{len(model.equations)} equations",
            needed=f"{len(model.states)}, for {', '.join(model.states)}",
        )


def _check_names(model: Linearisation) -> None:
    seen: dict[str, str] = {}
    for kind in ("states", "inputs", "parameters", "definitions", "tables"):
        for name in getattr(model, kind):
            require_name(name, f"one of the {kind}")
            if name in seen:
                raise ModelError(
                    f"name {name!r} is given twice", found=f"among the {seen[name]} and the {kind}"
                )
            seen[name] = kind
    for name in model.outputs:
        if not NAME.fullmatch(name) or name in model.inputs:
            raise ModelError(
                "an output cannot have this name",
                found=repr(name),
                needed="letters, digits and underscores, not the name of an input",
            )
    for name, value in model.trim.items():
        if not math.isfinite(value):
            raise ModelError(f"trim value of {name} is not finite", found=value)


def _defined(
    text: str, units: Mapping[str, str], subject: str, model: Linearisation | None
) -> set[str]:
    """Names in a formula, all of them known."""
    try:
        names = formula_names(text, model.tables if model else ())
    except ModelError as error:
        raise ModelError(
            f"{subject} is outside the grammar", found=f"{text[:200]!r}, {error}"
        ) from error
    for name in names:
        if name not in units:
            raise ModelError(
                f"{subject} names what is not defined: {text[:200]!r}",
                found=repr(name),
                needed=f"one of {', '.join(units)}",
            )
    return set(names)
