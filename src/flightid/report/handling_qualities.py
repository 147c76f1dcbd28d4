"""What a report shows of handling qualities: verdicts, the table, charts and curves."""

from __future__ import annotations

from flightid.dynamics.handling_qualities.handling_qualities import HandlingQualities
from flightid.dynamics.handling_qualities.pilot_cutoff import PilotCutoff
from flightid.dynamics.handling_qualities.rating import Rating
from flightid.dynamics.lower_order.result import LowerOrder
from flightid.plot.handling_qualities import (
    bandwidth_curves,
    cutoff_spectrum,
    level_chart,
    lower_order_curves,
)
from flightid.plot.verification import mismatch_envelopes
from flightid.report.blocks import result_blocks
from flightid.report.content import Block
from flightid.report.figures import figure_block


def handling_qualities_blocks(found: HandlingQualities) -> tuple[Block, ...]:
    """Verdicts and table, a chart for each requirement with two numbers, and a curve by axis.

    Parameters
    ----------
    found : HandlingQualities

    Returns
    -------
    tuple of Block
    """
    return (*result_blocks(found), *_charts(found.ratings), *_curves(found))


def lower_order_blocks(found: LowerOrder, ratings: tuple[Rating, ...] = ()) -> tuple[Block, ...]:
    """Numbers of an equivalent system, its curves and envelopes, and the charts of its levels.

    Parameters
    ----------
    found : LowerOrder
    ratings : tuple of Rating
        As from `LowerOrder.ratings`.

    Returns
    -------
    tuple of Block
    """
    shown = f"{found.name} and its equivalent system."
    envelopes = "Equivalent system over response inside the envelopes of unnoticed added dynamics."
    return (
        *result_blocks(found),
        figure_block(lower_order_curves(found), shown),
        figure_block(mismatch_envelopes(found.mismatch), envelopes),
        *_charts(ratings),
    )


def pilot_cutoff_blocks(found: PilotCutoff) -> tuple[Block, ...]:
    """Numbers of a pilot's use of a control, and the share of its power below each frequency.

    Parameters
    ----------
    found : PilotCutoff

    Returns
    -------
    tuple of Block
    """
    shown = f"{found.channel}: share of the power below each frequency; half of it at the cut-off."
    return (*result_blocks(found), figure_block(cutoff_spectrum(found), shown))


def _charts(ratings: tuple[Rating, ...]) -> list[Block]:
    made: list[Block] = []
    for rating in ratings:
        chart = rating.chart
        if len(chart.axes) != 2:
            continue
        case = f" ({chart.case})" if chart.case else ""
        shown = f"{chart.standard}: {chart.title}{case}; estimate with its 95 % region. "
        made.append(figure_block(level_chart(rating), (shown + chart.doubt).strip()))
    return made


def _curves(found: HandlingQualities) -> list[Block]:
    return [
        figure_block(
            bandwidth_curves(each),
            f"{axis}: where bandwidth and phase delay are read; the band is the 95 % interval of "
            "the bandwidth.",
        )
        for axis, each in found.bandwidths.items()
    ]
