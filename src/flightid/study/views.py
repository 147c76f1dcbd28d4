"""What a study asks of its log besides models: filters tried on its noise, fields plotted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from flightid.control.autopilots.parameter_files import parameter_suffix
from flightid.logs import Log
from flightid.logs.field_plot import FieldPlot, field_plot
from flightid.report.content import Section
from flightid.report.fields import field_blocks, tried_blocks
from flightid.review.tried_filters import TriedFilters, tried_on
from flightid.study.faults import Faults, section_of
from flightid.study.stage_runner import StageResult, StageRunner
from flightid.study.view_settings import ViewSettings


def view_log(
    asked: ViewSettings,
    log: StageResult[Log] | None,
    runner: StageRunner,
    faults: Faults,
    folder: Path,
) -> tuple[TriedFilters | None, tuple[FieldPlot, ...]]:
    """Carry out ``[filters]`` and ``[[plot]]``; filters that can be flown are written beside.

    Parameters
    ----------
    asked : ViewSettings
    log : StageResult Log or None
    runner : StageRunner
    faults : Faults
        Takes what cannot be made.
    folder : Path
        Of the results.
    """
    if log is None:
        return None, ()
    tried = None
    if asked.filters is not None:
        tried = faults.spare("filters tried", _tried, None, runner, log, asked.filters.parameters)
        if tried is not None and tried.is_flyable:
            path = folder / f"filters{parameter_suffix(tried.kind)}"
            faults.spare("the file of the filters", tried.write, None, path)
    shown = (
        faults.spare("a plot of fields", _plotted, None, runner, log, each.series, each.span_s)
        for each in asked.plots
    )
    return tried, tuple(each for each in shown if each is not None)


def view_sections(tried: TriedFilters | None, plots: Sequence[FieldPlot]) -> Iterator[Section]:
    """Sections of the report on them."""
    if tried is not None:
        yield section_of("Filters tried", tried_blocks, tried)
    if plots:
        yield section_of("Fields", field_blocks, plots)


def _tried(runner: StageRunner, *inputs: object) -> TriedFilters:
    return runner.stage("filters tried", tried_on, *inputs).value


def _plotted(runner: StageRunner, *inputs: object) -> FieldPlot:
    return runner.stage("fields", field_plot, *inputs).value
