"""What a report shows of a reduction: its verdicts, its path as a table, and as a picture."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from flightid.plot.reduction import reduction_path
from flightid.report.content import Block, Lights, TableBlock
from flightid.report.figures import figure_block

if TYPE_CHECKING:
    from flightid.identification import Reduction


def reduction_blocks(reduction: Reduction) -> tuple[Block, ...]:
    """Blocks of a section about a reduction; the verdicts on its fit stand with the fit.

    Parameters
    ----------
    reduction : Reduction

    Returns
    -------
    tuple of Block
    """
    table = reduction.summary().without_empty_columns()
    said = {str(finding) for finding in reduction.findings}
    shown = replace(table, notes=tuple(note for note in table.notes if note not in said))
    caption = (
        "Average cost, and the worst insensitivity and Cramér–Rao bound, after each step; dotted: "
        "guides."
    )
    return (
        Lights(reduction.path_findings),
        TableBlock(shown),
        figure_block(reduction_path(reduction), caption),
    )
