"""The choice of an order from singular values and prediction errors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.identification.prediction_error.information_criteria import Criteria, criteria
from flightid.identification.subspace.data import SubspaceData
from flightid.identification.subspace.estimate import RANK, Matrices, Subspace, realise
from flightid.models.innovations.model import InnovationsModel
from flightid.models.innovations.prediction import one_step_errors
from flightid.models.innovations.structure import SubspaceStructure
from flightid.result import Result
from flightid.table import Column, Table

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class OrderChoice(Result, schema="flightid.order_choice/1"):
    """Evidence for an order, one entry for each candidate 1, 2, ….

    Attributes
    ----------
    chosen : int
    singular_values : ndarray
        All of the method's weighting.
    correlations : ndarray
        Canonical correlations of past and future.
    gap : int
        Order before the largest ratio of neighbouring singular values.
    svc : tuple of float
        Bauer's criterion ρ²ₙ₊₁ + d(n) ln N / N with canonical correlation ρ.
    criteria : tuple of Criteria
        Of the errors one step ahead before refinement; the loss is the determinant of their
        covariance. Empty where the order was given.
    horizon : int
    asked : bool
        Whether the order was given.

    Example
    -------
    >>> OrderChoice(1, np.array([3.0, 0.1]), np.array([0.9, 0.1]), 1, (0.1,), (), 5, True)
    OrderChoice(1 state as asked, gap after 1, SVC smallest at 1)
    """

    chosen: int
    singular_values: Array
    correlations: Array
    gap: int
    svc: tuple[float, ...]
    criteria: tuple[Criteria, ...]
    horizon: int
    asked: bool

    @property
    def smallest_svc(self) -> int:
        """Order with the smallest SVC."""
        return int(np.argmin(self.svc)) + 1

    @property
    def smallest_bic(self) -> int | None:
        """Order with the smallest BIC of prediction errors; None where they vanish."""
        values = [math.inf if each.bic is None else each.bic for each in self.criteria]
        return None if not values or math.isinf(min(values)) else int(np.argmin(values)) + 1

    @property
    def rivals(self) -> dict[str, int]:
        """Criteria that ask for another order, and which."""
        said = {"singular-value gap": self.gap, "SVC": self.smallest_svc}
        if self.smallest_bic is not None:
            said["BIC of prediction errors"] = self.smallest_bic
        return {name: n for name, n in said.items() if n != self.chosen}

    def summary(self) -> Table:
        """Table of the candidates."""
        columns = (
            Column("states"),
            Column("singular value", digits=6),
            Column("ratio to next", digits=3),
            Column("canonical correlation"),
            Column("SVC"),
            Column("BIC", digits=6),
        )
        rows = []
        values = self.singular_values
        for place, svc in enumerate(self.svc):
            after = values[place + 1] if place + 1 < values.size else 0.0
            ratio = float(values[place] / after) if after > RANK * values[0] else None
            bic = self.criteria[place].bic if place < len(self.criteria) else None
            rho = float(self.correlations[place]) if place < self.correlations.size else None
            value = float(values[place]) if place < values.size else None
            rows.append((place + 1, value, ratio, rho, svc, bic))
        notes = (
            f"{self.horizon} block rows of past and of future",
            "SVC: squared next canonical correlation + d ln N / N; BIC of errors one step ahead "
            "before refinement; the smallest value counts",
        )
        return Table(repr(self), columns, tuple(rows), notes)

    def __repr__(self) -> str:
        """Chosen order and what the criteria say on one line."""
        how = "as asked" if self.asked else "chosen"
        states = f"{self.chosen} state{'' if self.chosen == 1 else 's'}"
        return (
            f"OrderChoice({states} {how}, gap after {self.gap}, SVC smallest at "
            f"{self.smallest_svc})"
        )


def choose_order(
    structure: SubspaceStructure, data: SubspaceData, found: Subspace
) -> tuple[OrderChoice, Matrices]:
    """Order by the smallest SVC unless one is asked, and the model of that order.

    Reference: Bauer, "Order estimation for subspace methods", *Automatica* 37 (2001).
    """
    values, samples = found.singular_values, found.n_columns
    rank = int(np.sum(values > RANK * max(float(values[0]), 1e-300)))
    if structure.order is not None:
        largest = max(structure.order, min(rank - 1, structure.maximum_order))
    else:
        largest = min(rank, structure.maximum_order)
    svc, made, fitted = [], [], {}
    for n in range(1, largest + 1):
        d = structure.n_parameters(n)
        after = float(found.correlations[n]) if n < found.correlations.size else 0.0
        svc.append(after**2 + d * math.log(samples) / samples)
        if structure.order in (None, n):
            fitted[n] = realise(structure, data, found, n)
        if structure.order is None:
            made.append(_prediction_criteria(structure, data, fitted[n], d))
    padded = np.maximum(values[: largest + 1], RANK * values[0])
    ratios = padded[:-1] / padded[1:] if padded.size > 1 else np.ones(1)
    gap = int(np.argmax(ratios)) + 1
    chosen = structure.order or int(np.argmin(svc)) + 1
    choice = OrderChoice(
        chosen, values, found.correlations, gap, tuple(svc), tuple(made), found.horizon,
        structure.order is not None,
    )  # fmt: skip
    return choice, fitted[chosen]


def _prediction_criteria(
    structure: SubspaceStructure, data: SubspaceData, matrices: Matrices, count: int
) -> Criteria:
    model = InnovationsModel(structure.inputs, structure.outputs, 1.0, *matrices)
    size = data.scales[:, None]
    errors = np.hstack(
        [
            one_step_errors(model, y * size, u, structure.initial_state)
            for y, u in zip(data.outputs, data.inputs, strict=True)
        ]
    )
    return determinant_criteria(errors, size, count)


def determinant_criteria(errors: Array, size: Array, count: int) -> Criteria:
    """Criteria with the determinant of the errors' covariance for the loss.

    Rounding below the outputs' own size counts as no error at all.
    """
    samples = errors.shape[1]
    relative = errors / size
    sign, level = np.linalg.slogdet(relative @ relative.T / samples)
    if sign <= 0 or level < -60.0 * len(errors):
        return criteria(0.0, samples, count)
    determinant = float(np.exp(level)) * float(np.prod(np.asarray(size) ** 2))
    return criteria(determinant * samples, samples, count)
