"""What is read off step responses, against a curve that is known; NumPy's and SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from flightid.review.step_features import step_features

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
    ("slow_s", "scatter", "told"),
    [(1.0, 0.001, False), (1.0, 0.3, True), (0.01, 0.001, True)],
    ids=["slow", "slow or not", "settled"],
)
def test_a_step_that_has_not_settled_has_no_level(
    slow_s: float, scatter: float, told: bool
) -> None:
    """A demo's yaw rate rose at the end of its window: it "ended at 0.536 (0.533 to 0.538)"."""
    random = np.random.default_rng(3)
    late = 0.4 * (1.0 - np.exp(-TIME_S / slow_s))
    slopes = np.concatenate([[0.0], scatter * random.standard_normal(120)])[:, None]
    found = step_features(0.6 * _curve() + late + slopes * TIME_S, TIME_S)
    assert all((each.value is not None) is told for each in found[:1])
    if not told:
        assert {each.reason for each in found} == {"not settled in this window of 0.49 s"}
