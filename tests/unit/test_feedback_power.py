"""A test for a loop that saw none tells what it would have seen."""

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.conventions import Light
from flightid.evidence.data_checks import loop_check
from tests.feedback_flights import DT, flight


def held(seed: int, gain: float) -> fid.Record:
    """A vehicle in slow gusts behind noisy sensors, whose controller reads cleaner ones."""
    rng, n = np.random.default_rng(seed), 4000
    push = signal.lfilter([0.02], np.poly([0.995, 0.97]), rng.standard_normal(n))
    own = signal.lfilter([0.3], [1.0, -0.7], rng.standard_normal(n))
    y, u, law = np.zeros(n), np.zeros(n), 0.0
    for k in range(1, n):
        y[k] = 0.98 * y[k - 1] + 0.02 * u[k - 1] + 0.02 * push[k - 1]
        law += 0.2 * (-gain * y[k] - law)
        u[k] = own[k] + law
    seen = y + 0.05 * rng.standard_normal(n)
    return fid.Record.from_arrays(np.arange(n) * DT, inputs={"u": u}, outputs={"y": seen})


@pytest.mark.parametrize("seed", range(3))
def test_a_loop_that_no_test_sees_is_not_green(seed: int) -> None:
    found = fid.feedback_test(held(seed, 0.3))
    assert found.source == "blind"
    assert found.loop == "unknown"
    check = loop_check(found)
    assert check.light is Light.UNKNOWN
    assert "standard errors" in check.what
    assert "loop='open'" in check.action


@pytest.mark.parametrize("kind", ["white", "prbs", "held"])
def test_open_loops_whose_noise_dies_out_stay_open(kind: str) -> None:
    for seed in range(4):
        u, y = flight(kind, n=2000, seed=seed, pole=0.5)
        record = fid.Record.from_arrays(np.arange(u.size) * DT, inputs={"u": u}, outputs={"y": y})
        found = fid.feedback_test(record)
        assert found.loop == "open"
        assert found.unseen_bias is not None
        assert found.unseen_bias < 1.0
        assert "would be, and a smaller one bends estimates by" in str(found)
