"""The problem that filter error solves: a model, its records, and first guesses of all noises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import UnknownNameError
from flightid.identification.filter_error.extended_kalman import (
    ExtendedProblem,
    along_the_flight,
    has_free_constants,
    sizes_of_states,
)
from flightid.identification.filter_error.innovations import FilteredData, InnovationsProblem
from flightid.identification.output_error.distinct import require_distinct
from flightid.identification.output_error.equation_records import equation_runs
from flightid.identification.records.held_model import LinearPoint
from flightid.identification.records.options import RecordOptions
from flightid.identification.records.setup import prepare_records
from flightid.identification.records.white_noise import white_levels
from flightid.identification.regression.options import FilterErrorOptions
from flightid.models import StateSpaceModel
from flightid.record import Record

_FIRST_SHARE = 0.1
_FLOOR = 1e-6
_NONE = 1e-5
"""Share of an output's size below which its white noise is what rounding leaves."""


def innovations_problem(
    model: StateSpaceModel, records: Sequence[Record], options: FilterErrorOptions
) -> InnovationsProblem:
    """What is searched: noises begin at a tenth of the motion, and at the outputs' white levels.

    The noises' common factor is told by the output whose white noise is the least part of it, in
    any order of outputs: what gusts shake at each sample has some that the filter takes off.

    Parameters
    ----------
    model : StateSpaceModel
        Nonlinear, or with free constants about no trim: an `ExtendedProblem` along the flight.
    records : sequence of Record
    options : FilterErrorOptions
        Without `process_noise` all states have it whose derivatives hold a free parameter.

    Raises
    ------
    UnknownNameError
        `process_noise` names a state that the model has not.
    """
    data = tuple(
        FilteredData(
            record.matrix(model.inputs), record.matrix(model.outputs), record.sample_time_s
        )
        for record in records
    )
    p, n = len(model.outputs), len(model.states)
    blank = InnovationsProblem(
        model,
        data,
        (),
        np.zeros(0),
        np.ones(p),
        options.output_bias,
        options.input_bias,
        options.hold,
    )
    seen, steps = along_the_flight(model, records)
    point = LinearPoint.of(seen, model.parameters.independent_values())
    varies = not model.is_linear or has_free_constants(model, point)
    if options.process_noise is None:
        moved = np.any(np.concatenate([point.a[1:], point.b[1:]], axis=2), axis=(0, 2))
        noisy = tuple(map(int, np.flatnonzero(moved))) or tuple(range(n))
    else:
        noisy = _places(options.process_noise, list(model.states))
    spread = np.sqrt(np.mean([np.var(each.outputs, axis=1) for each in data], axis=0))
    found = [white_levels(each.outputs) for each in data]
    level = np.sqrt(np.mean([levels**2 for levels in found], axis=0))
    reach = sizes_of_states(point, spread)
    scale = np.maximum(level, _FLOOR * spread + 1e-300)
    made = replace(
        blank,
        noisy=noisy,
        process_scale=_FIRST_SHARE * reach[list(noisy)],
        output_scale=scale,
        reference=_reference(scale / np.maximum(spread, 1e-300)),
    )
    if not varies:
        return made
    own = RecordOptions(
        output_bias=options.output_bias, input_bias=options.input_bias, hold=options.hold
    )
    prepared = prepare_records(model, records, own)
    require_distinct(model, prepared, equation_runs(model, prepared))
    return ExtendedProblem.along(made, steps, reach)


def _reference(share: NDArray[np.float64]) -> int:
    """Output of the least white noise over its own size, of those in which some is seen."""
    seen = share > _NONE
    return int(np.argmin(np.where(seen | ~seen.any(), share, np.inf)))


def _places(names: Sequence[str], states: list[str]) -> tuple[int, ...]:
    for name in names:
        if name not in states:
            raise UnknownNameError(
                "process_noise names an unknown state", found=repr(name), needed=", ".join(states)
            )
    return tuple(sorted({states.index(name) for name in names}))
