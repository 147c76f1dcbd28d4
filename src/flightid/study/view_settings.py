"""What a study may say of its log besides models: filters to try, fields to plot, sweeps to fly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from flightid.errors import OptionError, StudyError
from flightid.frozen import dataclass
from flightid.logs.field_plot import require_series
from flightid.option_forms import NOTHING, SPAN
from flightid.options import Options, option
from flightid.planning.options import PlanOptions
from flightid.study.reading import TableReader, read_table

TOLD_BY_LOG = ("vehicle", "autopilot")
"""Options of a plan without a log."""


@dataclass(frozen=True)
class FilterSettings(Options):
    """Filters to try on the noise of the flight: the table ``[filters]``."""

    parameters: Mapping[str, float] = option(
        doc="Values by the autopilot's names; the others stay as flown."
    )


@dataclass(frozen=True)
class PlotSettings(Options):
    """Fields over time in one pane: a table ``[[plot]]``; see `flightid.logs.field_plot`."""

    series: tuple[str, ...] = option(
        (), doc="Fields (MESSAGE.FIELD), and formulas of fields behind an equals sign."
    )
    layout: str | None = option(
        None, doc="Or: a file of panes (plots/NAME.toml of the page); what a log lacks is left out."
    )
    span_s: tuple[float, float] | None = option(
        None, unit="s", forms=(SPAN, NOTHING), doc="Start and stop on the log's clock."
    )

    def __post_init__(self) -> None:
        """Refuse what names no field before anything is read."""
        super().__post_init__()
        if bool(self.series) == (self.layout is not None):
            raise OptionError(
                "a plot shows nothing" if not self.series else "a plot has series and a layout",
                needed='series = ["MESSAGE.FIELD"], or layout = "FILE.toml"',
            )
        for each in self.series:
            require_series(each)


@dataclass(frozen=True)
class ViewSettings:
    """All that a study asks of its log besides models.

    Attributes
    ----------
    filters : FilterSettings or None
    plots : tuple of PlotSettings
    plan : PlanOptions or None
        Of the next flight.
    """

    filters: FilterSettings | None = None
    plots: tuple[PlotSettings, ...] = ()
    plan: PlanOptions | None = None


def read_views(root: TableReader, folder: Path) -> ViewSettings:
    """Check the tables ``[filters]``, ``[[plot]]`` and ``[plan]``.

    Parameters
    ----------
    root : TableReader
        The whole study file.
    folder : Path
        Of the study: layouts lie there.

    Raises
    ------
    StudyError
        A key is unknown, a value does not fit, or the study reads no log.
    """
    filters, rows, plan = root.table("filters"), root.tables("plot"), root.table("plan")
    asked = [word for word in ("filters", "plot", "plan") if word in root]
    if asked and not ("log" in root or "flight" in root):
        raise StudyError(
            f"study file: {' and '.join(asked)} are of a log, and there is none",
            needed="[log] or [flight]",
            action="records have columns: derive makes others of them",
        )
    return ViewSettings(
        read_table(FilterSettings, filters) if "filters" in root else None,
        tuple(_plot(each, folder) for each in rows),
        _plan(plan) if "plan" in root else None,
    )


def _plot(reader: TableReader, folder: Path) -> PlotSettings:
    made = read_table(PlotSettings, reader)
    return made if made.layout is None else replace(made, layout=str(folder / made.layout))


def _plan(reader: TableReader) -> PlanOptions:
    for name in TOLD_BY_LOG:
        if name in reader:
            raise reader.error(name, "is the log's to tell", found=name, needed="no such key")
    return read_table(PlanOptions, reader)
