"""A model as portable C: a header and a source that need nothing but ``math.h``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path

import jinja2
import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import ModelError, OptionError
from flightid.export.equation_code import EquationCode, equation_code
from flightid.export.names import (
    comment,
    identifier,
    identifiers,
    number_literal,
    text_literal,
)
from flightid.frozen import dataclass
from flightid.models import StateSpaceModel
from flightid.models.linear.hold_equivalent import Hold
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.state_space.integration_steps import STEP_RADIUS, steps_per_sample
from flightid.version import VERSION

MAXIMUM_HISTORY = 100_000
"""Longest delay in samples: the past of an input is held in the model's own memory."""


@dataclass(frozen=True)
class Entry:
    """A line of a table in the C source: a state, input, output or parameter."""

    name: str
    unit: str
    start: float = 0.0
    minimum: float = -math.inf
    maximum: float = math.inf


@dataclass(frozen=True)
class CSource:
    """A model written in C.

    Attributes
    ----------
    prefix : str
        Beginning of every name that the header declares.
    stem : str
        Name of the two files without suffix.
    header, source : str
        Text of the two files.
    states, inputs, outputs, parameters : tuple of Entry
        Its tables, in the order of its arrays.
    sample_time_s : float
        Time of one step, s.
    hold : str
        What inputs do between samples.
    method : str
        How a step is made, in words.
    is_equations : bool
        Whether it holds the equations with their parameters, not a discretisation.
    """

    prefix: str
    stem: str
    header: str
    source: str
    states: tuple[Entry, ...]
    inputs: tuple[Entry, ...]
    outputs: tuple[Entry, ...]
    parameters: tuple[Entry, ...]
    sample_time_s: float
    hold: Hold
    method: str
    is_equations: bool


def linear_source(
    system: LinearSystem, name: str, stem: str, sample_time_s: float | None, hold: Hold
) -> CSource:
    """C of a linear system, discretised exactly, fractional delays included.

    Parameters
    ----------
    system : LinearSystem
        Continuous, or discrete with its own sample time.
    name : str
        Of the model; names in C begin with it.
    stem : str
        Of the files.
    sample_time_s : float or None
        Time of one step, s; None for a discrete system.
    hold : {"zero", "first"}
        What the inputs do between samples.

    Raises
    ------
    OptionError
        A sample time is missing, has no meaning or is not the discrete system's own.
    ModelError
        A delay is too long.
    """
    step_s = step_of_samples(system.sample_time_s, sample_time_s)
    if hold == "first" and system.is_discrete:
        raise OptionError(
            "a discrete system takes its inputs at its samples alone", found="hold='first'"
        )
    transition, taps = _taps(system, step_s, hold)
    offset = 1 if hold == "first" else 0
    depth = max([offset - ahead + 1 for _, ahead, _, _ in taps], default=1)
    _require_depth(depth)
    c = system.state_space()[2]
    states, inputs, outputs = _channels(system)
    tables = Tables(states, inputs, outputs, ())
    words = {
        "transition": transition.tolist(),
        "measure": c.tolist(),
        "taps": [
            {"input": i, "ahead": ahead, "state": list(state), "output": list(output)}
            for i, ahead, state, output in taps
        ],
        "equations": None,
        "depth": max(depth, 2),
        "first_order": hold == "first",
    }
    kind = "as it is" if system.is_discrete else f"discretised exactly, {_HOLDS[hold]}"
    return rendered("linear.c.j2", name, stem, tables, step_s, hold, f"linear, {kind}", words)


def equation_source(
    model: StateSpaceModel,
    name: str,
    stem: str,
    sample_time_s: float | None,
    hold: Hold,
    substeps: int | None = None,
    radius: float = STEP_RADIUS,
) -> CSource:
    """C of the equations of a state-space model, with Runge-Kutta steps and parameters to change.

    Parameters
    ----------
    model : StateSpaceModel
    name, stem : str
        As for `linear_source`.
    sample_time_s : float or None
        Time of one step, s.
    hold : {"zero", "first"}
        What the inputs do between samples.
    substeps : int, optional
        Runge-Kutta steps in a sample; left out: as `simulate` chooses them.
    radius : float
        Largest product of step and eigenvalue where `substeps` is left out.

    Raises
    ------
    OptionError
        A sample time that is missing or has no meaning.
    ModelError
        A delay is too long, or a state derivative does not enter linearly.
    """
    step_s = _positive(sample_time_s)
    prefix = identifier(name)
    code = equation_code(model, prefix)
    count = steps_per_sample(model, step_s, substeps, radius)
    words = {
        "equations": code,
        "substeps": count,
        "depth": _depth_of_delays(model, step_s),
        "first_order": hold == "first",
    }
    method = f"Runge-Kutta steps of fourth order, {count} in a sample, {_HOLDS[hold]}"
    tables = Tables(
        tuple(
            Entry(x, unit, 0.0 if model.is_linear else float(model.trim.get(x, 0.0)))
            for x, unit in model.states.items()
        ),
        tuple(Entry(u, unit, float(model.trim.get(u, 0.0)))
              for u, unit in model.input_units.items()),
        tuple(Entry(y, output.unit) for y, output in model.measurements.items()),
        tuple(
            Entry(p.name, p.unit, float(value), p.minimum, p.maximum)
            for p, value in zip(
                model.parameters.independent, model.parameters.independent_values(), strict=True
            )
        ),
    )  # fmt: skip
    return rendered("equations.c.j2", name, stem, tables, step_s, hold, method, words)


_HOLDS = {
    "zero": "inputs are steps between samples",
    "first": "inputs are straight lines between samples",
}


@dataclass(frozen=True)
class Tables:
    """Lines of the tables in the C source."""

    states: tuple[Entry, ...]
    inputs: tuple[Entry, ...]
    outputs: tuple[Entry, ...]
    parameters: tuple[Entry, ...]


def rendered(
    template: str,
    name: str,
    stem: str,
    tables: Tables,
    sample_time_s: float,
    hold: Hold,
    method: str,
    words: Mapping[str, object],
) -> CSource:
    """Header and source by a template, with names and tables in their places."""
    prefix = identifier(name)
    kinds = {"x": tables.states, "u": tables.inputs, "y": tables.outputs, "p": tables.parameters}
    texts = {
        **words,
        "title": comment(name),
        "version": VERSION,
        "method": method,
        "prefix": prefix,
        "file_stem": stem,
        "sample_time_s": sample_time_s,
        "places": [
            (kind, identifiers(entry.name for entry in each)) for kind, each in kinds.items()
        ],
        "entries_by_kind": [
            ("states", tables.states),
            ("inputs", tables.inputs),
            ("outputs", tables.outputs),
            ("parameters", tables.parameters),
        ],
        **{key: getattr(tables, key) for key in ("states", "inputs", "outputs", "parameters")},
    }
    environment = c_environment()
    header = environment.get_template("model.h.j2").render(texts)
    source = environment.get_template(template).render(texts)
    return CSource(
        prefix, stem, header, source, tables.states, tables.inputs, tables.outputs,
        tables.parameters, sample_time_s, hold, method,
        isinstance(words["equations"], EquationCode),
    )  # fmt: skip


def file_stem(path: Path) -> str:
    """Stem of a C file, which its header can carry.

    Raises
    ------
    OptionError
        It holds more than letters, digits and underscores.
    """
    stem = identifier(path.stem)
    if path.stem != stem:
        raise OptionError(
            "a C file has a name that its header cannot carry",
            found=path.name,
            needed=f"letters, digits and underscores, such as {stem}.c",
        )
    return stem


@cache
def c_environment() -> jinja2.Environment:
    """Templates of C; numbers and texts go through the filters, which write literals."""
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_template),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = number_literal
    environment.filters["numbers"] = lambda row: ", ".join(map(number_literal, row))
    environment.filters["text"] = text_literal
    return environment


def _template(name: str) -> str:
    folder = files("flightid.export") / "templates"
    return (folder / name).read_text(encoding="utf-8")


def step_of_samples(own: float | None, sample_time_s: float | None) -> float:
    """Time of one step, s: a discrete model's own, or what is given for a continuous one."""
    if own is None:
        return _positive(sample_time_s)
    if sample_time_s is not None and abs(sample_time_s / own - 1.0) > 1e-9:
        raise OptionError(
            "a discrete model has a sample time of its own",
            found=f"{sample_time_s:g} s",
            needed=f"{own:g} s, or none",
        )
    return own


def _positive(sample_time_s: float | None) -> float:
    if sample_time_s is None or not (math.isfinite(sample_time_s) and sample_time_s > 0.0):
        raise OptionError(
            "the code of a continuous model needs the time of one step",
            found=sample_time_s,
            needed="sample_time_s above 0 s",
            action="give the rate at which the code will be called, such as sample_time_s=1/400",
        )
    return float(sample_time_s)


def _require_depth(depth: float) -> None:
    if depth > MAXIMUM_HISTORY:
        raise ModelError(
            "a delay is too long for code that holds the past of its inputs",
            found=f"{depth:g} samples",
            needed=f"at most {MAXIMUM_HISTORY}",
            action="use a longer sample time",
        )


def _depth_of_delays(model: StateSpaceModel, sample_time_s: float) -> int:
    delays = model.matrices().delays_s
    lag = float(np.max(delays, initial=0.0)) / sample_time_s
    _require_depth(lag)
    # A delay may be tuned up to twice its value.
    return 2 * math.ceil(lag) + 4


Tap = tuple[int, int, Sequence[float], Sequence[float]]


def _taps(system: LinearSystem, step_s: float, hold: Hold) -> tuple[NDArray[np.float64], list[Tap]]:
    a, b, c, d, delays = (np.ascontiguousarray(each) for each in system.state_space())
    if not system.is_discrete:
        _require_depth(float(np.max(delays, initial=0.0)) / step_s)
        transition, found = _native.discretise_linear(a, b, c, d, delays, step_s, hold == "first")
        return transition, [
            (i, ahead, state.tolist(), output.tolist()) for i, ahead, state, output in found
        ]
    lags = delays / step_s
    whole = np.rint(lags)
    if np.any(np.abs(lags - whole) > 1e-9):
        raise ModelError(
            "a delay of a discrete system is no whole number of samples",
            found=f"{', '.join(f'{lag:g}' for lag in lags)} samples",
        )
    columns = range(b.shape[1])
    return a, [(k, -int(whole[k]), b[:, k].tolist(), d[:, k].tolist()) for k in columns]


def _channels(system: LinearSystem) -> tuple[tuple[Entry, ...], ...]:
    units = system.units
    return tuple(
        tuple(Entry(name, units.get(name, "1")) for name in names)
        for names in (system.states, system.inputs, system.outputs)
    )
