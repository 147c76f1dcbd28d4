"""Whether free numbers have different effects on the records, seen before any search.

A constant in an equation, an output's bias and an initial state may move the outputs of a record in
one and the same way: no search can then tell them apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FitError, SingularError
from flightid.identification.output_error.equation_records import EquationRuns
from flightid.identification.records.setup import OwnNumbers, RecordSet
from flightid.identification.records.slopes_at_start import require_slopes
from flightid.models import GreyBoxModel
from flightid.uncertainty.triangle import triangle_of_rows

Array = NDArray[np.float64]
TOLERANCE = 1e-9
"""Share of a combination's effect below which what the others leave of it is rounding."""
SHARE = 0.1
"""Of the largest part of a combination: less is not named."""
BEGINNING, TOLD = 2048, 1e-6
"""Samples of each record that are asked first, and the effect that tells numbers apart there."""
MOVED = 0.05
"""Relative change of the start at which a combination is looked at once more."""


def run_with_slopes(
    fitted: GreyBoxModel,
    prepared: RecordSet,
    runs_of: EquationRuns | None,
    place: int,
    own: OwnNumbers,
    *,
    sloped: bool = True,
) -> tuple[Array, Array]:
    """Outputs with bias, and their derivatives by θ, initial states, shifts and biases.

    Without slopes these have no columns.
    """
    asked = (
        fitted.parameters.independent_values(),
        fitted.parameters.free_indices,
        prepared.arrays[place],
        own.native,
        prepared.hold,
        sloped,
    )
    outputs, slopes = (
        fitted.native.run_record(*asked)
        if runs_of is None
        else runs_of.native.run_record(place, *asked)
    )
    return outputs + own.bias[:, None], slopes


def require_distinct(
    model: GreyBoxModel, prepared: RecordSet, runs_of: EquationRuns | None
) -> None:
    """Refuse free numbers that move all records in one way, at the start and near it.

    Of long records the beginnings are asked first. Where those tell the numbers apart by far, what
    follows could hide that only by effects a thousand times as large, which the search's end shows.

    Parameters
    ----------
    model : TransferFunctionModel or StateSpaceModel
        At its start.
    prepared : RecordSet
    runs_of : EquationRuns or None

    Raises
    ------
    FitError
        Names them, and says which to hold; or names an output without a slope at the start.
    """
    try:
        short = _beginnings(prepared, runs_of)
        if short is not None and _alike(model, short, runs_of, TOLD) is None:
            return
        if _alike(model, prepared, runs_of) is None:
            return
        # At its own start a product may show one of its factors only.
        found = _alike(_moved(model), prepared, runs_of)
    except (DataError, SingularError):
        return  # the run diverges there; the search says so with its numbers
    if found is None:
        return
    shares, parts, unseen = found
    names = [
        p.name for p, is_unseen in zip(model.parameters.free, unseen, strict=True) if is_unseen
    ]
    raise _unseen(names) if names else _error(model, prepared, shares, parts)


def _beginnings(prepared: RecordSet, runs_of: EquationRuns | None) -> RecordSet | None:
    """Beginnings of the records; None where that saves little, or where runs meet at both ends."""
    lengths = [outputs.shape[1] for _, outputs, _ in prepared.arrays]
    if min(lengths) < 2 * BEGINNING or (runs_of is not None and runs_of.is_segmented):
        return None
    arrays = [
        (inputs[:, :BEGINNING].copy(), outputs[:, :BEGINNING].copy(), step)
        for inputs, outputs, step in prepared.arrays
    ]
    return replace(prepared, arrays=arrays)


def _moved(model: GreyBoxModel) -> GreyBoxModel:
    steps = np.random.default_rng(0).uniform(0.5 * MOVED, MOVED, len(model.parameters.free))
    values = {}
    for parameter, step in zip(model.parameters.free, steps, strict=True):
        value = float(parameter.value or 0.0)
        moved = value + step * (abs(value) or 1.0)
        values[parameter.name] = moved if moved <= parameter.maximum else value
    return model.with_values(values)


def _alike(
    model: GreyBoxModel,
    prepared: RecordSet,
    runs_of: EquationRuns | None,
    tolerance: float = TOLERANCE,
) -> tuple[Array, list[Array], NDArray[np.bool_]] | None:
    """A combination without effect, and which parameters have none by themselves.

    Of the combination: shares of the parameters, and of each record's own numbers.
    """
    n = len(model.parameters.free)
    scale = _scale(prepared)
    shared, own = [], []
    for place, numbers in enumerate(prepared.own):
        slopes = run_with_slopes(model, prepared, runs_of, place, numbers)[1]
        if numbers.start is None and len(numbers.initial) == len(prepared.states):
            require_slopes(slopes, numbers, prepared.states, model.outputs, n)
        slopes /= scale[:, None, None]
        # Lengths and angles are those of the triangle, of as many rows as there are numbers.
        rows = triangle_of_rows(slopes.reshape(-1, slopes.shape[2]))
        shared.append(rows[:, :n])
        own.append(rows[:, n:])
    size = np.sqrt(np.sum([np.sum(each**2, axis=0) for each in shared], axis=0))
    unseen = size == 0.0
    size = np.where(unseen, 1.0, size)
    shared = [each / size for each in shared]
    bases = [_basis(each) for each in own]
    left = [each - basis @ (basis.T @ each) for each, basis in zip(shared, bases, strict=True)]
    triangle = triangle_of_rows(np.vstack(left))
    _, values, right = np.linalg.svd(triangle, full_matrices=True)
    if len(values) == n and values[-1] > tolerance:
        return None
    null = right[-1]
    parts = [_answers(each, rows @ null) for each, rows in zip(own, shared, strict=True)]
    return np.abs(null), parts, unseen


def _scale(prepared: RecordSet) -> Array:
    """Size of each output over all records, shape (n_outputs,)."""
    spread = np.max([np.ptp(outputs, axis=1) for _, outputs, _ in prepared.arrays], axis=0)
    return np.asarray(np.where(spread > 0.0, spread, 1.0))


def _basis(own: Array) -> Array:
    if not own.shape[1]:
        return own
    size = np.linalg.norm(own, axis=0)
    left, values, _ = np.linalg.svd(own / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return np.asarray(left[:, values > TOLERANCE * values.max(initial=0.0)])


def _answers(own: Array, effect: Array) -> Array:
    """Share of each own number's effect in what undoes the parameters'."""
    size = np.linalg.norm(own, axis=0)
    found = np.linalg.lstsq(own / np.where(size > 0.0, size, 1.0), effect, rcond=TOLERANCE)[0]
    return np.asarray(np.abs(found))


def _unseen(names: Sequence[str]) -> FitError:
    held = ", ".join(f"{name}=..." for name in names)
    return FitError(
        "the data do not see a parameter" if len(names) == 1 else "the data do not see parameters",
        found=", ".join(names),
        needed="an effect on an output",
        action=f"fix with model.with_fixed({held}), or fly what moves the outputs through them",
    )


def _error(
    model: GreyBoxModel, prepared: RecordSet, shares: Array, parts: Sequence[Array]
) -> FitError:
    top = max(float(shares.max()), *(float(part.max(initial=0.0)) for part in parts))
    # It is a parameter that the others undo, however many of them and how small it is beside them.
    most = SHARE * float(shares.max())
    free = [p.name for p, share in zip(model.parameters.free, shares, strict=True) if share > most]
    biased, others = set[str](), set[str]()
    for numbers, part in zip(prepared.own, parts, strict=True):
        for place, share in enumerate(part):
            if share <= SHARE * top:
                continue
            kind, name = _own_name(model, prepared, numbers, place)
            (biased if kind == "bias" else others).add(name if kind == "bias" else f"{kind} {name}")
    named = [*free, *(f"output bias of {name}" for name in sorted(biased)), *sorted(others)]
    if len(named) == 1:
        return _unseen(named)
    return FitError(
        "the data cannot tell these parameters apart" if not biased | others
        else "free numbers move the records in one way, so that no search can tell them apart",
        found=", ".join(named),
        needed="a different effect of each on the data",
        action=_action(model, free, biased),
    )  # fmt: skip


def _own_name(
    model: GreyBoxModel, prepared: RecordSet, numbers: OwnNumbers, place: int
) -> tuple[str, str]:
    kinds = (
        ("initial", prepared.states, numbers.free_initial),
        ("input shift of", model.inputs, numbers.free_shift),
        ("bias", model.outputs, numbers.free_bias),
    )
    for kind, names, places in kinds:
        if place < len(places):
            free = kind == "initial" and numbers.start is None
            return kind, names[places[place]] if free or kind != "initial" else "state"
        place -= len(places)
    raise IndexError(place)


def _action(model: GreyBoxModel, free: Sequence[str], biased: set[str]) -> str:
    fix = (
        f"fix one of {', '.join(free)} with model.with_fixed(NAME=VALUE)"
        if len(free) > 1
        else f"fix {free[0]} with model.with_fixed({free[0]}=...)"
    )
    if not biased:
        return f"{fix}, tie one to another, or excite them apart"
    kept = [name for name in model.outputs if name not in biased]
    return (
        f"hold biases: output_bias={kept or False!r}, where the equations have constants; or {fix}"
    )
