"""How far a fitted model lies from what was measured, by frequency: what no parameter holds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FlightidError
from flightid.frozen import dataclass
from flightid.identification.fitted_record import FittedRecord
from flightid.identification.fitted_response import FittedResponse
from flightid.models.model import Model, linear_system
from flightid.record import Record
from flightid.responses import FrequencyResponse, estimate_response
from flightid.responses.bands import usable_band
from flightid.responses.errors.linear_estimate import LinearEstimate
from flightid.responses.estimators.by_window import (
    NarrowResidual,
    WindowResidual,
    residuals_by_window,
)
from flightid.simulation import simulate

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
SHOWN = 0.5
"""Relative error up to which a model counts as shown: 6 dB or 30°."""
SIGMAS = 2.0
REACH = 0.25 * np.log(2.0)
"""Half an octave in all: errors of a structure change no faster."""
FEWEST = 2
ALIKE = 2.0
"""Neighbouring estimates that share their windows count as one."""
STANDS_OUT = 2.63
"""Standard deviations that noise alone leaves behind at one frequency in 1,000: exp(-2.63²)."""
TINY = float(np.finfo(float).tiny)
TRACE = 1e-9
"""Share of an output that is left of it where the model leaves nothing."""
MOST = 0.9
"""Growth ends here: a model that nothing shows is not known to 5 dB upwards and 20 dB down."""


class BySize(Protocol):
    """Share of a response that hangs on the size of the motion, by frequency."""

    @property
    def omega_rad_s(self) -> Array:
        """Of the share, rad/s."""

    @property
    def share(self) -> Array:
        """Of the response."""

    @property
    def ratio(self) -> float:
        """Of the term that makes it to its standard error."""


class LeftOver(Protocol):
    """What a model leaves of the records behind its responses, by ``"output/input"``."""

    @property
    def narrow(self) -> Mapping[str, Sequence[NarrowResidual]]:
        """By single windows."""

    @property
    def by_size(self) -> Mapping[str, BySize]:
        """Of answers that hang on the size of the motion beyond chance."""


@dataclass(frozen=True, eq=False)
class ModelErrorBound:
    """Bound of |H_true/H_model − 1| that the data show, at their frequencies.

    Attributes
    ----------
    omega_rad_s : ndarray, shape (n,)
    bound : ndarray, shape (n,)
        Relative: mean error over half an octave with two of its standard deviations; noise, a wrong
        structure and parameters that are not known all enlarge it.

    Example
    -------
    >>> import numpy as np
    >>> seen = ModelErrorBound(np.geomspace(1.0, 100.0, 5), np.array([0.1, 0.1, 0.2, 0.6, 2.0]))
    >>> tuple(round(edge, 1) for edge in seen.band_rad_s)
    (1.0, 10.0)
    """

    omega_rad_s: Array
    bound: Array

    @property
    def band_rad_s(self) -> tuple[float, float] | None:
        """Widest band in which the model was shown to hold, rad/s; None where there is none."""
        return usable_band(self.omega_rad_s, -self.bound, -SHOWN)

    def at(self, omega_rad_s: Array) -> Array:
        """Bound at any frequency; beyond the band, on either side, it grows with the distance.

        Beyond the band that shows it, an error of dynamics that are missing grows as that of a lag
        does: with frequency above it, and below it as that of a damping, with the period. There it
        ends at `SHOWN`, for what a whole loop does so low hangs little on the vehicle.
        """
        omega = np.asarray(omega_rad_s, dtype=np.float64)
        band = self.band_rad_s
        if band is None:
            return np.full(omega.shape, MOST)
        inside = np.interp(np.log(np.clip(omega, *band)), np.log(self.omega_rad_s), self.bound)
        above = np.minimum(inside * np.maximum(omega / band[1], 1.0), MOST)
        slow = np.maximum(band[0] / np.maximum(omega, TINY), 1.0)
        return np.asarray(np.where(omega < band[0], np.minimum(inside * slow, SHOWN), above))

    def averaged(self, values: Complex) -> Complex:
        """Means over half an octave at the bound's frequencies, as those of the error are taken.

        Parameters
        ----------
        values : ndarray of complex, shape (…, n)
        """
        return _window_means(values, *_half_octaves(self.omega_rad_s))

    def to_dict(self) -> dict[str, object]:
        """Plain values, four digits."""
        return {
            "omega_rad_s": [float(f"{w:.6g}") for w in self.omega_rad_s],
            "bound": [float(f"{b:.4g}") for b in self.bound],
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> ModelErrorBound:
        """From plain values.

        Raises
        ------
        DataError
            They are none, as in a file that was changed by hand.
        """
        try:
            omega, bound = (np.array(values[k], dtype=np.float64) for k in ("omega_rad_s", "bound"))
            sound = omega.shape == bound.shape and omega.ndim == 1 and len(omega) > 1
            sound = sound and bool(np.all(np.diff(omega) > 0.0) and omega[0] > 0.0)
            if not (sound and np.all(np.isfinite(bound)) and np.all(bound >= 0.0)):
                raise ValueError("frequencies must increase and bounds be at least 0")
        except (KeyError, TypeError, ValueError) as error:
            raise DataError(
                "these values are no error of a model", found=str(error)[:200]
            ) from error
        return cls(omega, bound)


def model_errors(
    model: Model,
    responses: Sequence[FittedResponse],
    records: Sequence[FittedRecord],
    *,
    filtered: bool = False,
    left: LeftOver | None = None,
) -> dict[str, ModelErrorBound]:
    """Errors of a fitted model by ``"output/input"``, from what it was fitted to.

    Of responses: measured over model, their estimator's bias taken out as in the fit. Of records:
    the response of what a free run leaves to the inputs, by way of an injected excitation where
    the records have one, so that noise that is fed back does not count as an error of the model.

    Parameters
    ----------
    model : Model
    responses : sequence of FittedResponse
    records : sequence of FittedRecord
        Used where there are no responses.
    filtered : bool
        Whether the records' modelled outputs are no free run.
    left : LeftOver, optional
        What else is known of the responses.

    Returns
    -------
    dict of str to ModelErrorBound
        Without the pairs for which nothing can be told.

    Assumes
    -------
    A linear vehicle. Biased where a loop was closed and no excitation is known: a direct estimate
    and the fit then err alike.

    Reference
    ---------
    Goodwin, Gevers & Ninness, *IEEE Trans. Automatic Control* 37 (1992), 913–928 (bias and
    variance of an estimated response); Ljung, *System Identification*, 2nd ed., section 16.6
    (model error models).
    """
    found: dict[str, ModelErrorBound] = {}
    for each in responses:
        omega, (low, high) = each.measured.omega_rad_s, each.band_rad_s
        inside = (omega >= low) & (omega <= high)
        ratio = each.measured.response[inside] / each.model[inside]
        spread = each.measured.random_error[inside] * np.abs(ratio)
        made = _named(each.name, omega[inside], ratio - 1.0, spread)
        found |= {name: _with_left(bound, name, left) for name, bound in made.items()}
    return found or _of_records(model, records, filtered)


def _with_left(bound: ModelErrorBound, name: str, left: LeftOver | None) -> ModelErrorBound:
    if left is None:
        return bound
    return with_size(reaching(bound, left.narrow.get(name, ())), left.by_size.get(name))


def with_size(bound: ModelErrorBound, sized: BySize | None) -> ModelErrorBound:
    """The bound with what smaller motion may answer otherwise; as it was where nothing does.

    Parameters
    ----------
    bound : ModelErrorBound
    sized : BySize or None
    """
    if sized is None:
        return bound
    more = np.interp(bound.omega_rad_s, sized.omega_rad_s, sized.share)
    return ModelErrorBound(bound.omega_rad_s, bound.bound + more)


def reaching(bound: ModelErrorBound, narrow: Iterable[NarrowResidual]) -> ModelErrorBound:
    """The bound as far up as what single window lengths show beyond their noise.

    A composite leans on short windows, and its mean over half an octave on many frequencies: both
    smooth what a lightly damped mode that the structure lacks does to its response.

    Parameters
    ----------
    bound : ModelErrorBound
    narrow : iterable of NarrowResidual

    Returns
    -------
    ModelErrorBound
        At the same frequencies.
    """
    made = np.array(bound.bound)
    for each in narrow:
        size, omega = np.abs(each.error), each.omega_rad_s
        stands_out = size > STANDS_OUT * each.spread
        # What a window shows at one frequency it holds to one of its bins beside it.
        near = np.abs(omega[:, None] - omega[stands_out]) <= 2.0 * np.pi / each.window_s
        shown = near.any(axis=1) & np.isin(omega, bound.omega_rad_s)
        places = np.searchsorted(bound.omega_rad_s, omega[shown])
        made[places] = np.maximum(made[places], (size + SIGMAS * each.spread)[shown])
    return ModelErrorBound(bound.omega_rad_s, made)


def _of_records(
    model: Model, records: Sequence[FittedRecord], filtered: bool
) -> dict[str, ModelErrorBound]:
    if not records:
        return {}
    found: dict[str, ModelErrorBound] = {}
    try:
        left = left_of_records(model, records, filtered=filtered)
        seen = response_of(left, model)
        known = linear_system(model).frequency_response(seen.omega_rad_s)
        narrow = [] if seen.linear is None else [*_by_window(seen.linear, seen.omega_rad_s)]
    except FlightidError:
        return {}
    for i, output in enumerate(model.outputs):
        for j, name in enumerate(model.inputs):
            if np.all(known[i, j] != 0.0):
                error = seen.response[i, j] / known[i, j]
                spread = seen.random_error[i, j] * np.abs(error)
                made = _named(f"{output}/{name}", seen.omega_rad_s, error, spread)
                some = [each.relative(i, j, known[i, j], seen.omega_rad_s) for each in narrow]
                found |= {name: reaching(bound, some) for name, bound in made.items()}
    return found


def _by_window(left: LinearEstimate, omega_rad_s: Array) -> Iterator[WindowResidual]:
    """What each window length makes of records that hold what a model leaves."""
    band = float(omega_rad_s[0]), float(omega_rad_s[-1])
    return residuals_by_window(left, omega_rad_s, left.output_records, band)


def left_of_records(
    model: Model, records: Sequence[FittedRecord], *, filtered: bool
) -> list[Record]:
    """Records that hold what a free run of a model leaves of each, in place of the outputs.

    Parameters
    ----------
    model : Model
    records : sequence of FittedRecord
    filtered : bool
        Whether their modelled outputs are no free run.

    Raises
    ------
    FlightidError
        The model cannot be followed over a record.
    """
    return [_left_over(model, each, filtered) for each in records]


def _left_over(model: Model, item: FittedRecord, filtered: bool) -> Record:
    """Measured minus a free run of the model, and a trace of what was measured.

    Exact data leave nothing, of which no response can be estimated.
    """
    if not filtered:
        left = item.residual_record()
        traces = {name: TRACE * item.measured[name][-left.n_samples :] for name in left.outputs}
        return left.replace({name: left[name] + trace for name, trace in traces.items()})
    run = simulate(model, item.measured)
    whole = {name: item.measured[name] for name in item.outputs}
    return item.measured.replace({n: (1.0 + TRACE) * y - run[n] for n, y in whole.items()})


def response_of(records: Sequence[Record], model: Model) -> FrequencyResponse:
    """Of a model's outputs in records to its inputs.

    By way of the excitations where there are enough of them, else directly.

    Parameters
    ----------
    records : sequence of Record
    model : Model

    Raises
    ------
    FlightidError
        Nothing can be estimated of them.
    """
    counts = [len(record.excitations) for record in records]
    estimator = "instrument" if min(counts) >= len(model.inputs) else "composite"
    return estimate_response(
        records,
        inputs=model.inputs,
        outputs=model.outputs,
        estimator=estimator,
        loop="open",
    )


def _named(name: str, omega: Array, error: Complex, spread: Array) -> dict[str, ModelErrorBound]:
    """Mean error about each frequency with its own doubt; nothing of fewer than two frequencies."""
    if len(omega) < FEWEST:
        return {}
    low, high = _half_octaves(omega)
    count = high - low
    means, powers = (_window_means(values, low, high) for values in (error, spread**2))
    doubt = np.sqrt(powers.real * np.minimum(ALIKE / count, 1.0))
    return {name: ModelErrorBound(omega, np.abs(means) + SIGMAS * doubt)}


def _half_octaves(omega: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First place about each frequency, and the one after the last."""
    logs = np.log(omega)
    low = np.searchsorted(logs, logs - REACH)
    return low, np.searchsorted(logs, logs + REACH, side="right")


def _window_means(
    values: Array | Complex, low: NDArray[np.intp], high: NDArray[np.intp]
) -> Complex:
    start = np.zeros((*values.shape[:-1], 1))
    sums = np.concatenate([start, np.cumsum(values.astype(np.complex128), axis=-1)], axis=-1)
    return np.asarray((sums[..., high] - sums[..., low]) / (high - low))
