"""What is read off step responses, against a curve that is known; NumPy's and SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from flightid.review.deconvolution import LoopSamples
from flightid.review.step_features import step_features
from flightid.review.told_band import told_by, told_hz

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
    ("slow_s", "late", "scatter", "told", "settles"),
    [
        (1.0, 0.4, 0.001, False, False),
        (1.0, 0.4, 0.3, True, True),
        (0.01, 0.4, 0.001, True, True),
        (1.0, 0.1, 0.001, True, False),
    ],
    ids=["slow", "slow or not", "settled", "creeps"],
)
def test_a_step_that_has_not_settled_has_no_level(
    slow_s: float, late: float, scatter: float, told: bool, settles: bool
) -> None:
    """A demo's yaw rate rose at the end of its window: it "ended at 0.536 (0.533 to 0.538)".

    Its roll rate crept there, as a slow integrator has it: it settled "in 164 (164 to 164) ms".
    """
    random = np.random.default_rng(3)
    late_curve = late * (1.0 - np.exp(-TIME_S / slow_s))
    slopes = np.concatenate([[0.0], scatter * random.standard_normal(120)])[:, None]
    found = step_features(0.6 * _curve() + late_curve + slopes * TIME_S, TIME_S)
    assert all((each.value is not None) is told for each in found[:1])
    settling, overshoot = found[4], found[3]
    assert (settling.value is not None) is settles
    if settles:
        assert (settling.half_width95 or 0.0) > 0.0
    elif told:
        assert (
            settling.reason == "still rises where this window of 0.49 s ends: settling is not seen"
        )
        assert overshoot.value is None
    if not told:
        assert {each.reason for each in found} == {"not settled in this window of 0.49 s"}


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
