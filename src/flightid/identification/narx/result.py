"""The fit of a NARX model: terms with what each explains, beside the linear model of its lags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from flightid.findings import Finding
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.narx.model import NarxModel
from flightid.models.narx.prediction import NarxPrediction
from flightid.models.narx.structure import NarxStructure
from flightid.models.narx.terms import Term
from flightid.record import Record
from flightid.table import Column, Table

SCHEMA = "flightid.narx_fit/1"


@dataclass(frozen=True)
class ChosenTerm:
    """One term of the fit.

    `error_reduction` is the share of the scaled output's sum of squares that the term explained
    when it was chosen; `sum_of_squares` and `leave_one_out` (mean square) are the errors after it.
    `penalty` is λ of its regularisation. `stderr` holds for the terms as given, in white noise: it
    ignores the choice unless samples were held back for the weights (`NarxStructure.held_back`).
    """

    term: Term
    weight: float
    stderr: float
    error_reduction: float
    sum_of_squares: float
    leave_one_out: float
    penalty: float = 0.0


@dataclass(frozen=True)
class NarxFit:
    """A fitted NARX model (made by `identify`).

    Attributes
    ----------
    equation : NarxModel
        Terms and weights that run.
    baseline : NarxModel
        Linear ARX model with constant, of the same lags and records.
    chosen : tuple of ChosenTerm
        In the order of choice; with samples held back, products before radial functions.
    one_step_rms, free_run_rms, baseline_free_run_rms : float
        Errors on the training records, in the output's unit.
    n_samples : int
        Samples that the weights rest on, those that initialise lags excluded.
    findings : tuple of Finding

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> u = np.random.default_rng(0).uniform(-1, 1, 300)
    >>> y = np.zeros(300)
    >>> for t in range(1, 300):
    ...     y[t] = 0.7 * y[t - 1] + 0.4 * u[t - 1] - 0.3 * u[t - 1] ** 2
    >>> record = fid.Record.from_arrays(np.arange(300) / 10, inputs={"u": u}, outputs={"y": y})
    >>> model = fid.NarxStructure("y", ("u",), 1, 1, kernel=None, degree=2, stop="bic")
    >>> fit = fid.identify(model, record)
    >>> [chosen.term.name for chosen in fit.chosen]
    ['constant', 'y(t-1)', 'u(t-1)', 'u(t-1)^2']
    >>> fit.predict(record, "free_run").error_rms < 1e-12
    True
    """

    equation: NarxModel
    baseline: NarxModel
    chosen: tuple[ChosenTerm, ...]
    one_step_rms: float
    free_run_rms: float
    baseline_free_run_rms: float
    n_samples: int
    findings: tuple[Finding, ...]

    @property
    def model(self) -> NarxStructure:
        """The structure that was asked for."""
        return self.equation.structure

    def linear_system(self) -> LinearSystem:
        """The linear system of the fitted model; ModelError with the reason where there is none."""
        return self.equation.linear_system()

    def predict(self, record: Record, horizon: int | str = "free_run") -> NarxPrediction:
        """Prediction on a record, `horizon` samples ahead or ``"free_run"``."""
        return self.equation.predict(record, horizon)

    def residuals(
        self, records: Record | Sequence[Record], horizon: int | str = 1
    ) -> tuple[Record, ...]:
        """Records with the prediction errors in place of the output, for `residual_tests`.

        The samples that start the lags are cut off.
        """
        found = []
        for record in (records,) if isinstance(records, Record) else records:
            run = self.predict(record, horizon)
            errors = record.replace({self.model.output: run.measured - run.predicted})
            first = record.time_s[run.start]
            found.append(errors.segment(first, record.time_s[-1] + record.sample_time_s))
        return tuple(found)

    def summary(self) -> Table:
        """Table of the terms with weight, standard error and error-reduction ratio."""
        penalised = self.model.regularisation != "none"
        rows = tuple(
            (
                item.term.name,
                item.term.kind,
                item.term.degree,
                item.weight,
                item.stderr,
                100.0 * item.error_reduction,
                item.sum_of_squares,
                item.leave_one_out,
                *([item.penalty] if penalised else []),
            )
            for item in self.chosen
        )
        columns = (
            Column("term"),
            Column("kind"),
            Column("degree"),
            Column("weight"),
            Column("standard error"),
            Column("ERR", "%"),
            Column("SSE"),
            Column("leave-one-out mean square"),
            *([Column("penalty λ")] if penalised else []),
        )
        unit = self.equation.scaling.units[self.model.output]
        notes = (
            repr(self.model),
            "weights and errors are of channels scaled to zero mean and unit deviation; "
            + self._meaning_of_errors(),
            f"rms error on training records [{unit}]: one step {self.one_step_rms:.4g}, free run "
            f"{self.free_run_rms:.4g}, free run of the linear model of the same lags "
            f"{self.baseline_free_run_rms:.4g}",
            *map(str, self.findings),
        )
        return Table(f"NARX model of {self.model.output}", columns, rows, notes)

    def _meaning_of_errors(self) -> str:
        model = self.model
        if model.held_back:
            return (
                f"weights and standard errors come from the last {100 * model.held_back:.3g} % of "
                "each record, which took no part in the choice; they hold in white noise"
            )
        kind = "" if model.regularisation == "none" else "Bayesian (posterior) "
        return (
            f"{kind}standard errors ignore the choice of terms: they hold for the terms as given, "
            "in white noise, and are too small after a choice among many (see held_back)"
        )

    def to_dict(self) -> dict[str, object]:
        """Plain values: ``schema``, structure, scaling, terms with centres, errors, findings."""
        scaling = self.equation.scaling
        return {
            "schema": SCHEMA,
            "structure": repr(self.model),
            "mean": dict(scaling.mean),
            "deviation": dict(scaling.deviation),
            "units": dict(scaling.units),
            "sample_time_s": scaling.sample_time_s,
            "beta": self.model.beta,
            "terms": [
                {
                    "name": item.term.name,
                    "kind": item.term.kind,
                    "factors": [[lag.channel, lag.lag, p] for lag, p in item.term.factors],
                    "centre": list(item.term.centre),
                    "weight": item.weight,
                    "stderr": item.stderr,
                    "error_reduction": item.error_reduction,
                    "penalty": item.penalty,
                }
                for item in self.chosen
            ],
            "one_step_rms": self.one_step_rms,
            "free_run_rms": self.free_run_rms,
            "baseline_free_run_rms": self.baseline_free_run_rms,
            "findings": [finding.to_dict() for finding in self.findings],
        }

    def __repr__(self) -> str:
        """Terms, samples and the free-run error beside the baseline's on one line."""
        return (
            f"NarxFit({self.model.output!r}, {len(self.chosen)} terms, {self.n_samples} samples, "
            f"free-run rms {self.free_run_rms:.4g}, linear {self.baseline_free_run_rms:.4g})"
        )

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()
