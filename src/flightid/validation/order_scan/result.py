"""What a scan of orders found."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.identification.fit import Fit
from flightid.identification.prediction_error.information_criteria import Criteria
from flightid.models.innovations.model import InnovationsModel
from flightid.models.model import Model
from flightid.models.polynomial.orders import ANY
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.validation.order_scan.edges import Structure, delay_findings, edge_findings

Range = int | Iterable[int]
CRITERIA = ("aic", "aicc", "bic", "mdl", "fpe")
ALIKE = 0.02
SHOWN = 20
MUCH_WORSE = 2.0
"""Ratio of free-run errors beyond which no chance makes trials alike."""


@dataclass(frozen=True, eq=False)
class OrderTrial:
    """One structure: its model and criteria, and its free run on the validation records.

    `free_run_rms` is in the output's unit; None where `note` says why there is none. `criteria` are
    of polynomials, `whitened` those with the colour of the errors taken out where there is no model
    of the noise. A fit that is not `settled` ended at no minimum and stands behind all others.
    `fit` is kept of the best of a kind alone, and `errors` of the free runs, by record, where they
    are not `MUCH_WORSE` than the best: what is paired with another's tells them apart.

    Example
    -------
    >>> import flightid as fid
    >>> asked = fid.PolynomialModel.arx("u", "y", na=1, nb=1)
    >>> OrderTrial(asked, None, None, None, None, "collinear regressors").note
    'collinear regressors'
    """

    structure: Structure
    model: Model | None
    criteria: Criteria | None
    free_run_rms: float | None
    fit_percent: float | None
    note: str = ""
    settled: bool = True
    fit: Fit | None = field(default=None, repr=False)
    whitened: Criteria | None = None
    errors: tuple[NDArray[np.float32], ...] = field(default=(), repr=False)

    @property
    def likelihood(self) -> Criteria | None:
        """Criteria that compare structures: slow errors that count as white are likely of none."""
        return self.whitened or self.criteria

    @property
    def kind(self) -> str:
        """Kind in a word: "ARX", "subspace", "NARX"."""
        return self.structure.kind

    @property
    def n_parameters(self) -> int | None:
        """Coefficients, terms of NARX, or what determines an innovations form; None: no model."""
        if isinstance(self.structure, PolynomialStructure):
            return self.structure.n_parameters
        if isinstance(self.model, InnovationsModel):
            n, p, m = self.model.order, len(self.model.outputs), len(self.model.inputs)
            return n * (2 * p + m) + p * m * bool(np.any(self.model.matrices[3]))
        return None if self.model is None else len(self.model.parameters)


def rank_of(trial: OrderTrial) -> tuple[bool, float]:
    """What trials are ranked by: whether the fit settled, then its free-run error."""
    unranked = trial.free_run_rms is None
    return unranked or not trial.settled, np.inf if unranked else trial.free_run_rms or 0.0


def is_settled(fit: Fit) -> bool:
    """Whether a search ended at a minimum of its cost."""
    return all(finding.code != "not-converged" for finding in fit.findings)


def whole_numbers(name: str, item: Range) -> list[int]:
    """Orders to try.

    Raises
    ------
    OptionError
        There is none, or one below zero.
    """
    found = [item] if isinstance(item, int) else list(item)
    if not found or min(found) < 0:
        raise OptionError(f"{name} has nothing to try", found=found, needed="orders from 0 up")
    return found


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
    settle_s : float
        First stretch of each free run, s: its start is solved for there, and no score counts it.
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
    settle_s: float
    unit: str

    @property
    def is_of_several_kinds(self) -> bool:
        """Whether models of several kinds were ranked."""
        return self.kind == ANY

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
            if t.settled and t.free_run_rms is not None and t.free_run_rms <= least * (1 + ALIKE)
        ]
        return min(alike or self.trials[:1], key=lambda t: t.n_parameters or 0)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Verdicts on the choice."""
        found = []
        best, simple = self.trials[0], self.simplest
        if (simple.n_parameters or 0) < (best.n_parameters or 0):
            found.append(
                Finding(
                    "simpler-model",
                    Light.AMBER,
                    f"{words_of(self, simple)} with {simple.n_parameters} coefficients runs as "
                    f"well within 2 % as {words_of(self, best)} with {best.n_parameters}",
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
        tried = [each.structure for each in self.trials]
        at_edges = edge_findings(best.structure, tried)
        late = delay_findings(best.structure, self.best.parameters, tried)
        return (*found, *at_edges, *late)

    def summary(self, rows: int = SHOWN) -> Table:
        """Table of the best trials; marks say which structure each criterion would take."""
        scored = Column("free-run rms", self.unit), Column("free-run fit", "%")
        notes: tuple[str, ...] = (
            f"ranked by free run on {', '.join(self.validation)}; the start of each run is solved "
            f"for on the first {self.settle_s:.3g} s (NARX: measured lags), which no score counts",
        )
        if self.is_of_several_kinds:
            head = Column("kind"), Column("orders"), Column("coefficients"), *scored, Column("note")
            best = {trial.kind: trial for trial in reversed(self.trials)}
            shown = list(self.trials[:rows])
            shown += [t for t in self.trials[rows:] if t is best[t.kind]]
            cells = [
                (t.kind, t.structure.orders_text, t.n_parameters, t.free_run_rms, t.fit_percent,
                 t.note) for t in shown
            ]  # fmt: skip
            counted = f"{len(shown)} of {len(self.trials)} structures, each kind's best among them"
            notes = (*notes, counted, *map(str, self.findings))
            return Table(repr(self), head, tuple(cells), notes)
        columns = (
            Column("na"), Column("nb"), Column("nc"), Column("nd"), Column("nf"), Column("nk"),
            Column("coefficients"), *scored,
            Column("loss"), Column("FPE"), Column("AIC", digits=7), Column("AICc", digits=7),
            Column("BIC", digits=7), Column("MDL"), Column("smallest"), Column("note"),
        )  # fmt: skip
        chosen = {name: self.smallest(name) for name in CRITERIA}
        shown = list(self.trials[:rows])
        shown += [t for t in dict.fromkeys(chosen.values()) if t not in shown]
        notes = (
            *notes,
            "criteria of the prediction errors on the records of the fit",
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
        best = f"best {words_of(self, first)}{fit}"
        return f"OrderScan({self.kind}, {len(self.trials)} structures, {best})"


def words_of(scan: OrderScan, trial: OrderTrial) -> str:
    """A structure in words, its kind too where there are several."""
    text = trial.structure.orders_text
    return f"{trial.kind} {text}" if scan.is_of_several_kinds else text


def _row(trial: OrderTrial, chosen: dict[str, OrderTrial]) -> tuple[Cell, ...]:
    s, c = trial.structure, trial.criteria
    orders: list[Cell] = [None] * 6
    if isinstance(s, PolynomialStructure):
        below = s.nf_text if s.is_common else _alike(s.nf)
        orders = [s.na, _alike(s.nb), s.nc, s.nd, below, _alike(s.nk)]
    marks = ", ".join(name.upper() for name, item in chosen.items() if item is trial)
    measures: list[Cell] = [None] * 6 if c is None else [c.loss, c.fpe, c.aic, c.aicc, c.bic, c.mdl]
    return (
        *orders, trial.n_parameters, trial.free_run_rms, trial.fit_percent, *measures,
        marks.replace("AICC", "AICc"), trial.note,
    )  # fmt: skip


def _alike(values: tuple[int, ...]) -> Cell:
    return values[0] if len(set(values)) == 1 else ", ".join(map(str, values))
