"""Predictions of sampled models with a noise model: polynomials and innovations forms.

What the model holds about is its own operating point, that of its training records, or the trim a
record declares: never the mean of the record that is predicted.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass
from flightid.identification.prediction.request import FREE_RUN, Request, usual_stretch
from flightid.identification.prediction.result import Prediction, Shifts
from flightid.models import InnovationsModel, PolynomialModel
from flightid.models.innovations import prediction as innovations
from flightid.models.polynomial import prediction as polynomial
from flightid.models.sampled.channels import hold_diverged, require_same
from flightid.record import Channel, Record, Step

Array = NDArray[np.float64]
SampledModel = PolynomialModel | InnovationsModel
RANK = 1e-10
"""Directions of the initial state weaker than this share of the strongest are left at rest."""
FADED = 1e-20
"""Samples in which free motions are below this share of their largest tell nothing of the start."""


@dataclass(frozen=True, eq=False)
class Deviations:
    """A record's channels about the point that the model holds about.

    Attributes
    ----------
    outputs : ndarray, shape (p, n_samples)
    inputs : ndarray, shape (m, n_samples)
    point : ndarray, shape (p,)
        What was taken off the outputs.
    """

    outputs: Array
    inputs: Array
    point: Array


def predict_sampled(
    model: SampledModel, record: Record, outputs: tuple[str, ...], request: Request
) -> Prediction:
    """Predict one record; `flightid.predict` says how.

    Raises
    ------
    OptionError
        Something is asked that this kind of model does not have.
    DataError
        Another sample time, or a record too short to tell the start.
    UnitError
        A channel in another unit.
    """
    _refuse(request)
    names = _outputs(model)
    require_same(
        model,
        {name: record.unit(name) for name in (*names, *model.inputs)},
        record.sample_time_s,
    )
    data = _deviations(model, record, names)
    with np.errstate(over="ignore", invalid="ignore"):
        if request.horizon == FREE_RUN:
            run, start, shifts = _free_run(model, data, record, request)
        else:
            run, start, shifts = _ahead(model, data, request), 0, None
    diverged_at = hold_diverged(run)
    made = run + data.point[:, None]
    rows = dict(zip(names, made, strict=True))
    known = record.channels
    channels = [known[name] for name in model.inputs]
    channels += [Channel(name, known[name].unit, known[name].role, "predicted") for name in outputs]
    predicted = record.replace(
        {name: rows[name] for name in outputs}, channels=channels, step=Step("predict", {})
    )
    settled = {} if shifts is None else {"shifts": shifts}
    return Prediction(
        record,
        predicted,
        outputs,
        request.horizon,
        start_words(request, start, record.sample_time_s),
        start,
        diverged_at=diverged_at,
        **settled,
    )


def start_words(request: Request, start: int, sample_time_s: float) -> str:
    """Where a sampled model started."""
    if request.horizon != FREE_RUN:
        return "the measured past"
    if request.initial_state in ("zero", "trim"):
        return "rest" if request.initial_state == "zero" else "rest at trim"
    return f"an initial state solved for over the first {start * sample_time_s:.3g} s"


def _refuse(request: Request) -> None:
    if request.state_bias:
        raise OptionError(
            "a sampled model has no state biases", found="state_bias=True", needed="False"
        )
    if isinstance(request.initial_state, Mapping):
        raise OptionError(
            "the states of a sampled model have no names",
            found=", ".join(map(str, request.initial_state)),
            needed="'trim', 'zero', 'measured' or 'estimate'",
        )
    if request.horizon != FREE_RUN and request.output_bias:
        raise OptionError(
            "a prediction from the measured past takes no bias off",
            found="output_bias=True",
            needed="False, or a free run",
        )


def _outputs(model: SampledModel) -> tuple[str, ...]:
    return (model.output,) if isinstance(model, PolynomialModel) else model.outputs


def _deviations(model: SampledModel, record: Record, names: tuple[str, ...]) -> Deviations:
    # A trim that the record declares is its own, and goes before that of the training records.
    point = {**model.operating_point, **record.trim}

    def about(channels: tuple[str, ...]) -> Array:
        rows = [record[name] - point.get(name, 0.0) for name in channels]
        return np.array(rows, dtype=np.float64).reshape(len(channels), record.n_samples)

    offsets = np.array([point.get(name, 0.0) for name in names])
    return Deviations(about(names), about(model.inputs), offsets)


def _free_run(
    model: SampledModel, data: Deviations, record: Record, request: Request
) -> tuple[Array, int, Shifts]:
    """The answer to the inputs, with the free motion that its first stretch tells."""
    forced = _forced(model, data.inputs)
    p, n_samples = data.outputs.shape
    settle = request.settle_samples(n_samples, record.sample_time_s)
    solved = request.initial_state not in ("zero", "trim")
    n_free = (_order(model) if solved else 0) + (p if request.output_bias else 0)
    if not n_free:
        return forced, settle or 0, Shifts(np.zeros(0), np.zeros(p), np.zeros(0), 0, 0)
    stretch = settle or _stretch(request, n_samples, p, n_free)
    if stretch * p < n_free:
        raise DataError(
            "the first stretch is too short to tell the start",
            found=f"{stretch} samples of {p} outputs",
            needed=f"{n_free} numbers or more",
            action="give a longer settle_s, or initial_state='zero'",
        )
    motion = _motion(model, stretch) if solved else np.zeros((0, p, stretch))
    columns = [*motion, *(_constants(p, stretch) if request.output_bias else ())]
    told = np.array(columns).reshape(len(columns), -1).T
    error = (data.outputs - forced)[:, :stretch].ravel()
    if not (np.all(np.isfinite(told)) and np.all(np.isfinite(error))):
        return forced, stretch, Shifts(np.zeros(0), np.zeros(p), np.zeros(len(motion)), 0, 0)
    size = np.max(np.abs(told), axis=1)
    heard = size > FADED * np.max(size)
    weights, _, rank, _ = np.linalg.lstsq(told[heard], error[heard], rcond=RANK)
    k = len(motion)
    bias = weights[k:] if request.output_bias else np.zeros(p)
    # One recursion from the start that was found, not one for each number of it.
    run = forced + bias[:, None]
    if k:
        run = run + _motion_from(model, weights[:k], n_samples)
    return run, stretch, Shifts(np.zeros(0), bias, weights[:k], len(columns), int(rank))


def _stretch(request: Request, n_samples: int, p: int, n_columns: int) -> int:
    if request.initial_state == "measured":
        return min(-(-n_columns // p), n_samples - 1)
    return usual_stretch(n_samples, n_columns)


def _constants(p: int, n_samples: int) -> Array:
    return np.asarray(np.eye(p)[:, :, None] * np.ones(n_samples))


def _forced(model: SampledModel, inputs: Array) -> Array:
    if isinstance(model, PolynomialModel):
        return polynomial.forced_run(model, inputs)[None]
    return innovations.forced_run(model, inputs)


def _motion(model: SampledModel, n_samples: int) -> Array:
    """What each number of the initial state makes of the outputs, shape (k, p, n_samples)."""
    if isinstance(model, PolynomialModel):
        return polynomial.free_motion(model, n_samples)[:, None]
    a, _, c, _, _ = model.matrices
    return innovations.free_motion(a, c, n_samples)


def _motion_from(model: SampledModel, start: Array, n_samples: int) -> Array:
    """What a whole initial state makes of the outputs, shape (p, n_samples)."""
    if isinstance(model, PolynomialModel):
        return polynomial.motion_from(model, start, n_samples)[None]
    a, _, c, _, _ = model.matrices
    return innovations.motion_from(a, c, start, n_samples)


def _order(model: SampledModel) -> int:
    """Numbers of the initial state."""
    if isinstance(model, PolynomialModel):
        return np.size(model.a) - 1 + sum(row.size - 1 for row in model.distinct_f)
    return model.order


def _ahead(model: SampledModel, data: Deviations, request: Request) -> Array:
    """y(t) minus the part of the noise that is younger than the horizon."""
    horizon = int(request.horizon)
    # Before the record: rest where that is said, else the past that fits its errors best.
    past = "zero" if request.initial_state in ("zero", "trim") else "estimate"
    if isinstance(model, PolynomialModel):
        return polynomial.ahead(model, data.outputs[0], data.inputs, horizon, past)[None]
    return innovations.ahead(model, data.outputs, data.inputs, horizon, past)
