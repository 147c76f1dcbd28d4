"""Prediction with an innovations model: one step, k steps, free run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.errors import OptionError
from flightid.models.innovations.form import InnovationsForm
from flightid.models.sampled.channels import LARGEST, OFFSETS, gather_channels, require_same
from flightid.models.sampled.recursion import run_recursion
from flightid.record import Record

Array = NDArray[np.float64]
RANK = 1e-10
"""Directions of the initial state weaker than this share of the strongest are left at rest."""


@dataclass(frozen=True, eq=False)
class InnovationsPrediction:
    """Outputs of an innovations model on a record.

    Attributes
    ----------
    outputs : tuple of str
    measured, predicted : ndarray, shape (p, n_samples)
        In the outputs' units, the operating point included.
    horizon : int or str
        Samples ahead, or ``"free_run"``.
    initial_state : str
        ``"estimate"`` or ``"zero"``.
    diverged : bool
        Whether the run left the range of numbers and was held.

    Example
    -------
    >>> rows = np.array([[1.0, 3.0]]), np.array([[1.0, 2.0]])
    >>> InnovationsPrediction(("y",), *rows, 1, "zero")
    InnovationsPrediction(1 ahead from rest, 2 samples, rms y 0.7071)
    """

    outputs: tuple[str, ...]
    measured: Array
    predicted: Array
    horizon: int | str
    initial_state: str
    diverged: bool = False

    @property
    def residual(self) -> Array:
        """Measured minus predicted, shape (p, n_samples)."""
        return np.asarray(self.measured - self.predicted)

    @property
    def error_rms(self) -> dict[str, float]:
        """Root mean square of each residual, in the output's unit."""
        rms = np.sqrt(np.mean(self.residual**2, axis=1))
        return dict(zip(self.outputs, rms.tolist(), strict=True))

    @property
    def fit_percent(self) -> dict[str, float | None]:
        """100 (1 - |y - ŷ| / |y - mean y|) by output; None for a constant one."""
        found: dict[str, float | None] = {}
        for name, y, error in zip(self.outputs, self.measured, self.residual, strict=True):
            size = float(np.linalg.norm(y - y.mean()))
            found[name] = 100.0 * (1.0 - float(np.linalg.norm(error)) / size) if size else None
        return found

    @property
    def words(self) -> str:
        """Horizon and initial state in words."""
        ahead = "free run" if self.horizon == "free_run" else f"{self.horizon} ahead"
        return f"{ahead} from {'rest' if self.initial_state == 'zero' else 'an estimated state'}"

    def __repr__(self) -> str:
        """Horizon, initial state, size and errors on one line."""
        rms = ", ".join(f"{name} {value:.4g}" for name, value in self.error_rms.items())
        left = ", diverged" if self.diverged else ""
        samples = self.measured.shape[1]
        return f"InnovationsPrediction({self.words}, {samples} samples, rms {rms}{left})"


def predict(
    model: InnovationsForm, record: Record, horizon: int | str, *, initial_state: str, offsets: str
) -> InnovationsPrediction:
    """Predict one record; `InnovationsModel.predict` says how."""
    if horizon != "free_run" and not (isinstance(horizon, int) and horizon > 0):
        raise OptionError("unknown horizon", found=horizon, needed="1, 2, … or 'free_run'")
    for what, value, allowed in (
        ("initial state", initial_state, ("estimate", "zero")),
        ("offsets", offsets, OFFSETS),
    ):
        if value not in allowed:
            raise OptionError(f"unknown {what}", found=value, needed=", ".join(allowed))
    p = len(model.outputs)
    others = (*model.outputs[1:], *model.inputs)
    data = gather_channels([record], model.outputs[0], others, offsets)
    require_same(model, data.units, data.sample_time_s)
    y = np.vstack([data.output[None], data.inputs[: p - 1]])
    u = data.inputs[p - 1 :]
    with np.errstate(over="ignore", invalid="ignore"):
        if horizon == "free_run":
            run = free_run(model, y, u, initial_state=initial_state)
        else:
            run = ahead(model, y, u, int(horizon), initial_state)
    usable = np.all(np.abs(run) < LARGEST, axis=0)
    diverged = not bool(np.all(usable))
    if diverged:
        last = int(np.argmin(usable))
        run[:, last:] = run[:, last - 1 : last]
    offset = np.array([data.offsets[0][name] for name in model.outputs])[:, None]
    return InnovationsPrediction(
        model.outputs, y + offset, run + offset, horizon, initial_state, diverged
    )


def forced_run(model: InnovationsForm, u: Array) -> Array:
    """Response to the inputs alone, shape (p, n_samples), from rest."""
    a, b, c, d, _ = model.matrices
    return np.asarray(c @ run_recursion(a, b @ u) + d @ u)


def free_run(model: InnovationsForm, y: Array, u: Array, *, initial_state: str) -> Array:
    """Response to the inputs, shape (p, n_samples), from rest or from the state that fits best."""
    a, _, c, _, _ = model.matrices
    run = forced_run(model, u)
    if initial_state == "zero" or not np.all(np.isfinite(run)):
        return run
    motion = free_motion(a, c, y.shape[1])
    if not np.all(np.isfinite(motion)):
        return run
    return run + _best(motion, y - run)


def one_step_errors(model: InnovationsForm, y: Array, u: Array, initial_state: str) -> Array:
    """Prediction errors one step ahead, shape (p, n_samples)."""
    a, b, c, d, k = model.matrices
    state = run_recursion(a - k @ c, (b - k @ d) @ u + k @ y)
    errors = y - c @ state - d @ u
    if initial_state == "zero":
        return np.asarray(errors)
    # The state is as uncertain as the outputs: each counts by its innovations.
    r = model.noise_covariance
    whiten = np.eye(len(y)) if r is None else np.linalg.inv(np.linalg.cholesky(r))
    motion = free_motion(a - k @ c, whiten @ c, y.shape[1])
    return np.asarray(errors - np.linalg.solve(whiten, _best(motion, whiten @ errors)))


def free_motion(a: Array, c: Array, n_samples: int) -> Array:
    """C Aᵗ for t = 0, 1, …, shape (n, p, n_samples): what each initial state makes."""
    n = a.shape[0]
    return np.asarray(c @ run_recursion(a, np.zeros((n, n, n_samples)), np.eye(n)))


def _best(motion: Array, errors: Array) -> Array:
    columns = motion.reshape(motion.shape[0], -1).T
    weights = np.linalg.lstsq(columns, errors.ravel(), rcond=RANK)[0]
    return np.asarray((columns @ weights).reshape(errors.shape))


def ahead(
    model: InnovationsForm, y: Array, u: Array, horizon: int, initial_state: str = "estimate"
) -> Array:
    """y(t) minus the part of the noise that is younger than the horizon."""
    errors = one_step_errors(model, y, u, initial_state)
    a, _, c, _, k = model.matrices
    young, gain = errors.copy(), k
    for lag in range(1, min(horizon, y.shape[1])):
        young[:, lag:] += c @ gain @ errors[:, :-lag]
        gain = a @ gain
    return np.asarray(y - young)
