"""The page of counts says what the kept flights hold, and marks what chance does not explain."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from tests.strangers.cases import CASES, LIGHTS, families
from tests.strangers.counting import Case, Reading, Tally, Trial
from tests.strangers.coverage_page import Counted, page
from tests.strangers.kept import KeptFlights, read


def _trial(*misses: bool, light: str = "green") -> Trial:
    ends = {False: (0.0, 2.0), True: (1.5, 2.0)}
    readings = [Reading(f"p{k}", 1.0, 1.0, 0.5, ends[missed]) for k, missed in enumerate(misses)]
    return Trial(tuple(readings), light)


def test_every_condition_has_its_family() -> None:
    listed = [case.name for _, cases in families() for case in cases]
    assert sorted(listed) == sorted(case.name for case in (*CASES, *LIGHTS))


@pytest.mark.parametrize(
    ("missed", "off"),
    [(20, False), (28, False), (45, True), (0, True)],
)
def test_a_share_outside_the_range_by_more_than_chance_is_marked(missed: int, *, off: bool) -> None:
    trials = tuple(_trial(k < missed, light="amber") for k in range(400))
    row = Counted(Tally("case", trials))
    assert row.is_off is off
    assert ("**!**" in row.cells()[4]) is off


def test_errors_are_those_of_flights_not_of_intervals() -> None:
    """Ten intervals of a flight that miss together are one miss."""
    alone = tuple(_trial(*(k == j for j in range(10))) for k in range(20))
    together = tuple(_trial(*(k < 2 for _ in range(10))) for k in range(20))
    assert Counted(Tally("a", alone)).held[0] > Counted(Tally("b", together)).held[0]
    assert Counted(Tally("b", together)).error > 3.0 * Counted(Tally("a", alone)).error


def test_the_page_tells_lights_what_was_shown_and_what_was_before() -> None:
    name = CASES[0].name
    bare = Trial((Reading("p", 1.0, 1.0),), "red")
    now = {name: {0: _trial(False, False), 1: _trial(False, True), 2: bare}}
    made = page(now, {name: {0: _trial(True, True, light="amber")}})
    (row,) = (line for line in made.splitlines() if line.startswith(f"| {name} "))
    cells = [cell.strip() for cell in row.strip("|").split("|")]
    assert cells[1:5] == ["3", "4", "80", "75.0"]
    assert cells[6:8] == ["67, 0, 33", "33.3"]
    assert cells[-1] == "0.0"
    assert "3 flights of 1 conditions" in made


def test_kept_flights_add_up_the_cheapest_case_first(tmp_path: Path) -> None:
    flown: list[tuple[str, int]] = []

    def fly(seed: int, name: str, seconds: float) -> Trial:
        flown.append((name, seed))
        return replace(_trial(False), seconds=seconds)

    cases = [Case(n, partial(fly, name=n, seconds=s)) for n, s in (("dear", 2.0), ("cheap", 0.1))]
    path = tmp_path / "flights.jsonl"
    KeptFlights(path).fly(cases[0], [5])
    path.write_text(path.read_text() + '{"case": "cheap", "se')
    tallies = list(KeptFlights(path).flown(cases, 5, (1, 2)))
    assert flown == [("dear", 5), ("cheap", 5), ("cheap", 6), ("dear", 6)]
    assert [(each.name, len(each.trials)) for each in tallies] == [("cheap", 2), ("dear", 2)]
    assert {name: sorted(seeds) for name, seeds in read(path).items()} == {
        "dear": [5, 6],
        "cheap": [5, 6],
    }
