"""What others published of the same model: values, bounds and insensitivities beside ours."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.identification import Fit, PolynomialDetails, SubspaceDetails
from flightid.options import Options, option
from flightid.reading import read_toml
from flightid.study.reading import TableReader, read_table
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Estimate
from flightid.validation import Verification

SHOWN = 4
"""Records of a fit whose errors stand each for itself."""


@dataclass(frozen=True)
class Remark(Options):
    """A table ``[[remark]]``."""

    printed: str = option(doc="What is printed.")
    but: str = option(doc="What speaks against it.")


@dataclass(frozen=True)
class MeanSquareErrors(Options):
    """What mean square errors are of."""

    training: Mapping[str, float] = option(default_factory=dict, doc="Of the fitted records.")
    validation: Mapping[str, float] = option(default_factory=dict, doc="Of unseen records.")

    @property
    def outputs(self) -> tuple[str, ...]:
        """Outputs of which one was published."""
        return tuple(dict.fromkeys((*self.training, *self.validation)))


@dataclass(frozen=True)
class PublishedFigures(Options):
    """Figures of a paper or report, by parameter: what a file of them says.

    Example
    -------
    >>> PublishedFigures("a paper", {"Lp": -4.0}, {"Lp": 3.1}).cramer_rao_percent["Lp"]
    3.1
    """

    source: str = option(doc="Where they stand.")
    value: Mapping[str, float] = option(
        default_factory=dict, doc="By parameter, in the unit of the model."
    )
    cramer_rao_percent: Mapping[str, float] = option(
        default_factory=dict, unit="%", doc="Of the value, by parameter."
    )
    insensitivity_percent: Mapping[str, float] = option(
        default_factory=dict, unit="%", doc="Of the value, by parameter."
    )
    average_cost: float | None = option(None, above=0.0, doc="Of all responses.")
    loss: float | None = option(None, above=0.0, doc="Of a model without equations.")
    singular_values: tuple[float, ...] | None = option(
        None, doc="Of a subspace estimate, the largest first."
    )
    mean_square_error: MeanSquareErrors = option(
        default_factory=MeanSquareErrors, doc="By output, in its unit squared."
    )
    remark: tuple[Remark, ...] = option((), doc="What is to be read with care.")


def read_published(path: Path) -> PublishedFigures:
    """Figures from a TOML file.

    Raises
    ------
    StudyError
        The file cannot be read, a key is unknown, or a figure is no number.
    """
    try:
        content = read_toml(path, "a file of published figures", StudyError)
    except OSError as error:
        raise StudyError(
            "a file of published figures cannot be read",
            found=f"{path.name}: {error}",
            needed="a TOML file beside the study",
        ) from error
    return read_table(PublishedFigures, TableReader(content, f"published figures {path.name}"))


def published_tables(
    published: PublishedFigures, fit: Fit, unseen: Mapping[str, Verification]
) -> tuple[Table, ...]:
    """Every published figure of a model beside ours, and what speaks against them.

    Parameters
    ----------
    published : PublishedFigures
    fit : Fit
    unseen : mapping of str to Verification
        Free runs through records that the fit has not seen, by name.
    """
    first = published_table(published, fit)
    # The source alone is no figure.
    made = [first] if first.rows or len(first.notes) > 1 else []
    if published.mean_square_error.outputs:
        made.append(error_table(published, fit, unseen))
    if published.remark:
        columns = (Column("printed"), Column("but"))
        rows = tuple((each.printed, each.but) for each in published.remark)
        made.append(Table("Published figures, read with care", columns, rows))
    return tuple(made)


def error_table(published: PublishedFigures, fit: Fit, unseen: Mapping[str, Verification]) -> Table:
    """Published mean square errors of each output beside ours.

    Parameters
    ----------
    published : PublishedFigures
    fit : Fit
        Its own are of all its records together.
    unseen : mapping of str to Verification
    """
    theirs = published.mean_square_error
    ours = _training_errors(fit)
    rows: list[tuple[Cell, ...]] = []
    for name in theirs.outputs:
        if name not in fit.model.outputs:
            continue
        first, second = theirs.training.get(name), theirs.validation.get(name)
        own = (errors.get(name) for errors in ours.values())
        free = (run.mse.get(name) for run in unseen.values())
        rows.append((name, fit.model.units.get(name, "1"), first, *own, second, *free))
    columns = (
        *(Column("output"), Column("unit, squared"), Column("published training", digits=3)),
        *(Column(f"training, {name}" if name else "training", digits=3) for name in ours),
        Column("published validation", digits=3),
        *(Column(name, digits=3) for name in unseen),
    )
    note = "Mean square of measured minus modelled, in training and in free runs. Published: "
    note += f"{published.source}."
    made = Table("Published mean square errors beside ours", columns, tuple(rows), (note,))
    return made.without_empty_columns()


def _training_errors(fit: Fit) -> dict[str, dict[str, float]]:
    """Mean squares of residuals by record and output; of all records where they are many."""
    squares: dict[str, dict[str, list[float]]] = {}
    for record in fit.records:
        name = str(record.measured.name) if len(fit.records) <= SHOWN else ""
        of_record = squares.setdefault(name, {})
        for output in record.outputs:
            of_record.setdefault(output, []).extend(record.residual(output) ** 2)
    return {
        name: {output: float(np.mean(values)) for output, values in of_record.items()}
        for name, of_record in squares.items()
    }


def published_table(published: PublishedFigures, fit: Fit) -> Table:
    """Each published figure beside ours, with the ratio of ours to it.

    Parameters
    ----------
    published : PublishedFigures
    fit : Fit

    Returns
    -------
    Table
        One row for each parameter of which something was published. Bounds and insensitivities
        rest on the flights behind them: those of other flights agree in order of magnitude.
    """
    kinds = {
        "value": (published.value, "", _value),
        "CR": (published.cramer_rao_percent, "%", _bound),
        "I": (published.insensitivity_percent, "%", _insensitivity),
    }
    named = dict.fromkeys(name for theirs, _, _ in kinds.values() for name in theirs)
    columns = [Column("parameter"), Column("unit")]
    for kind, (_, unit, _) in kinds.items():
        columns += [Column(kind, unit, 4), Column(f"published {kind}", unit, 4)]
        columns.append(Column(f"{kind} ratio", digits=3))
    rows: list[tuple[Cell, ...]] = []
    for name in named:
        parameter = fit.parameters.get(name)
        if parameter is None:
            continue
        cells: list[Cell] = [name, parameter.unit]
        for theirs, _, read in kinds.values():
            cells += _pair(read(parameter) if name in theirs else None, theirs.get(name))
        rows.append(tuple(cells))
    absent = [name for name in named if name not in fit.parameters]
    notes = [f"Published: {published.source}."]
    if published.average_cost is not None and fit.responses:
        notes.append(f"Average cost {fit.average_cost:.3g}; published {published.average_cost:g}.")
    if published.loss is not None and isinstance(fit.details, PolynomialDetails):
        notes.append(f"Loss {fit.details.criteria.loss:.5g}; published {published.loss:g}.")
    if published.singular_values and isinstance(fit.details, SubspaceDetails):
        sizes = published.singular_values
        ours = fit.details.order.singular_values[: len(sizes)]
        notes.append(f"Singular values {_listed(ours)}; published {_listed(sizes)}.")
    if absent:
        notes.append(f"Published, and not in this model: {', '.join(absent)}.")
    made = Table("Published figures beside ours", tuple(columns), tuple(rows), tuple(notes))
    return made.without_empty_columns()


def _listed(values: Iterable[float]) -> str:
    return ", ".join(f"{value:.6g}" for value in values)


def _value(parameter: Estimate) -> float | None:
    return parameter.value


def _bound(parameter: Estimate) -> float | None:
    return parameter.cramer_rao_percent


def _insensitivity(parameter: Estimate) -> float | None:
    return parameter.insensitivity_percent


def _pair(ours: float | None, theirs: float | None) -> tuple[Cell, Cell, Cell]:
    ratio = ours / theirs if ours is not None and theirs else None
    return ours, theirs, ratio
