"""A fit to short stretches of one axis in its rate loop, whose noise the loop feeds back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.identification.damaged_samples import with_damage_judged
from flightid.identification.fit_evidence import evidence_of
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.innovation_tests import InnovationTests, innovation_tests
from flightid.identification.multistart import DenseEnd
from flightid.identification.records.options import RecordOptions
from flightid.identification.records.setup import RecordSet, prepare_records
from flightid.identification.regression.fit import Inner, Knowledge, assemble, require_seen
from flightid.identification.regression.options import RegressionOptions
from flightid.identification.withheld_intervals import without_intervals
from flightid.models.transfer.model import TransferFunctionModel
from flightid.record import Record, Step
from flightid.review.autotune.twitch_noise import SOURCES, TICKS
from flightid.review.autotune.twitch_search import TwitchEnd, TwitchSearch
from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import residual_covariance
from flightid.uncertainty.foretold import is_material

Array = NDArray[np.float64]
HOLD = "first"
ORDERS = (0, 4, 8)
"""Of the colour of a gyro's noise before its filter; the first that leaves innovations white."""


UNSEEN = 2.0
"""Times by which bars are longer where the loop before the tests is not logged: what it answered to
noise is on its way in motors and delays, and goes with what inputs hold of that noise. Counted with
two simulators: errors were 1.6 standard errors, with noise of .02 as with .2 rad/s."""
SIZES, WIDEST = ("K", "T_m"), 0.5
"""Numbers that have no other sign, and the half of an interval, over the number, up to which what
follows from it is as good as linear."""


@dataclass(frozen=True)
class TwitchRecord:
    """A record whose first samples are the inputs' past alone.

    Attributes
    ----------
    record : Record
        Inputs as departures from those that hold the vehicle still.
    lead : int
        Samples before the first measured rate.
    begun : int or None
        Sample at which measured inputs begin; those before are supposed to hold the vehicle still.
        None where all are measured.
    """

    record: Record
    lead: int
    begun: int | None = None


def fit_stretches(
    model: TransferFunctionModel, stretches: Sequence[TwitchRecord], gyro_filter_hz: float
) -> Fit:
    """Fit a rate's answer to its command where the loop feeds the gyro's noise back.

    Parameters
    ----------
    model : TransferFunctionModel
        From `template`: K, L, T_m and tau.
    stretches : sequence of TwitchRecord
    gyro_filter_hz : float
        Hz; 0 where the rate is not filtered.

    Returns
    -------
    Fit
        Records hold predictions one sample ahead. Without intervals where innovations are foretold
        by more than bars can hold.

    Raises
    ------
    FitError
        The stretches cannot tell parameters apart.

    Assumes
    -------
    Gaussian disturbances: noise before the gyro's filter, of any colour of low order, and white
    and steady accelerations. Inputs that answer measured rates of the past alone, and no faster
    than the vehicle's delay of a sample.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., §13.4 (direct identification in a closed loop with a
    noise model that holds the truth); Nickell (1981), Econometrica 49 (what numbers of each short
    stretch do to those that all share); Pinheiro & Bates, *Mixed-Effects Models in S and S-PLUS*,
    ch. 2 (numbers that are drawn instead).
    """
    options = RecordOptions(initial_state="trim", output_bias=False, input_bias=False, hold=HOLD)
    prepared = prepare_records(model, [each.record for each in stretches], options)
    search = TwitchSearch(
        prepared,
        [each.lead for each in stretches],
        gyro_filter_hz,
        prepare_records(model, [_stepped(model, stretches)], options),
        [each.begun for each in stretches],
    )
    end, tests = _searched(search, model, prepared, stretches)
    return _fit(model, search, end, tests, stretches)


def _stepped(model: TransferFunctionModel, stretches: Sequence[TwitchRecord]) -> Record:
    """A step of the input at the second sample, longer than any of the stretches."""
    longest = max((each.record for each in stretches), key=lambda record: record.n_samples)
    step = np.ones(longest.n_samples + 2)
    step[0] = 0.0
    channels = (*model.inputs, *model.outputs)
    return Record.from_arrays(
        longest.sample_time_s * np.arange(len(step)),
        inputs=dict.fromkeys(model.inputs, step),
        outputs=dict.fromkeys(model.outputs, np.zeros(len(step))),
        units={name: longest.unit(name) for name in channels},
    )


def _searched(
    search: TwitchSearch,
    begun: TransferFunctionModel,
    prepared: RecordSet,
    stretches: Sequence[TwitchRecord],
) -> tuple[TwitchEnd, InnovationTests]:
    """The likelier form of the filter, and the first colour that leaves innovations white."""
    best = search.search(begun, ticks=TICKS[0], order=0, start=None)
    other = search.search(best.model, ticks=TICKS[1], order=0, start=best)
    if other.cost < best.cost:
        best = other
    tests = _tested(search, best, prepared, stretches)
    plain = best
    for order in ORDERS[1:]:
        if tests.is_white:
            break
        best = search.search(plain.model, ticks=plain.noise.shape.ticks, order=order, start=plain)
        tests = _tested(search, best, prepared, stretches)
    return best, tests


def _tested(
    search: TwitchSearch, end: TwitchEnd, prepared: RecordSet, stretches: Sequence[TwitchRecord]
) -> InnovationTests:
    outputs = [y[:, s.lead :] for (_, y, _), s in zip(prepared.arrays, stretches, strict=True)]
    return innovation_tests(
        _rows(search, end.innovations),
        _past(search, stretches),
        outputs,
        (len(end.noise.partial), 0),
    )


def _past(search: TwitchSearch, stretches: Sequence[TwitchRecord]) -> list[Array]:
    """Inputs of the sample before: one of this tick holds the rate of this tick already."""
    return [
        inputs[:, each.lead - 1 : -1]
        for (inputs, _, _), each in zip(search.prepared.arrays, stretches, strict=True)
    ]


def _rows(search: TwitchSearch, padded: Array) -> list[Array]:
    return [row[None, :n] for row, n in zip(padded, search.lengths, strict=True)]


def _fit(
    structure: TransferFunctionModel,
    search: TwitchSearch,
    end: TwitchEnd,
    tests: InnovationTests,
    stretches: Sequence[TwitchRecord],
) -> Fit:
    model = end.model
    free = model.parameters.free
    values = np.array([float(p.value or 0.0) for p in free])
    inner = Inner.of(model, values)
    slopes = [
        np.ascontiguousarray(end.slopes[inner.mask, k, :n].T) for k, n in enumerate(search.lengths)
    ]
    jacobian = np.concatenate(slopes)
    require_seen(inner, jacobian)
    blocks = [
        RecordBlock.of(each[None], np.ones((1, len(each), 0)), row)
        for each, row in zip(slopes, _rows(search, end.white), strict=True)
    ]
    found = residual_covariance(blocks, inputs=_past(search, stretches))
    ratio = np.sqrt(np.sum(end.innovations**2) / np.sum(search.measured**2))
    tests = tests.fitted(found.correlations, [float(ratio)])
    times = _longer(tests)
    unseen = UNSEEN if any(each.begun is not None for each in stretches) else 1.0
    known = Knowledge(
        jacobian,
        found.covariance * (unseen * (times or 1.0)) ** 2,
        found.freedom,
        "innovations",
        found.colour,
        found.agreement,
    )
    residuals = np.concatenate([row[0] for row in _rows(search, end.white)])
    ended = DenseEnd(
        values, end.cost, end.turns, "cost" if end.is_converged else "iterations",
        residuals, jacobian,
    )  # fmt: skip
    records = [_measured(each) for each in stretches]
    predictions = [
        _predicted(record, model.outputs[0], row[0])
        for record, row in zip(records, _rows(search, end.innovations), strict=True)
    ]
    fit = assemble(
        "maximum likelihood of stretches in a loop", inner, [[ended]], known,
        _costs(model.outputs[0], records, predictions), records,
        [
            FittedRecord(record, each, model.outputs)
            for record, each in zip(records, predictions, strict=True)
        ],
        RegressionOptions(hold=HOLD),
        findings=[*tests.findings(biased=True, times=times)],
        extra={"noise": _described(end)},
        residual_horizon=1,
    )  # fmt: skip
    fit = with_damage_judged(replace(fit, structure=structure, method="output_error"), records)
    why = tests.why_biased if times is None else _untold(fit, end)
    if why:
        fit = without_intervals(fit, why)
    return replace(fit, evidence=evidence_of(fit, records, "closed"))


def _longer(tests: InnovationTests) -> float | None:
    """Times by which bars hold what the tests say is missing; None: it shows in the rate.

    A step of a fifth of a second is far above its noise: filters that run by ticks, taken as smooth
    ones, are foretold long before they matter. What is missing bends no estimate by more of its
    standard errors than all that is missing has itself.
    """
    if tests.is_independent or is_material(tests.worth_percent):
        return tests.widening(biased=True)
    return replace(tests, worth_percent=0.0).widening(biased=True)


def _untold(fit: Fit, end: TwitchEnd) -> str:
    """Why the stretches tell too little for bars about a linear point; empty where they do not."""
    noise = f"under noise of {np.exp(end.noise.sizes[0]):.2g} rad/s behind the gyro's filter"
    for name, each in fit.parameters.items():
        value, ends = float(each.value or 0.0), each.interval95
        if each.status == "at bound":
            return (
                f"{name} stands at its bound, {value:.3g} {each.unit}: {noise} the "
                "tests do not tell it, and bars of the others leave that out"
            )
        if name in SIZES and ends is not None and ends[1] - value > WIDEST * value:
            return (
                f"{name} is told to {100.0 * (ends[1] / value - 1.0):.3g} %: bars take "
                f"{100 * WIDEST:.0f} % or better, and {noise} the tests are too few or too small"
            )
    return ""


def _described(end: TwitchEnd) -> dict[str, object]:
    sizes = dict(zip(SOURCES, map(float, np.exp(end.noise.sizes)), strict=True))
    return {**sizes, "colour": np.tanh(end.noise.partial).tolist()}


def _measured(stretch: TwitchRecord) -> Record:
    """The stretch without the inputs' past."""
    time_s = stretch.record.time_s
    return stretch.record.segment(float(time_s[stretch.lead]), float(time_s[-1]) + 1.0)


def _predicted(record: Record, output: str, innovations: Array) -> Record:
    step = Step("identify", {"method": "maximum likelihood, one-step predictions"})
    return record.replace({output: record[output] - innovations}, step=step)


def _costs(
    output: str, measured: Sequence[Record], predicted: Sequence[Record]
) -> dict[str, float]:
    """Percent of the rate's variance, about zero, that predictions leave."""
    left = sum(
        float(np.sum((m[output] - p[output]) ** 2))
        for m, p in zip(measured, predicted, strict=True)
    )
    return {output: 100.0 * left / sum(float(np.sum(m[output] ** 2)) for m in measured)}
