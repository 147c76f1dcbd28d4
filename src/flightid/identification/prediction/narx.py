"""Predictions of NARX models: measured samples fill the lags, and the guard holds the run."""

from __future__ import annotations

from flightid.errors import OptionError
from flightid.identification.prediction.request import FREE_RUN, Request
from flightid.identification.prediction.result import Prediction
from flightid.models import NarxModel
from flightid.record import Channel, Record, Step


def predict_narx(
    model: NarxModel, record: Record, outputs: tuple[str, ...], request: Request
) -> Prediction:
    """Predict one record; `flightid.predict` says how.

    Raises
    ------
    OptionError
        Another start than the measured lags, or a bias.
    DataError
        Another sample time, or fewer samples than lags.
    UnitError
        A channel in another unit.
    """
    if request.initial_state not in (None, "measured"):
        raise OptionError(
            "a NARX model starts from measured lags",
            found=repr(request.initial_state),
            needed="'measured'",
        )
    if request.state_bias or request.output_bias:
        raise OptionError("a NARX model takes no bias off", found="a bias", needed="none")
    run, began, diverged_at = model.run(record, request.horizon)
    (name,) = outputs
    known = record.channels
    channels = [known[each] for each in model.inputs]
    channels.append(Channel(name, known[name].unit, known[name].role, "predicted"))
    predicted = record.replace({name: run}, channels=channels, step=Step("predict", {}))
    settle = request.settle_samples(record.n_samples, record.sample_time_s) or 0
    start = began if request.horizon != FREE_RUN else max(began, settle)
    return Prediction(
        record,
        predicted,
        outputs,
        request.horizon,
        f"{began} measured samples",
        start,
        diverged_at=diverged_at,
    )
