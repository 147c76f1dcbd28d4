"""Regularised regressions: the posterior as written down, and where noise is next to nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flightid.identification.prediction_error.kernel_regression import (
    KernelEstimate,
    kernel_estimate,
)
from flightid.identification.prediction_error.linear_regression import LinearRegression, regress
from tests.closeness import assert_close

LAGS = (20, 20)


def made(noise: float, still: int = 0) -> tuple[LinearRegression, KernelEstimate]:
    """Regression of a second-order loop whose input stands still for a while."""
    random = np.random.default_rng(0)
    u = np.concatenate([np.full(still, -0.001418), random.standard_normal(2000)])
    y = np.zeros(u.size)
    for k in range(2, u.size):
        y[k] = 1.5 * y[k - 1] - 0.7 * y[k - 2] + 0.3 * u[k - 1]
    y += noise * random.standard_normal(u.size)
    found = regress(y, u[None], (u.size,), LAGS[0], [LAGS[1]], [1])
    return found, kernel_estimate(found, LAGS, "dc")


def block(settings: tuple[tuple[float, float, float], ...]) -> NDArray[np.float64]:
    """Prior covariance, lag by lag."""
    whole = np.zeros((sum(LAGS), sum(LAGS)))
    for place, (size, decay, correlation) in enumerate(settings):
        for i in range(20):
            for j in range(20):
                whole[20 * place + i, 20 * place + j] = (
                    size * decay ** ((i + j + 2) / 2) * correlation ** abs(i - j)
                )
    return whole


def test_the_posterior_is_that_of_the_normal_equations() -> None:
    regression, found = made(0.1)
    prior = block(found.settings)
    information = regression.factor.T @ regression.factor / found.variance + np.linalg.inv(prior)
    covariance = np.linalg.inv(information)
    told = -regression.factor.T @ regression.triangle[:-1, -1] / found.variance
    assert_close(found.theta, covariance @ told, atol=1e-9, why="mean of the posterior")
    assert_close(found.covariance, covariance, atol=1e-10, why="covariance of the posterior")
    total = found.variance * np.eye(40) + regression.factor @ prior @ regression.factor.T
    wanted = regression.triangle[:-1, -1]
    evidence = wanted @ np.linalg.solve(total, wanted) + np.linalg.slogdet(total)[1]
    rest = regression.n_rows - 40
    evidence += rest * np.log(found.variance) + regression.sum_of_squares / found.variance
    assert_close(found.evidence, evidence, rtol=1e-9, why="marginal likelihood")


def test_next_to_no_noise_costs_no_digits() -> None:
    _, found = made(1e-9, still=3000)
    impulse = np.eye(1, 30)[0]
    a, b = np.r_[1.0, found.theta[:20]], np.r_[0.0, found.theta[20:]]
    truth = lfilter([0.0, 0.3], [1.0, -1.5, 0.7], impulse)
    assert_close(lfilter(b, a, impulse), truth, atol=1e-6, why="what hardly any noise moves")
    assert np.linalg.eigvalsh(found.covariance).min() > -1e-16
