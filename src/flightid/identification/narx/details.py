"""What a NARX model adds to a fit: what each term explains, and the linear model of its lags."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Self

from flightid.frozen import dataclass
from flightid.identification.details import Details
from flightid.models.narx.model import NarxModel
from flightid.models.narx.structure import NarxStructure
from flightid.models.narx.terms import Term
from flightid.table import Column, Table

CENTRES = (
    "where a radial term is centred, in scaled lags: centre of that term in results.json (chosen) "
    "and in the model file"
)


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

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "name": self.term.name,
            "kind": self.term.kind,
            "factors": [[lag.channel, lag.lag, power] for lag, power in self.term.factors],
            "centre": list(self.term.centre),
            "weight": self.weight,
            "stderr": self.stderr,
            "error_reduction": self.error_reduction,
            "sum_of_squares": self.sum_of_squares,
            "leave_one_out": self.leave_one_out,
            "penalty": self.penalty,
        }


@dataclass(frozen=True, eq=False)
class NarxDetails(Details):
    """Beside the weights of a NARX model.

    Attributes
    ----------
    baseline : NarxModel
        Linear ARX model with constant, of the same lags and records.
    chosen : tuple of ChosenTerm
        In the order of choice; with samples held back, products before radial functions.
    one_step_rms, free_run_rms, baseline_free_run_rms : float
        Errors on the training records, in `unit`.
    n_samples : int
        Samples that the weights rest on, those that initialise lags excluded.
    unit : str
        Of the output.
    why_biased : str
        What the prediction errors say against the weights and their standard errors, which are
        then not shown; else empty.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> u = np.random.default_rng(0).uniform(-1, 1, 300)
    >>> y = np.zeros(300)
    >>> for t in range(1, 300):
    ...     y[t] = 0.7 * y[t - 1] + 0.4 * u[t - 1] - 0.3 * u[t - 1] ** 2
    >>> record = fid.Record.from_arrays(np.arange(300) / 10, inputs={"u": u}, outputs={"y": y})
    >>> structure = fid.NarxStructure(("u",), "y", 1, 1, kernel=None, degree=2, stop="bic")
    >>> fit = fid.identify(structure, record)
    >>> [chosen.term.name for chosen in fit.details.chosen]
    ['constant', 'y(t-1)', 'u(t-1)', 'u(t-1)^2']
    >>> fit.details.free_run_rms < 1e-12
    True
    """

    baseline: NarxModel
    chosen: tuple[ChosenTerm, ...]
    one_step_rms: float
    free_run_rms: float
    baseline_free_run_rms: float
    n_samples: int
    unit: str
    why_biased: str = ""

    @property
    def words(self) -> str:
        """Error in free run beside that of the linear model of the same lags."""
        return f"free-run rms {self.free_run_rms:.4g}, linear {self.baseline_free_run_rms:.4g}"

    def without_intervals(self, reason: str) -> Self:
        """Terms whose standard errors are not shown."""
        return replace(self, why_biased=self.why_biased or reason)

    def notes(self, structure: Any) -> tuple[str, ...]:  # noqa: ANN401 - each kind's own
        """Structure, what the errors mean, and the errors on the training records."""
        return (
            repr(structure),
            "weights and errors are of channels scaled to zero mean and unit deviation; "
            + (self.why_biased or _meaning_of_errors(structure)),
            f"rms error on training records [{self.unit}]: one step {self.one_step_rms:.4g}, free "
            f"run {self.free_run_rms:.4g}, free run of the linear model of the same lags "
            f"{self.baseline_free_run_rms:.4g}",
        )

    def terms_table(self) -> Table:
        """Table of the terms with weight, standard error and error-reduction ratio."""
        columns = (
            Column("term"),
            Column("kind"),
            Column("degree"),
            Column("weight"),
            Column("standard error"),
            Column("ERR", "%"),
            Column("SSE"),
            Column("leave-one-out mean square"),
            Column("penalty λ"),
        )
        rows = tuple(
            (
                item.term.name,
                item.term.kind,
                item.term.degree,
                item.weight,
                None if self.why_biased else item.stderr,
                100.0 * item.error_reduction,
                item.sum_of_squares,
                item.leave_one_out,
                item.penalty or None,
            )
            for item in self.chosen
        )
        radial = any(len(item.term.centre) for item in self.chosen)
        notes = (CENTRES,) if radial else ()
        return Table("Terms in the order of choice", columns, rows, notes).without_empty_columns()

    def tables(self) -> tuple[Table, ...]:
        """The table of the terms."""
        return (self.terms_table(),)

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "baseline": self.baseline.to_dict(),
            "chosen": [item.to_dict() for item in self.chosen],
            "why_biased": self.why_biased,
            "one_step_rms": self.one_step_rms,
            "free_run_rms": self.free_run_rms,
            "baseline_free_run_rms": self.baseline_free_run_rms,
            "n_samples": self.n_samples,
            "unit": self.unit,
        }


def _meaning_of_errors(structure: NarxStructure) -> str:
    if structure.held_back:
        return (
            f"weights and standard errors come from the last {100 * structure.held_back:.3g} % of "
            "each record, which took no part in the choice; they hold in white noise"
        )
    kind = "" if structure.regularisation == "none" else "Bayesian (posterior) "
    return (
        f"{kind}standard errors ignore the choice of terms: they hold for the terms as given, "
        "in white noise, and are too small after a choice among many (see held_back)"
    )
