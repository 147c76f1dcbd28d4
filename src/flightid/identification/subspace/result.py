"""The fit of an innovations model: order choice, poles, zeros and gains with intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from flightid.findings import Finding
from flightid.identification.prediction_error.information_criteria import Criteria
from flightid.identification.prediction_error.result import FitScore, roots_table
from flightid.identification.prediction_error.roots import POLE, FittedRoot
from flightid.identification.subspace.order import OrderChoice
from flightid.models.innovations.model import InnovationsModel
from flightid.models.innovations.prediction import InnovationsPrediction
from flightid.models.innovations.structure import SubspaceStructure
from flightid.models.linear.linear_system import LinearSystem
from flightid.record import Record
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate

SCHEMA = "flightid.innovations_fit/1"


@dataclass(frozen=True, repr=False, eq=False)
class InnovationsFit:
    """Result of `flightid.identify` for a subspace structure.

    Attributes
    ----------
    model : InnovationsModel
        Estimate with the covariance of its innovations.
    structure : SubspaceStructure
        What was asked.
    order : OrderChoice
        Singular values and criteria of all candidate orders.
    roots : tuple of FittedRoot
        Poles, shared by all responses, and zeros of each response, with errors.
    gains : mapping of str to Estimate
        Steady gains by ``"output/input"``.
    covariance : ndarray or None
        Of the entries of A, B, C, (D,) K row by row; singular, since states are free to turn.
    criteria : Criteria
        Their loss is the determinant of the innovations' covariance.
    scores : mapping of str to tuple of FitScore
        By output: one step ahead and free run on the records of the fit.
    records : tuple of Record
    errors : tuple of ndarray, shape (p, n_samples)
        Prediction errors one step ahead, for each record.
    termination : str
        How the refinement ended; ``"subspace"`` without one.
    iterations : int
    findings : tuple of Finding
    provenance : mapping

    Example
    -------
    >>> import flightid as fid
    >>> truth = fid.InnovationsModel(("y",), ("u",), 0.1, [[0.9, 0.2], [-0.2, 0.9]],
    ...                              [[1.0], [0.5]], [[1.0, 0.0]])
    >>> u = np.random.default_rng(0).standard_normal(400)
    >>> record = fid.Record.from_arrays(np.arange(400) / 10, inputs={"u": u},
    ...                                 outputs={"y": np.zeros(400)})
    >>> record = record.replace({"y": truth.simulate(record)[0]})
    >>> fit = fid.identify(fid.InnovationsModel.subspace("u", "y", offsets="none"), record)
    >>> fit
    InnovationsFit(moesp, 2 states, 400 samples, free-run fit y 100.0 %)
    >>> fit.modes[0]
    FittedRoot(pole of all responses at 0.9 ± 0.2i)
    """

    model: InnovationsModel
    structure: SubspaceStructure
    order: OrderChoice
    roots: tuple[FittedRoot, ...]
    gains: Mapping[str, Estimate]
    covariance: NDArray[np.float64] | None
    criteria: Criteria
    scores: Mapping[str, tuple[FitScore, FitScore]]
    records: tuple[Record, ...]
    errors: tuple[NDArray[np.float64], ...]
    termination: str
    iterations: int
    findings: tuple[Finding, ...] = ()
    provenance: Mapping[str, object] = field(default_factory=dict)

    @property
    def modes(self) -> tuple[FittedRoot, ...]:
        """Poles with a natural frequency, the slowest first."""
        return tuple(root for root in self.roots if root.kind == POLE and root.natural_frequency)

    def linear_system(self) -> LinearSystem:
        """The linear system of the fitted model; ModelError with the reason where there is none."""
        return self.model.linear_system()

    def predict(
        self, record: Record, horizon: int | str = "free_run", *, initial_state: str = "estimate"
    ) -> InnovationsPrediction:
        """Predict a record, by default in free run; see `InnovationsModel.predict`."""
        return self.model.predict(
            record, horizon, initial_state=initial_state, offsets=self.structure.offsets
        )

    def summary(self) -> Table:
        """Table of poles and gains with intervals, and scores, criteria and findings below."""
        columns = (
            Column("quantity"),
            Column("value", digits=6),
            Column("unit"),
            Column("standard error", digits=3),
            Column("95 % low", digits=5),
            Column("95 % high", digits=5),
            Column("note"),
        )
        items = []
        for root in self.modes:
            items += [each for each in (root.natural_frequency, root.damping) if each is not None]
        rows = tuple(_row(item) for item in (*items, *self.gains.values()))
        scores = [s for pair in self.scores.values() for s in pair]
        notes = (
            repr(self.order),
            *(f"fit {s.fit_percent:.2f} % ({s.predictor}), rms {s.rms:.4g}" for s in scores),
            str(self.criteria),
            f"initial state: {self.structure.initial_state}; offsets taken off: "
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
            "order": self.order.to_dict(),
            "roots": [root.to_dict() for root in self.roots],
            "gains": {name: p.to_dict() for name, p in self.gains.items()},
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "criteria": self.criteria.to_dict(),
            "scores": {
                name: [
                    {"predictor": s.predictor, "rms": s.rms, "fit_percent": s.fit_percent}
                    for s in pair
                ]
                for name, pair in self.scores.items()
            },
            "termination": self.termination,
            "iterations": self.iterations,
            "findings": [finding.to_dict() for finding in self.findings],
            "provenance": dict(self.provenance),
        }

    def __repr__(self) -> str:
        """Method, size and free-run fits on one line."""
        n, samples = self.model.order, sum(row.shape[1] for row in self.errors)
        states = f"{n} state{'' if n == 1 else 's'}"
        fits = ", ".join(f"{y} {pair[1].fit_percent:.1f} %" for y, pair in self.scores.items())
        return (
            f"InnovationsFit({self.structure.method}, {states}, {samples} samples, "
            f"free-run fit {fits})"
        )

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_() + self.roots_table()._repr_html_()


def _row(item: Estimate) -> tuple[Cell, ...]:
    low, high = item.interval95 or (None, None)
    return item.name, item.value, item.unit, item.stderr, low, high, item.reason
