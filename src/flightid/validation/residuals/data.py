"""Residuals and inputs as plain series, from a verification, records or arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid.errors import DataError, OptionError, ShapeError
from flightid.frozen import dataclass
from flightid.identification import Fit
from flightid.models import Model
from flightid.record import Record
from flightid.record.hold import SAME_SAMPLE_TIME
from flightid.uncertainty.fitted_correlation import FittedCorrelation
from flightid.uncertainty.residual_correlation import Series
from flightid.validation.residuals.correlation_result import Horizon
from flightid.validation.verification.result import Verification

Residuals = (
    Fit
    | Sequence[Fit]
    | Verification
    | Record
    | Sequence[Record]
    | Mapping[str, ArrayLike]
    | ArrayLike
)
Inputs = Iterable[str] | Mapping[str, ArrayLike] | ArrayLike

_ONE_STEP = "Residuals of the one-step-ahead predictor: a good model leaves them white."
_FREE_RUN = (
    "Residuals of a free run hold the noise as it is, coloured or not: only independence of the "
    "inputs counts."
)


@dataclass(frozen=True)
class ResidualData:
    """Series by channel name, and what they are.

    Attributes
    ----------
    residuals, inputs : mapping of str to tuple of ndarray
        One array for each record.
    scale : mapping of str to float
        Size of the measured output where it is known: a residual far below it is rounding noise.
    horizon : Horizon
    predictor : str
        Which predictor made the residuals, in words.
    fitted_noise, fitted_input : int
        Parameters that were fitted to these samples, as `residual_tests` counts them.
    fitted : mapping of (output, input) to FittedCorrelation
        Of a fit that knows what it leaves of its residuals' noise.
    """

    residuals: Mapping[str, Series]
    inputs: Mapping[str, Series]
    scale: Mapping[str, float]
    horizon: Horizon
    predictor: str
    fitted_noise: int = 0
    fitted_input: int = 0
    fitted: Mapping[tuple[str, str], FittedCorrelation] = field(default_factory=dict)

    @property
    def lengths(self) -> tuple[int, ...]:
        """Samples of each record."""
        return tuple(record.size for record in next(iter(self.residuals.values())))


def gather_residuals(
    residuals: Residuals,
    inputs: Inputs | None,
    outputs: Iterable[str] | None,
    horizon: Horizon | None,
) -> ResidualData:
    """Bring every form of residuals to series.

    Raises
    ------
    OptionError
        The horizon is not said, or contradicts a verification; names with bare arrays.
    ShapeError
        Arrays that do not fit.
    DataError
        A sample that is not finite, nothing to test, or sample times that differ.
    UnknownNameError
        A record lacks a channel.
    """
    if isinstance(residuals, Verification):
        return _of_verification(residuals, _channel_names(inputs), outputs, horizon)
    if isinstance(residuals, Fit):
        residuals = (residuals,)
    if isinstance(residuals, Sequence) and residuals and isinstance(residuals[0], Fit):
        fits = tuple(fit for fit in residuals if isinstance(fit, Fit))
        return _of_fits(fits, _channel_names(inputs), outputs, horizon)
    if isinstance(residuals, Model):
        raise DataError(
            "a model has no residuals of its own",
            found=type(residuals).__name__,
            needed="a fit, or predictions of records",
            action="predict records first: residual_tests(flightid.verify(model, records))",
        )
    if horizon is None:
        raise OptionError(
            "the predictor is not said",
            needed="horizon='one step ahead' or 'free run'",
            action="say which predictor made the residuals: a free run need not leave them white",
        )
    predictor = _ONE_STEP if horizon is Horizon.ONE_STEP else _FREE_RUN
    if isinstance(residuals, Record):
        residuals = (residuals,)
    if isinstance(residuals, Sequence) and residuals and isinstance(residuals[0], Record):
        records = tuple(record for record in residuals if isinstance(record, Record))
        names = tuple(records[0].outputs if outputs is None else outputs)
        given = _channel_names(inputs)
        driven = tuple(records[0].inputs if given is None else given)
        _require_one_sample_time(records)
        return _checked(_columns(records, names), _columns(records, driven), {}, horizon, predictor)
    if outputs is not None:
        raise OptionError(
            "names choose channels of records", found="arrays", action="give a mapping instead"
        )
    named = {} if inputs is None else _named(inputs, "u")
    return _checked(_named(residuals, "e"), named, {}, horizon, predictor)


def _sizes(measured: Sequence[Record], names: Iterable[str]) -> dict[str, float]:
    """Root mean square of each output about its mean, over all records."""
    return {
        name: float(np.sqrt(np.mean(np.concatenate([row - row.mean() for row in series]) ** 2)))
        for name, series in _columns(measured, names).items()
    }


def _of_verification(
    verification: Verification,
    inputs: Iterable[str] | None,
    outputs: Iterable[str] | None,
    horizon: Horizon | None,
) -> ResidualData:
    made_with = Horizon.ONE_STEP if verification.horizon == 1 else Horizon.FREE_RUN
    if horizon not in (None, made_with):
        raise OptionError(
            "this verification has another predictor", found=str(horizon), needed=str(made_with)
        )
    names = tuple(verification.outputs if outputs is None else outputs)
    driven = tuple(verification.predicted.inputs if inputs is None else inputs)
    scored = tuple(item.residual_record() for item in verification.predictions)
    _require_one_sample_time(scored)
    words = _ONE_STEP if made_with is Horizon.ONE_STEP else _FREE_RUN
    sizes = _sizes([item.measured for item in verification.predictions], names)
    return _checked(
        _columns(scored, names),
        _columns(scored, driven),
        sizes,
        made_with,
        f"{verification.protocol} {words}",
    )


def _of_fits(
    fits: Sequence[Fit],
    inputs: Iterable[str] | None,
    outputs: Iterable[str] | None,
    horizon: Horizon | None,
) -> ResidualData:
    """Residuals of fits to the same records, cut to their common samples."""
    wanted = None if outputs is None else tuple(outputs)
    measured = _common_records(fits)
    found = Horizon.ONE_STEP if all(fit.residual_horizon == 1 for fit in fits) else Horizon.FREE_RUN
    if horizon is not None and horizon is not found:
        raise OptionError(
            "residuals of this fit come from another predictor",
            found=str(horizon),
            needed=str(found),
        )
    rows = list(zip(*(fit.residuals for fit in fits), strict=True))
    counts = [min(record.n_samples for record in row) for row in rows]

    def series(place: int, name: str) -> Series:
        return tuple(row[place][name][-n:] for row, n in zip(rows, counts, strict=True))

    made = {
        name: series(place, name)
        for place, fit in enumerate(fits)
        for name in fit.records[0].outputs
        if wanted is None or name in wanted
    }
    names = dict.fromkeys(name for fit in fits for name in fit.model.inputs)
    driven = {name: series(0, name) for name in (names if inputs is None else inputs)}
    spent = [(0, 0) if fit.details is None else fit.details.spent for fit in fits]
    words = _FREE_RUN if found is Horizon.FREE_RUN else _ONE_STEP
    checked = _checked(made, driven, _sizes(measured, made), found, words)
    return replace(
        checked,
        fitted_noise=max(noise for noise, _ in spent),
        fitted_input=max(count for _, count in spent),
        fitted={
            (fit.records[0].outputs[each.output], fit.model.inputs[each.input]): each
            for fit in fits
            for each in fit.input_correlations
        },
    )


def _common_records(fits: Sequence[Fit]) -> list[Record]:
    """The measured records of all fits, which must be the same."""
    if not all(fit.residuals for fit in fits):
        raise DataError(
            "the fit has no residuals in time",
            found="a fit of frequency responses",
            needed="a fit of records",
            action="verify it on records first: flightid.verify",
        )
    measured = [[item.measured for item in fit.records] for fit in fits]
    if any(each != measured[0] for each in measured):
        raise DataError(
            "fits of different records have no common residuals",
            found=", ".join(record.name for each in measured for record in each),
            needed="the same records",
            action="fit all outputs to the same records",
        )
    _require_one_sample_time(measured[0])
    return measured[0]


def _channel_names(inputs: Inputs | None) -> tuple[str, ...] | None:
    if inputs is None:
        return None
    if isinstance(inputs, str):
        return (inputs,)
    names = tuple(inputs) if isinstance(inputs, Iterable) else ()
    texts = tuple(name for name in names if isinstance(name, str))
    if isinstance(inputs, Mapping) or len(texts) != len(names) or not names:
        raise OptionError(
            "inputs of records are channel names", found=type(inputs).__name__, needed="names"
        )
    return texts


def _columns(records: Sequence[Record], names: Iterable[str]) -> dict[str, Series]:
    return {name: tuple(record[name] for record in records) for name in names}


def _require_one_sample_time(records: Sequence[Record]) -> None:
    times = [record.sample_time_s for record in records]
    if max(times) - min(times) > SAME_SAMPLE_TIME * times[0]:
        raise DataError(
            "records have different sample times",
            found=f"{min(times):.6g} to {max(times):.6g} s",
            needed="one: a lag is a number of samples",
            action="resample them with conditioning.resample",
        )


def _named(values: object, stem: str) -> dict[str, Series]:
    if isinstance(values, Mapping):
        return {name: (_row(samples),) for name, samples in values.items()}
    try:
        matrix = np.atleast_2d(np.asarray(values, dtype=np.float64))
    except ValueError as error:
        raise ShapeError(
            "residuals or inputs are not numbers in rows", needed="(n_samples,) or (n, n_samples)"
        ) from error
    if matrix.ndim != 2:
        raise ShapeError(
            "residuals or inputs are not rows of samples",
            found=matrix.shape,
            needed="(n_samples,) or (n_channels, n_samples)",
        )
    return {f"{stem}{index}": (row,) for index, row in enumerate(matrix, start=1)}


def _row(samples: ArrayLike) -> NDArray[np.float64]:
    row = np.asarray(samples, dtype=np.float64)
    if row.ndim != 1:
        raise ShapeError("a named series is one row", found=row.shape, needed="(n_samples,)")
    return row


def _checked(
    residuals: dict[str, Series],
    inputs: dict[str, Series],
    scale: dict[str, float],
    horizon: Horizon,
    predictor: str,
) -> ResidualData:
    if not residuals:
        raise DataError("there are no residuals", needed="one output or more")
    if horizon is Horizon.FREE_RUN and not inputs:
        raise DataError(
            "a free run without inputs leaves nothing to test",
            needed="inputs",
            action="give the inputs that drove the run",
        )
    lengths = [record.size for record in next(iter(residuals.values()))]
    for name, series in (*residuals.items(), *inputs.items()):
        if [record.size for record in series] != lengths:
            raise ShapeError(
                f"{name} does not fit the residuals",
                found=[record.size for record in series],
                needed=lengths,
            )
        if not all(np.all(np.isfinite(record)) for record in series):
            raise DataError(
                f"{name} holds samples that are not finite",
                needed="finite numbers",
                action="cut the record before the gap",
            )
    return ResidualData(residuals, inputs, scale, horizon, predictor)
