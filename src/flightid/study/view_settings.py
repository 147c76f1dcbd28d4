"""What a study file may say of its log besides models: filters to try, fields to plot."""

from __future__ import annotations

from collections.abc import Mapping

from flightid.errors import OptionError, StudyError
from flightid.frozen import dataclass
from flightid.logs.field_plot import require_series
from flightid.option_forms import NOTHING, SPAN
from flightid.options import Options, option
from flightid.study.reading import TableReader, read_table


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
        doc="Fields (MESSAGE.FIELD), and formulas of fields behind an equals sign."
    )
    span_s: tuple[float, float] | None = option(
        None, unit="s", forms=(SPAN, NOTHING), doc="Start and stop on the log's clock."
    )

    def __post_init__(self) -> None:
        """Refuse what names no field before anything is read."""
        super().__post_init__()
        if not self.series:
            raise OptionError("a plot shows nothing", needed='series = ["MESSAGE.FIELD"]')
        for each in self.series:
            require_series(each)


@dataclass(frozen=True)
class ViewSettings:
    """All that a study asks of its log besides models.

    Attributes
    ----------
    filters : FilterSettings or None
    plots : tuple of PlotSettings
    """

    filters: FilterSettings | None = None
    plots: tuple[PlotSettings, ...] = ()


def read_views(root: TableReader) -> ViewSettings:
    """Check the tables ``[filters]`` and ``[[plot]]``.

    Parameters
    ----------
    root : TableReader
        The whole study file.

    Raises
    ------
    StudyError
        A key is unknown, a value does not fit, or the study reads no log.
    """
    filters, rows = root.table("filters"), root.tables("plot")
    asked = [word for word in ("filters", "plot") if word in root]
    if asked and not ("log" in root or "flight" in root):
        raise StudyError(
            f"study file: {' and '.join(asked)} are of a log, and there is none",
            needed="[log] or [flight]",
            action="records have columns: derive makes others of them",
        )
    return ViewSettings(
        read_table(FilterSettings, filters) if "filters" in root else None,
        tuple(read_table(PlotSettings, each) for each in rows),
    )
