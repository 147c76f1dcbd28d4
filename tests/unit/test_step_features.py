"""What is read off step responses, against a curve that is known; NumPy's and SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, freqz, lfilter

from flightid.review.deconvolution import LoopDraws
from flightid.review.loop_samples import LoopSamples
from flightid.review.step_features import FALLS, creep, frequency_features, step_features
from flightid.review.told_band import told_by, told_hz
from flightid.uncertainty.estimate import Reading

TIME_S = 0.01 * np.arange(50)
DAMPING, OMEGA = 0.83, 30.0


def _curve() -> np.ndarray:
    fast = OMEGA * np.sqrt(1.0 - DAMPING**2)
    swing = np.cos(fast * TIME_S) + DAMPING * OMEGA / fast * np.sin(fast * TIME_S)
    return 1.0 - np.exp(-DAMPING * OMEGA * TIME_S) * swing


def test_a_small_overshoot_is_not_lifted_by_its_errors() -> None:
    """Read where the estimate peaks it was 0.6 points too high."""
    random = np.random.default_rng(5)
    clean = _curve()
    truth = 100.0 * (clean.max() / clean[40:].mean() - 1.0)
    assert 0.9 < truth < 1.1
    values, held = [], []
    for _ in range(150):
        errors = lfilter([0.004], [1.0, -0.8], random.standard_normal((121, 70)), axis=1)[:, 20:]
        errors[1:] += errors[0]
        found = {each.name: each for each in step_features(clean + errors, TIME_S)}["overshoot"]
        if found.interval95 is not None:
            values.append(found.value)
            held.append(found.interval95[0] <= truth <= found.interval95[1])
    assert len(held) >= 140
    assert abs(np.mean(values) - truth) < 0.35
    assert 0.92 < np.mean(held) < 0.985


@pytest.mark.parametrize(
    ("slow_s", "late", "scatter", "rises", "settles"),
    [
        (1.0, 0.4, 0.001, False, False),
        (1.0, 0.4, 0.3, True, True),
        (0.01, 0.4, 0.001, True, True),
        (1.0, 0.1, 0.001, True, False),
    ],
    ids=["slow", "slow or not", "settled", "creeps"],
)
def test_a_step_that_still_moves_tells_what_it_reaches_and_nothing_that_goes_by_its_window(
    slow_s: float, late: float, scatter: float, rises: bool, settles: bool
) -> None:
    """A demo's yaw rate rose at the end of its window: it "ended at 0.536 (0.533 to 0.538)".

    Its roll rate crept there, as a slow integrator has it: it settled "in 164 (164 to 164) ms", and
    rose in 214, 336 or 552 ms by windows of 0.5, 1 and 2 s.
    """
    random = np.random.default_rng(3)
    late_curve = late * (1.0 - np.exp(-TIME_S / slow_s))
    slopes = np.concatenate([[0.0], scatter * random.standard_normal(120)])[:, None]
    clean = 0.6 * _curve() + late_curve
    found = step_features(clean + slopes * TIME_S, TIME_S)
    level, half, rise, overshoot, settling = found
    assert level.value == pytest.approx(clean[40:].mean(), rel=1e-9)
    assert half.value is not None
    assert (rise.value is not None) is rises
    assert (settling.value is not None) is settles
    said = "still rises where this window of 0.49 s ends: "
    if settles:
        assert (settling.half_width95 or 0.0) > 0.0
    else:
        assert settling.reason == f"{said}settling is not seen"
        assert overshoot.value is None
    if not rises:
        assert rise.reason == f"{said}its last tenths are as long as one looks"


@pytest.mark.parametrize(
    ("level", "peak", "slow_s", "creeps"),
    [(1.0, 1.022, 0.5, ""), (1.0, 1.066, 0.25, ""), (0.8, 0.82, 0.5, ""), (0.7, 0.9, 0.5, FALLS)],
)
def test_settled_loops_have_settled_and_overshoots_are_of_one_line(
    level: float, peak: float, slow_s: float, creeps: str
) -> None:
    """A demo's angle loops, within 2 % of what is asked, "still fell".

    They overshot by 0.4 % of levels that their windows left at 1.018, and by 6.5 % of 1.001: a
    change of 6 points, where the peaks lay 4 apart.
    """
    time_s = 0.01 * np.arange(150)
    rise, decay = 1.0 - np.exp(-((time_s / 0.2) ** 2)), np.exp(-time_s / slow_s)
    clean = rise * (level + (peak - level) / (rise * decay).max() * decay)
    true = 100.0 * (clean.max() - 1.0 if level == 1.0 else clean.max() / clean[120:].mean() - 1.0)
    errors = 1e-4 * np.random.default_rng(2).standard_normal((121, 1)) * rise
    assert creep(clean + errors) == creeps
    found = {each.name: each for each in step_features(clean + errors, time_s)}
    assert found["overshoot"].value == pytest.approx(true, abs=0.05)
    assert (found["settling time"].value is None) is bool(creeps)


def test_bandwidth_is_below_what_is_asked_and_a_loop_that_never_follows_has_none() -> None:
    """Read below the gain at 1 Hz, a loop that lost gain looked quicker: 2.99 and 7.09 Hz.

    Truth by SciPy: a fast lag of some gain, and a slow one that brings the rest.
    """
    step_s = 0.01

    def told(quick: float, slow: float) -> tuple[dict[str, Reading], float]:
        top, bottom = np.zeros(1), np.ones(1)
        for gain, lag_s in ((quick, 0.05), (slow, 0.8)):
            pole = np.exp(-step_s / lag_s)
            one = np.array([0.0, gain * (1.0 - pole)]), np.array([1.0, -pole])
            top = np.polyadd(np.convolve(top, one[1])[::-1], np.convolve(one[0], bottom)[::-1])[
                ::-1
            ]
            bottom = np.convolve(bottom, one[1])
        hertz = np.geomspace(0.2, 30.0, 20_000)
        gain = np.abs(freqz(top, bottom, hertz, fs=1.0 / step_s)[1])
        loop = LoopDraws(np.tile(top, (3, 1)), np.tile(bottom, (3, 1)), step_s)
        read = {each.name: each for each in frequency_features(loop, 2.0)}
        assert read["gain at 1 Hz"].value == pytest.approx(np.interp(1.0, hertz, gain), rel=1e-6)
        return read, float(hertz[np.argmax(gain < np.sqrt(0.5))])

    (much, truth), (less, low) = told(0.8, 0.2), told(0.5, 0.5)
    assert much["bandwidth at -3 dB"].value == pytest.approx(truth, rel=2e-3)
    assert less["bandwidth at -3 dB"].value == pytest.approx(low, rel=2e-3)
    assert truth > 4.0 * low
    (never, _) = told(0.5, 0.1)
    lost = never["bandwidth at -3 dB"]
    assert lost.value is None
    assert lost.reason == "it follows with less than 0.71 of what is asked at 0.2 Hz already"


def test_what_is_quicker_than_the_set_point_ever_was_is_not_told() -> None:
    """Slow sticks on quick loops: 23 of 27 rise times missed the truth, all too long."""
    random = np.random.default_rng(2)
    step_s, seconds = 0.01, 120
    sticks = random.standard_normal(round(seconds / step_s))
    top, bottom = butter(4, 4.0, fs=1.0 / step_s)
    set_point = lfilter(top, bottom, sticks)
    followed = lfilter([0.0, 0.4], [1.0, -0.6], set_point)
    followed += 0.05 * random.standard_normal(followed.size)
    samples = LoopSamples(set_point, followed, None, (7000, 5000), step_s)
    seen = told_hz(samples)
    # Coherence of white noise through filter and loop with white noise added.
    hertz = np.arange(5.0, 20.0)
    behind = 0.4 / np.abs(1.0 - 0.6 * np.exp(-2j * np.pi * hertz * step_s))
    power = np.square(behind) / (1.0 + (np.tan(np.pi * hertz * step_s) / np.tan(0.04 * np.pi)) ** 8)
    coherence = power / (power + 0.05**2)
    assert seen == pytest.approx(hertz[coherence >= 0.2][-1], abs=1.0)
    assert told_hz(LoopSamples(set_point, followed, None, (50, 50), step_s)) == 0.0
    readings = step_features(np.tile(_curve(), (401, 1)), TIME_S)
    rise = readings[2].value
    assert rise is not None
    kept = told_by(readings, 0.41 / rise)
    assert kept == readings
    left = {each.name: each for each in told_by(readings, 0.39 / rise)}
    assert left["rise time"].value is None
    assert left["rise time"].reason.endswith("quicker sticks")
    assert left["delay to half"].value == readings[1].value


def test_an_overshoot_of_a_level_that_may_be_either_spans_both() -> None:
    """A step to .92 (.86 to .98) was read by what is asked alone, which one to .89 is not."""
    time_s, random = np.arange(0.0, 1.0, 0.005), np.random.default_rng(3)
    levels = np.concatenate([[0.92], 0.92 + 0.03 * random.standard_normal(400)])
    course = np.where(time_s < 0.2, 1.15, 1.0) * np.clip(time_s / 0.1, 0.0, 1.0)
    found = step_features(levels[:, None] * course, time_s)
    (over,) = (each for each in found if each.name == "overshoot")
    low, high = over.interval95 or (0.0, 0.0)
    assert low < 100.0 * (0.92 * 1.15 - 1.0) < 14.9 < high


def test_an_overshoot_whose_draws_go_mostly_by_their_own_level_reaches_the_estimate() -> None:
    """One to 1.09, of what is asked, beside draws that end higher and pass that by 1 %: untold."""
    time_s, random = np.arange(0.0, 1.0, 0.005), np.random.default_rng(3)
    levels = np.concatenate([[1.09], 1.13 + 0.02 * random.standard_normal(400)])
    course = np.where(time_s < 0.2, 1.01, 1.0) * np.clip(time_s / 0.1, 0.0, 1.0)
    found = step_features(levels[:, None] * course, time_s)
    (over,) = (each for each in found if each.name == "overshoot")
    assert over.value is not None, over.reason
    low, high = over.interval95 or (0.0, 0.0)
    assert low <= 1.0 < 5.0 < over.value <= high
