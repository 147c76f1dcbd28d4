"""The steady filter, its slopes, the likelihood of innovations, and filter error as a fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import flightid as fid
from flightid import _native
from flightid.errors import FitError, SingularError
from flightid.identification.filter_error import gust_score, search
from flightid.identification.filter_error.gust_score import Score, score
from flightid.identification.filter_error.gusts import Gust
from flightid.identification.filter_error.innovation_covariance import (
    innovation_covariance,
    told_noises,
)
from flightid.identification.filter_error.innovations import FilteredData, InnovationsProblem
from flightid.identification.filter_error.steady_filter import ContinuousPoint, steady_filter
from flightid.identification.multistart import DenseEnd
from tests.closeness import assert_close
from tests.regression_flights import fly, noisy, short_period, values
from tests.strangers import gusts


def test_steady_filter_is_the_textbook_one() -> None:
    a = np.array([[-1.0, 0.5], [-3.0, 0.2]])
    c, w = np.array([[1.0, 0.0]]), np.diag([0.3, 0.8])
    point = ContinuousPoint(a, c, w, np.array([[0.1]]))
    found = steady_filter(point, [], 0.05)[0]
    phi = _native.matrix_exponential(a * 0.05)
    grid = (np.arange(2000) + 0.5) / 2000 * 0.05
    turned = np.array([_native.matrix_exponential(a * s) for s in grid])
    q = np.mean(turned @ w @ turned.transpose(0, 2, 1), axis=0) * 0.05
    wanted = solve_discrete_are(phi.T, c.T, q, np.array([[0.1]]))
    assert_close(found.predicted, wanted, rtol=1e-6, why="midpoint rule for the integral")


def test_an_unstable_part_that_no_output_sees_has_no_filter() -> None:
    seen = np.array([[1.0, 0.0]])
    point = ContinuousPoint(np.diag([-1.0, 2.0]), seen, np.eye(2), np.array([[0.1]]))
    with pytest.raises(FitError, match="no steady filter"):
        steady_filter(point, [], 0.1)


def test_a_search_that_was_stopped_asks_no_more() -> None:
    asked = []

    def residuals(x: np.ndarray) -> np.ndarray:
        asked.append(x)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return np.array([np.exp(x[0]) - 7.0, x[0]])

    def jacobian(x: np.ndarray) -> np.ndarray:
        return np.array([[np.exp(x[0])], [1.0]])

    wide = np.array([np.inf])
    with pytest.raises(KeyboardInterrupt):
        _native.least_squares(residuals, jacobian, np.zeros(1), -wide, wide, 2, 50)
    assert len(asked) == 3


def _problem(
    model: fid.StateSpaceModel, hold: str = "first"
) -> tuple[InnovationsProblem, np.ndarray]:
    generator = np.random.default_rng(0)
    walk = np.cumsum(generator.standard_normal((4, 240)), axis=1)
    data = (
        FilteredData(0.01 * walk[:1], 0.05 * walk[1:], 0.02),
        FilteredData(0.01 * walk[:1, :150] + 0.1, 0.05 * walk[1:, 50:200], 0.03),
    )
    scales = np.array([0.1, 0.2]), np.array([0.01, 0.02, 0.1])
    problem = InnovationsProblem(
        model, data, (0, 1), *scales, output_bias=True, input_bias=True, hold=hold
    )
    start = np.array([*values(model).values(), -1.0, 0.5, 0.2, -0.3])
    start[5] = 0.013
    return problem, start


@pytest.mark.parametrize("hold", ["first", "zero", "band_limited"])
def test_slopes_of_the_likelihood_are_exact(hold: str) -> None:
    problem, start = _problem(short_period(), hold)
    residuals, jacobian = problem.residuals(start, with_slopes=True)
    gradient = 2.0 * jacobian.T @ residuals

    def cost(x: np.ndarray) -> float:
        return float(np.sum(problem.residuals(x, with_slopes=False)[0] ** 2))

    for place, value in enumerate(start):
        step = 1e-5 * max(abs(value), 0.1)
        around = [start + sign * step * np.eye(len(start))[place] for sign in (1.0, -1.0)]
        central = (cost(around[0]) - cost(around[1])) / (2.0 * step)
        assert_close(gradient[place], central, rtol=2e-6, atol=1e-6, why="central differences")


def test_sum_of_squares_is_the_likelihood_with_its_best_scale() -> None:
    problem, start = _problem(short_period())
    residuals, _ = problem.residuals(start, with_slopes=False)
    total = sum(each.outputs.size for each in problem.data)
    logs = squares = 0.0
    for found, _ in problem.records(start, with_slopes=False):
        b = found.filter.innovation
        logs += len(found.innovations) * np.linalg.slogdet(b)[1]
        squares += float(np.sum(found.innovations * np.linalg.solve(b, found.innovations.T).T))
    wanted = logs + total * np.log(squares / total)
    found_log = total * np.log(np.sum(residuals**2) / total)
    assert_close(found_log, wanted, rtol=1e-12, why="the same number")


def test_without_turbulence_it_agrees_with_output_error() -> None:
    model = short_period()
    flight = noisy(fly(model), 2, factor=3.0)
    filtered = fid.identify(model, flight, method="filter_error")
    output = fid.identify(model, flight)
    for name in values(model):
        one, other = filtered.parameters[name], output.parameters[name]
        assert other.stderr is not None
        assert abs(one.value - other.value) < 0.7 * other.stderr, name
    noise = filtered.noise_covariance
    assert noise is not None
    assert_close(np.sqrt(np.diag(noise)), [0.0018, 0.0036, 0.03], rtol=0.1, why="1001 samples")
    record = filtered.records[0]
    assert set(record.states) == {"alpha", "q"}
    assert record.states["q"].shape == (flight.n_samples,)
    assert filtered.to_dict()["schema"] == "flightid.fit/1"


def test_slopes_of_a_gust_are_exact() -> None:
    problem, start = _problem(short_period())
    gust = Gust(0, np.array([True, True]), np.array([False, False, True]), 0.02, 0.4)
    problem, start = replace(problem, gust=gust), np.concatenate([start, [0.3, -0.2]])
    residuals, jacobian = problem.residuals(start, with_slopes=True)
    gradient = 2.0 * jacobian.T @ residuals

    def cost(x: np.ndarray) -> float:
        return float(np.sum(problem.residuals(x, with_slopes=False)[0] ** 2))

    for place in (0, 1, len(start) - 2, len(start) - 1):
        step = 1e-5 * np.eye(len(start))[place]
        central = (cost(start + step) - cost(start - step)) / 2e-5
        assert_close(gradient[place], central, rtol=2e-6, atol=1e-6, why="central differences")


def test_the_score_of_a_gust_is_the_slope_by_its_density() -> None:
    """Central differences of a likelihood that is even in the deviation; the null's own size."""
    problem, start = _problem(short_period())
    gust = Gust(0, np.array([True, True]), np.array([False, False, True]), 0.02, 0.4)
    gusty = replace(problem, gust=gust)
    found = gusty.residuals(np.concatenate([start, [-6.0, 0.0]]), with_slopes=True)
    end = DenseEnd(start, float(found[0] @ found[0]), 0, "step", found[0], found[1][:, :-2])
    with pytest.MonkeyPatch.context() as patch:  # one time of the gust: the one checked here
        patch.setattr(gust_score, "TIMES", (1.0,))
        scored = score(gusty, end)

    def cost(square: float) -> float:
        logs = [0.5 * np.log(square), 0.0]
        moved, _ = gusty.residuals(np.concatenate([start, logs]), with_slopes=False)
        return float(moved @ moved)

    by_square = found[1][:, -2] / (2.0 * np.exp(-12.0))
    central = (cost(1.1e-5) - cost(0.9e-5)) / 2e-6
    assert_close(2.0 * by_square @ found[0], central, rtol=2e-3, why="slope at 6e-6, not 1e-5")
    # What the step of all unknowns would gain, less what the step without a gust would.
    both = np.column_stack([end.jacobian, by_square])
    left = [
        r @ r
        for r in (
            found[0] - j @ np.linalg.lstsq(j, found[0], rcond=1e-12)[0]
            for j in (both, end.jacobian)
        )
    ]
    wanted = problem.n_measured * (left[1] - left[0]) / end.cost
    assert_close(abs(scored.gain), wanted, rtol=1e-6, why="least squares by another way")


def test_a_gust_felt_as_the_velocity_is_found_and_unbends_its_derivatives() -> None:
    """SciPy's flight in Dryden's gust: white noise alone misses Zw by five standard errors."""
    record, starts, scored = gusts.flight(4, 1.0, 0.3), [], []
    kept, test = search.minimise, search.score
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "minimise", lambda *a, **b: starts.append(a[1]) or kept(*a, **b))
        patch.setattr(search, "score", lambda *a: scored.append(test(*a)) or scored[-1])
        fit = fid.identify(gusts.model(), record, method="filter_error")
    # Three candidates are told apart without a search: one of them alone is searched for.
    assert len(scored) == 3
    assert sorted(each.gain for each in scored)[1] < 4.0 < 30.0 < scored[0].gain
    tried = [x for x in starts if len(x) == len(scored[0].start)]
    assert np.array_equal(tried[0], scored[0].start)
    with pytest.MonkeyPatch.context() as patch:  # a step that leads nowhere: anew, hardly any noise
        patch.setattr(search, "minimise", lambda *a, **b: starts.append(a[1]) or kept(*a, **b))
        patch.setattr(search, "score", lambda *a: _led_astray(test(*a)))
        anew = fid.identify(gusts.model(), record, method="filter_error")
    begun = [each.value for each in gusts.model().parameters.free]
    assert any(np.array_equal(x[:5], begun) and np.all(x[5:7] < -6.0) for x in starts)
    for name in gusts.TRUTH:
        one, other = fit.parameters[name], anew.parameters[name]
        assert abs(one.value - other.value) < 0.01 * one.stderr
    white = fid.identify(gusts.model(), record, method="filter_error", gust_states=False)
    heave, bent = fit.parameters["Zw"], white.parameters["Zw"]
    truth = gusts.TRUTH["Zw"]
    assert abs(heave.value - truth) < 3.0 * heave.stderr < 0.2
    assert abs(bent.value - truth) > abs(heave.value - truth)
    assert bent.stderr is None  # inputs foretell what white noise leaves of the gust
    gust = fit.provenance["gust"]
    assert gust["state"] == "w"
    assert gust["outputs"] == ["az"]
    assert_close(gust["deviation"], 1.0, rtol=0.15, why="60 s of a gust of 1 m/s")
    assert fit.records[0].states["gust"].shape == (record.n_samples,)
    assert white.provenance["gust"] is None
    (said,) = (each for each in fit.findings if each.code.startswith("gust"))
    assert (said.code, str(said.light)) == ("gust-found", "green")
    assert said.message.startswith(f"a gust on w of {gust['deviation']:.3g} m/s")
    tests = fid.residual_tests(fit)
    assert tests.horizon == "one step ahead"
    assert all(test.counts for test in tests.tests)


def test_a_gust_beyond_severe_turbulence_is_red() -> None:
    fit = fid.identify(gusts.model(), gusts.flight(3, 12.0, 0.5, 20.0), method="filter_error")
    (said,) = (each for each in fit.findings if each.code == "gust-beyond-severe")
    assert str(said.light) == "red"
    assert "calls severe is 7.19 m/s" in said.message


def _led_astray(scored: Score) -> Score:
    """The same test, its step to where all noise is as large as it may be."""
    start = scored.start.copy()
    start[5:] = np.append(scored.problem.reach[:-2], [6.0, -6.0])
    return replace(scored, start=start)


def test_a_noise_that_is_none_refuses_no_fit_and_a_parameter_is_named() -> None:
    """A noise of nothing, "parameter 5 of 5", refused 6 flights of a stranger's gusty rolls."""
    random = np.random.default_rng(1)
    jacobian = random.standard_normal((40, 5))
    jacobian[:, 3] *= 1e-5
    jacobian[:, 4] = jacobian[:, 2]
    assert told_noises(jacobian, 2).tolist() == [True, True, True, False, False]
    assert told_noises(jacobian[:3], 2).tolist() == [True, True, True, False, False]
    jacobian[:, 1] = jacobian[:, 0]
    with pytest.raises(SingularError, match="found L_p; needed"):
        innovation_covariance([], np.zeros(40), jacobian[:, :3], ["p_0", "L_p"])
