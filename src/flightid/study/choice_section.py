"""How a structure without equations was chosen, as blocks of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flightid.models import PolynomialStructure
from flightid.plot.polynomial import order_scan
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Lights, Paragraph, TableBlock
from flightid.report.figures import figure_block
from flightid.table import Table
from flightid.validation import OrderScan

if TYPE_CHECKING:
    from flightid.study.identified import ModelResults


def choice_blocks(item: ModelResults) -> tuple[Block, ...]:
    """What was tried, and which was taken by what rule.

    Parameters
    ----------
    item : ModelResults
        With a ``choice``.

    Returns
    -------
    tuple of Block
    """
    choice, fit, structure = item.choice, item.fit, item.settings.structure
    if not isinstance(choice, OrderScan) or fit is None or structure is None:
        return () if choice is None else result_blocks(choice)
    shown = "Every structure tried: error in free run on the selection records, and BIC of the fit."
    taken = fit.structure if isinstance(fit.structure, PolynomialStructure) else None
    words = f"Chosen by “{structure.choose}”"
    if taken is not None:
        words += f": {taken.orders_text}"
    if structure.choose == "balanced":
        words += (
            ". Free runs do not see the noise model; so of all structures whose free-run error "
            "lies within 10 % of the smallest the one with the smallest BIC is taken"
        )
    lights = (Lights(item.choice_findings),) if item.choice_findings else ()
    table = choice.summary()
    # Verdicts of the scan are about its first structure, which need not be the one taken.
    notes = tuple(note for note in table.notes if note not in set(map(str, choice.findings)))
    shorter = Table("Structures by free run", table.columns, table.rows, notes)
    return (
        Paragraph(f"{words}."),
        *lights,
        figure_block(order_scan(choice, taken), shown),
        TableBlock(shorter, folded=True),
    )
