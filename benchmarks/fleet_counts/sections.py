"""Sections of the page of counts: a table each, written between two marks of the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

Words = tuple[str, ...]


@dataclass(frozen=True)
class Section:
    """A table: its columns, and what counts its rows one by one.

    Attributes
    ----------
    columns : tuple of str
    rows : callable
        Yields a row as soon as it is counted.
    """

    columns: Words
    rows: Callable[[], Iterator[Words]]

    def table(self, tell: Callable[[str], None]) -> str:
        """The table in Markdown; each row is told once it is there."""
        lines = [_line(self.columns), _line(("---",) * len(self.columns))]
        for row in self.rows():
            lines.append(_line(row))
            tell(lines[-1])
        return "\n".join(lines)


def percent(part: int, whole: int) -> str:
    """A share in percent; a dash of none."""
    return f"{100.0 * part / whole:.1f} %" if whole else "–"


def placed(page: str, name: str, table: str) -> str:
    """The page with a table between the marks of its section.

    Raises
    ------
    ValueError
        The page has no such section.
    """
    begin, end = f"<!-- counted: {name} -->\n", "<!-- end -->"
    if begin not in page:
        raise ValueError(
            f"the page has no line {begin.strip()!r}; write it where the table belongs"
        )
    before, rest = page.split(begin)
    return f"{before}{begin}\n{table}\n\n{end}{rest.split(end, 1)[1]}"


def _line(cells: Words) -> str:
    return f"| {' | '.join(cells)} |"
