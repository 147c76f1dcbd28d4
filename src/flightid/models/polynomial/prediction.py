"""Prediction with a polynomial model: one step, k steps, free run (`polynomial_predictor.rs`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flightid import _native
from flightid.errors import OptionError
from flightid.models.polynomial.polynomials import Polynomials
from flightid.models.sampled.channels import LARGEST, OFFSETS, gather_channels, require_same
from flightid.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PolynomialPrediction:
    """Output of a polynomial model on a record.

    Attributes
    ----------
    measured, predicted : ndarray, shape (n_samples,)
        In the output's unit, the operating point included.
    horizon : int or str
        Samples ahead, or ``"free_run"``.
    initial_state : str
        ``"estimate"`` or ``"zero"``.
    diverged : bool
        Whether the run left the range of numbers and was held.

    Example
    -------
    >>> import numpy as np
    >>> PolynomialPrediction(np.array([1.0, 3.0]), np.array([1.0, 2.0]), 1, "zero")
    PolynomialPrediction(1 ahead from rest, 2 samples, rms 0.7071)
    """

    measured: Array
    predicted: Array
    horizon: int | str
    initial_state: str
    diverged: bool = False

    @property
    def residual(self) -> Array:
        """Measured minus predicted, shape (n_samples,)."""
        return np.asarray(self.measured - self.predicted)

    @property
    def error_rms(self) -> float:
        """Root mean square of the residual, in the output's unit."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def words(self) -> str:
        """Horizon and initial state in words."""
        ahead = "free run" if self.horizon == "free_run" else f"{self.horizon} ahead"
        return f"{ahead} from {'rest' if self.initial_state == 'zero' else 'an estimated state'}"

    def __repr__(self) -> str:
        """Horizon, initial state, size and error on one line."""
        left = ", diverged" if self.diverged else ""
        return (
            f"PolynomialPrediction({self.words}, {self.measured.size} samples, "
            f"rms {self.error_rms:.4g}{left})"
        )


def predict(
    model: Polynomials, record: Record, horizon: int | str, *, initial_state: str, offsets: str
) -> PolynomialPrediction:
    """Predict one record; `PolynomialModel.predict` says how."""
    if horizon != "free_run" and not (isinstance(horizon, int) and horizon > 0):
        raise OptionError("unknown horizon", found=horizon, needed="1, 2, … or 'free_run'")
    for what, value, allowed in (
        ("initial state", initial_state, ("estimate", "zero")),
        ("offsets", offsets, OFFSETS),
    ):
        if value not in allowed:
            raise OptionError(f"unknown {what}", found=value, needed=", ".join(allowed))
    data = gather_channels([record], model.output, model.inputs, offsets)
    require_same(model, data.units, data.sample_time_s)
    if horizon == "free_run":
        deviation = free_run(model, data.output, data.inputs, initial_state=initial_state)
    else:
        deviation = ahead(model, data.output, data.inputs, int(horizon), initial_state)
    usable = np.abs(deviation) < LARGEST
    diverged = not bool(np.all(usable))
    if diverged:
        last = int(np.argmin(usable))
        deviation[last:] = deviation[last - 1]
    offset = data.offsets[0][model.output]
    return PolynomialPrediction(
        record[model.output], deviation + offset, horizon, initial_state, diverged
    )


def one_step_errors(model: Polynomials, output: Array, inputs: Array, initial_state: str) -> Array:
    """Prediction errors one step ahead, shape (n_samples,), of deviations from trim."""
    return _native.polynomial_errors(
        output,
        np.ascontiguousarray(inputs),
        [output.size],
        model.structure.native,
        model.theta,
        "unknown" if initial_state == "estimate" else "rest",
        [],
    )


def ahead(
    model: Polynomials,
    output: Array,
    inputs: Array,
    horizon: int,
    initial_state: str = "estimate",
) -> Array:
    """y(t) minus the part of the noise that is younger than the horizon."""
    errors = one_step_errors(model, output, inputs, initial_state)
    above, below = model.noise_transfer
    impulse = np.zeros(horizon)
    impulse[0] = 1.0
    young = lfilter(above, below, impulse)
    return np.asarray(output - lfilter(young, [1.0], errors))


def forced_run(model: Polynomials, inputs: Array) -> Array:
    """Response to the inputs alone, shape (n_samples,), from rest."""
    run = np.zeros(inputs.shape[1])
    with np.errstate(over="ignore", invalid="ignore"):
        for name, row in zip(model.inputs, inputs, strict=True):
            run += lfilter(*model.transfer(name), row)
    return run


def free_motion(model: Polynomials, n_samples: int) -> Array:
    """What each sample before the record makes of the output, shape (count, n_samples)."""
    below = np.asarray(model.a)
    for row in model.f:
        below = np.convolve(below, np.asarray(row))
    impulse = np.zeros((below.size - 1, n_samples))
    np.fill_diagonal(impulse, 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(lfilter([1.0], below, impulse))


def free_run(model: Polynomials, output: Array, inputs: Array, *, initial_state: str) -> Array:
    """Response to the inputs alone, and with ``"estimate"`` the free motion that fits best."""
    run = forced_run(model, inputs)
    if initial_state == "zero":
        return run
    motion = free_motion(model, output.size)
    if not len(motion) or not (np.all(np.isfinite(run)) and np.all(np.isfinite(motion))):
        return run
    weights = np.linalg.lstsq(motion.T, output - run, rcond=None)[0]
    return np.asarray(run + weights @ motion)
