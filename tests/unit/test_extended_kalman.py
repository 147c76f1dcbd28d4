"""The extended filter: the steady one where equations are linear, and what it makes of squares."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid import _native
from flightid.errors import FitError
from flightid.identification.filter_error.steady_filter import ContinuousPoint, steady_filter
from tests.closeness import assert_close
from tests.strangers import nonlinear_gusts

STEP_S = 0.05


def _linear() -> fid.StateSpaceModel:
    return fid.StateSpaceModel(
        states={"x": "m", "v": "m/s"},
        input_units={"u": "m/s^2"},
        measurements={"x": fid.Output("x", "m")},
        equations={"x'": "v", "v'": "-w2*x - k*v + u"},
        parameters=fid.Parameters(
            [fid.Parameter("k", 0.5, "1/s"), fid.Parameter("w2", 4.0, "1/s^2")]
        ),
    )


def test_on_linear_equations_it_becomes_the_steady_filter() -> None:
    density, variance = np.array([0.0, 0.3]), np.array([0.01])
    random = np.random.default_rng(0)
    inputs, measured = random.standard_normal((1, 400)), random.standard_normal((400, 1))
    model = _linear()
    (innovations, triangles, states), _ = _native.extended_filter(
        model.native, model.parameters.independent_values(), inputs, measured,
        (STEP_S, "zero", 4), (np.zeros(2), np.eye(2), [], []), (density, variance),
    )  # fmt: skip
    a, c = np.array([[0.0, 1.0], [-4.0, -0.5]]), np.array([[1.0, 0.0]])
    point = ContinuousPoint(a, c, np.diag(density), np.diag(variance))
    found = steady_filter(point, [], STEP_S)[0]
    assert_close(
        triangles[-1] @ triangles[-1].T, found.innovation, rtol=5e-4, why="process noise of a step"
    )
    # The recursion with the steady gain ends where the varying one does.
    matrix = np.block([[a, np.array([[0.0], [1.0]])], [np.zeros((1, 3))]])
    driven = _native.matrix_exponential(matrix * STEP_S)[:2, 2]
    state = np.zeros(2)
    for sample in range(400):
        last = state
        state = found.closed @ state + found.gain @ measured[sample] + driven * inputs[0, sample]
    assert_close(states[-1], last, rtol=5e-3, why="gain of a step's process noise")
    assert_close(innovations[-1], measured[-1] - c @ last, rtol=5e-3, why="the same")


def test_constants_of_channels_are_found() -> None:
    model = _linear()
    time_s = STEP_S * np.arange(600)
    inputs = np.sin(0.3 * time_s**1.5)[None]
    clean = fid.simulate(model, fid.Record.from_arrays(time_s, inputs={"u": inputs[0] + 0.2}))
    measured = clean["x"][:, None] + 0.7
    # A constant push moves x by a quarter of it for good: x alone tells neither from a bias.
    for biased, shifted, wanted in (([0], [], 0.75), ([], [0], 3.0)):
        (_, _, states), _ = _native.extended_filter(
            model.native, model.parameters.independent_values(), inputs, measured,
            (STEP_S, "first", 4), (np.zeros(3), 10.0 * np.eye(3), shifted, biased),
            (np.zeros(2), np.array([1e-4])),
        )  # fmt: skip
        assert_close(states[-1, 2], wanted, rtol=0.02, why="a start that fades")


def test_slopes_are_those_of_the_filter() -> None:
    model = fid.StateSpaceModel(
        states={"alpha": "rad", "q": "rad/s"},
        input_units={"de": "rad", "da": "rad"},
        measurements={
            "alpha": fid.Output("alpha", "rad"),
            "q": fid.Output("q", "rad/s"),
            "az": fid.Output("lever*q' + g*sin(alpha)", "m/s^2"),
        },
        equations={
            "alpha'": "Za*alpha + q",
            "(1 + k*alpha^2)*q'": "Ma*alpha + Maa*alpha^3 + Mq*q*exp(alpha) + Md*de - Ma*da",
        },
        delays={"de": "tau"},
        parameters=fid.Parameters(
            [
                fid.Parameter("Ma", -6.0, "1/s^2"),
                fid.Parameter("Mq", -1.8, "1/s"),
                fid.Parameter("Za", -1.2, "1/s"),
                fid.Parameter("Maa", 40.0, "1/s^2"),
                fid.Parameter("Md", -9.0, "1/s^2"),
                fid.Parameter("k", 0.5, "1"),
                fid.Parameter("lever", 0.3, "m"),
                fid.Parameter("g", 4.0, "m/s^2"),
                fid.Parameter("tau", 0.033, "s"),
            ]
        ),
    )
    n = len(model.parameters.free)
    random = np.random.default_rng(2)
    inputs, measured = 0.2 * random.standard_normal((2, 60)), 0.1 * random.standard_normal((60, 3))
    constants = [1], [0, 2]
    size = 2 + 1 + 2

    def found(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, prior, process, variance = np.split(x, np.cumsum([n, size, 2]))
        return _native.extended_filter(
            model.native, values, inputs, measured, (0.02, "zero", 2),
            (np.full(size, 0.1), np.diag(prior), *constants), (process, variance),
        )[1]  # fmt: skip

    at = np.concatenate(
        [model.parameters.independent_values(), 0.2 + 0.1 * np.arange(size), [0.1, 0.3],
         [0.01, 0.02, 0.05]]
    )  # fmt: skip
    count = at.size
    ahead = np.eye(count)
    turned = np.zeros((count, size, size))
    _, priors, densities, variances = np.split(ahead, np.cumsum([n, size, 2]), axis=1)
    turned[:, range(size), range(size)] = priors
    values, prior, process, variance = np.split(at, np.cumsum([n, size, 2]))
    given = (
        model.native, values, inputs, measured, (0.02, "zero", 2),
        (np.full(size, 0.1), np.diag(prior), *constants), (process, variance),
    )  # fmt: skip
    run, (white, logs) = _native.extended_filter_slopes(
        *given,
        tuple(map(np.ascontiguousarray, (ahead[:, :n], turned, densities, variances))),
    )
    for part, alone in zip(sum(run, ()), sum(_native.extended_filter(*given), ()), strict=True):
        assert_close(part, alone, rtol=0.0, atol=1e-14 * np.abs(alone).max(), why="same values")
    for place, direction in enumerate(ahead):
        step = 1e-6 * max(abs(at[place]), 0.01)
        above, below = found(at + step * direction), found(at - step * direction)
        for exact, high, low in zip((white, logs), above, below, strict=True):
            wanted = (high - low).ravel() / (2.0 * step)
            assert_close(
                exact[:, place],
                wanted,
                rtol=0.0,
                atol=1e-6 * np.abs(wanted).max(),
                why="differences",
            )


def test_filter_error_follows_squares_where_output_error_has_no_interval() -> None:
    record = nonlinear_gusts.flight(1, (0.02, 0.2), 16.0)
    model = nonlinear_gusts.model()
    free = fid.identify(model, record, method="output_error")
    assert all(each.interval95 is None for each in free.parameters.values())
    assert "filter_error" in free.parameters["Ma"].reason
    assert free.covariance is None
    assert "by noise alone" not in str(free.summary())
    assert "intervals allow for it" not in str(free.summary())
    fit = fid.identify(model, record, method="filter_error")
    for name, truth in nonlinear_gusts.TRUTH.items():
        found = fit.parameters[name]
        assert abs(found.value - truth) < 4.0 * found.stderr
    densities = fit.provenance["process_noise"]
    assert_close(densities["alpha"], 0.02, rtol=0.15, why="800 samples")
    assert_close(densities["q"], 0.2, rtol=0.15, why="800 samples")


def test_constants_of_linear_equations_are_followed_or_named() -> None:
    random = np.random.default_rng(0)
    model = fid.StateSpaceModel(
        states={"q": "rad/s"},
        input_units={"de": "rad"},
        measurements={"q": fid.Output("q", "rad/s")},
        equations={"q'": "M0 + Mq*q + Md*de"},
        parameters=fid.Parameters(
            [
                fid.Parameter("M0", 0.1, "1/s^2"),
                fid.Parameter("Mq", -1.0, "1/s"),
                fid.Parameter("Md", -4.0, "1/s^2"),
            ]
        ),
    )
    elevator = 0.05 * np.repeat(random.choice([-1.0, 0.0, 1.0], 30), 20)
    decay, rate = np.exp(-0.04), np.zeros(elevator.size)
    for k in range(elevator.size - 1):
        push = 0.5 * (1.0 - decay) * (0.2 - 8.0 * elevator[k])
        rate[k + 1] = decay * rate[k] + push + 0.003 * random.standard_normal()
    record = fid.Record.from_arrays(
        np.arange(elevator.size) * 0.02,
        inputs={"de": elevator},
        outputs={"q": rate + 0.002 * random.standard_normal(elevator.size)},
        units={"de": "rad", "q": "rad/s"},
        hold="zero",
    )
    found = fid.identify(model, record, method="filter_error", output_bias=False)
    for name, truth in {"M0": 0.2, "Mq": -2.0, "Md": -8.0}.items():
        assert abs(found.parameters[name].value - truth) < 4.0 * found.parameters[name].stderr
    with pytest.raises(FitError, match="M0, output bias of q"):
        fid.identify(model, record, method="filter_error")
