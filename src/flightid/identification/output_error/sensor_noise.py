"""Noise of each output by itself: white, autoregressive or drifting; what no states share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid import _native
from flightid.identification.output_error.innovation_gain import ORDER, SETTLED, SHARES, STEPS

Array = NDArray[np.float64]
FALSE_ALARMS = 0.01
"""Share of records with white residuals in which something else is found."""
DRIFTS = (0.6, 0.8, 0.9, 0.95, 0.98, 0.995, 0.999)
"""Poles of a sensor's drift."""
MOVES = 0.01 + 1e-12
"""Variance of a drift's steps where the search for its gain begins, over that of the residual."""
CROSSED = 25
"""Lags between outputs."""


def crossed(errors: Array) -> float:
    """p-value of no correlation between outputs at different times; 1 for a single output.

    Noise of sensors may be common at one instant; what moves one output now and another later went
    through the states. Reference: Haugh (1976), J. American Statistical Association 71.
    """
    p, n = errors.shape
    unit = errors / np.sqrt(np.sum(errors**2, axis=1))[:, None]
    total, count = 0.0, 0
    for lag in range(1, CROSSED + 1):
        square = (unit[:, lag:] @ unit[:, :-lag].T) ** 2
        total += n / (n - lag) * n * float(np.sum(square) - np.trace(square))
        count += p * (p - 1)
    return float(scipy.special.chdtrc(count, total)) if count else 1.0


def sensor_errors(residuals: Sequence[Array]) -> tuple[Array, int]:
    """Errors of noise of each output by itself, and how many numbers it took.

    Autoregressive, or a slow drift under white noise.
    """
    n_rows = sum(each.shape[1] - ORDER for each in residuals)
    errors, count = [], 0
    for place in range(residuals[0].shape[0]):
        rows = [each[place : place + 1] for each in residuals]
        options = [_autoregression(rows), *((_drift(rows, pole), 2) for pole in DRIFTS)]
        left, order = min(
            options,
            key=lambda each: n_rows * np.log(np.mean(each[0] ** 2)) + each[1] * np.log(n_rows),
        )
        errors.append(left)
        count += order
    return np.array(errors), count


def _autoregression(rows: Sequence[Array]) -> tuple[Array, int]:
    """Errors of the autoregression of the best order, which goes along.

    Least squares on the past: Yule and Walker's equations bend poles near the unit circle.
    """
    now = np.concatenate([each[0, ORDER:] for each in rows])
    past = np.concatenate([_lagged(each, ORDER) for each in rows], axis=1)
    n, gram, cross = len(now), past @ past.T, past @ now
    choices = [(n * float(np.log(np.mean(now**2))), np.zeros(0))]
    for order in range(1, ORDER + 1):
        weights = np.linalg.lstsq(gram[:order, :order], cross[:order], rcond=None)[0]
        error = max(float(np.mean((now - weights @ past[:order]) ** 2)), 1e-300)
        choices.append((n * np.log(error) + order * np.log(n), weights))
    weights = min(choices, key=lambda each: each[0])[1]
    return np.asarray(now - weights @ past[: len(weights)]), len(weights)


def _autocovariance(row: Array) -> Array:
    return np.array([row[: max(len(row) - lag, 0)] @ row[lag:] for lag in range(ORDER + 1)])


def is_white(residuals: Sequence[Array]) -> bool:
    """Portmanteau test, Bonferroni over outputs: Ljung & Box (1978), Biometrika 65."""
    n = sum(each.shape[1] for each in residuals)
    for place in range(residuals[0].shape[0]):
        lags = np.sum([_autocovariance(each[place]) for each in residuals], axis=0)
        sizes = (lags[1:] / lags[0]) ** 2 / (n - np.arange(1, ORDER + 1))
        if (
            scipy.special.chdtrc(ORDER, n * (n + 2) * sizes.sum())
            < FALSE_ALARMS / residuals[0].shape[0]
        ):
            return False
    return True


def _drift(rows: Sequence[Array], pole: float) -> Array:
    """Errors one sample ahead of a drift under white noise: `innovations` of a single state.

    e = v − x and x⁺ = pole x + K e are one filter of v, (1 − pole q⁻¹) / (1 − (pole − K) q⁻¹).
    """
    low = 0.5 * (1.0 - pole**2) - MOVES
    covariance = 0.5 * (np.sqrt(low**2 + 2.0 * MOVES) - low)
    gain = float(pole * covariance / (covariance + 0.5))
    lengths = [each.shape[1] for each in rows]
    search = (STEPS, SETTLED, list(SHARES))
    return _native.drift_errors(
        np.concatenate(rows, axis=1)[0], lengths, (pole, gain), ORDER, search
    )


def _lagged(rows: Array, order: int) -> Array:
    """Past values, (n_outputs · order, n_samples - ORDER)."""
    n = rows.shape[1]
    return np.concatenate([rows[:, ORDER - lag : n - lag] for lag in range(1, order + 1)])
