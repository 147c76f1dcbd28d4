"""What a report shows of a controller closed around a model: poles, blocks, and its margins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flightid.plot.loops import diagram
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.report.margins import margin_blocks

if TYPE_CHECKING:
    from flightid.control.closed_loop.result import ClosedLoop


def closed_loop_section(
    closed: ClosedLoop, *, band_rad_s: tuple[float, float] | None = None
) -> Section:
    """Section about closed loops: verdicts and poles first, then each loop broken at its actuator.

    Parameters
    ----------
    closed : ClosedLoop
    band_rad_s : tuple of float, optional
        Where margins are looked for, rad/s; as for `ClosedLoop.margins`.
    """
    parts = tuple(
        Section(f"Loop broken at {actuator}, the others closed", margin_blocks(found))
        for actuator, found in closed.margins(band_rad_s=band_rad_s).items()
    )
    return Section(closed.name, closed_loop_blocks(closed), parts)


def closed_loop_blocks(closed: ClosedLoop) -> tuple[Block, ...]:
    """Verdicts, poles with their intervals, and the blocks between the signals.

    Parameters
    ----------
    closed : ClosedLoop

    Returns
    -------
    tuple of Block
    """
    return (
        *result_blocks(closed),
        figure_block(diagram(closed.loops), "The blocks and the signals that join them."),
        TableBlock(closed.loops.summary(), folded=True),
    )
