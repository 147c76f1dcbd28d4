"""Flights that hold nothing are never green, good ones seldom red, on a simulator not ours."""

from __future__ import annotations

import pytest

from tests.strangers.counting import Case, count, limits, table
from tests.strangers.false_lights import BARREN, SOUND

MOST_FALSE_REDS = 0.03


@pytest.mark.slow
@pytest.mark.parametrize("case", BARREN, ids=lambda case: case.name)
def test_flights_that_hold_nothing_are_never_green(case: Case) -> None:
    tally = count(case, 25)
    assert tally.share("green") == 0.0, table([tally])


@pytest.mark.slow
@pytest.mark.parametrize("case", SOUND, ids=lambda case: case.name)
def test_good_flights_are_seldom_red(case: Case) -> None:
    tally = count(case, 125)
    _, ceiling = limits(125, nominal=MOST_FALSE_REDS)
    assert tally.share("red") <= ceiling, table([tally])


def test_a_red_count_can_fail() -> None:
    """The barren flights would not pass for good ones."""
    (spiked,) = [case for case in BARREN if case.name == "barren, output_error, spikes"]
    assert count(spiked, 2).share("red") == 1.0
