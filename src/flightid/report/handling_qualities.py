"""What a report shows of handling qualities: verdicts, the table, charts and curves."""

from __future__ import annotations

from dataclasses import replace

from flightid.dynamics.handling_qualities.handling_qualities import HandlingQualities
from flightid.dynamics.handling_qualities.rating import Rating
from flightid.plot.handling_qualities import (
    bandwidth_curves,
    level_chart,
)
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, TableBlock
from flightid.report.figures import figure_block
from flightid.uncertainty.quantiles import interval_words, shown


def handling_qualities_blocks(
    found: HandlingQualities, *, folded: bool = False
) -> tuple[Block, ...]:
    """Verdicts and table, a chart for each requirement with two numbers, and a curve by axis.

    Parameters
    ----------
    found : HandlingQualities
    folded : bool
        Open the table and the charts on demand.

    Returns
    -------
    tuple of Block
    """
    judged = (
        replace(each, folded=True) if folded and isinstance(each, TableBlock) else each
        for each in result_blocks(found)
    )
    return (*judged, *_charts(found.ratings, folded), *_curves(found))


def _charts(ratings: tuple[Rating, ...], folded: bool) -> list[Block]:
    made: list[Block] = []
    for rating in ratings:
        chart = rating.chart
        if len(chart.axes) != 2:
            continue
        case = f" ({chart.case})" if chart.case else ""
        words = interval_words(shown())
        said = f"{chart.standard}: {chart.title}{case}; estimate with its {words} region. "
        made.append(figure_block(level_chart(rating), (said + chart.doubt).strip(), folded=folded))
    return made


def _curves(found: HandlingQualities) -> list[Block]:
    return [
        figure_block(
            bandwidth_curves(each),
            f"{axis}: where bandwidth and phase delay are read; the band is the "
            f"{interval_words(shown())} interval of the bandwidth.",
            folded=True,
        )
        for axis, each in found.bandwidths.items()
    ]
