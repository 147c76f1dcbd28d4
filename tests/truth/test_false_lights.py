"""Flights that hold nothing are never green, good ones seldom red, on a simulator not ours."""

from __future__ import annotations

import pytest

from flightid.conventions import Light
from tests.strangers import rig_lights
from tests.strangers.counting import Case, count, limits, table
from tests.strangers.false_lights import BARREN, SOUND
from tests.strangers.light_counts import at_most, counted, lights

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


def test_one_green_model_of_a_barren_run_is_a_false_green_and_one_red_of_a_sound_a_false_red(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A run may give a linear model beside a NARX one, which had ended the count."""
    both = (rig_lights.Judged(Light.RED), rig_lights.Judged(Light.GREEN))
    monkeypatch.setattr(rig_lights, "found_by_run", lambda _: both)
    for barren, light in ((True, "green"), (False, "red")):
        assert rig_lights.flown(0, columns=rig_lights.SOUND["prbs"], barren=barren).light == light


def test_conditions_take_turns_and_what_a_count_allows_is_exact() -> None:
    tallies = counted("barren", 4, 29 * 3, None)
    assert [lights(each).count("green") for each in tallies] == [0] * 4
    assert at_most(0, 500) == pytest.approx(1.0 - 0.05 ** (1 / 500), rel=1e-9)
    assert at_most(3, 3) == 1.0
