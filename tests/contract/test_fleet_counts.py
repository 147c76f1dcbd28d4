"""The page of counted fleets holds what its command counts: every section, column and fleet."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from benchmarks.fleet_counts import SECTIONS
from benchmarks.fleet_counts.changes import CHANGED, QUIET, SHARED
from benchmarks.fleet_counts.sections import Section, placed

PAGE = Path(__file__).parents[2] / "docs" / "fleet_counts.md"
ROWS = {
    "alarms": [each.words for each in QUIET],
    "steps": [each.words for each, *_ in CHANGED],
    "shared": [words for words, *_ in SHARED],
}


def _tables() -> dict[str, list[list[str]]]:
    found = re.findall(r"<!-- counted: (\S+) -->\n(.*?)<!-- end -->", PAGE.read_text(), re.DOTALL)
    return {
        name: [
            [cell.strip() for cell in line[2:-2].split(" | ")] for line in table.split("\n") if line
        ]
        for name, table in found
    }


def test_every_section_of_the_page_is_counted_and_named_by_its_command() -> None:
    tables = _tables()
    assert list(tables) == list(SECTIONS)
    for name, section in SECTIONS.items():
        assert tables[name][0] == list(section(100).columns)
        assert len(tables[name]) > 2
        assert f"`python -m benchmarks.fleet_counts {name}`" in PAGE.read_text()
    for name, rows in ROWS.items():
        assert [row[0] for row in tables[name][2:]] == rows


def test_a_section_is_written_where_it_belongs_and_nowhere_else() -> None:
    section = Section(("what", "count"), lambda: iter([("steps", "3 of 4")]))
    told: list[str] = []
    table = section.table(told.append)
    assert told == ["| steps | 3 of 4 |"]
    page = "a\n<!-- counted: x -->\nold\n<!-- end -->\nb\n<!-- counted: y -->\n<!-- end -->\n"
    written = placed(page, "x", table)
    assert "old" not in written
    assert written.startswith(
        "a\n<!-- counted: x -->\n\n| what | count |\n| --- | --- |\n| steps |"
    )
    assert written.endswith("<!-- end -->\nb\n<!-- counted: y -->\n<!-- end -->\n")
    with pytest.raises(ValueError, match="counted: z"):
        placed(page, "z", table)
