"""Predictors of a loop: what integrators sum, joint draws, and the first hundredth of a step."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from flightid.review.deconvolution import closed_loop
from flightid.review.loop_predictors import _Regression, _seen_from, predictors
from flightid.review.loop_response import LoopResponse
from flightid.review.loop_samples import LoopSamples
from flightid.review.loops import refused
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.uneven import DrawnEnds
from tests.strangers.ordinary_steps import BETAFLIGHT, fly_samples, truths


def test_sums_of_errors_are_those_of_the_channels_as_they_were() -> None:
    random = np.random.default_rng(0)
    pieces = [(random.standard_normal(n) + 2.0, random.standard_normal(n), None) for n in (40, 25)]
    sums = LoopSamples.of(pieces, 0.01, 1).sums_of_errors()
    expected = np.concatenate([np.cumsum(wanted - measured) for wanted, measured, _ in pieces])
    assert sums == pytest.approx(expected)


@pytest.fixture
def both() -> tuple[LoopSamples, _Regression, _Regression]:
    """A flight's two channels on the past of both, in either order."""
    random = np.random.default_rng(1)
    shared, one, other = 0.1 * random.standard_normal((3, 1200))
    wanted = np.repeat(random.standard_normal(60), 20)
    w, y = np.zeros(1200), np.zeros(1200)
    for k in range(1, 1200):
        w[k] = 0.8 * w[k - 1] + 0.1 * wanted[k - 1] + 0.6 * shared[k] + 0.8 * one[k]
        y[k] = 0.7 * y[k - 1] + 0.3 * w[k - 1] + 0.6 * shared[k] + 0.8 * other[k]
    samples = LoopSamples(wanted - wanted.mean(), y, w, (700, 500), 0.01)
    sums = samples.sums_of_errors()
    first = _Regression.of(y, w, sums, samples, (3, 2, 4))
    return samples, first, _Regression.of(w, y, sums, samples, (2, 3, 4))


def test_both_triangles_tell_the_same_of_one_channel(
    both: tuple[LoopSamples, _Regression, _Regression],
) -> None:
    _, first, second = both
    seen = _seen_from(first, second, first.wanted[None])[0]
    found = scipy.linalg.solve_triangular(second.factor, seen)
    y, w, rest = np.split(first.theta, [3, 5])
    assert found == pytest.approx(np.concatenate([-w, -y, rest]), abs=1e-9)


def test_errors_of_channels_that_one_gust_moves_go_together(
    both: tuple[LoopSamples, _Regression, _Regression],
) -> None:
    samples, first, second = both
    errors = [each.errors(samples.lengths) for each in (first, second)]
    assert np.sum(errors[0] ** 2) == pytest.approx(first.variance * (1200 - 2 * 4 - 2 - 11))
    assert np.corrcoef(errors[0], errors[1])[0, 1] == pytest.approx(0.36, abs=0.08)
    ahead, beside = predictors(samples, (3, 2, 4), 2000, np.random.default_rng(2))
    # Of the same past by the same channel: what is estimated scatters as errors do.
    drawn = np.corrcoef(ahead.own[1:, 0], beside.other[1:, 0])[0, 1]
    assert drawn == pytest.approx(0.36, abs=0.1)


def test_a_constant_error_of_a_sensor_does_not_count_as_an_integrator() -> None:
    random = np.random.default_rng(3)
    wanted = np.repeat(random.standard_normal(100), 20)
    y = scipy.signal.lfilter([0.0, 0.2], [1.0, -0.8], wanted) + 0.05 * random.standard_normal(2000)
    steps = [
        closed_loop(LoopSamples.of([(wanted, y + off, None)], 0.01, 1)).step(40)[0]
        for off in (0.0, 0.3)
    ]
    assert steps[0] == pytest.approx(steps[1], abs=1e-6)


def test_slow_sticks_do_not_make_the_begin_of_a_step_late() -> None:
    known = truths(BETAFLIGHT, 4, 125)[1][2]
    steps = closed_loop(fly_samples(1, BETAFLIGHT, acro=True, duration_s=30.0)).step(3)[:, 2]
    low, high = np.quantile(steps[1:], [0.025, 0.975])
    assert known == pytest.approx(0.065, abs=0.001)
    assert low <= known <= high


@pytest.mark.parametrize(("level", "half", "told"), [(0.3, 0.38, False), (0.9, 0.38, True)])
def test_a_step_that_may_be_none_is_not_told(level: float, half: float, *, told: bool) -> None:
    """A yaw loop at its limits, logged at 10 Hz, was said to end at .3 (.01 to .77)."""
    ends = DrawnEnds(np.linspace(level - half, level + half, 401))
    readings = (
        Estimate("level", level, "1", ends=ends),
        Estimate("delay to half", 0.1, "s"),
        Estimate("rise time", 0.2, "s"),
        Estimate("overshoot", 0.0, "%"),
    )
    none = np.zeros(0)
    begun = LoopResponse("yaw", "rate", "", "", 10.0, 25.0, 1, 1.0, None, none, none, none)
    unfit = refused(begun, readings, 0.01, "log faster")
    assert (unfit is None) == told
