"""Drift that a fit bends out of its residuals has its power back in the bars."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import residual_covariance
from flightid.uncertainty.fitted_directions import FittedDirections
from flightid.uncertainty.residual_noise import Autoregression
from flightid.uncertainty.restricted_drift import with_drifts
from flightid.uncertainty.restricted_likelihood import shapes_of, weighed
from flightid.uncertainty.slow_half_cycles import half_cycles, slowest
from tests.closeness import assert_close

Array = np.ndarray
N = 160


def _walk_power(n: int = N) -> Array:
    """Covariance of a walk that ends a standard deviation away."""
    steps = np.arange(1, n + 1)
    return np.minimum.outer(steps, steps) / n


def _slow_columns() -> tuple[Array, Array]:
    """What a roll rate and the angle answer to Lda, Lp and Lphi of a slow spiral; own levels."""
    step = 10.0 / N
    stick = np.repeat(np.random.default_rng(8).choice([-1.0, 0.0, 1.0], N // 10), 10)
    system = np.array([[-3.2, -0.35], [1.0, 0.0]])
    columns = np.zeros((2, N, 3))
    for place in range(3):
        state = np.zeros(2)
        for k in range(N):
            columns[:, k, place] = state
            push = stick[k] if place == 0 else columns[place - 1, k, 0]
            state = state + step * (system @ state + np.array([push, 0.0]))
    own = np.zeros((2, N, 2))
    own[0, :, 0] = own[1, :, 1] = 1.0
    return columns, own


def _fitted(random: np.random.Generator, deviation: float) -> tuple[RecordBlock, Array]:
    """A fit to white noise and walks of some deviation, and how wrong its parameters are."""
    shared, own = _slow_columns()
    walks = np.cumsum(random.standard_normal((2, N)), axis=1) / np.sqrt(N)
    noise = random.standard_normal((2, N)) + deviation * walks
    columns = np.concatenate([shared, own], axis=2).reshape(2 * N, -1)
    found = np.linalg.lstsq(columns, noise.ravel(), rcond=None)[0]
    left = (noise.ravel() - columns @ found).reshape(2, N)
    return RecordBlock.of(shared, own, left), found[:3]


def _true_covariance(deviation: float) -> Array:
    shared, own = _slow_columns()
    columns = np.concatenate([shared, own], axis=2).reshape(2 * N, -1)
    power = np.kron(np.eye(2), np.eye(N) + deviation**2 * _walk_power())
    gain = np.linalg.pinv(columns)
    return (gain @ power @ gain.T)[:3, :3]


@pytest.mark.parametrize(("deviation", "least", "fewest"), [(1.0, 0.6, 0.9), (3.0, 0.4, 0.7)])
def test_bars_hold_the_drift_that_slow_parameters_follow(
    deviation: float, least: float, fewest: float
) -> None:
    """By what shows alone the slow one's errors came out at 0.3 of the truth: 25, 42 % held."""
    truth = np.sqrt(np.diag(_true_covariance(deviation)))
    found, held = [], []
    for seed in range(24):
        block, wrong = _fitted(np.random.default_rng(seed), deviation)
        known = residual_covariance([block])
        found.append(np.sqrt(np.diag(known.covariance)) / truth)
        reach = scipy.stats.t.ppf(0.975, known.freedom) * found[-1] * truth
        held.append(np.abs(wrong) < reach)
    assert least < np.median(found, axis=0)[2] < 1.3
    assert np.mean(held, axis=0)[2] > fewest
    assert np.mean(held) > 0.9


def test_white_noise_keeps_its_bars() -> None:
    wider = []
    for seed in range(24):
        block, _ = _fitted(np.random.default_rng(seed), 0.0)
        wider.append(residual_covariance([block]).ratios)
    assert 0.9 < np.median(wider) < 1.1


def _dense(columns: Array, left: Array, power: Array) -> float:
    """Restricted likelihood by what no column reaches."""
    unreached = scipy.linalg.null_space(columns.T)
    seen = unreached.T @ power @ unreached
    mean = unreached.T @ left
    return -0.5 * float(np.linalg.slogdet(seen)[1] + mean @ np.linalg.solve(seen, mean))


def test_its_likelihood_is_that_of_what_no_fit_reaches() -> None:
    """And its slope that of differences: two outputs, two records of one parameter set."""
    random = np.random.default_rng(3)
    n, n_bins, factor = 48, 12, np.array([0.9, 1.2])
    whole = np.linalg.qr(random.standard_normal((4 * n, 3)).cumsum(axis=0))[0]
    taken, left, sides = [], [], []
    for k in range(2):
        shared = whole.reshape(2, 2, n, 3)[k]
        own = np.zeros((2, n, 1))
        own[1, :, 0] = 1.0 / np.sqrt(n)
        taken.append(FittedDirections(own, shared))
        left.append(random.standard_normal((2, n)))
        beside = [np.zeros((2, n, 1)), np.zeros((2, n, 1))]
        beside[k] = own
        sides.append(np.concatenate([*beside, shared], axis=2).reshape(2 * n, -1))
    white = [Autoregression(np.array([1.0]), np.empty(0), 2 * n, 256) for _ in range(2)]
    one = np.ones(2)
    parts = [
        half_cycles(white, *pair, slowest(*pair, one, n_bins), one)
        for pair in zip(left, taken, strict=True)
    ]
    shapes = shapes_of([3.0 / n, 0.2], n_bins, n)

    def dense(variance: Array) -> float:
        cosines = scipy.fft.dct(np.eye(n), axis=0, norm="ortho")
        blocks = []
        for o in range(2):
            level = np.full(n, factor[o])
            level[:n_bins] += variance[o] * shapes[o]
            blocks.append(cosines.T @ np.diag(level) @ cosines)
        power = scipy.linalg.block_diag(*blocks, *blocks)
        return _dense(np.vstack(sides), np.concatenate([each.ravel() for each in left]), power)

    here, there, step = np.array([0.3, 0.05]), np.array([0.02, 0.4]), 1e-5
    told = weighed(parts, shapes, factor, here)
    other = weighed(parts, shapes, factor, there)
    assert_close(
        told.value - other.value, dense(here) - dense(there), rtol=1e-6, why="but for a constant"
    )
    slope = [(dense(here + d) - dense(here - d)) / (2 * step) for d in step * np.eye(2)]
    assert_close(told.slope, slope, rtol=1e-4, atol=1e-5, why="central differences")


def test_what_bends_no_slow_half_cycle_is_left_alone() -> None:
    """Columns that change sign from sample to sample follow no drift."""
    column = np.where(np.arange(N) % 2, 1.0, -1.0) / np.sqrt(N)
    taken = FittedDirections(np.zeros((1, N, 0)), column[None, :, None])
    noise = np.random.default_rng(0).standard_normal((1, N)).cumsum(axis=1)
    model = Autoregression(np.array([1.0]), np.empty(0), N, 512)
    assert with_drifts([model], [noise], [taken])[0] is model
    long, none = np.random.default_rng(1).standard_normal((1, 5003)), np.zeros((1, 5003, 0))
    found = slowest(long + 1.0, FittedDirections(none, none), np.ones(1), 4)[0, :, 0]
    known = np.sqrt(np.array([1.0, 2.0, 2.0, 2.0]) / 5003) * [
        np.cos(np.pi * k * (np.arange(5003) + 0.5) / 5003) @ (long[0] + 1.0) for k in range(4)
    ]
    assert_close(found, known, atol=2e-3, why="sums over blocks, in which cosines turn little")


def test_an_output_that_tells_nothing_of_a_parameter_brings_no_doubt() -> None:
    """Its share of the variance is none of none."""
    random = np.random.default_rng(5)
    shared, own = _slow_columns()
    shared[0, :, 0] = 0.0
    walks = np.cumsum(random.standard_normal((2, N)), axis=1)
    block = RecordBlock.of(shared, own, walks - walks.mean(axis=1, keepdims=True))
    with np.errstate(invalid="raise"):
        known = residual_covariance([block])
    assert np.all(np.isfinite(known.freedom))
    assert np.all(known.freedom >= 1.0)
