"""What records say of a hold that was told: likelihood and estimates under another, without a fit.

Estimates under another hold lie half a sample of delay away: a few steps of Gauss and Newton from
those of the fit, on the records themselves, reach them. Fits by other ways than least squares on
outputs leave residuals with colour (gusts, what lies outside a response's band): it is taken out,
the same for every hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import DataError, FlightidError
from flightid.frozen import dataclass
from flightid.identification.delay_cells import DelayCells, later_by
from flightid.identification.fit import Fit
from flightid.identification.output_error.distinct import run_with_slopes
from flightid.identification.output_error.equation_records import (
    EquationRuns,
    equation_runs,
    segmented_starts,
)
from flightid.identification.records.options import RecordOptions
from flightid.identification.records.setup import OwnNumbers, RecordSet, prepare_records
from flightid.models import GreyBoxModel
from flightid.record import Record
from flightid.record.hold import InputHold
from flightid.recursive_filter import filtered
from flightid.responses import FrequencyResponse
from flightid.uncertainty.foretold import expected_gain, likelihood_gain
from flightid.uncertainty.triangle import triangle_of_parts, triangle_of_rows

Array = NDArray[np.float64]
ALIKE = 1e-9
"""Share of an own number's effect that others of its record leave, up to which it is rounding."""
RIDGE = 1e-9
"""Added to the power of what is left, as white noise."""
FAR = 100.0
"""Residual over an output's deviation beyond which a model follows nothing."""
AT_ONCE = 1 << 16
"""Rows that are turned into a triangle together."""
LAGS = 20
"""Of the filters that take colour out."""
STEPS, COLOURED_STEPS = 2, 8
"""Of Gauss and Newton: what a delay moves by half a sample bends by less than the second tells.
Where colour is taken out, quick errors count most, and half a sample is half a turn of those."""
SETTLED = 0.1
"""Squared changes of outputs by all numbers, over what is left, from which on no step follows."""
SHORT = 1000.0
"""Squared changes of outputs by shared parameters, over what is left of outputs, up to which slopes
stay: some 30 bars. At 10 the second step then ends within 0.04 of one of where full steps do."""
NEAR = 4.0
"""The same by a record's own numbers, for each sample: what noise of a measured start makes."""


@dataclass(frozen=True, eq=False)
class HeldOutputs:
    """Records beside a model whose inputs are held in one way.

    Attributes
    ----------
    values : ndarray, shape (n_free,)
        Estimates by the records alone, near those of the fit.
    left : list of ndarray, shape (n_outputs, n_samples)
        Measured less modelled, by record.
    """

    values: Array
    left: list[Array]

    @classmethod
    def of(cls, fit: Fit) -> Self:
        """A fit as it is: least squares on its records lead nowhere else."""
        values = [float(parameter.value or 0.0) for parameter in fit.model.parameters.free]
        return cls(np.array(values), [record.residuals for record in fit.records])

    def gain_over(self, other: HeldOutputs) -> float:
        """Logarithm of this likelihood over another: ½ Σ n ln(power left there / here)."""
        return sum(
            likelihood_gain(
                [each[output] for each in other.left], [each[output] for each in self.left]
            )
            for output in range(len(self.left[0]))
        )

    def apart_from(self, other: HeldOutputs) -> float:
        """The gain that is expected where this hold is true."""
        moved = [mine - theirs for mine, theirs in zip(self.left, other.left, strict=True)]
        return sum(
            expected_gain([each[output] for each in moved], [each[output] for each in self.left])
            for output in range(len(self.left[0]))
        )


def records_behind(data: object, model: GreyBoxModel) -> list[Record]:
    """A record, or those that a response of a model was estimated from, means removed."""
    if isinstance(data, Record):
        return [data]
    if not isinstance(data, FrequencyResponse) or data.linear is None:
        return []
    linear = data.linear
    if not set(model.inputs) <= set(linear.inputs):
        return []
    outputs = {name: linear.places[0][k] for k, name in enumerate(data.outputs)}
    if not set(model.outputs) <= set(outputs):
        return []
    trim = getattr(model, "trim", {})
    return [
        Record.from_arrays(
            np.arange(u.shape[1]) * linear.sample_time_s,
            inputs={
                name: u[linear.inputs.index(name)] + trim.get(name, 0.0) for name in model.inputs
            },
            outputs={name: y[outputs[name]] for name in model.outputs},
            units={name: model.units[name] for name in (*model.inputs, *model.outputs)},
        )
        for u, y in zip(linear.input_records, linear.output_records, strict=True)
    ]


def held_outputs(
    model: GreyBoxModel,
    records: Sequence[Record],
    given: Mapping[str, Any],
    holds: Sequence[InputHold],
    *,
    coloured: bool = False,
    assumed: InputHold | None = None,
) -> list[HeldOutputs]:
    """Records beside a model near whose values the estimates lie, under each of some holds.

    Parameters
    ----------
    model : GreyBoxModel
        With the estimates of a fit.
    records : sequence of Record
    given : mapping
        Options of the fit, of which those of records count.
    holds : sequence of {"zero", "first", "band_limited"}
    coloured : bool
        Take out the colour of what is left under the first of them.
    assumed : {"zero", "first", "band_limited"}, optional
        Hold that the estimates were made under; left out: the first of them.

    Raises
    ------
    FlightidError
        The model cannot be run there.
    """
    known = {field.name for field in fields(RecordOptions)}
    options = RecordOptions(**{name: value for name, value in given.items() if name in known})
    prepared = prepare_records(model, records, options)
    runs_of = equation_runs(model, prepared)
    if runs_of is not None:
        prepared = segmented_starts(prepared, runs_of)
    # Under the hold of the fit no whole sample of a delay is passed: its search tried their sides.
    cells = {prepared.hold: _cell(prepared)}
    filters = None
    if coloured:
        first = replace(prepared, hold=holds[0])
        filters = _whitening(_under(first, runs_of, None, cells.get(holds[0])).left)
    return [
        _under(_begun(prepared, hold, assumed or holds[0]), runs_of, filters, cells.get(hold))
        for hold in holds
    ]


def _begun(prepared: RecordSet, hold: InputHold, assumed: InputHold) -> RecordSet:
    """Records under a hold, delays begun where it leaves the inputs' mean delay as it was."""
    later = np.mean([dt for _, _, dt in prepared.arrays]) / 2.0
    later *= float(assumed == "zero") - float(hold == "zero")
    begun = replace(prepared, hold=hold)
    if not later:
        return begun
    try:
        values = later_by(prepared.model, float(later))
    except FlightidError:
        return begun
    names = [parameter.name for parameter in prepared.model.parameters.free]
    model = prepared.model.with_values(dict(zip(names, map(float, values), strict=True)))
    return replace(begun, model=model)


def _cell(prepared: RecordSet) -> tuple[Array, Array] | None:
    cells = DelayCells(tuple({dt for _, _, dt in prepared.arrays}), prepared.hold)
    try:
        return cells.around(prepared.model)
    except FlightidError:
        # Equations that have no linearisation at their trim.
        return None


def _whitening(left: Sequence[Array]) -> list[Array]:
    """Of each output, the filter that makes white what is left of it (Yule and Walker)."""
    found = []
    for output in range(len(left[0])):
        rows = [each[output] for each in left]
        lags = min(LAGS, *(row.size // LAGS for row in rows))
        own = np.array([sum(float(r[: r.size - k] @ r[k:]) for r in rows) for k in range(lags + 1)])
        own[0] = own[0] * (1.0 + RIDGE) + np.finfo(float).tiny
        past = scipy.linalg.solve_toeplitz(own[:-1], own[1:]) if lags else np.empty(0)
        found.append(np.concatenate([[1.0], -past]))
    return found


def _whitened(values: Array, filters: Sequence[Array] | None) -> Array:
    """Values or slopes, shape (n_outputs, n_samples, …), along the samples."""
    if filters is None:
        return values
    return np.stack(
        [filtered(f, [1.0], row, axis=0) for f, row in zip(filters, values, strict=True)]
    )


def _under(
    prepared: RecordSet,
    runs_of: EquationRuns | None,
    filters: Sequence[Array] | None,
    cell: tuple[Array, Array] | None,
) -> HeldOutputs:
    free = [parameter.name for parameter in prepared.model.parameters.free]
    values = np.array([prepared.model.parameters[name].value or 0.0 for name in free])
    sizes = np.std(np.concatenate([each[1] for each in prepared.arrays], axis=1), axis=1)
    largest = FAR * sizes
    samples = sum(each[1].size for each in prepared.arrays)
    slopes: list[Array] = []
    squares: list[Array] = []
    for round_ in range(STEPS if filters is None else COLOURED_STEPS):
        if round_:
            model = prepared.model.with_values(dict(zip(free, map(float, values), strict=True)))
            prepared = replace(prepared, model=model)
        runs = [
            run_with_slopes(prepared.model, prepared, runs_of, place, own, sloped=not slopes)
            for place, own in enumerate(prepared.own)
        ]
        left = [each[1] - run[0] for each, run in zip(prepared.arrays, runs, strict=True)]
        _require_near(left, [slope for _, slope in runs], largest)
        left = [_whitened(each, filters) for each in left]
        if not slopes:
            slopes = [_whitened(slope, filters) for _, slope in runs]
            squares = [_squares_of(slope) for slope in slopes]
        del runs  # whose slopes would stand beside the next ones
        limits = None if cell is None else (cell[0] - values, cell[1] - values)
        steps = _steps(left, slopes, squares, sizes, len(free), limits)
        changes = [_changes(*pair, len(free)) for pair in zip(slopes, steps, strict=True)]
        left = [rest - shared - own for rest, (shared, own) in zip(left, changes, strict=True)]
        sizes = np.sqrt(np.mean(np.concatenate(left, axis=1) ** 2, axis=1))
        shared, own = ([each[place] for each in changes] for place in (0, 1))
        moved = _squares(shared, sizes), _squares(own, sizes)
        if moved[0] > SHORT or moved[1] > NEAR * samples:
            slopes = []
        ended = sum(moved) < SETTLED
        values = values + steps[0][: len(free)]
        begun = [
            numbers.filled(_free_values(numbers) + step[len(free) :])
            for numbers, step in zip(prepared.own, steps, strict=True)
        ]
        prepared = replace(prepared, own=begun)
        if ended:
            break
    return HeldOutputs(values, left)


def _squares_of(slopes: Array) -> Array:
    """Products of slopes by all numbers with all, of each output, (n_outputs, k, k)."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.array([slope.T @ slope for slope in slopes])


def _changes(slopes: Array, step: Array, n_free: int) -> tuple[Array, Array]:
    """What a step changes of outputs by the shared parameters, and by the record's own numbers."""
    apart = np.zeros((len(step), 2))
    apart[:n_free, 0], apart[n_free:, 1] = step[:n_free], step[n_free:]
    found = slopes @ apart
    return found[:, :, 0], found[:, :, 1]


def _squares(changes: Sequence[Array], sizes: Array) -> float:
    """Sum of squares of changes of outputs, each over what is left of it."""
    total = np.sum([np.sum(each**2, axis=1) for each in changes], axis=0)
    return float(np.sum(total / np.where(sizes > 0.0, sizes, 1.0) ** 2))


def _require_near(left: Sequence[Array], slopes: Sequence[Array], largest: Array) -> None:
    """Refuse to step from a model that is nowhere near its records.

    Raises
    ------
    DataError
        A run that explodes, or leaves far more than there was.
    """
    sound = all(
        np.all(np.abs(rest) <= largest[:, None]) and np.isfinite(np.sum(slope))
        for rest, slope in zip(left, slopes, strict=True)
    )
    if not sound:
        raise DataError(
            "a step under another hold leads away from the records",
            found=f"residuals above {FAR:g} times the outputs",
            needed="a model that follows them",
        )


def _steps(
    left: Sequence[Array],
    slopes: Sequence[Array],
    squares: Sequence[Array],
    sizes: Array,
    n_free: int,
    limits: tuple[Array, Array] | None,
) -> list[Array]:
    """Least squares: changes of the shared parameters and of each record's own numbers."""
    weights = 1.0 / np.where(sizes > 0.0, sizes, 1.0)
    # Triangles hold all that least squares ask, of as many rows as there are numbers.
    triangles = [
        triangle_of_parts(
            partial(_weighed, rest, slope, weights, n_free),
            _products(rest, slope, square, weights, n_free),
            partial(_columns, rest, slope, n_free),
        )
        for rest, slope, square in zip(left, slopes, squares, strict=True)
    ]
    seen = [_told_apart(each, each.shape[1] - n_free - 1) for each in triangles]
    triangles = [each for each, _ in seen]
    n_own = [each.shape[1] - n_free - 1 for each in triangles]
    inner = [each[m:, m:] for each, m in zip(triangles, n_own, strict=True)]
    whole = triangle_of_rows(np.concatenate(inner))
    shared: Array = np.asarray(np.linalg.lstsq(whole[:, :-1], whole[:, -1])[0], dtype=np.float64)
    if limits is not None:
        shared = _inside(shared, whole, limits)
    found = []
    for each, (_, kept), m in zip(triangles, seen, n_own, strict=True):
        rest = each[:m, -1] - each[:m, m:-1] @ shared
        own = np.zeros(len(kept))
        own[kept] = np.linalg.lstsq(each[:m, :m], rest)[0]
        found.append(np.concatenate([shared, own]))
    return found


def _told_apart(triangle: Array, n_own: int) -> tuple[Array, NDArray[np.bool_]]:
    """The triangle without own numbers that do what others of the record do, and which are left.

    A bias of an output that is a state and the state's start may have one effect: rounding would
    decide along what the second of them is eliminated, and take that from the shared parameters.
    """
    size = np.linalg.norm(triangle[:, :n_own], axis=0)
    kept = np.abs(np.diag(triangle)[:n_own]) > ALIKE * size
    if np.all(kept):
        return triangle, kept
    rest = np.ones(triangle.shape[1] - n_own, dtype=bool)
    return triangle_of_rows(triangle[:, np.concatenate([kept, rest])]), kept


def _inside(step: Array, triangle: Array, limits: tuple[Array, Array]) -> Array:
    """The step, what would leave its limits held there and the rest solved again."""
    clipped = np.clip(step, *limits)
    rest = clipped == step
    if np.all(rest):
        return step
    target = triangle[:, -1] - triangle[:, :-1][:, ~rest] @ clipped[~rest]
    clipped[rest] = np.linalg.lstsq(triangle[:, :-1][:, rest], target)[0]
    return np.clip(clipped, *limits)


def _products(left: Array, slopes: Array, squares: Array, weights: Array, n_free: int) -> Array:
    """Products of the columns that `_weighed` gives, without a copy of long slopes.

    Those of slopes, `squares` by output, are the same in steps that keep them.
    """
    count = slopes.shape[2]
    found = np.zeros((count + 1, count + 1))
    with np.errstate(over="ignore", invalid="ignore"):
        for rest, slope, square, weight in zip(left, slopes, squares, weights, strict=True):
            found[:count, :count] += weight**2 * square
            found[:count, count] += weight**2 * (slope.T @ rest)
            found[count, count] += weight**2 * (rest @ rest)
    found[count, :count] = found[:count, count]
    places = _order(count, n_free)
    return np.asarray(found[np.ix_(places, places)])


def _order(count: int, n_free: int) -> list[int]:
    """Own numbers' slopes, the shared ones', what is left, as they stand in slopes and left."""
    return [*range(n_free, count), *range(n_free), count]


def _columns(left: Array, slopes: Array, n_free: int, places: Sequence[int]) -> Iterator[Array]:
    """Some columns of `_weighed`, by output and without its weights."""
    order = _order(slopes.shape[2], n_free)
    for rest, slope in zip(left, slopes, strict=True):
        whole = [rest if order[k] == slope.shape[1] else slope[:, order[k]] for k in places]
        yield np.column_stack(whole)


def _weighed(left: Array, slopes: Array, weights: Array, n_free: int) -> Iterator[Array]:
    """Rows of a record: own numbers' slopes, the shared ones', what is left."""
    for rest, slope, weight in zip(left, slopes, weights, strict=True):
        for begin in range(0, len(rest), AT_ONCE):
            rows = slice(begin, begin + AT_ONCE)
            parts = slope[rows, n_free:], slope[rows, :n_free], rest[rows]
            yield weight * np.column_stack(parts)


def _free_values(numbers: OwnNumbers) -> Array:
    parts = (
        (numbers.initial, numbers.free_initial),
        (numbers.shift, numbers.free_shift),
        (numbers.bias, numbers.free_bias),
    )
    return np.concatenate([values[places] for values, places in parts])
