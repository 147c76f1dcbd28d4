"""The content tree as plain text, for terminals and mail."""

from __future__ import annotations

from typing import assert_never

from flightid.report.content import (
    Block,
    Document,
    Figure,
    KeyValues,
    Lights,
    Paragraph,
    Section,
    TableBlock,
)
from flightid.report.text_tables import folded_table
from flightid.table import Column
from flightid.wrapping import without_controls, wrapped

WIDTH = 100
_VALUE = Column("value", digits=6)


def to_text(document: Document) -> str:
    """Draw a document as plain text.

    Parameters
    ----------
    document : Document
        What to say.

    Returns
    -------
    str
        Lines of at most 100 characters, tables of many numbers excepted; control characters that a
        log may hold are shown as ``\N{REPLACEMENT CHARACTER}`` so that no terminal obeys them.
    """
    parts = [document.title, "=" * len(document.title)]
    parts += [line for line in (document.subtitle, verdict_line(document)) if line]
    for section in document.sections:
        parts += ["", *_section(section, level=1)]
    if document.footer:
        parts += ["", document.footer]
    return without_controls("\n".join(parts)) + "\n"


def verdict_line(document: Document) -> str:
    """The worst light of a document and what it is made of; empty where nothing was judged."""
    if not document.tally:
        return ""
    return f"Verdict: {document.verdict} ({document.tally})"


def _section(section: Section, level: int) -> list[str]:
    mark = "-" if level == 1 else "."
    lines = [section.title, mark * len(section.title)]
    for block in section.blocks:
        lines += [*_block(block), ""]
    for inner in section.sections:
        lines += _section(inner, level + 1)
    return lines


def _block(block: Block) -> list[str]:
    match block:
        case Paragraph(text):
            return wrapped(text, WIDTH) or [""]
        case Lights():
            return _lights(block)
        case TableBlock(table):
            return [
                *folded_table(table, WIDTH),
                *(line for note in table.notes for line in wrapped(note, WIDTH)),
            ]
        case KeyValues():
            return _key_values(block)
        case Figure(caption=caption):
            shown = f" ({', '.join(block.series)})" if block.series else ""
            return wrapped(f"[Figure: {caption}{shown}]", WIDTH)
        case _:
            assert_never(block)


def _lights(block: Lights) -> list[str]:
    lines = [block.title] if block.title else []
    for finding in block.findings:
        head = f"{f'[{finding.light.words}]':<10} "
        body = finding.message + (f" — {finding.action}" if finding.action else "")
        lines += wrapped(body, WIDTH, first=head, later=" " * len(head))
    return lines or ["Nothing was judged."]


def _key_values(block: KeyValues) -> list[str]:
    width = max((len(key) for key, _ in block.items), default=0)
    lines = [f"{key:<{width}}  {_VALUE.show(value)}" for key, value in block.items]
    return [block.title, *lines] if block.title else lines
