"""Output of a NARX model on a record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class NarxPrediction:
    """Output of a NARX model on a record.

    Attributes
    ----------
    measured, predicted : ndarray, shape (n_samples,)
        In the output's unit; the first `start` predictions are the measured values.
    horizon : int or str
        Samples ahead, or ``"free_run"``.
    start : int
        Samples that initialise the lags: no score counts them.
    diverged_at : int or None
        First sample at which the guard held the prediction.
    """

    measured: NDArray[np.float64]
    predicted: NDArray[np.float64]
    horizon: int | str
    start: int
    diverged_at: int | None

    @property
    def scored(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Measured and predicted samples after the start, for `flightid.validation`."""
        return self.measured[self.start :], self.predicted[self.start :]

    @property
    def error_rms(self) -> float:
        """Root mean square error after the start, in the output's unit."""
        measured, predicted = self.scored
        return float(np.sqrt(np.mean((measured - predicted) ** 2)))

    def __repr__(self) -> str:
        """Horizon, size and error on one line."""
        ahead = "free run" if self.horizon == "free_run" else f"{self.horizon} ahead"
        left = "" if self.diverged_at is None else f", held from sample {self.diverged_at}"
        return (
            f"NarxPrediction({ahead}, {self.measured.size} samples, rms {self.error_rms:.4g}{left})"
        )
