"""What a report shows of modes: verdicts, their table, the map, and who takes part."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flightid.dynamics.modes.result import LEAST_SHOWN
from flightid.plot.modes import pole_map
from flightid.plot.participations import participation_bars
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, TableBlock
from flightid.report.figures import figure_block
from flightid.uncertainty.quantiles import interval_words, shown

if TYPE_CHECKING:
    from flightid.dynamics import ApproximateModes, DerivativeTable, Modes


def modes_blocks(found: Modes) -> tuple[Block, ...]:
    """Blocks of a section about modes.

    Parameters
    ----------
    found : Modes
        Result of `flightid.modes`.

    Returns
    -------
    tuple of Block
    """
    blocks: list[Block] = list(result_blocks(found))
    if any(mode.eigenvalue is not None for mode in found):
        caption = (
            f"Eigenvalues with their {interval_words(shown())} regions; rays of equal damping "
            "ratio ζ, circles of equal natural frequency."
        )
        blocks.append(figure_block(pole_map(found), caption))
    parts = found.participation_table()
    if parts.rows:
        shown_from = f"{100 * LEAST_SHOWN:.0f} %"
        caption = (
            f"Participation of the states in each mode; shares below {shown_from} are left out."
        )
        blocks.append(figure_block(participation_bars(found), caption))
        blocks.append(TableBlock(parts, folded=True))
    return tuple(blocks)


def physics_blocks(
    found: ApproximateModes | None, derivatives: DerivativeTable | None
) -> tuple[Block, ...]:
    """Approximate modes and derivatives, folded away; nothing where a model has neither.

    Parameters
    ----------
    found : ApproximateModes or None
    derivatives : DerivativeTable or None

    Returns
    -------
    tuple of Block
    """
    blocks: list[Block] = []
    for result in (found, derivatives):
        if result is not None:
            blocks += result_blocks(result, folded=True)
    return tuple(blocks)
