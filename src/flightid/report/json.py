"""The content tree as plain values for JSON, and back; nothing is left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, assert_never

from flightid.conventions import Light
from flightid.errors import FileFormatError
from flightid.findings import Finding
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
from flightid.table import Column, Table

SCHEMA = "flightid.document/1"
Part = TypeVar("Part")


def to_dict(document: Document) -> dict[str, Any]:
    """Write a document as plain values.

    Parameters
    ----------
    document : Document
        What to say.

    Returns
    -------
    dict
        Keys ``schema``, ``title``, ``subtitle``, ``verdict``, ``tally``, ``sections``, ``footer``.
    """
    return {
        "schema": SCHEMA,
        "title": document.title,
        "subtitle": document.subtitle,
        "verdict": str(document.verdict),
        "tally": document.tally,
        "sections": [_section(section) for section in document.sections],
        "footer": document.footer,
    }


def _section(section: Section) -> dict[str, Any]:
    return {
        "title": section.title,
        "blocks": [_block(block) for block in section.blocks],
        "sections": [_section(inner) for inner in section.sections],
    }


def _block(block: Block) -> dict[str, Any]:
    match block:
        case Paragraph(text):
            return {"kind": "paragraph", "text": text}
        case Lights(findings, title, repeats):
            return {
                "kind": "lights",
                "title": title,
                "repeats": repeats,
                "findings": [finding.to_dict() for finding in findings],
            }
        case TableBlock(table, folded):
            digits = [column.digits for column in table.columns]
            return {"kind": "table", **table.to_dict(), "digits": digits, "folded": folded}
        case KeyValues(items, title):
            pairs = [[key, value] for key, value in items]
            return {"kind": "key_values", "title": title, "items": pairs}
        case Figure(spec, caption, folded):
            return {"kind": "figure", "caption": caption, "folded": folded, "spec": dict(spec)}
        case _:
            assert_never(block)


def from_dict(values: Mapping[str, Any]) -> Document:
    """Read a document from plain values, which may come from a stranger.

    Parameters
    ----------
    values : mapping
        What `to_dict` wrote.

    Raises
    ------
    FileFormatError
        The values are not a document of this schema.
    """
    if values.get("schema") != SCHEMA:
        raise FileFormatError("not a report", found=values.get("schema"), needed=SCHEMA)
    try:
        return Document(
            str(values["title"]),
            str(values["subtitle"]),
            _each(values["sections"], _read_section),
            str(values["footer"]),
        )
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise FileFormatError(
            "a report whose parts do not fit together",
            found=f"{type(error).__name__}: {error}",
            action="write it again with flightid run",
        ) from error


def _each(values: Sequence[Any], read: Callable[[Any], Part]) -> tuple[Part, ...]:
    return tuple(read(value) for value in values)


def _read_section(values: Mapping[str, Any]) -> Section:
    return Section(
        str(values["title"]),
        _each(values["blocks"], _read_block),
        _each(values["sections"], _read_section),
    )


def _read_block(values: Mapping[str, Any]) -> Block:
    match values["kind"]:
        case "paragraph":
            return Paragraph(str(values["text"]))
        case "lights":
            findings = _each(values["findings"], _read_finding)
            return Lights(findings, str(values["title"]), bool(values["repeats"]))
        case "table":
            return TableBlock(_read_table(values), bool(values["folded"]))
        case "key_values":
            items = tuple((str(key), _read_cell(value)) for key, value in values["items"])
            return KeyValues(items, str(values["title"]))
        case "figure":
            return Figure(
                dict(values["spec"]), str(values["caption"]), bool(values.get("folded", False))
            )
        case other:
            raise ValueError(f"there is no block of kind {other!r}")


def _read_finding(values: Mapping[str, Any]) -> Finding:
    return Finding(
        str(values["code"]), Light(values["light"]), str(values["message"]), str(values["action"])
    )


def _read_table(values: Mapping[str, Any]) -> Table:
    columns = tuple(
        Column(str(column["name"]), str(column["unit"]), int(digits))
        for column, digits in zip(values["columns"], values["digits"], strict=True)
    )
    rows = tuple(tuple(_read_cell(cell) for cell in row) for row in values["rows"])
    return Table(str(values["title"]), columns, rows, tuple(str(note) for note in values["notes"]))


def _read_cell(value: object) -> str | float | int | bool | None:
    if value is None or isinstance(value, str | float | int | bool):
        return value
    raise TypeError(f"a cell holds {type(value).__name__}")
