"""The prediction: a record, the model's answer to its inputs, and what was solved for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass
from flightid.record import Record
from flightid.result import Result
from flightid.simulation import metrics
from flightid.table import Cell, Column, Table


@dataclass(frozen=True, eq=False)
class Shifts:
    """What was solved for in one record.

    Attributes
    ----------
    state_bias : ndarray, shape (n_states,)
        Constant added to the state derivatives; zero where it was not free.
    output_bias : ndarray, shape (n_outputs,)
        Constant added to the outputs, in their units.
    initial_state : ndarray, shape (n_states,)
        State at the first sample.
    n_free : int
        Numbers that were free.
    rank : int
        How many of them the record tells apart; fewer than `n_free` means that their values are
        one choice among many.
    e_folds : float
        How often the model's fastest growing mode grows by e over the record; 0 where none grows.
    input_bias : ndarray, shape (n_inputs,), or None
        Of a nonlinear model, whose equations were integrated: constant added to the inputs.
    told_s : float or None
        Length of the first stretch that tells them, s; None where the whole record does.
    is_open : bool
        Whether what that stretch does not tell apart moves the prediction after it.

    Example
    -------
    >>> Shifts(np.zeros(1), np.array([0.2]), np.zeros(1), 2, 2).output_bias
    array([0.2])
    """

    state_bias: NDArray[np.float64]
    output_bias: NDArray[np.float64]
    initial_state: NDArray[np.float64]
    n_free: int
    rank: int
    e_folds: float = 0.0
    input_bias: NDArray[np.float64] | None = None
    told_s: float | None = None
    is_open: bool = False


NOTHING = Shifts(np.zeros(0), np.zeros(0), np.zeros(0), 0, 0)
"""Of a prediction that starts from measured samples alone."""


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(
    Result,
    schema="flightid.prediction/1",
    untold={"measured": "time histories", "predicted": "time histories"},
):
    """One record and what a model makes of its inputs.

    Attributes
    ----------
    measured : Record
        What was predicted.
    predicted : Record
        Inputs, and outputs of the model with all shifts, in the record's units.
    outputs : tuple of str
        Outputs predicted.
    horizon : int or "free_run"
        Samples ahead.
    initial_state : str
        Where the model started, in words.
    start : int
        First samples that no score counts: they told the start.
    shifts : Shifts
        Biases and initial state that were solved for.
    diverged_at : int or None
        First sample at which the run left its range and was held.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> time_s = np.arange(300) * 0.02
    >>> lag = fid.LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> flown = fid.Record.from_arrays(time_s, inputs={"u": np.sin(time_s)})
    >>> fid.predict(lag, fid.simulate(lag, flown))  # doctest: +NORMALIZE_WHITESPACE
    Prediction(free run from an initial state solved for over the first 2 s, 300 samples, fit y
    100.0 %)
    """

    measured: Record
    predicted: Record
    outputs: tuple[str, ...]
    horizon: int | str
    initial_state: str
    start: int = 0
    shifts: Shifts = NOTHING
    diverged_at: int | None = None

    def residual(self, name: str) -> NDArray[np.float64]:
        """Measured minus predicted, in the channel's unit, shape (n_samples,)."""
        return np.asarray(self.measured[name] - self.predicted[name])

    def scored(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Measured and predicted samples after the start, about the mean of the measured ones.

        How a constant is shared between trim, bias and offset must not change a number, and an
        offset must not flatter it.
        """
        measured, predicted = (side[name][self.start :] for side in (self.measured, self.predicted))
        middle = np.mean(measured)
        return measured - middle, predicted - middle

    @property
    def fit_percent(self) -> dict[str, float]:
        """100 (1 - |y - ŷ| / |y - mean y|) by output."""
        return {name: float(metrics.fit_percent(*self.scored(name))) for name in self.outputs}

    @property
    def theil(self) -> dict[str, float]:
        """Theil's coefficient about the measured mean, by output."""
        return {name: float(metrics.theil(*self.scored(name))) for name in self.outputs}

    @property
    def rms_error(self) -> dict[str, float]:
        """Root mean square error by output, in its unit."""
        return {name: float(metrics.rms_error(*self.scored(name))) for name in self.outputs}

    @property
    def words(self) -> str:
        """Horizon and initial state in words."""
        ahead = "free run" if self.horizon == "free_run" else f"{self.horizon} ahead"
        return f"{ahead} from {self.initial_state}"

    def residual_record(self) -> Record:
        """Measured minus predicted after the start, beside the inputs."""
        left = self.measured.replace({name: self.residual(name) for name in self.outputs})
        time_s, half = self.measured.time_s, 0.5 * self.measured.sample_time_s
        return left.segment(time_s[self.start] - half, time_s[-1] + half, name=self.measured.name)

    def summary(self) -> Table:
        """Table by output, after the start."""
        columns = (
            Column("output"),
            Column("unit"),
            Column("fit", "%", 4),
            Column("Theil coefficient", digits=3),
            Column("rms error", digits=3),
        )
        numbers = (self.fit_percent, self.theil, self.rms_error)
        rows: list[tuple[Cell, ...]] = [
            (name, self.measured.unit(name), *(each[name] for each in numbers))
            for name in self.outputs
        ]
        notes = [f"{self.words}; the first {self.start} samples are not scored."]
        if self.diverged_at is not None:
            notes.append(f"The run left its range at sample {self.diverged_at} and was held.")
        return Table(repr(self), columns, tuple(rows), tuple(notes))

    def _computed(self) -> dict[str, object]:
        return {
            "record": self.measured.name,
            "fit_percent": self.fit_percent,
            "theil": self.theil,
            "rms_error": self.rms_error,
        }

    def _fit_words(self, name: str) -> str:
        """Fit of one output; of one that does not change its error, since it has no fit."""
        measured, predicted = self.scored(name)
        if np.ptp(measured) == 0.0:
            return f"{name} rms error {float(metrics.rms_error(measured, predicted)):.4g}"
        return f"{name} {float(metrics.fit_percent(measured, predicted)):.1f} %"

    def __repr__(self) -> str:
        """Horizon, start, size and fits on one line."""
        fits = ", ".join(map(self._fit_words, self.outputs))
        left = "" if self.diverged_at is None else f", held from sample {self.diverged_at}"
        return f"Prediction({self.words}, {self.measured.n_samples} samples, fit {fits}{left})"
