"""What a scan of orders found."""

from __future__ import annotations

from dataclasses import dataclass

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.identification.fit import Fit
from flightid.identification.prediction_error.information_criteria import Criteria
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.result import Result
from flightid.table import Cell, Column, Table

CRITERIA = ("aic", "aicc", "bic", "mdl", "fpe")
ALIKE = 0.02
SHOWN = 20


@dataclass(frozen=True, eq=False)
class OrderTrial:
    """One structure: its model and criteria, and its free run on the validation records.

    `free_run_rms` is in the output's unit; None where `note` says why there is none.

    Example
    -------
    >>> asked = PolynomialModel.arx("u", "y", na=1, nb=1)
    >>> OrderTrial(asked, None, None, None, None, "collinear regressors").note
    'collinear regressors'
    """

    structure: PolynomialStructure
    model: PolynomialModel | None
    criteria: Criteria | None
    free_run_rms: float | None
    fit_percent: float | None
    note: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class OrderScan(Result, schema="flightid.order_scan/1"):
    """Result of `flightid.scan_orders`.

    Attributes
    ----------
    kind : str
    trials : tuple of OrderTrial
        The smallest free-run error on the validation records first.
    best : Fit
        Full fit of the first trial.
    validation : tuple of str
        Names of the validation records.
    start : int
        Longest lag of the scan, samples: what each free run starts from.
    unit : str
        Of the output.

    Example
    -------
    See `scan_orders`:

    >>> OrderScan.__name__
    'OrderScan'
    """

    kind: str
    trials: tuple[OrderTrial, ...]
    best: Fit
    validation: tuple[str, ...]
    start: int
    unit: str

    def smallest(self, criterion: str) -> OrderTrial:
        """Trial with the smallest ``"aic"``, ``"aicc"``, ``"bic"``, ``"mdl"`` or ``"fpe"``."""
        found = [
            (value, place)
            for place, trial in enumerate(self.trials)
            if trial.criteria is not None
            and (value := trial.criteria.to_dict()[criterion]) is not None
        ]
        return self.trials[min(found)[1]]

    @property
    def simplest(self) -> OrderTrial:
        """Fewest coefficients among those whose free-run error is within 2 % of the smallest."""
        least = self.trials[0].free_run_rms or 0.0
        alike = [
            t
            for t in self.trials
            if t.free_run_rms is not None and t.free_run_rms <= least * (1 + ALIKE)
        ]
        return min(alike or self.trials[:1], key=lambda t: t.structure.n_parameters)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts on the choice."""
        found = []
        best, simple = self.trials[0].structure, self.simplest.structure
        if simple.n_parameters < best.n_parameters:
            found.append(
                Finding(
                    "simpler-model",
                    Light.AMBER,
                    f"{simple.orders_text} with {simple.n_parameters} coefficients runs as well "
                    f"within 2 % as {best.orders_text} with {best.n_parameters}",
                    "take the simpler one (scan.simplest)",
                )
            )
        diverged = sum(t.note == "free run diverged" for t in self.trials)
        if diverged:
            found.append(
                Finding(
                    "free-run-diverged",
                    Light.AMBER,
                    f"{diverged} of {len(self.trials)} models grow in free run",
                    "expected where the vehicle is unstable; else lower the orders",
                )
            )
        edges = _at_edge(self)
        if edges:
            found.append(
                Finding(
                    "at-edge-of-scan",
                    Light.AMBER,
                    f"the best model has the largest {', '.join(edges)} of the scan",
                    "scan higher values",
                )
            )
        return tuple(found)

    def summary(self, rows: int = SHOWN) -> Table:
        """Table of the best trials; marks say which structure each criterion would take."""
        columns = (
            Column("na"), Column("nb"), Column("nc"), Column("nd"), Column("nf"), Column("nk"),
            Column("coefficients"), Column("free-run rms", self.unit), Column("free-run fit", "%"),
            Column("loss"), Column("FPE"), Column("AIC", digits=7), Column("AICc", digits=7),
            Column("BIC", digits=7), Column("MDL"), Column("smallest"), Column("note"),
        )  # fmt: skip
        chosen = {name: self.smallest(name) for name in CRITERIA}
        shown = list(self.trials[:rows])
        shown += [t for t in dict.fromkeys(chosen.values()) if t not in shown]
        notes = (
            f"ranked by free run on {', '.join(self.validation)}, started by {self.start} measured "
            "samples; criteria of the prediction errors on the records of the fit",
            f"{len(shown)} of {len(self.trials)} structures",
            *map(str, self.findings),
        )
        return Table(repr(self), columns, tuple(_row(trial, chosen) for trial in shown), notes)

    def _computed(self) -> dict[str, object]:
        return {
            "trials": self.summary(len(self.trials)).to_dict(),
            "findings": self.findings,
        }

    def __repr__(self) -> str:
        """Number of structures and the best on one line."""
        first = self.trials[0]
        fit = "" if first.fit_percent is None else f", free-run fit {first.fit_percent:.1f} %"
        return (
            f"OrderScan({self.kind}, {len(self.trials)} structures, best "
            f"{first.structure.orders_text}{fit})"
        )


def _at_edge(scan: OrderScan) -> list[str]:
    best = scan.trials[0].structure
    found = []
    for name in ("na", "nb", "nc", "nd", "nf", "nk"):
        values = {getattr(trial.structure, name) for trial in scan.trials}
        if len(values) > 1 and getattr(best, name) == max(values):
            found.append(name)
    return found


def _row(trial: OrderTrial, chosen: dict[str, OrderTrial]) -> tuple[Cell, ...]:
    s, c = trial.structure, trial.criteria
    orders: list[Cell] = [s.na, _alike(s.nb), s.nc, s.nd, _alike(s.nf), _alike(s.nk)]
    marks = ", ".join(name.upper() for name, item in chosen.items() if item is trial)
    measures: list[Cell] = [None] * 6 if c is None else [c.loss, c.fpe, c.aic, c.aicc, c.bic, c.mdl]
    return (
        *orders, s.n_parameters, trial.free_run_rms, trial.fit_percent, *measures,
        marks.replace("AICC", "AICc"), trial.note,
    )  # fmt: skip


def _alike(values: tuple[int, ...]) -> Cell:
    return values[0] if len(set(values)) == 1 else ", ".join(map(str, values))
