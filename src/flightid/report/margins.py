"""What a report shows of margins, disk margins and disturbance rejection."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flightid.plot.margins import (
    disk_figure,
    disturbance_figure,
    loop_bode,
    loop_nichols,
    loop_nyquist,
)
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, TableBlock
from flightid.report.figures import figure_block
from flightid.uncertainty.quantiles import interval_words, shown

if TYPE_CHECKING:
    from flightid.control.margins.disk_margin import DiskMargin
    from flightid.control.margins.disturbance_rejection import DisturbanceRejection
    from flightid.control.margins.margins import Margins


def margin_blocks(margins: Margins, disk: DiskMargin | None = None) -> tuple[Block, ...]:
    """Blocks of a section about the margins of a loop.

    Parameters
    ----------
    margins : Margins
    disk : DiskMargin, optional
        Of the same loop.

    Returns
    -------
    tuple of Block
    """
    words = interval_words(shown())
    forbidden = "the disk margin's" if disk is not None else "the modulus margin's"
    blocks = (
        *result_blocks(margins),
        TableBlock(margins.crossing_table(), folded=True),
        figure_block(
            loop_bode(margins),
            f"The broken loop with its {words} band; bars: margins where they are taken.",
        ),
        figure_block(
            loop_nyquist(margins, disk),
            f"The broken loop in the complex plane; shaded: {forbidden} disk around −1.",
        ),
        figure_block(
            loop_nichols(margins),
            f"Gain over phase; shaded: what the guides keep free; bars: {words} intervals.",
        ),
    )
    return blocks if disk is None else (*blocks, *disk_blocks(disk))


def disk_blocks(disk: DiskMargin) -> tuple[Block, ...]:
    """Blocks of a section about a disk margin.

    Parameters
    ----------
    disk : DiskMargin

    Returns
    -------
    tuple of Block
    """
    caption = "Least disk of gains and phases, moved at once in every loop, that may be unstable."
    return (*result_blocks(disk), figure_block(disk_figure(disk), caption))


def disturbance_blocks(found: DisturbanceRejection) -> tuple[Block, ...]:
    """Blocks of a section about disturbance rejection.

    Parameters
    ----------
    found : DisturbanceRejection

    Returns
    -------
    tuple of Block
    """
    caption = (
        f"What is left of a disturbance, with its {interval_words(shown())} band; "
        "dotted: −3 dB and 0 dB."
    )
    return (*result_blocks(found), figure_block(disturbance_figure(found), caption))
