"""The one table type behind every `summary()`: text, HTML and plain values from the same cells."""

from __future__ import annotations

import math
from dataclasses import field
from html import escape

from flightid.frozen import dataclass
from flightid.wrapping import without_controls

Cell = str | float | int | bool | None


LONG_TEXT = 60
"""Letters above which a text that several rows repeat stands below the table."""


@dataclass(frozen=True)
class Column:
    """Heading of a table column.

    Attributes
    ----------
    name : str
        Heading.
    unit : str
        Unit of all its numbers; empty where there is none or rows differ.
    digits : int
        Significant digits of its numbers.
    """

    name: str
    unit: str = ""
    digits: int = 4

    @property
    def heading(self) -> str:
        """Name with unit, for example ``"bandwidth [rad/s]"``."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def show(self, cell: Cell) -> str:
        """Write a cell as text; absence is a dash, never an empty place or NaN."""
        if cell is None or (isinstance(cell, float) and math.isnan(cell)):
            return "–"
        if isinstance(cell, bool):
            return "yes" if cell else "no"
        if isinstance(cell, float):
            return f"{cell:.{self.digits}g}"
        return str(cell)


@dataclass(frozen=True)
class Table:
    """Rows under named columns, with a title and notes.

    Attributes
    ----------
    title : str
        What the table shows.
    columns : tuple of Column
        Headings.
    rows : tuple of tuple
        Cells, one tuple a row, as long as `columns`.
    notes : tuple of str
        Sentences below the table.

    Example
    -------
    >>> table = Table("Modes", (Column("mode"), Column("frequency", "rad/s")), (("roll", 7.5),))
    >>> print(table.to_text())
    Modes
    mode  frequency [rad/s]
    ----  -----------------
    roll                7.5
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(
                    f"table {self.title!r}: a row has {len(row)} cells, {len(self.columns)} needed"
                )

    def shown(self) -> list[list[str]]:
        """Cells as text, headings excluded.

        Returns
        -------
        list of list of str
        """
        return [
            [column.show(cell) for column, cell in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]

    def is_numeric(self, index: int) -> bool:
        """Tell whether a column holds numbers (and is therefore aligned to the right)."""
        cells = [row[index] for row in self.rows if row[index] is not None]
        return bool(cells) and all(
            isinstance(cell, int | float) and not isinstance(cell, bool) for cell in cells
        )

    def _numeric(self) -> list[bool]:
        """Of each column, whether it holds numbers."""
        return [self.is_numeric(index) for index in range(len(self.columns))]

    def without_empty_columns(self) -> Table:
        """Copy without columns in which no row says anything."""
        keep = [
            index
            for index in range(len(self.columns))
            if any(row[index] not in (None, "") for row in self.rows)
        ]
        rows = tuple(tuple(row[index] for index in keep) for row in self.rows)
        return Table(self.title, tuple(self.columns[i] for i in keep), rows, self.notes)

    def said_once(self) -> Table:
        """Copy whose long texts that several rows repeat stand below, under a number.

        Example
        -------
        >>> rows = (("a", "why " * 20), ("b", "why " * 20), ("c", "short"))
        >>> found = Table("t", (Column("name"), Column("note")), rows).said_once()
        >>> [row[1] for row in found.rows], found.notes[0][:12]
        (['see (1)', 'see (1)', 'short'], '(1) why why ')
        """
        cells = [cell for row in self.rows for cell in row if isinstance(cell, str)]
        long = [cell for cell in dict.fromkeys(cells) if len(cell) > LONG_TEXT]
        numbers = {
            cell: place
            for place, cell in enumerate((each for each in long if cells.count(each) > 1), 1)
        }
        rows = tuple(
            tuple(
                f"see ({numbers[cell]})" if isinstance(cell, str) and cell in numbers else cell
                for cell in row
            )
            for row in self.rows
        )
        below = (f"({place}) {cell}" for cell, place in numbers.items())
        return Table(self.title, self.columns, rows, (*below, *self.notes))

    def to_text(self) -> str:
        """Plain text with aligned columns; what a terminal would obey is shown as a mark."""
        headings = [_told(column.heading) for column in self.columns]
        body = [[_told(cell) for cell in row] for row in self.shown()]
        widths = [max(map(len, cells)) for cells in zip(headings, *body, strict=True)]
        numeric = self._numeric()

        def line(cells: list[str]) -> str:
            return "  ".join(
                cell.rjust(width) if is_numeric else cell.ljust(width)
                for is_numeric, cell, width in zip(numeric, cells, widths, strict=True)
            ).rstrip()

        rule = "  ".join("-" * width for width in widths)
        around = [without_controls(text) for text in (self.title, *self.notes)]
        lines = [around[0], line(headings), rule, *map(line, body), *around[1:]]
        return "\n".join(text for text in lines if text)

    def to_dict(self) -> dict[str, object]:
        """Plain values: title, columns with units, rows with unrounded numbers, notes."""
        return {
            "title": self.title,
            "columns": [{"name": c.name, "unit": c.unit} for c in self.columns],
            "rows": [list(row) for row in self.rows],
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        """Same as `to_text`."""
        return self.to_text()

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{escape(column.heading)}</th>" for column in self.columns)
        kinds = ["number" if is_numeric else "text" for is_numeric in self._numeric()]
        body = "".join(
            "<tr>"
            + "".join(
                f'<td class="{kind}">{escape(cell)}</td>'
                for kind, cell in zip(kinds, row, strict=True)
            )
            + "</tr>"
            for row in self.shown()
        )
        notes = "".join(f'<p class="note">{escape(note)}</p>' for note in self.notes)
        return (
            f"<table><caption>{escape(self.title)}</caption>"
            f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{notes}"
        )


def _told(cell: str) -> str:
    """A cell in one line, without what a terminal would obey."""
    return without_controls(cell.replace("\n", " "))
