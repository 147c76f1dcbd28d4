"""What cross-validation of a black-box model found."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.findings import Finding
from flightid.record import Record
from flightid.simulation.metrics import fit_percent, mse, theil
from flightid.table import Column, Table

MODEL, LINEAR = "model", "linear, same lags"


def squared(unit: str) -> str:
    """Unit of a mean square.

    Example
    -------
    >>> squared("rad"), squared("m/s"), squared("1")
    ('rad²', '(m/s)²', '')
    """
    if unit == "1":
        return ""
    return f"{unit}²" if unit.isalpha() else f"({unit})²"


def horizon_words(horizon: int | str) -> str:
    """A horizon for people.

    Example
    -------
    >>> horizon_words("free_run"), horizon_words(1)
    ('free run', '1 ahead')
    """
    return "free run" if horizon == "free_run" else f"{horizon} ahead"


@dataclass(frozen=True, eq=False)
class CrossRun:
    """One model through one record.

    Attributes
    ----------
    record : Record
        As measured.
    output : str
    model : str
        ``"model"``, or ``"linear, same lags"``.
    horizon, initial_state : str
        How far ahead, and from what state, in words.
    predicted : ndarray, shape (n_samples,)
        In the output's unit.
    start : int
        Samples at the start that are measured and not scored.
    held : bool
        Whether the run left its range and was held.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1, 0.2], outputs={"y": [1.0, -1.0, 0.0]})
    >>> run = CrossRun(record, "y", MODEL, "free run", "rest", np.array([0.5, -0.5, 0.0]), 0, False)
    >>> round(run.fit_percent, 6), round(run.theil, 6)
    (50.0, 0.333333)
    """

    record: Record
    output: str
    model: str
    horizon: str
    initial_state: str
    predicted: NDArray[np.float64]
    start: int
    held: bool

    @property
    def scored(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Measured and predicted samples after the start."""
        return self.record[self.output][self.start :], self.predicted[self.start :]

    @property
    def fit_percent(self) -> float:
        """100 (1 - |y - ŷ| / |y - mean y|)."""
        return float(fit_percent(*self.scored))

    @property
    def theil(self) -> float:
        """Theil's coefficient of changes about the measured mean."""
        measured, predicted = self.scored
        middle = measured.mean()
        return float(theil(measured - middle, predicted - middle))

    @property
    def mse(self) -> float:
        """Mean square error, in the square of the output's unit."""
        return float(mse(*self.scored))

    @property
    def rms(self) -> float:
        """Root mean square error, in the output's unit."""
        return math.sqrt(self.mse)

    def predicted_record(self) -> Record:
        """The record with the predicted output in place of the measured one."""
        return self.record.replace({self.output: self.predicted})

    def residual_record(self) -> Record:
        """Measured minus predicted, after the start, beside the inputs."""
        left = self.record.replace({self.output: self.record[self.output] - self.predicted})
        time_s = self.record.time_s
        half = 0.5 * self.record.sample_time_s
        return left.segment(time_s[self.start] - half, time_s[-1] + half, name=self.record.name)


@dataclass(frozen=True, eq=False, repr=False)
class CrossValidation:
    """Result of `flightid.validation.cross_validate`.

    Attributes
    ----------
    output : str
    runs : tuple of CrossRun
        By record, horizon and model.
    findings : tuple of Finding
        On free runs.

    Example
    -------
    >>> record = Record.from_arrays([0.0, 0.1, 0.2], outputs={"y": [1.0, -1.0, 0.0]})
    >>> run = CrossRun(record, "y", MODEL, "free run", "rest", np.array([0.5, -0.5, 0.0]), 0, False)
    >>> CrossValidation("y", (run,), ())
    CrossValidation('y', 1 record, worst free-run fit 50.0 %)
    """

    output: str
    runs: tuple[CrossRun, ...]
    findings: tuple[Finding, ...]

    def of(self, record: str, horizon: str = "free run", model: str = MODEL) -> CrossRun:
        """One run by the record's name.

        Raises
        ------
        KeyError
            There is none.
        """
        for run in self.runs:
            if (run.record.name, run.horizon, run.model) == (record, horizon, model):
                return run
        raise KeyError((record, horizon, model))

    def summary(self) -> Table:
        """Table by run: fit percent, Theil's coefficient, errors, horizon and initial state."""
        unit = self.runs[0].record.unit(self.output)
        columns = (
            Column("record"),
            Column("predictor"),
            Column("horizon"),
            Column("initial state"),
            Column("fit", "%", 3),
            Column("TIC", digits=3),
            Column("MSE", squared(unit), 3),
            Column("rms", unit if unit != "1" else "", 3),
        )
        rows = tuple(
            (
                run.record.name,
                run.model,
                run.horizon,
                run.initial_state,
                run.fit_percent,
                run.theil,
                run.mse,
                run.rms,
            )
            for run in self.runs
        )
        notes = (
            "fit: 100 (1 - |y - ŷ| / |y - mean y|); TIC: Theil's coefficient about the mean; "
            "one step ahead says little about dynamics: the last sample again does well there",
            *map(str, self.findings),
        )
        return Table(repr(self), columns, rows, notes)

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "schema": "flightid.cross_validation/1",
            "output": self.output,
            "runs": [
                {
                    "record": run.record.name,
                    "model": run.model,
                    "horizon": run.horizon,
                    "initial_state": run.initial_state,
                    "fit_percent": run.fit_percent,
                    "theil": run.theil,
                    "mse": run.mse,
                    "held": run.held,
                }
                for run in self.runs
            ],
            "findings": [finding.to_dict() for finding in self.findings],
        }

    def __repr__(self) -> str:
        """Output, records and the worst free-run fit on one line."""
        n = len({id(run.record) for run in self.runs})
        free = [r.fit_percent for r in self.runs if r.model == MODEL and r.horizon == "free run"]
        worst = f", worst free-run fit {min(free):.1f} %" if free else ""
        return f"CrossValidation({self.output!r}, {n} record{'s' * (n != 1)}{worst})"

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()
