"""How a structure without equations was chosen, as blocks of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flightid.plot.polynomial import order_scan
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Lights, Paragraph, TableBlock
from flightid.report.figures import figure_block
from flightid.study.structures import ranked
from flightid.table import Table
from flightid.validation import OrderScan
from flightid.validation.order_scan.result import words_of

if TYPE_CHECKING:
    from flightid.study.identified import ModelResults


def choice_blocks(item: ModelResults) -> tuple[Block, ...]:
    """What was tried, kinds and models of several outputs too, and which was taken by what rule.

    Parameters
    ----------
    item : ModelResults
        With a ``choice``, or with words on what was tried beside it.

    Returns
    -------
    tuple of Block
    """
    beside = (Paragraph(item.settings.tried),) if item.settings.tried else ()
    return (*beside, *_scanned(item))


def _scanned(item: ModelResults) -> tuple[Block, ...]:
    """Structures of the kind that was taken."""
    choice, fit, structure = item.choice, item.fit, item.settings.structure
    if not isinstance(choice, OrderScan) or fit is None or structure is None:
        return () if choice is None else result_blocks(choice)
    shown = "Every structure tried: error in free run on the selection records"
    shown += "." if choice.is_of_several_kinds else ", and BIC of the fit."
    taken = next((t for t in choice.trials if _orders(t.structure) == _orders(fit.structure)), None)
    words = f"Chosen by “{structure.rule}”"
    if taken is not None:
        words += f": {words_of(choice, taken)}"
    if structure.rule == "balanced":
        words += (
            ". Free runs do not see the noise model; so of all structures whose free-run error "
            "lies within 5 % of the smallest, those count whose AICc is within 6 of the smallest, "
            "and of them the one with fewest coefficients is taken. Structures with fewer "
            "coefficients of B than of F come last: sampling gives B as many, and a model that "
            "leaves them out has intervals that are too short"
        )
    if taken is not None and taken is not ranked(choice, structure.rule)[0]:
        words += (
            ". Those before it have a pole and a zero that cancel within their errors, leave what "
            "the inputs foretell, or their search ended at no minimum or at one of several "
            "that fit as well"
        )
    lights = (Lights(item.choice_findings),) if item.choice_findings else ()
    table = choice.summary()
    # Verdicts of the scan are about its first structure, which need not be the one taken.
    notes = tuple(note for note in table.notes if note not in set(map(str, choice.findings)))
    shorter = Table("Structures by free run", table.columns, table.rows, notes)
    return (
        Paragraph(f"{words}."),
        *lights,
        figure_block(order_scan(choice, None if taken is None else taken.structure), shown),
        TableBlock(shorter, folded=True),
    )


def _orders(structure: Any) -> tuple[str, str]:  # noqa: ANN401 - each kind's own
    """Kind and orders: the full fit of a structure may have started otherwise."""
    return structure.kind, structure.orders_text
