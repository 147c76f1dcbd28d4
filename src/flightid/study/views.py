"""What a study asks of its log besides models: filters tried, fields plotted, the next flight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from flightid.control.autopilots.parameter_files import parameter_suffix
from flightid.files import write_atomically
from flightid.logs import Log
from flightid.logs.field_plot import FieldPlot, field_plot
from flightid.planning import SweepPlan, plan_flight
from flightid.planning.options import PlanOptions
from flightid.report.content import Section
from flightid.report.fields import field_blocks, plan_blocks, tried_blocks
from flightid.report.flight_card import card_html
from flightid.review.tried_filters import TriedFilters, tried_on
from flightid.study.faults import Faults, section_of
from flightid.study.plot_layout import layout_panes
from flightid.study.stage_runner import StageResult, StageRunner
from flightid.study.view_settings import TOLD_BY_LOG, PlotSettings, ViewSettings

PLAN = "plan"
"""Folder of the card and of the settings to fly, below the results."""


def view_log(
    asked: ViewSettings,
    log: StageResult[Log] | None,
    runner: StageRunner,
    faults: Faults,
    folder: Path,
) -> tuple[TriedFilters | None, tuple[FieldPlot, ...], SweepPlan | None]:
    """Carry out ``[filters]``, ``[[plot]]`` and ``[plan]``; what can be flown is written beside.

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
        return None, (), None
    tried = None
    if asked.filters is not None:
        tried = faults.spare("filters tried", _tried, None, runner, log, asked.filters.parameters)
        if tried is not None and tried.is_flyable:
            path = folder / f"filters{parameter_suffix(tried.kind)}"
            faults.spare("the file of the filters", tried.write, None, path)
    none: tuple[tuple[str, ...], ...] = ()
    panes = [
        (series, each.span_s)
        for each in asked.plots
        for series in faults.spare("a layout of plots", _panes, none, each)
    ]
    shown = (faults.spare("a plot of fields", _plotted, None, runner, log, *pane) for pane in panes)
    plots = tuple(each for each in shown if each is not None)
    plan = None
    if asked.plan is not None:
        plan = faults.spare("the plan of the next flight", _planned, None, runner, log, asked.plan)
        if plan is not None and plan.sweeps:
            faults.spare("the files of the plan", _write_plan, None, plan, folder / PLAN)
    return tried, plots, plan


def view_sections(
    tried: TriedFilters | None, plots: Sequence[FieldPlot], plan: SweepPlan | None
) -> Iterator[Section]:
    """Sections of the report on them."""
    if tried is not None:
        yield section_of("Filters tried", tried_blocks, tried)
    if plots:
        yield section_of("Fields", field_blocks, plots)
    if plan is not None:
        yield section_of("The next flight", plan_blocks, plan)


def _tried(runner: StageRunner, *inputs: object) -> TriedFilters:
    return runner.stage("filters tried", tried_on, *inputs).value


def _panes(asked: PlotSettings) -> tuple[tuple[str, ...], ...]:
    return (asked.series,) if asked.layout is None else layout_panes(asked.layout)


def _planned(runner: StageRunner, log: StageResult[Log], asked: PlanOptions) -> SweepPlan:
    return runner.stage("plan of the next flight", _plan, log, asked).value


def _plan(log: Log, asked: PlanOptions) -> SweepPlan:
    options = {key: value for key, value in vars(asked).items() if key not in TOLD_BY_LOG}
    return plan_flight(log, **options)


def _write_plan(plan: SweepPlan, folder: Path) -> None:
    """The card, and settings where it is a go, as ``flightid plan`` writes them."""
    folder.mkdir(exist_ok=True)
    write_atomically(folder / "card.html", card_html(plan))
    if plan.is_go:
        plan.write(folder, overwrite=True)


def _plotted(runner: StageRunner, *inputs: object) -> FieldPlot:
    return runner.stage("fields", field_plot, *inputs).value
