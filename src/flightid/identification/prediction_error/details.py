"""What a polynomial model adds to a fit: roots and gains with intervals, criteria and scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, Self

from flightid.frozen import dataclass
from flightid.identification.details import Details
from flightid.identification.prediction_error.information_criteria import Criteria
from flightid.identification.prediction_error.roots import (
    NO_ERRORS,
    POLE,
    FittedRoot,
    without_errors,
)
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import half_width


@dataclass(frozen=True)
class FitScore:
    """How one predictor fits the records of the fit.

    `predictor` says horizon and initial state; `fit_percent` is 100 (1 - |y - ŷ| / |y - mean y|).
    """

    predictor: str
    rms: float
    fit_percent: float


@dataclass(frozen=True, eq=False)
class PolynomialDetails(Details):
    """Beside the coefficients of a polynomial model.

    Attributes
    ----------
    roots : tuple of FittedRoot
        Poles and zeros with errors, natural frequencies and dampings.
    gains : mapping of str to Estimate
        Steady gains by ``"output/input"``.
    criteria : Criteria
        Loss, FPE, AIC, AICc, BIC, MDL.
    scores : mapping of str to tuple of FitScore
        By output: one step ahead and free run on the records of the fit.
    equation : str
        The model in samples.
    transfer : tuple of str
        Its transfer functions in factors of z.

    Example
    -------
    >>> import numpy as np
    >>> import flightid as fid
    >>> u = np.random.default_rng(0).standard_normal(500)
    >>> truth = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.5, 0.7], b=[[1.0, 0.5]])
    >>> record = fid.Record.from_arrays(np.arange(500) / 10, inputs={"u": u},
    ...                                 outputs={"y": np.zeros(500)})
    >>> record = record.replace({"y": truth.simulate(record)})
    >>> fit = fid.identify(fid.PolynomialModel.arx("u", "y", na=2, nb=2, offsets="none"), record)
    >>> fit
    Fit('ARX model of y', 4 free of 4 parameters, 1 record, average cost 0.00 %, free-run fit y
    100.0 %)
    >>> [round(p.value, 9) for p in fit.parameters.values()]
    [-1.5, 0.7, 1.0, 0.5]
    >>> fit.details.modes[0].natural_frequency.unit
    'rad/s'
    """

    roots: tuple[FittedRoot, ...]
    gains: Mapping[str, Estimate]
    criteria: Criteria
    scores: Mapping[str, tuple[FitScore, FitScore]]
    equation: str
    transfer: tuple[str, ...] = ()

    @property
    def modes(self) -> tuple[FittedRoot, ...]:
        """Poles with a natural frequency, the slowest first."""
        return tuple(root for root in self.roots if root.kind == POLE and root.natural_frequency)

    @property
    def words(self) -> str:
        """Free-run fit of each output."""
        fits = ", ".join(f"{y} {pair[1].fit_percent:.1f} %" for y, pair in self.scores.items())
        return f"free-run fit {fits}"

    def quantities(self, parameters: Mapping[str, Estimate]) -> Sequence[Estimate]:
        """Coefficients and steady gains."""
        return (*parameters.values(), *self.gains.values())

    def without_intervals(self, reason: str) -> Self:  # noqa: ARG002 - that of the coefficients
        """Roots and gains without error bars."""
        bare = {
            name: replace(gain, stderr=None, ends=None, reason=gain.reason or NO_ERRORS)
            for name, gain in self.gains.items()
        }
        roots = without_errors(self.roots, self.roots, NO_ERRORS, noted=False)
        return replace(self, roots=roots, gains=bare)

    def notes(self, structure: Any) -> tuple[str, ...]:  # noqa: ANN401 - each kind's own
        """Equation, scores, criteria and what was done about start and offsets."""
        scores = [score for pair in self.scores.values() for score in pair]
        return (
            self.equation,
            *self.transfer,
            *(f"fit {s.fit_percent:.2f} % ({s.predictor}), rms {s.rms:.4g}" for s in scores),
            str(self.criteria),
            f"initial state: {structure.initial_state}; offsets taken off: {structure.offsets}",
        )

    def roots_table(self) -> Table:
        """Table of poles and zeros with 95 % half-widths."""
        return roots_table(self.roots)

    def tables(self) -> tuple[Table, ...]:
        """The table of poles and zeros."""
        return (self.roots_table(),)

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "equation": self.equation,
            "transfer": list(self.transfer),
            "roots": [root.to_dict() for root in self.roots],
            "gains": {name: p.to_dict() for name, p in self.gains.items()},
            "criteria": self.criteria.to_dict(),
            "scores": {name: [asdict(s) for s in pair] for name, pair in self.scores.items()},
        }


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


def _with_half(item: Estimate | None) -> tuple[Cell, Cell]:
    if item is None:
        return None, None
    return item.value, item.half_width95
