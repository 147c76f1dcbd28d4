"""What grows, unasked, until a flight ends."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.inspection.divergence import _grown, _of_signal, divergence
from flightid.inspection.signals import Signal
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


WINDOW_S, PER = 0.1, 20


def _windows(envelope: list[float], kept: tuple[int, int] = (0, PER), flip: int = 1) -> Any:
    """Stamps and errors of windows of that size, and of an older one that is cut short.

    Of the window `kept[0]` from the end that many samples are left; the sign turns by `flip`.
    """
    back = [(k + (i + 0.5) / PER) * WINDOW_S for k in range(len(envelope)) for i in range(PER)]
    sizes = np.repeat(envelope[::-1], PER) * (-1.0) ** (np.arange(len(back)) // flip)
    inside = np.arange(len(back)) - PER * kept[0]
    left = (inside < kept[1]) | (inside >= PER)
    old_s = (len(envelope) + 0.4) * WINDOW_S
    time_s = np.concatenate([[old_s], np.array(back)[left][::-1], [0.0]])
    return 30.0 - time_s, np.concatenate([[99.0], sizes[left][::-1], [envelope[-1]]])


def _rising(count: int, factor: float = 1.5, **others: float) -> list[float]:
    """Growing windows, some with factors of their own to the one after."""
    factors = [others.get(f"at_{k}", factor) for k in range(count - 1)]
    return np.cumprod([1.0, *factors]).tolist()


GROWTHS: list[tuple[list[float], int | None, int]] = [
    (_rising(8), 0, 7),
    (_rising(7), None, 0),
    ([*_rising(7), 1.5**6], 0, 6),
    ([*_rising(6), 1.5**5, 1.5**5], None, 0),
    ([*_rising(7), 0.26 * 1.5**6], 0, 6),
    ([*_rising(7), 0.24 * 1.5**6], None, 0),
    ([1e-9, *_rising(8)], 1, 8),
    ([0.0, *_rising(8)], None, 0),
    ([*_rising(6), 1.38 * 1.5**5, 2.0 * 1.5**5], 0, 7),
    ([*_rising(6), 1.42 * 1.5**5, 2.0 * 1.5**5], 0, 6),
    (_rising(10, at_1=1.06), 0, 9),
    (_rising(10, at_1=1.04), 2, 9),
    (_rising(10, 1.8, at_1=7.9), 0, 9),
    (_rising(10, 1.8, at_1=8.1), 2, 9),
    (_rising(10, at_2=1.04), 3, 9),
    (_rising(10, at_3=1.04), None, 0),
    (_rising(8, 1.42), 0, 6),
    (_rising(8, 1.41), None, 0),
    ([0.5 * 1.5**6 / 0.72, *_rising(7), 1.5**6 / 0.72], 1, 7),
    ([0.51 * 1.5**6 / 0.72, *_rising(7), 1.5**6 / 0.72], None, 0),
]
"""Envelopes, and the first and last window of growth; none where nothing is told."""


def test_growth_is_from_its_last_falter_to_the_first_large_window() -> None:
    """The rules on both sides of their limits, and all that is told of what they leave."""
    for envelope, first, top in GROWTHS:
        time_s, error = _windows(envelope)
        found = _grown(time_s, error, WINDOW_S)
        assert (found is None) == (first is None), envelope
        if found is None or first is None:
            continue
        start_s = 30.0 - WINDOW_S * (len(envelope) - first)
        stop_s = 30.0 - WINDOW_S * (len(envelope) - 1 - top)
        heights = np.log(envelope[first : top + 1])
        slope = np.polyfit(WINDOW_S * np.arange(heights.size), heights, 1)[0]
        told = (found.start_s, found.stop_s, found.first, found.last, found.at_limit_s)
        assert told == pytest.approx(
            (start_s, stop_s, envelope[first], envelope[top], 30.0 - stop_s)
        )
        assert found.time_constant_s == pytest.approx(1.0 / slope)
        assert found.frequency_hz == pytest.approx(0.5 * PER / WINDOW_S, rel=0.1)


def test_growth_is_straight_in_the_logarithm_of_eight_windows_of_two_samples() -> None:
    # Of the shortest window two more than have to grow; in less time nothing is told.
    for span_s, is_found in ((0.82, True), (0.78, False)):
        time_s = np.arange(0.0, span_s, 0.001)
        grown = np.exp((time_s - span_s) / 0.25) * np.sin(200.0 * time_s)
        found = divergence(time_s, grown, np.zeros_like(time_s))
        assert (found is not None) == is_found, span_s
    # Of slow samples four stand in each: 33 are eight windows between them.
    for count, is_found in ((33, True), (32, False)):
        time_s = 0.25 * np.arange(count)
        grown = 1.5**time_s * (-1.0) ** np.arange(count)
        assert (divergence(time_s, grown, 0.0 * grown) is not None) == is_found
    told = set()
    for slow in range(1, 9):
        envelope = _rising(12, 6.0, **{f"at_{k}": 1.06 for k in range(slow)})
        share = np.corrcoef(np.arange(12), np.log(envelope))[0, 1] ** 2
        assert (_grown(*_windows(envelope), WINDOW_S) is not None) == (share >= 0.9), slow
        told.add(bool(share >= 0.9))
    assert told == {True, False}
    for place in (1, 4, 7):
        for left, is_found in ((2, True), (1, False)):
            time_s, error = _windows(_rising(8), (place, left))
            assert (_grown(time_s, error, WINDOW_S) is not None) == is_found
    # Turns of the last third are counted, from four on.
    for flip, hertz in ((4, 0.5 * 13 / 0.8 * 3.0), (13, 0.5 * 4 / 0.8 * 3.0), (18, None)):
        found = _grown(*_windows(_rising(8), flip=flip), WINDOW_S)
        assert found is not None
        assert found.frequency_hz == (hertz and pytest.approx(hertz))


def test_what_diverges_is_larger_than_a_loop_that_flies() -> None:
    time_s, error = _windows(_rising(11))
    assert divergence(time_s[:1], error[:1]) is None
    for unit, least in (("rad/s", 0.5), ("rad", 0.35)):
        for size, is_found in ((1.001 * least, True), (0.999 * least, False)):
            signal = Signal("p", time_s, error * size / 1.5**10, unit, "R")
            asked = Signal("p_ref", time_s, 0.0 * time_s, unit, "R")
            found = _of_signal(signal, asked, (28.95, 30.0))
            assert (found is not None) == is_found
            assert _of_signal(signal, None, (28.95, 29.7)) is None
            assert _of_signal(signal, signal, (28.95, 30.0)) is None


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
