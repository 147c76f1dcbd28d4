"""What records say of a hold that was told: likelihood and estimates under another, without a fit.

Estimates under another hold lie half a sample of delay away: a few steps of Gauss and Newton from
those of the fit, on the records themselves, reach them. Fits by other ways than least squares on
outputs leave residuals with colour (gusts, what lies outside a response's band): it is taken out,
the same for every hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import DataError, FlightidError
from flightid.frozen import dataclass
from flightid.identification.delay_cells import DelayCells, later_by
from flightid.identification.fit import Fit
from flightid.identification.hold_slopes import (
    RunSlopes,
    begun_with_slopes,
    residuals_of,
    whitened,
)
from flightid.identification.hold_steps import LEFT, OWN, SHARED, squares_of_steps, steps_of
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
from flightid.responses import FrequencyResponse
from flightid.uncertainty.foretold import expected_gain, likelihood_gain

Array = NDArray[np.float64]
RIDGE = 1e-9
"""Added to the power of what is left, as white noise."""
FAR = 100.0
"""Residual over an output's deviation beyond which a model follows nothing."""
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
    beside: Fit | None = None,
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
    beside : Fit, optional
        Whose estimates are those of least squares on these records: steps begin at its own numbers
        of each.

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
    if beside is not None and (runs_of is None or not runs_of.is_segmented):
        prepared = replace(prepared, own=_ended(prepared, beside))
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


def _ended(prepared: RecordSet, fit: Fit) -> list[OwnNumbers]:
    """Own numbers of each record, the free ones as a fit left them."""
    found = []
    for numbers, record in zip(prepared.own, fit.records, strict=True):
        kinds = (
            (prepared.states, numbers.free_initial, record.initial_state),
            (fit.model.inputs, numbers.free_shift, record.reference_shift),
            (fit.model.outputs, numbers.free_bias, record.bias),
        )
        names = [(names[place], known) for names, places, known in kinds for place in places]
        found.append(numbers.filled(np.array([known[name].value for name, known in names])))
    return found


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
    slopes: list[RunSlopes] = []
    for round_ in range(STEPS if filters is None else COLOURED_STEPS):
        if round_:
            model = prepared.model.with_values(dict(zip(free, map(float, values), strict=True)))
            prepared = replace(prepared, model=model)
        if slopes:
            left = [residuals_of(prepared, runs_of, *each) for each in enumerate(prepared.own)]
            _require_near(left, slopes, largest)
            left = [whitened(each, filters) for each in left]
            products = [each.products(rest) for each, rest in zip(slopes, left, strict=True)]
        else:
            begun = [
                begun_with_slopes(prepared, runs_of, *each, filters)
                for each in enumerate(prepared.own)
            ]
            left, slopes = [each[0] for each in begun], [each[2] for each in begun]
            _require_near(left, slopes, largest)
            left = [whitened(each, filters) for each in left]
            products = [each[1] for each in begun]
        limits = None if cell is None else (cell[0] - values, cell[1] - values)
        steps = steps_of(left, slopes, products, sizes, len(free), limits)
        ran = slopes
        squares = squares_of_steps(left, ran, products, steps, len(free))
        sizes = np.sqrt(squares[:, LEFT] * len(sizes) / samples)
        over = squares / np.where(sizes > 0.0, sizes, 1.0)[:, None] ** 2
        moved = np.sum(over, axis=0)
        if moved[SHARED] > SHORT or moved[OWN] > NEAR * samples:
            slopes = []
        ended = moved[SHARED] + moved[OWN] < SETTLED
        values = values + steps[0][: len(free)]
        own = [
            numbers.filled(_free_values(numbers) + step[len(free) :])
            for numbers, step in zip(prepared.own, steps, strict=True)
        ]
        prepared = replace(prepared, own=own)
        if ended:
            break
    # Residuals themselves are asked where the steps end.
    ends = [run.stepped(*pair) for run, *pair in zip(ran, left, steps, strict=True)]
    return HeldOutputs(values, ends)


def _require_near(left: Sequence[Array], slopes: Sequence[RunSlopes], largest: Array) -> None:
    """Refuse to step from a model that is nowhere near its records.

    Raises
    ------
    DataError
        A run that explodes, or leaves far more than there was.
    """
    near = all(np.all(np.abs(rest) <= largest[:, None]) for rest in left)
    if not (near and all(each.is_finite for each in slopes)):
        raise DataError(
            "a step under another hold leads away from the records",
            found=f"residuals above {FAR:g} times the outputs",
            needed="a model that follows them",
        )


def _free_values(numbers: OwnNumbers) -> Array:
    parts = (
        (numbers.initial, numbers.free_initial),
        (numbers.shift, numbers.free_shift),
        (numbers.bias, numbers.free_bias),
    )
    return np.concatenate([values[places] for values, places in parts])
