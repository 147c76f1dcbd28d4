"""The choice of an order from singular values and prediction errors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.prediction.request import usual_stretch
from flightid.identification.prediction_error.information_criteria import Criteria, criteria
from flightid.identification.subspace.data import SubspaceData
from flightid.identification.subspace.estimate import (
    RANK,
    Matrices,
    Subspace,
    decompose,
    realise,
    realised,
)
from flightid.identification.subspace.prediction_errors import Predictor
from flightid.models.innovations.model import InnovationsModel
from flightid.models.innovations.prediction import (
    forced_run,
    free_motion,
    motion_from,
)
from flightid.models.innovations.structure import SubspaceStructure
from flightid.result import Result
from flightid.table import Column, Table

Array = NDArray[np.float64]
FITTED = 2.0 / 3.0
"""Share of each record that fits the models which run through the rest of it."""
STRETCHES = 12
BEYOND_CHANCE = 1.7958848187040437
"""Student's 95 % point, one side, of a mean over so many stretches, in standard errors."""
SAME = 1e-6
"""Relative difference of mean squares that is rounding."""


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
    kept_errors : tuple of float
        Mean squares of free runs through the last third of each record by models of the rest, over
        the outputs' power. Empty where the order was given or records are short.

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
    kept_errors: tuple[float, ...] = ()

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
            Column("free run on the kept third", "%"),
        )
        rows = []
        values = self.singular_values
        for place, svc in enumerate(self.svc):
            after = values[place + 1] if place + 1 < values.size else 0.0
            ratio = float(values[place] / after) if after > RANK * values[0] else None
            bic = self.criteria[place].bic if place < len(self.criteria) else None
            rho = float(self.correlations[place]) if place < self.correlations.size else None
            value = float(values[place]) if place < values.size else None
            run = self.kept_errors[place] if place < len(self.kept_errors) else None
            percent = None if run is None else 100.0 * (1.0 - math.sqrt(run))
            rows.append((place + 1, value, ratio, rho, svc, bic, percent))
        notes = (
            f"{self.horizon} block rows of past and of future",
            "SVC: squared next canonical correlation + d ln N / N; BIC of errors one step ahead "
            "before refinement; the smallest value counts",
            "taken: the fewest states whose free run on the kept third of each record is not worse "
            "than the best beyond chance (5 %), and more, up to one standard error's choice, where "
            "BIC of the refined model asks for them; without a kept third the smallest SVC",
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
) -> tuple[OrderChoice, Matrices, int]:
    """Order by free run on kept samples unless one is asked, the model of that order, and a limit.

    The limit is the order that one standard error of the free runs would take: what lies between
    is open.

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
            fitted[n], squares = realised(structure, data, found, n)
            if structure.order is None:
                made.append(_prediction_criteria(structure, data, fitted[n], d, squares))
    padded = np.maximum(values[: largest + 1], RANK * values[0])
    ratios = padded[:-1] / padded[1:] if padded.size > 1 else np.ones(1)
    gap = int(np.argmax(ratios)) + 1
    runs = () if structure.order else kept_errors(structure, data, largest)
    chosen = structure.order or simplest(runs) or int(np.argmin(svc)) + 1
    choice = OrderChoice(
        chosen, values, found.correlations, gap, tuple(svc), tuple(made), found.horizon,
        structure.order is not None, tuple(float(np.mean(each)) for each in runs),
    )  # fmt: skip
    return choice, fitted[chosen], simplest(runs, errors_apart=1.0)


def kept_errors(structure: SubspaceStructure, data: SubspaceData, largest: int) -> list[Array]:
    """By order: squared errors of free runs over the outputs' power, in stretches of what was kept.

    Models of the first two thirds of each record run through the last, started by its first
    stretch. Empty where records are too short for that.
    """
    first, kept = data.split(FITTED)
    try:
        found = decompose(structure, first)
        made = [realise(structure, first, found, n) for n in range(1, largest + 1)]
    except (DataError, np.linalg.LinAlgError):
        return []
    skip = usual_stretch(min(y.shape[1] for y in kept.outputs), largest)
    if min(y.shape[1] for y in kept.outputs) < skip + STRETCHES:
        return []
    return [free_run_errors(structure, first, kept, each, skip) for each in made]


def free_run_errors(
    structure: SubspaceStructure,
    first: SubspaceData,
    kept: SubspaceData,
    matrices: Matrices,
    skip: int,
) -> Array:
    """Squared errors of a free run over the outputs' power, in stretches of `kept`.

    Levels are those of `first`, whose records go on in `kept`; the state at the start is fitted to
    the first `skip` samples, which do not count.
    """
    model = InnovationsModel(structure.inputs, structure.outputs, 1.0, *matrices)
    size, a, c = kept.scales[:, None], matrices[0], matrices[2]
    squares = []
    predictor, inside = predictor_of(structure, first, matrices)
    with np.errstate(over="ignore", invalid="ignore"):
        levels = predictor.levels(inside, np.eye(first.n_outputs))
        for y, u, level in zip(kept.outputs, kept.inputs, levels, strict=True):
            left = (y - level[:, None]) * size - forced_run(model, u)
            if not np.all(np.isfinite(left)):
                return np.full(STRETCHES, np.inf)
            motion = free_motion(a, c, skip).reshape(len(a), -1).T
            start = np.asarray(
                np.linalg.lstsq(motion, left[:, :skip].ravel(), rcond=RANK)[0], float
            )
            left -= motion_from(a, c, start, y.shape[1])
            squares.append(np.mean((left[:, skip:] / size) ** 2, axis=0))
        # A run of a state that grows may be finite, and its sum not.
        parts = np.array_split(np.concatenate(squares), STRETCHES)
        return np.array([np.mean(part) for part in parts])


def simplest(errors: Sequence[Array], *, errors_apart: float = BEYOND_CHANCE) -> int:
    """Fewest states that do not err more than the best beyond chance; 0 where nothing ran.

    Means over stretches longer than the noise remembers are independent, so Student's test of
    paired differences allows for its colour.

    Reference: Breiman et al., *Classification and Regression Trees* (1984), section 3.4.3, of
    differences in the same stretches; Schmeiser (1982), *Operations Research* 30, batch means.

    Example
    -------
    >>> simplest([np.array([9.0, 8.0]), np.array([1.0, 1.2]), np.array([1.1, 1.0])])
    2
    """
    if not errors or not np.isfinite(min(float(np.sum(each)) for each in errors)):
        return 0
    best = min(errors, key=lambda each: float(np.mean(each)))
    for place, each in enumerate(errors):
        if not np.all(np.isfinite(each)):
            continue
        more = each - best
        spread = float(np.std(more, ddof=1)) / math.sqrt(more.size)
        if float(np.mean(more)) <= max(errors_apart * spread, SAME * float(np.mean(best))):
            return place + 1
    return 0


def _prediction_criteria(
    structure: SubspaceStructure,
    data: SubspaceData,
    matrices: Matrices,
    count: int,
    squares: float | None,
) -> Criteria:
    """Criteria of the prediction errors; `squares` are those of `realised`."""
    if squares is not None and data.n_outputs == 1 and structure.initial_state == "estimate":
        samples = sum(y.shape[1] for y in data.outputs)
        return _criteria_of(np.array([[squares]]), samples, data.scales, count)
    predictor, scaled = predictor_of(structure, data, matrices)
    errors = np.hstack(predictor.fitted_errors(scaled, np.eye(data.n_outputs)))
    return determinant_criteria(data.scales[:, None] * errors, data.scales[:, None], count)


def predictor_of(
    structure: SubspaceStructure, data: SubspaceData, matrices: Matrices
) -> tuple[Predictor, Matrices]:
    """The predictor of a model in the outputs' units, and that model in their sizes."""
    a, b, c, d, k = matrices
    inside = a, b, c / data.scales[:, None], d / data.scales[:, None], k * data.scales
    direct, start = bool(structure.direct), structure.initial_state
    return Predictor.of(data, inside, direct=direct, initial_state=start), inside


def determinant_criteria(errors: Array, size: Array, count: int) -> Criteria:
    """Criteria with the determinant of the errors' covariance for the loss.

    Rounding below the outputs' own size counts as no error at all.
    """
    relative = errors / size
    return _criteria_of(relative @ relative.T, errors.shape[1], size, count)


def _criteria_of(products: Array, samples: int, size: Array, count: int) -> Criteria:
    """The same from products of errors in the outputs' own sizes."""
    sign, level = np.linalg.slogdet(products / samples)
    if sign <= 0 or level < -60.0 * len(products):
        return criteria(0.0, samples, count)
    determinant = float(np.exp(level)) * float(np.prod(np.asarray(size) ** 2))
    return criteria(determinant * samples, samples, count)
