"""Fields of a log over time, and formulas of fields: what one pane of a plot shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import FlightidError, OptionError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.logs.field_formula import FIELD, field_formula, require_formula
from flightid.logs.log import Log
from flightid.result import Result
from flightid.table import Cell, Column, Table

SIGN = "="
"""Ahead of a formula."""


@dataclass(frozen=True, eq=False)
class FieldSeries:
    """One line of a plot.

    Attributes
    ----------
    name : str
        Field, or formula without its sign.
    unit : str
    time_s, values : ndarray, shape (n,)
        Stamps, s, and samples; NaN where there is no number.
    """

    name: str
    unit: str
    time_s: NDArray[np.float64]
    values: NDArray[np.float64]

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Samples that are finite."""
        return self.values[np.isfinite(self.values)]


@dataclass(frozen=True, eq=False)
class FieldPlot(
    Result, schema="flightid.field_plot/1", untold={"series": "samples of the log; see rows"}
):
    """Fields over one span.

    Attributes
    ----------
    series : tuple of FieldSeries
    findings : tuple of Finding
        What was asked for and is not in the log.

    Example
    -------
    >>> import flightid as fid
    >>> log = fid.read_log("flight.bin")                             # doctest: +SKIP
    >>> field_plot(log, ["ATT.Roll", "= ATT.Roll - ATT.DesRoll"])    # doctest: +SKIP
    FieldPlot(ATT.Roll, ATT.Roll - ATT.DesRoll)
    """

    series: tuple[FieldSeries, ...]
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        """Names on one line."""
        return f"FieldPlot({', '.join(each.name for each in self.series)})"

    def summary(self) -> Table:
        """Least, mean and largest value of each line."""
        columns = (
            *(Column("field"), Column("unit"), Column("samples"), Column("least", digits=6)),
            *(Column("mean", digits=6), Column("largest", digits=6), Column("rms", digits=6)),
        )
        return Table("Fields", columns, tuple(map(_row, self.series)))

    def _computed(self) -> dict[str, object]:
        keys = ("field", "unit", "samples", "least", "mean", "largest", "rms")
        rows = [dict(zip(keys, _row(each), strict=True)) for each in self.series]
        return {"rows": rows}


def field_plot(
    log: Log, series: Sequence[str], span_s: tuple[float, float] | None = None
) -> FieldPlot:
    """Read fields and work out formulas of them.

    Parameters
    ----------
    log : Log
    series : sequence of str
        MESSAGE.FIELD, of one of several instances MESSAGE[k].FIELD; or a formula of such behind an
        equals sign.
    span_s : tuple of float, optional
        Start and stop on the log's clock; default: all of it.

    Raises
    ------
    OptionError
        One of them names no field, or is no formula.
    """
    found: list[FieldSeries] = []
    missing: list[Finding] = []
    for each in series:
        require_series(each)
        try:
            found.append(_inside(_read(log, each), span_s))
        except FlightidError as error:
            name = each.removeprefix(SIGN).strip()
            missing.append(Finding("field-missing", Light.AMBER, f"not plotted: {name}: {error}"))
    return FieldPlot(tuple(found), tuple(missing))


def require_series(text: str) -> None:
    """Refuse what names no field and is no formula of fields.

    Raises
    ------
    OptionError
        With what is wrong.

    Example
    -------
    >>> require_series("ATT.Roll"), require_series("= ATT.Roll - ATT.DesRoll")
    (None, None)
    """
    if text.startswith(SIGN):
        require_formula(text.removeprefix(SIGN).strip())
    elif FIELD.fullmatch(text) is None:
        needed = "MESSAGE.FIELD, or a formula of fields behind an equals sign"
        raise OptionError("this names no field of a log", found=repr(text)[:60], needed=needed)


def _read(log: Log, text: str) -> FieldSeries:
    if text.startswith(SIGN):
        name = text.removeprefix(SIGN).strip()
        made = field_formula(log, name)
        return FieldSeries(name, made.unit, made.time_s, made.values)
    match = FIELD.fullmatch(text)
    assert match is not None
    message, number, field = match.groups()
    table = log.table(message, None if number is None else int(number))
    return FieldSeries(text, table.unit(field), table.time_s, np.asarray(table[field], np.float64))


def _inside(series: FieldSeries, span_s: tuple[float, float] | None) -> FieldSeries:
    if span_s is None:
        return series
    inside = (series.time_s >= span_s[0]) & (series.time_s <= span_s[1])
    return FieldSeries(series.name, series.unit, series.time_s[inside], series.values[inside])


def _row(series: FieldSeries) -> tuple[Cell, ...]:
    known = series.numbers
    if not known.size:
        return (series.name, series.unit, 0, None, None, None, None)
    rms = float(np.sqrt(np.mean(np.square(known))))
    ends = float(known.min()), float(known.mean()), float(known.max())
    return (series.name, series.unit, int(known.size), *ends, rms)
