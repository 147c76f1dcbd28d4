"""Margins of an autotune's loop with intervals that a loop can have."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.review.autotune.possible_margins import UNTOLD, possible
from flightid.review.autotune.result import AutotuneReview
from flightid.review.autotune.review import _of_opinion
from flightid.review.autotune.run import AutotuneRun
from flightid.review.autotune.second_opinion import SecondOpinion
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.uneven import Reaching


@pytest.fixture
def loop() -> Any:
    return fid.margins(fid.LinearSystem([[0.0]], [[4.0]], [[1.0]], [[0.0]], ("e",), ("y",), [0.05]))


def test_no_interval_reaches_what_no_loop_has(loop: Any) -> None:
    peak = Estimate("sensitivity peak", 1.27, "1", 0.12)
    crossover = Estimate("crossover", 4.0, "rad/s", 1.5)
    told = possible(replace(loop, sensitivity_peak=peak, crossover=crossover))
    low, high = told.sensitivity_peak.interval95
    assert 1.0 < low < 1.27 < high
    assert (low - 1.0) * (high - 1.0) == pytest.approx(0.27**2)
    low, high = told.crossover.interval95
    assert 0.0 < low < 4.0 < high
    wide = possible(replace(loop, sensitivity_peak=replace(peak, stderr=4.7)))
    assert wide.sensitivity_peak.interval95 is None
    assert wide.sensitivity_peak.reason == UNTOLD
    reached = replace(peak, stderr=None, ends=Reaching(peak.interval, 2.5))
    low, high = possible(replace(loop, sensitivity_peak=reached)).sensitivity_peak.interval95
    assert high == 2.5
    assert low > 1.0


def _review(loop: Any) -> AutotuneReview:
    opinion = SecondOpinion("roll", flown=loop, tuned=loop)
    return AutotuneReview("a.bin", "", AutotuneRun("ardupilot", (), {}, {}, True), {}, (opinion,))


def test_a_margin_that_is_told_to_ten_degrees_alone_is_amber(loop: Any) -> None:
    for stderr, light in ((1.0, Light.GREEN), (5.5, Light.AMBER)):
        phase = replace(loop.phase_margin, value=80.0, stderr=stderr)
        gain = replace(loop.gain_margin, stderr=0.1)
        told = replace(loop, phase_margin=phase, gain_margin=gain)
        (finding,) = _of_opinion(SecondOpinion("roll", flown=told, tuned=told), "a.bin")
        assert finding.light is light


def test_a_table_without_brackets_says_nothing_of_brackets(loop: Any) -> None:
    bare = replace(loop, phase_margin=replace(loop.phase_margin, stderr=None))
    assert not any("In brackets" in note for note in _review(bare).margin_table().notes)
    phase = replace(loop.phase_margin, stderr=1.0)
    table = _review(replace(loop, phase_margin=phase)).margin_table()
    assert any("In brackets" in note for note in table.notes)
