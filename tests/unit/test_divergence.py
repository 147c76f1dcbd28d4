"""What grows, unasked, until a flight ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.inspection.divergence import divergence
from tests.ordinary_log import write_ordinary_log
from tests.strangers.ordinary_flights import Axis

TIME_S = np.arange(0.0, 30.0, 0.01)


def _noise(size: float) -> np.ndarray:
    return size * np.random.default_rng(3).standard_normal(TIME_S.size)


@pytest.mark.parametrize("tau_s", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("hertz", [0.0, 6.0])
def test_growth_is_found_with_its_time_constant(tau_s: float, hertz: float) -> None:
    grown = np.exp((TIME_S - 30.0) / tau_s) * np.cos(2.0 * np.pi * hertz * (TIME_S - 30.0))
    found = divergence(TIME_S, grown + _noise(0.01), np.zeros_like(TIME_S))
    assert found is not None
    assert found.time_constant_s == pytest.approx(tau_s, rel=0.2)
    assert found.at_limit_s <= found.time_constant_s
    # It grew from its first window to its last, by its time constant.
    risen_s = found.time_constant_s * np.log(found.last / found.first)
    assert found.stop_s - found.start_s == pytest.approx(risen_s, rel=0.25)
    if hertz:
        assert found.frequency_hz == pytest.approx(hertz, rel=0.15)
    else:
        assert found.frequency_hz is None


def test_growth_into_a_limit_is_found() -> None:
    grown = np.minimum(1.0, 0.02 * np.exp((TIME_S - 10.0) / 0.8)) * np.sin(20.0 * TIME_S)
    found = divergence(TIME_S, grown + _noise(0.005), np.zeros_like(TIME_S))
    assert found is not None
    assert found.stop_s == pytest.approx(10.0 + 0.8 * np.log(50.0), abs=0.7)
    assert found.at_limit_s == pytest.approx(30.0 - found.stop_s, abs=0.1)


def test_eight_windows_of_a_tenth_of_a_second_tell_growth() -> None:
    """Of the shortest window two more than have to grow; in less time nothing is told."""
    for span_s, is_found in ((0.82, True), (0.78, False)):
        time_s = np.arange(0.0, span_s, 0.001)
        grown = np.exp((time_s - span_s) / 0.25) * np.sin(200.0 * time_s)
        found = divergence(time_s, grown, np.zeros_like(time_s))
        assert (found is not None) == is_found, span_s


def test_what_ends_again_what_jumps_and_what_was_asked_is_none() -> None:
    still = np.zeros_like(TIME_S)
    swing = np.sin(20.0 * TIME_S)
    passed = np.exp(-np.abs(TIME_S - 15.0) / 0.8) * swing
    jumped = np.where(TIME_S > 29.0, 5.0, 0.0)
    asked = np.exp((TIME_S - 30.0) / 4.0) * swing
    followed = 0.7 * np.roll(asked, 5)
    for values, wanted in ((passed, still), (jumped, still), (followed, asked)):
        assert divergence(TIME_S, values + _noise(0.01), wanted) is None


def test_what_was_asked_counts_in_the_last_third_of_the_growth() -> None:
    grown = np.exp(TIME_S - 30.0) * np.sin(20.0 * TIME_S)
    for first_s, last_s, is_found in ((13.0, 20.0, True), (20.0, 27.0, True), (29.0, 30.0, False)):
        asked = np.where((first_s < TIME_S) & (last_s > TIME_S), 4.0 * np.sin(3.0 * TIME_S), 0.0)
        found = divergence(TIME_S, asked + grown + _noise(0.01), asked)
        assert (found is not None) == is_found, first_s


def test_flight_and_inspect_say_that_a_loop_diverges(tmp_path: Path) -> None:
    path = tmp_path / "grows.bin"
    write_ordinary_log(path, axis=Axis(i=3.0, gust=1.0, noise=0.02), size=0.15, duration_s=5.8)
    review = fid.review_flight(path)
    for findings in (review.findings, fid.inspect_log(path).findings):
        (said,) = (each for each in findings if each.code == "diverges-roll")
        assert said.light is Light.AMBER
        assert "as an oscillation of 2." in said.message
        assert "do not fly these settings again" in said.action
    assert "It diverges in roll: do not fly these settings again." in review.answer
    assert "Next: mend what diverges" in review.answer
    assert "flightid plan" not in review.answer


def test_a_flight_by_sticks_in_gusts_diverges_nowhere(tmp_path: Path) -> None:
    path = tmp_path / "well.bin"
    write_ordinary_log(path, axis=Axis(gust=10.0), size=0.4, duration_s=20.0)
    codes = {each.code for each in fid.inspect_log(path).findings}
    assert not any(code.startswith("diverges") for code in codes)
