"""The native Levenberg–Marquardt against SciPy's bounded least squares and certified answers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares as scipy_least_squares

from flightid import _native
from tests.closeness import assert_close

Array = np.ndarray
MISRA_Y = np.array(
    [
        10.07,
        14.73,
        17.94,
        23.93,
        29.61,
        35.18,
        40.02,
        44.82,
        50.76,
        55.05,
        61.01,
        66.40,
        75.47,
        81.78,
    ]
)
MISRA_X = np.array(
    [
        77.6,
        114.9,
        141.1,
        190.8,
        239.9,
        289.0,
        332.8,
        378.4,
        434.8,
        477.3,
        536.8,
        593.1,
        689.1,
        760.0,
    ]
)
TIME = np.linspace(0.0, 4.0, 40)


def rosenbrock(x: Array) -> tuple[Array, Array]:
    return (
        np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
        np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
    )


def powell(x: Array) -> tuple[Array, Array]:
    a, b, c, d = x
    five, ten = np.sqrt(5.0), np.sqrt(10.0)
    return (
        np.array([a + 10 * b, five * (c - d), (b - 2 * c) ** 2, ten * (a - d) ** 2]),
        np.array(
            [
                [1, 10, 0, 0],
                [0, 0, five, -five],
                [0, 2 * (b - 2 * c), -4 * (b - 2 * c), 0],
                [2 * ten * (a - d), 0, 0, -2 * ten * (a - d)],
            ]
        ),
    )


def misra(x: Array) -> tuple[Array, Array]:
    decay = np.exp(-x[1] * MISRA_X)
    return (
        x[0] * (1 - decay) - MISRA_Y,
        np.column_stack([1 - decay, x[0] * MISRA_X * decay]),
    )


def two_exponentials(x: Array) -> tuple[Array, Array]:
    data = 2 * np.exp(-TIME) + 0.5 * np.exp(-0.2 * TIME) + 0.01 * np.sin(37 * TIME)
    one, two = np.exp(-x[1] * TIME), np.exp(-x[3] * TIME)
    return (
        x[0] * one + x[2] * two - data,
        np.column_stack([one, -x[0] * TIME * one, two, -x[2] * TIME * two]),
    )


OPEN = np.inf
PROBLEMS = {
    "rosenbrock": (rosenbrock, [-1.2, 1.0], [-OPEN, -OPEN], [OPEN, OPEN]),
    "rosenbrock, x at most 0.5": (rosenbrock, [-1.2, 1.0], [-2, -2], [0.5, 2]),
    "rosenbrock, y at least 1.5": (rosenbrock, [-1.2, 1.8], [-2, 1.5], [0.9, 2]),
    "rosenbrock, corner": (rosenbrock, [-1.2, 0.0], [-2, -2], [0.5, 0.1]),
    "misra1a": (misra, [500.0, 1e-4], [0, 0], [1e4, 1]),
    "misra1a, bound": (misra, [200.0, 1e-4], [0, 0], [230.0, 1]),
    "exponentials": (two_exponentials, [1, 2, 1, 0.1], [0, 0, 0, 0], [9, 9, 9, 9]),
    "exponentials, bound": (two_exponentials, [1, 2, 1, 0.5], [0, 0, 0, 0.25], [9, 9, 9, 9]),
}


def native(
    problem: Callable[[Array], tuple[Array, Array]], start: object, low: object, high: object
) -> tuple[Array, float, Array, Array, int, str]:
    begin = np.asarray(start, dtype=float)
    return _native.least_squares(
        lambda x: problem(x)[0],
        lambda x: np.ascontiguousarray(problem(x)[1]),
        begin,
        np.asarray(low, dtype=float),
        np.asarray(high, dtype=float),
        len(problem(begin)[0]),
        500,
    )


@pytest.mark.parametrize("name", PROBLEMS)
def test_same_minimum_as_scipy(name: str) -> None:
    problem, start, low, high = PROBLEMS[name]
    x, cost, residuals, jacobian, iterations, reason = native(problem, start, low, high)
    peer = scipy_least_squares(
        lambda v: problem(v)[0],
        start,
        lambda v: problem(v)[1],
        bounds=(low, high),
        method="trf",
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=5000,
    )
    assert reason in {"gradient", "step", "cost", "zero", "bounds"}
    assert cost <= 2 * peer.cost * (1 + 1e-9) + 1e-20
    # SciPy's interior method stops beside a bound, so its answer is the looser of the two.
    assert_close(x, peer.x, rtol=2e-5, atol=1e-8, why="same minimum")
    assert_close(residuals, problem(x)[0], rtol=1e-12, atol=1e-14, why="residuals are those at x")
    assert_close(jacobian, problem(x)[1], rtol=1e-12, atol=1e-14, why="Jacobian is that at x")
    assert iterations < 200


def test_certified_values_of_misra1a() -> None:
    # NIST StRD, Misra1a: certified to 11 digits.
    x, cost, *_ = native(misra, [500.0, 1e-4], [0, 0], [1e4, 1])
    assert_close(x, [2.3894212918e02, 5.5015643181e-04], rtol=1e-9, why="certified values")
    assert_close(cost, 1.2455138894e-01, rtol=1e-9, why="certified sum of squares")


def test_singular_minimum_of_powell() -> None:
    x, cost, *_ = native(powell, [3.0, -1.0, 0.0, 1.0], [-9] * 4, [9] * 4)
    assert_close(x, np.zeros(4), atol=1e-3, why="the Jacobian is singular at the minimum")
    assert cost < 1e-12


def test_errors_of_callbacks_come_through() -> None:
    one, go = np.ones(1), np.array([5.0])

    def broken(x: Array) -> Array:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        _native.least_squares(broken, broken, one, -go, go, 1, 10)
    with pytest.raises(ValueError, match="values of a callback: found 2, needed 1"):
        _native.least_squares(lambda x: np.ones(2), lambda x: np.ones((1, 1)), one, -go, go, 1, 9)
    with pytest.raises(ValueError, match="lower bound: found 5, needed at most the upper bound"):
        _native.least_squares(lambda x: x, lambda x: np.ones((1, 1)), one, go, -go, 1, 10)
    with pytest.raises(ValueError, match="the start holds a value that is not finite"):
        _native.least_squares(lambda x: x, lambda x: np.eye(1), one * np.nan, -go, go, 1, 10)
    with pytest.raises(ValueError, match="the residuals at the start"):
        _native.least_squares(lambda x: x * np.nan, lambda x: np.eye(1), one, -go, go, 1, 10)
