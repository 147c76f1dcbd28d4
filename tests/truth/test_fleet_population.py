"""What a type has in common: published numbers, brute force, and counted intervals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import erfinv

from flightid.errors import DataError
from flightid.fleet.statistics.errors_by_value import errors_at_the_type, relative_share
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.heterogeneity import VehicleEstimates
from flightid.fleet.statistics.population import Population, estimate_population
from flightid.fleet.statistics.restricted_likelihood import RestrictedLikelihood
from tests.bcg_trials import log_ratios


def _bcg() -> Population:
    trials, ratio, variance = log_ratios()
    return estimate_population(
        FlightEstimates.of(["log ratio"], trials, ratio[:, None], variance[:, None, None])
    )


def test_bcg_trials_give_the_published_numbers() -> None:
    """Viechtbauer, J. Stat. Softw. 36 (2010): REML, Knapp–Hartung, interval of τ² by Q."""
    found = _bcg()
    one = found.parameters["log ratio"]
    assert found.spreads.between[0, 0] == pytest.approx(0.3132, abs=5e-5)
    assert one.mean.value == pytest.approx(-0.7145, abs=5e-5)
    assert np.sqrt(found.spreads.mean_covariance[0, 0]) == pytest.approx(0.1798, abs=5e-5)
    assert one.mean.stderr == pytest.approx(0.18079, abs=5e-6)
    assert one.mean.freedom == 12
    assert one.inconsistency_percent == pytest.approx(92.22, abs=5e-3)
    assert np.square(one.spread.interval95) == pytest.approx([0.1197, 1.1115], abs=5e-5)
    assert one.chance_alike == pytest.approx(1.9968e-26, rel=1e-4)


def _flights(seed: int, k: int = 8, p: int = 3) -> FlightEstimates:
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 5, k)
    n = int(counts.sum())
    roots = rng.normal(size=(n, p, p + 1))
    return FlightEstimates.of(
        [*"abcdef"[:p]],
        np.repeat([f"{i:02}" for i in range(k)], counts).tolist(),
        rng.normal(size=(n, p)) + np.repeat(rng.normal(size=(k, p)), counts, 0),
        roots @ np.swapaxes(roots, 1, 2) / 5 + 0.1 * np.eye(p),
        known=rng.random((n, p)) > 0.15,
    )


def _brute_force(data: FlightEstimates, between: np.ndarray, within: np.ndarray) -> float:
    """The same cost by one matrix of all flights and parameters."""
    at = np.argwhere(data.known)
    vehicle = data.member_of[at[:, 0]]
    total = between[np.ix_(at[:, 1], at[:, 1])] * (vehicle[:, None] == vehicle)
    for a, (i, r) in enumerate(at):
        for b, (j, c) in enumerate(at):
            if i == j:
                total[a, b] += within[r, c] + data.covariances[i, r, c]
    design = np.eye(len(data.names))[at[:, 1]]
    y, inverse = data.values[data.known], np.linalg.inv(total)
    information = design.T @ inverse @ design
    left = y - design @ np.linalg.solve(information, design.T @ inverse @ y)
    return float(
        np.linalg.slogdet(total)[1] + left @ inverse @ left + np.linalg.slogdet(information)[1]
    )


def test_likelihood_and_slopes_are_those_of_one_matrix() -> None:
    data = _flights(1)
    likelihood = RestrictedLikelihood.of(data)
    between = np.array([[1.0, 0.3, 0.1], [0.3, 0.5, 0.0], [0.1, 0.0, 0.7]])
    within = 0.3 * np.eye(3) + 0.1
    at = likelihood.evaluate(between, within)
    assert at.cost == pytest.approx(_brute_force(data, between, within), rel=1e-10)
    for first, second in ((0, 0), (0, 1), (2, 1)):
        step = np.zeros((3, 3))
        step[first, second] += 5e-6
        step[second, first] += 5e-6
        for slope, moved in (
            (at.between_slope, ((between + step, within), (between - step, within))),
            (at.within_slope, ((between, within + step), (between, within - step))),
        ):
            up, down = (likelihood.evaluate(*spreads).cost for spreads in moved)
            assert slope[first, second] == pytest.approx((up - down) / 2e-5, abs=2e-6)


def test_a_spread_of_zero_is_found_and_few_vehicles_take_a_diagonal() -> None:
    rng = np.random.default_rng(4)
    covariance = np.array([[1.0, 0.9], [0.9, 1.0]])
    # Less scatter than the errors say, in every direction.
    values = 0.4 * rng.normal(size=(6, 2)) @ np.linalg.cholesky(covariance).T
    covariances = np.tile(covariance, (6, 1, 1))
    found = estimate_population(FlightEstimates.of(["a", "b"], [*"uvwxyz"], values, covariances))
    assert found.spreads.structure == "diagonal"
    assert np.all(found.spreads.between == 0.0)
    assert all(each.inconsistency_percent == 0.0 for each in found.parameters.values())


def test_a_parameter_of_one_vehicle_is_no_population() -> None:
    data = FlightEstimates.of(["a"], ["u", "u"], [[1.0], [2.0]], np.ones((2, 1, 1)))
    with pytest.raises(DataError, match="needs several vehicles"):
        estimate_population(data)


def test_estimates_without_a_variance_are_refused_by_name() -> None:
    with pytest.raises(DataError, match="Lp of flight 1: 0"):
        FlightEstimates.of(["Lp"], ["u", "v"], [[1.0], [2.0]], [[[1.0]], [[0.0]]])


def test_errors_that_go_with_the_estimate_leave_the_mean_where_it_is() -> None:
    """Errors of 30 % of each estimate made the mean of 20 low by 0.18, 2.7 of its errors."""
    scores = np.sqrt(2.0) * erfinv(np.linspace(-0.95, 0.95, 20))
    values, names = 10.0 * (1.0 + 0.3 * scores), [f"{i:02}" for i in range(20)]

    def mean(errors: np.ndarray) -> float:
        variances = np.square(errors)[:, None, None]
        return float(
            estimate_population(
                FlightEstimates.of(["a"], names, values[:, None], variances)
            ).spreads.mean[0]
        )

    assert mean(0.3 * values) == pytest.approx(10.0, abs=0.02)
    # Errors that have nothing to do with the estimates weigh them as stated.
    errors = np.tile([1.0, 3.0], 10) + 1e-3 * np.arange(20)
    weights = 1.0 / np.square(errors)
    assert mean(10.0 * errors) == pytest.approx(weights @ values / weights.sum(), abs=0.05)


def test_errors_about_zero_or_with_both_signs_are_taken_as_stated() -> None:
    _, ratio, variance = log_ratios()
    names = [f"{i:02}" for i in range(13)]
    data = FlightEstimates.of(["a"], names, ratio[:, None], variance[:, None, None])
    assert errors_at_the_type(data) is data
    sizes, one = np.log([1.0, 2.0, 4.0]), np.zeros(3, dtype=np.intp)
    assert relative_share(sizes, np.log([0.1, 0.2, 0.4]), one) == pytest.approx(1.0)
    assert relative_share(sizes, np.zeros(3), one) == pytest.approx(0.0)
    assert relative_share(np.zeros(3), np.zeros(3), one) == 0.5
    # Vehicles that differ, each with the errors that all have: nothing goes with its own flights.
    assert relative_share(np.repeat(sizes, 2), np.repeat(sizes, 2), np.repeat([0, 1, 2], 2)) == 0.5


def test_the_interval_of_a_mean_is_hartung_and_knapps_where_errors_are_alike() -> None:
    """And longer than by the likeliest spread alone where they are not."""
    values = np.array([1.0, 2.0, 4.0, 4.5, 6.0, 7.0])
    low, high = VehicleEstimates(values, np.full(6, 0.8)).mean_ends()
    half = 2.570582 * values.std(ddof=1) / np.sqrt(6)
    assert (low, high) == pytest.approx((values.mean() - half, values.mean() + half), rel=1e-5)
    apart = VehicleEstimates(np.array([1.0, 4.0, 9.0]), np.array([1.0, 9.0, 100.0]))
    ends = apart.mean_ends()
    mean, total, squares = apart.weighed(np.zeros(1))
    half = 4.302653 * float(np.sqrt(squares[0] / 2.0 / total[0]))
    assert ends[1] - ends[0] > 3.0 * half
    assert ends[0] < mean[0] < ends[1]
    # Two that agree by chance: 97.9 to 98.1 before, of errors of 1 each.
    low, high = VehicleEstimates(np.array([98.0, 97.984]), np.ones(2)).mean_ends()
    assert high - low == pytest.approx(2.0 * 1.959964 / np.sqrt(2.0), rel=1e-6)
    assert 0.5 * (low + high) == pytest.approx(97.992, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("spread", [1.0, 5.0, 10.0])
def test_the_mean_of_three_whose_errors_differ_tenfold_is_held(spread: float) -> None:
    """Errors 1, 3 and 10: by the likeliest spread alone in 83 to 91 % of 1,000 fleets."""
    rng, held, errors = np.random.default_rng(3), [], np.array([1.0, 3.0, 10.0])
    for _ in range(400):
        values = 100.0 + spread * rng.normal(size=3) + errors * rng.normal(size=3)
        low, high = VehicleEstimates(values, errors**2).mean_ends()
        held.append(low <= 100.0 <= high)
    assert 0.91 < np.mean(held) <= 1.0, np.mean(held)


def _coverage(k: int, spread: float, runs: int, seed: int) -> np.ndarray:
    """Shares of runs in which mean, spread and next vehicle lie in their intervals."""
    rng = np.random.default_rng(seed)
    hits = np.zeros(3)
    for _ in range(runs):
        variances = rng.uniform(0.3, 2.0, k)
        values = 10.0 + spread * rng.normal(size=k) + np.sqrt(variances) * rng.normal(size=k)
        data = FlightEstimates.of(
            ["a"], [f"{i:02}" for i in range(k)], values[:, None], variances[:, None, None]
        )
        one = estimate_population(data).parameters["a"]
        truths = (10.0, spread, 10.0 + spread * rng.normal())
        for place, (each, truth) in enumerate(
            zip((one.mean, one.spread, one.next_vehicle), truths, strict=True)
        ):
            low, high = each.interval95 or (np.inf, -np.inf)
            hits[place] += low <= truth <= high
    return hits / runs


def test_intervals_of_ten_vehicles_cover() -> None:
    found = _coverage(10, 1.0, 60, 1)
    assert np.all(found > 0.87), found
    assert np.all(found < 1.0), found


@pytest.mark.slow
@pytest.mark.parametrize("spread", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("k", [5, 10, 20])
def test_intervals_cover_as_often_as_they_say(k: int, spread: float) -> None:
    """Of 400 fleets: 93 to 97 %, with two errors of the count (1.1 %) to either side."""
    found = _coverage(k, spread, 400, 100 * k + int(10 * spread))
    assert np.all((found > 0.908) & (found < 0.992)), found


@pytest.mark.slow
@pytest.mark.parametrize("k", [5, 10, 20])
def test_intervals_of_a_type_without_spread_are_long_rather_than_short(k: int) -> None:
    found = _coverage(k, 0.0, 300, k)
    assert np.all(found > 0.915), found


def test_the_next_vehicle_of_a_known_spread_is_student() -> None:
    """Without errors of estimates: mean ± t(k − 1) s √(1 + 1/k), within 1 %."""
    values = np.array([1.0, 2.0, 4.0, 4.5, 6.0, 7.0])
    low, high = VehicleEstimates(values, np.full(6, 1e-9)).next_ends() or (0.0, 0.0)
    half = 2.570582 * values.std(ddof=1) * np.sqrt(7 / 6)
    assert 0.5 * (low + high) == pytest.approx(values.mean(), abs=1e-3)
    assert 0.5 * (high - low) == pytest.approx(half, rel=0.01)


def test_vehicles_that_agree_by_chance_do_not_bind_the_next() -> None:
    """With all confidence in no spread it ended at 5.82: fleets were held too seldom."""
    found = VehicleEstimates(np.array([0.2, 0.9, 2.0, 3.1, 3.8]), np.full(5, 2.0))
    assert found.chance_alike == pytest.approx(0.3485, abs=1e-4)
    assert found.next_ends() == pytest.approx((-2.061, 6.061), abs=2e-3)
    assert VehicleEstimates(np.full(5, 2.0), np.ones(5)).next_ends() is None
    # Estimates that agree by chance: the next one had 0.09 of the interval of the mean.
    agreeing = VehicleEstimates(np.array([98.0, 97.99, 98.01]), np.ones(3))
    (low, high), mean = agreeing.next_ends() or (0.0, 0.0), agreeing.mean_ends()
    assert low <= mean[0]
    assert high >= mean[1]


def _vehicles(kind: str, k: int, rng: np.random.Generator) -> np.ndarray:
    """Vehicles of mean 0 and spread 1, of another shape than normal."""
    if kind == "bimodal":
        return (rng.choice([-1.0, 1.0], k) + 0.2 * rng.normal(size=k)) / np.sqrt(1.04)
    if kind == "skewed":
        return (rng.gamma(2.0, 1.0, k) - 2.0) / np.sqrt(2.0)
    return rng.standard_t(5, k) / np.sqrt(5.0 / 3.0)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "least"), [("bimodal", 0.93), ("skewed", 0.89), ("heavy", 0.89)])
def test_spreads_of_vehicles_that_are_not_normal_are_held_nearly_as_often(
    kind: str, least: float
) -> None:
    """Of 300 fleets of 10: as if normal, skewed ones were held in 88 % and heavy ones in 89 %."""
    rng, hits = np.random.default_rng(7), np.zeros(2)
    for _ in range(300):
        variances = rng.uniform(0.1, 0.5, 10)
        values = _vehicles(kind, 10, rng) + np.sqrt(variances) * rng.normal(size=10)
        found = VehicleEstimates(values, variances)
        following = found.next_ends() or (0.0, 0.0)
        for place, (ends, truth) in enumerate(
            ((found.spread_ends(), 1.0), (following, float(_vehicles(kind, 1, rng)[0])))
        ):
            hits[place] += ends[0] <= truth <= ends[1]
    assert hits[0] / 300 >= least
    assert hits[1] / 300 >= 0.89


def test_a_vehicle_far_out_makes_the_interval_of_the_spread_longer() -> None:
    even = np.linspace(-1.5, 1.5, 10)
    odd = even.copy()
    odd[-1] = 8.0
    for values, grows in ((even, False), (odd, True)):
        found = VehicleEstimates(values, np.full(10, 0.01))
        as_normal = np.sqrt(found.spread_quantiles(np.array([0.025, 0.975])))
        low, high = found.spread_ends()
        assert (high > 1.2 * as_normal[1]) == grows
        assert (low < 0.9 * as_normal[0]) == grows
