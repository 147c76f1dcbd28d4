"""Tables as plain text no wider than a screen: long words of their cells run over several lines."""

from __future__ import annotations

from flightid.table import Table
from flightid.wrapping import without_controls, wrapped

NARROWEST = 14
"""Letters to which a column of words is folded at most."""
GAP = 2


def folded_table(table: Table, width: int) -> list[str]:
    r"""Lines of a table, its notes left out; those of words are folded where it is too wide.

    Parameters
    ----------
    table : Table
    width : int
        Letters in a line. A table whose numbers or single words take more is as wide as they are.

    Example
    -------
    >>> from flightid.table import Column
    >>> made = Table("", (Column("n"), Column("why")), ((1, "one two three four five six"),))
    >>> print("\n".join(folded_table(made, 18)))
    n  why
    -  -------------
    1  one two three
       four five six
    """
    bare = Table(table.title, table.columns, table.rows)
    plain = bare.to_text().split("\n")
    if max(map(len, plain)) <= width or not table.rows:
        return plain
    body = [[without_controls(cell.replace("\n", " ")) for cell in row] for row in table.shown()]
    heads = [column.heading for column in table.columns]
    widths = _widths(table, [heads, *body], width)
    rule = "  ".join("-" * each for each in widths)
    numeric = [table.is_numeric(index) for index in range(len(heads))]
    lines = [*_row(numeric, heads, widths), rule]
    for row in body:
        lines += _row(numeric, row, widths)
    return [without_controls(table.title), *lines] if table.title else lines


def _widths(table: Table, rows: list[list[str]], width: int) -> list[int]:
    """Widest cell of every column; the widest of words gives way until all fit."""
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    words = [index for index in range(len(widths)) if not table.is_numeric(index)]
    while sum(widths) + GAP * (len(widths) - 1) > width:
        widest = max(words, key=lambda index: widths[index], default=None)
        if widest is None or widths[widest] <= NARROWEST:
            break
        widths[widest] -= 1
    # A word that is longer than its column makes room for itself.
    cells = [[wrapped(row[i], widths[i]) for row in rows] for i in range(len(widths))]
    return [
        max(len(line) for lines in column for line in (lines or [""])) if column else widths[i]
        for i, column in enumerate(cells)
    ]


def _row(numeric: list[bool], row: list[str], widths: list[int]) -> list[str]:
    folded = [wrapped(cell, width) or [""] for cell, width in zip(row, widths, strict=True)]
    lines = []
    for place in range(max(map(len, folded))):
        cells = [cell[place] if place < len(cell) else "" for cell in folded]
        lines.append(
            (" " * GAP)
            .join(
                text.rjust(width) if is_numeric else text.ljust(width)
                for is_numeric, text, width in zip(numeric, cells, widths, strict=True)
            )
            .rstrip()
        )
    return lines
