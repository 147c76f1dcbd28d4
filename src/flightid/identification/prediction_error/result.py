"""The fit of a polynomial model: coefficients, roots and gains with intervals, and criteria."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flightid.findings import Finding
from flightid.identification.fit import LocalMinimum
from flightid.identification.prediction_error.information_criteria import Criteria
from flightid.identification.prediction_error.roots import POLE, FittedRoot
from flightid.models.linear.linear_system import LinearSystem
from flightid.models.polynomial.model import PolynomialModel
from flightid.models.polynomial.prediction import PolynomialPrediction
from flightid.models.polynomial.structure import PolynomialStructure
from flightid.record import Record
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import half_width

SCHEMA = "flightid.polynomial_fit/1"


@dataclass(frozen=True)
class FitScore:
    """How one predictor fits the records of the fit.

    `predictor` says horizon and initial state; `fit_percent` is 100 (1 - |y - ŷ| / |y - mean y|).
    """

    predictor: str
    rms: float
    fit_percent: float


@dataclass(frozen=True, repr=False, eq=False)
class PolynomialFit:
    """Result of `flightid.identify` for a polynomial structure.

    Attributes
    ----------
    model : PolynomialModel
        With the estimates, their covariance and the noise variance.
    structure : PolynomialStructure
        What was asked.
    parameters : mapping of str to Estimate
        Coefficients by name.
    roots : tuple of FittedRoot
        Poles and zeros with errors, natural frequencies and dampings.
    gains : mapping of str to Estimate
        Steady gains by ``"output/input"``.
    criteria : Criteria
        Loss, FPE, AIC, AICc, BIC, MDL.
    scores : tuple of FitScore
        One step ahead and free run on the records of the fit.
    records : tuple of Record
    errors : tuple of ndarray
        Prediction errors one step ahead, for each record, those of its start not counted.
    minima : tuple of LocalMinimum
        What the starts found, best first.
    termination : str
    iterations : int
    findings : tuple of Finding
    provenance : mapping

    Example
    -------
    >>> import flightid as fid
    >>> u = np.random.default_rng(0).standard_normal(500)
    >>> truth = fid.PolynomialModel("y", ("u",), 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
    >>> record = fid.Record.from_arrays(np.arange(500) / 10, inputs={"u": u},
    ...                                 outputs={"y": np.zeros(500)})
    >>> record = record.replace({"y": truth.simulate(record)})
    >>> fit = fid.identify(fid.PolynomialModel.arx("u", "y", na=2, nb=2, offsets="none"), record)
    >>> fit
    PolynomialFit(ARX, 4 coefficients, 498 samples, free-run fit 100.0 %)
    >>> [round(p.value, 9) for p in fit.parameters.values()]
    [-1.5, 0.7, 1.0, 0.5]
    """

    model: PolynomialModel
    structure: PolynomialStructure
    parameters: Mapping[str, Estimate]
    roots: tuple[FittedRoot, ...]
    gains: Mapping[str, Estimate]
    criteria: Criteria
    scores: tuple[FitScore, ...]
    records: tuple[Record, ...]
    errors: tuple[NDArray[np.float64], ...]
    minima: tuple[LocalMinimum, ...]
    termination: str
    iterations: int
    findings: tuple[Finding, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)

    @property
    def covariance(self) -> NDArray[np.float64] | None:
        """Of the coefficients, in the order of `parameters`."""
        return self.model.covariance

    @property
    def modes(self) -> tuple[FittedRoot, ...]:
        """Poles with a natural frequency, the slowest first."""
        return tuple(root for root in self.roots if root.kind == POLE and root.natural_frequency)

    def linear_system(self) -> LinearSystem:
        """The linear system of the fitted model; ModelError with the reason where there is none."""
        return self.model.linear_system()

    def predict(
        self, record: Record, horizon: int | str = "free_run", *, initial_state: str = "estimate"
    ) -> PolynomialPrediction:
        """Predict a record, by default in free run; see `PolynomialModel.predict`."""
        return self.model.predict(
            record, horizon, initial_state=initial_state, offsets=self.structure.offsets
        )

    def summary(self) -> Table:
        """Table of the coefficients, with roots, gains, criteria and findings below."""
        columns = (
            Column("coefficient"),
            Column("value", digits=6),
            Column("unit"),
            Column("standard error", digits=3),
            Column("95 % low", digits=5),
            Column("95 % high", digits=5),
            Column("note"),
        )
        items = [*self.parameters.values(), *self.gains.values()]
        rows = tuple(map(_row, items))
        notes = (
            self.model.difference_equation(),
            *(f"fit {s.fit_percent:.2f} % ({s.predictor}), rms {s.rms:.4g}" for s in self.scores),
            str(self.criteria),
            f"initial state: {self.structure.past}; offsets taken off: "
            f"{self.structure.offsets}; ended by {self.termination} after {self.iterations} steps",
            *map(str, self.findings),
        )
        return Table(repr(self), columns, rows, notes)

    def roots_table(self) -> Table:
        """Table of poles and zeros with 95 % half-widths."""
        return roots_table(self.roots)

    def to_dict(self) -> dict[str, object]:
        """Plain values with a ``schema`` key, without the samples."""
        return {
            "schema": SCHEMA,
            "structure": repr(self.structure),
            "model": self.model.to_dict(),
            "parameters": {name: p.to_dict() for name, p in self.parameters.items()},
            "roots": [root.to_dict() for root in self.roots],
            "gains": {name: p.to_dict() for name, p in self.gains.items()},
            "criteria": self.criteria.to_dict(),
            "scores": [
                {"predictor": s.predictor, "rms": s.rms, "fit_percent": s.fit_percent}
                for s in self.scores
            ],
            "minima": [
                {
                    "objective": each.objective,
                    "count": each.count,
                    "values": dict(each.values),
                    "termination": each.termination,
                }
                for each in self.minima
            ],
            "termination": self.termination,
            "iterations": self.iterations,
            "findings": [finding.to_dict() for finding in self.findings],
            "provenance": dict(self.provenance),
        }

    def __repr__(self) -> str:
        """Kind, size and free-run fit on one line."""
        return (
            f"PolynomialFit({self.structure.kind}, {len(self.parameters)} coefficients, "
            f"{self.criteria.n_samples} samples, free-run fit {self.scores[-1].fit_percent:.1f} %)"
        )

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_() + self.roots_table()._repr_html_()


def roots_table(roots: Sequence[FittedRoot]) -> Table:
    """Table of poles and zeros with 95 % half-widths."""
    columns = (
        Column("response"),
        Column("root"),
        Column("real", digits=5),
        Column("± real", digits=2),
        Column("imaginary", digits=5),
        Column("± imaginary", digits=2),
        Column("natural frequency", "rad/s"),
        Column("± frequency", "rad/s", 2),
        Column("damping"),
        Column("± damping", digits=2),
        Column("note"),
    )
    rows: list[tuple[Cell, ...]] = []
    for root in roots:
        errors = root.stderr or (None, None)
        wide = [None if error is None else half_width() * error for error in errors]
        rows.append(
            (
                root.response, root.kind, root.z.real, wide[0], root.z.imag,
                wide[1] if root.z.imag else None,
                *_with_half(root.natural_frequency), *_with_half(root.damping), root.note,
            )
        )  # fmt: skip
    return Table(
        "Poles and zeros",
        columns,
        tuple(rows),
        ("one line for each conjugate pair; ± is half a 95 % interval",),
    )


def _row(item: Estimate) -> tuple[Cell, ...]:
    low, high = item.interval95 or (None, None)
    return item.name, item.value, item.unit, item.stderr, low, high, item.reason


def _with_half(item: Estimate | None) -> tuple[Cell, Cell]:
    if item is None:
        return None, None
    return item.value, item.half_width95
