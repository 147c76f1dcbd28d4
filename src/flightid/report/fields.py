"""The sections of a report on what a study asks of its log besides models."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from flightid.logs.field_plot import FieldPlot
from flightid.planning import SweepPlan
from flightid.report.content import Block, Lights, TableBlock
from flightid.report.figures import figure_block
from flightid.review.tried_filters import TriedFilters

NOISE = (
    "Noise of the gyroscope about {axis}: ahead of the filters, behind those that flew (dashed), "
    "and behind those that are tried."
)


def tried_blocks(tried: TriedFilters) -> Iterator[Block]:
    """Verdicts, numbers and a picture of each axis."""
    if tried.findings:
        yield Lights(tried.findings)
    yield TableBlock(tried.summary())
    for each in tried.axes:
        yield figure_block(tried.plot(axis=each.axis), NOISE.format(axis=each.axis))


def plan_blocks(plan: SweepPlan) -> Iterator[Block]:
    """Verdicts of the next flight, what is flown, and what that will show."""
    if plan.findings:
        yield Lights(plan.findings)
    for table in plan._tables():
        yield TableBlock(table)


def field_blocks(plots: Iterable[FieldPlot]) -> Iterator[Block]:
    """A picture and the numbers of each pane."""
    for each in plots:
        if each.findings:
            yield Lights(each.findings)
        if each.series:
            shown = ", ".join(one.name for one in each.series)
            yield figure_block(each.plot(), shown)
            yield TableBlock(each.summary())
