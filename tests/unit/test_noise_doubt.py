"""Noises of a filter are told by its own record: what they leave in doubt, by dense matrices."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
import scipy.signal

import flightid as fid
from flightid.identification.filter_error.noise_doubt import noise_doubt
from flightid.identification.filter_error.problem import innovations_problem
from flightid.identification.filter_error.unseen_noise import unseen_noises
from flightid.identification.multistart import DenseEnd
from flightid.identification.regression.options import FilterErrorOptions
from tests.closeness import assert_close

STEP_S, DAMPING, N = 0.05, -1.0, 240
SPREAD = np.array([[0.4, 0.1], [0.1, 0.2]])
"""Covariance of the control derivative and of the logarithm of the process noise."""


def _model() -> fid.StateSpaceModel:
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"u": "rad"},
        measurements={"rate": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Ld*u"},
        parameters=fid.Parameters(
            [
                fid.Parameter("Lp", DAMPING, "1/s", free=False),
                fid.Parameter("Ld", 4.0, "1/s^2"),
            ]
        ),
        name="roll",
    )


def _record(seed: int, gusts: float = 0.02) -> fid.Record:
    drawn = np.random.default_rng(seed)
    u = 0.1 * np.sign(np.sin(np.arange(N) * STEP_S * 1.3))
    keep, push = np.exp(DAMPING * STEP_S), np.expm1(DAMPING * STEP_S) / DAMPING
    p = np.zeros(N)
    for k in range(N - 1):
        p[k + 1] = keep * p[k] + push * 4.0 * u[k] + gusts * drawn.standard_normal()
    return fid.Record.from_arrays(
        np.arange(N) * STEP_S,
        inputs={"u": u},
        outputs={"rate": p + 0.03 * drawn.standard_normal(N)},
        units={"u": "rad", "rate": "rad/s"},
        hold="zero",
        loop="open",
    )


def _dense(record: fid.Record, process: float, measured: float) -> np.ndarray:
    """Logarithms of the variance of Ld, and of the determinant with start and output bias.

    The start is what the steady filter foretells: the state lies about it by its own error.
    """
    u, y = record.matrix(["u"])[0], record.matrix(["rate"])[0]
    keep, push = np.exp(DAMPING * STEP_S), np.expm1(DAMPING * STEP_S) / DAMPING
    drive = process * np.expm1(2.0 * DAMPING * STEP_S) / (2.0 * DAMPING)
    runs = scipy.linalg.toeplitz(keep ** np.arange(N), np.zeros(N))
    moved = np.zeros((N, N))
    moved[1:] = runs[:-1]
    first = keep ** np.arange(N)
    prior = scipy.linalg.solve_discrete_are(keep, 1.0, drive, measured)[0, 0]
    noise = drive * moved @ moved.T + measured * np.eye(N) + prior * np.outer(first, first)
    own = np.column_stack([first, np.ones(N)])
    slope = moved @ (push * u)
    white = scipy.linalg.solve_triangular(
        np.linalg.cholesky(noise), np.column_stack([slope, own, y - 4.0 * slope]), lower=True
    )
    rest = white - white[:, 1:3] @ np.linalg.lstsq(white[:, 1:3], white)[0]
    squares = float(rest[:, 3] @ rest[:, 3])
    whole = np.linalg.slogdet(white[:, :3].T @ white[:, :3])[1]
    return np.array([np.log(squares / (rest[:, 0] @ rest[:, 0])), 3.0 * np.log(squares) - whole])


@pytest.mark.parametrize("level", [-1.0, 1.0])
def test_it_is_what_dense_matrices_make_of_the_noise(level: float) -> None:
    record = _record(3)
    options = FilterErrorOptions(hold="zero", process_noise=("p",))
    problem = innovations_problem(_model(), [record], options)
    x = np.array([4.0, level])
    residuals, jacobian = problem.residuals(x, with_slopes=True)
    end = DenseEnd(x, float(residuals @ residuals), 1, "gradient", residuals, jacobian)
    found = noise_doubt(problem, end, np.ones(2, dtype=bool), SPREAD)
    step = np.sqrt(SPREAD[1, 1])
    noises = [problem.noise(np.array([4.0, at])) for at in (level, level + step)]
    here, there = (_dense(record, float(w[0]), float(r[0])) for w, r in noises)
    own, whole = (there - here) / step
    why = "two ways to one likelihood"
    assert_close(found.variance[0], own**2 * SPREAD[1, 1], rtol=1e-3, why=why)
    lacking = 0.5 * SPREAD[1, 1] * whole
    assert_close(np.log(found.factor[0]), 0.5 * own * lacking, rtol=1e-3, why=why)
    assert found.factor[0] > 1.01


def _misfit(record: fid.Record, process: float, measured: float) -> float:
    """-2 ln p by dense matrices, level of all noises and what is linear at their best."""
    u, y = record.matrix(["u"])[0], record.matrix(["rate"])[0]
    keep, push = np.exp(DAMPING * STEP_S), np.expm1(DAMPING * STEP_S) / DAMPING
    drive = process * np.expm1(2.0 * DAMPING * STEP_S) / (2.0 * DAMPING)
    moved = np.zeros((N, N))
    moved[1:] = scipy.linalg.toeplitz(keep ** np.arange(N), np.zeros(N))[:-1]
    first = keep ** np.arange(N)
    noise = drive * moved @ moved.T + measured * np.eye(N)
    lower = np.linalg.cholesky(noise)
    table = np.column_stack([moved @ (push * u), first, np.ones(N), y])
    white = scipy.linalg.solve_triangular(lower, table, lower=True)
    rest = white[:, 3] - white[:, :3] @ np.linalg.lstsq(white[:, :3], white[:, 3])[0]
    return float(N * np.log(rest @ rest) + 2.0 * np.sum(np.log(np.diag(lower))))


def test_noise_that_came_out_as_none_may_be_there() -> None:
    """What is possible of it by the likelihood itself, and its share of bars by dense matrices."""
    record = _record(3, 0.0)
    options = FilterErrorOptions(hold="zero", process_noise=("p",))
    problem = innovations_problem(_model(), [record], options)
    (measured,) = problem.noise(np.array([4.0, 0.0]))[1]
    scale = float(problem.process_scale[0] ** 2)
    value = fid.identify(_model(), record, method="filter_error").parameters["Ld"].value
    x = np.array([value, -problem.reach[0]])
    residuals, jacobian = problem.residuals(x, with_slopes=True)
    end = DenseEnd(x, float(residuals @ residuals), 1, "gradient", residuals, jacobian)
    columns = np.array([True, False])
    (found,) = unseen_noises(problem, end)
    # Steps of deviation up to a tenth of the motion, all as likely before.
    levels = np.linspace(0.0, 1.0, 61) ** 2
    misfit = np.array([_misfit(record, level * scale, measured) for level in levels])
    chance = np.exp(0.5 * (misfit[0] - misfit))
    assert np.argmax(chance) == 0
    mean = np.sum(levels * chance) / np.sum(chance)
    assert_close(found.mean, mean, rtol=0.1, why="parameters stay at their values")
    made = noise_doubt(problem, end, columns, SPREAD[:1, :1])
    none, some = (_dense(record, q * scale, measured)[0] for q in (1e-9, 1e-5))
    grown = 1.0 + found.mean * (some - none) / 1e-5
    assert_close(made.factor[0] ** 2, grown, rtol=1e-2, why="two ways to one slope")
    assert made.factor[0] > 1.02
    doubt = (grown - 1.0) * found.deviation / found.mean / grown
    assert_close(made.variance[0], doubt**2, rtol=0.1, why="two ways to one slope")


def test_bars_of_a_short_record_know_that_it_tells_its_noise() -> None:
    fit = fid.identify(_model(), _record(5), method="filter_error")
    freedom = fit.parameters["Ld"].freedom
    assert freedom is not None
    # The innovations alone would tell some 240.
    assert 5.0 < freedom < 120.0


@pytest.mark.parametrize("seed", [3, 9])
def test_a_noise_that_is_nearly_none_leaves_bars_of_a_size(seed: int) -> None:
    """Its logarithm, which the record does not tell, made bars of 1e114 or of no number at all."""
    drawn, step_s, damped = np.random.default_rng(seed), 0.04, 0.95
    u = np.zeros(250)
    for begin in (25, 117):
        u[begin : begin + 63] = np.repeat([1.0, -1.0, 1.0, -1.0], [27, 18, 9, 9])
    a, b = np.array([[-1.3, 1.0], [-7.0, -1.8]]), np.array([[0.0], [-9.0]])
    held = scipy.signal.cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), step_s)
    _, y, _ = scipy.signal.dlsim(held, u)
    white = drawn.standard_normal((450, 2))
    noise = scipy.signal.lfilter([np.sqrt(1.0 - damped**2)], [1.0, -damped], white, axis=0)[200:]
    y = y + 0.08 * y.std(axis=0) * noise
    model = fid.StateSpaceModel.from_dict(
        {
            "name": "short period",
            "states": {"alpha": "rad", "q": "rad/s"},
            "inputs": {"de": "1"},
            "outputs": {"alpha": "alpha", "q": "q"},
            "parameters": {
                "Za": {"value": -1.0, "unit": "1/s"},
                "Ma": {"value": -5.0, "unit": "1/s^2"},
                "Mq": {"value": -1.2, "unit": "1/s"},
                "Mde": {"value": -6.0, "unit": "1/s^2"},
            },
            "equations": {"alpha'": "Za*alpha + q", "q'": "Ma*alpha + Mq*q + Mde*de"},
        }
    )
    record = fid.Record.from_arrays(
        np.arange(250) * step_s,
        inputs={"de": u},
        outputs={"alpha": y[:, 0], "q": y[:, 1]},
        units={"de": "1", "alpha": "rad", "q": "rad/s"},
        hold="zero",
    )
    fit = fid.identify(model, record, method="filter_error")
    for name, true in {"Za": -1.3, "Ma": -7.0, "Mq": -1.8, "Mde": -9.0}.items():
        found = fit.parameters[name]
        assert found.interval95 is not None
        assert found.stderr is not None
        low, high = found.interval95
        assert low < true < high
        assert high - low < 20.0 * found.stderr
