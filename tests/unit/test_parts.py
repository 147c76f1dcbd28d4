"""Parts of data against analytic truth: their test, the scatter between them, the bars."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from flightid.conventions import Light
from flightid.evidence import Check, Evidence
from flightid.evidence.data_checks import loop_check
from flightid.evidence.part_checks import agreement_check, beside_loop
from flightid.uncertainty.agreement import Agreement, _freedom_of, _in_doubt, compare_parts
from flightid.uncertainty.blocks import RecordBlock, flights_of, noise_heard
from flightid.uncertainty.feedback_result import FeedbackTest
from flightid.uncertainty.parts import RecordParts, _freedom, chance_alike, larger, scatter
from flightid.uncertainty.quantiles import LEVEL, half_width
from flightid.uncertainty.residual_noise import Autoregression
from tests.closeness import assert_close
from tests.strangers.parts import arx_flown, by_arx, by_output_error, changed_midway, steps_flown

Array = NDArray[np.float64]


def _flights(means: Array, informations: Array) -> list[RecordParts]:
    """Records that each know a mean, scalar or not, with noise of unit variance."""
    total = informations.sum(axis=0)
    common = np.linalg.solve(total, np.einsum("kij,kj->i", informations, means))
    made = []
    for mean, information in zip(means, informations, strict=True):
        half = 0.5 * information
        noise = np.einsum("kl,ij->kilj", np.eye(2), half)
        made.append(
            RecordParts(np.tile(half @ (mean - common), (2, 1)), np.stack([half, half]), noise)
        )
    return made


def test_homogeneity_of_means_is_the_chi_square_of_analysis_of_variance() -> None:
    means, weights = np.array([1.0, 2.0, 4.0]), np.array([3.0, 1.0, 2.0])
    flights = [f.whole for f in _flights(means[:, None], weights[:, None, None])]
    centre = means @ weights / weights.sum()
    expected = stats.chi2.sf(np.sum(weights * (means - centre) ** 2), 2)
    assert_close(chance_alike(flights, np.inf), expected, rtol=1e-12, why="rounding")
    wide = stats.f.sf(np.sum(weights * (means - centre) ** 2) / 2, 2, 20.0)
    assert_close(chance_alike(flights, 20.0), wide, rtol=1e-12, why="rounding")


def test_scatter_of_equal_records_is_the_error_of_their_mean() -> None:
    random = np.random.default_rng(3)
    means = random.standard_normal((5, 2))
    information = np.array([[2.0, 0.5], [0.5, 1.0]])
    flights = [f.whole for f in _flights(means, np.tile(information, (5, 1, 1)))]
    spread = np.linalg.inv(5.0 * information)
    found = scatter(flights, spread, spread)
    assert_close(found.covariance, np.cov(means.T) / 5.0, rtol=1e-9, why="rounding")
    assert_close(found.freedom, [4.0, 4.0], rtol=1e-9, why="rounding")


def test_a_parameter_that_one_record_alone_sees_has_no_scatter() -> None:
    informations = np.array([np.diag([1.0, 1.0]), np.diag([1.0, 0.0]), np.diag([1.0, 0.0])])
    means = np.array([[0.0, 3.0], [1.0, 0.0], [2.0, 0.0]])
    flights = [f.whole for f in _flights(means, informations)]
    spread = np.linalg.inv(informations.sum(axis=0))
    found = scatter(flights, spread, spread)
    assert_close(
        found.covariance, [[1.0 / 3.0, 0.0], [0.0, 0.0]], rtol=1e-9, atol=1e-12, why="rounding"
    )
    assert_close(chance_alike(flights, np.inf), stats.chi2.sf(2.0, 2), rtol=1e-9, why="rounding")


def test_what_others_hardly_see_of_one_records_axis_widens_nothing() -> None:
    """Manoeuvres of one axis each, in gusts that a loop answers: bars were 208 times as long."""
    informations = np.array([np.diag([1.0, 1.0]), np.diag([1.0, 3e-3]), np.diag([1.0, 3e-3])])
    flights = _flights(np.array([[0.0, 0.0], [1.0, 200.0], [2.0, -150.0]]), informations)
    spread = np.linalg.inv(informations.sum(axis=0))
    found = compare_parts(flights, spread, spread, np.full(2, np.inf), by_halves=False)
    assert_close(found.agreement.records, stats.chi2.sf(2.0, 2), rtol=1e-9, why="the first alone")
    assert_close(found.covariance, spread, rtol=1e-9, why="rounding")
    assert agreement_check(found.agreement).limit.startswith("1 of 2 estimates are told by one")
    assert chance_alike([each.whole for each in flights], np.inf) < 1e-9


def test_the_larger_covariance_is_below_neither() -> None:
    random = np.random.default_rng(0)
    one, other = (a @ a.T for a in random.standard_normal((2, 4, 4)))
    both = larger(one, other)
    for less in (one, other):
        assert np.min(np.linalg.eigvalsh(both - less)) > -1e-9


def test_records_that_differ_carry_the_scatter_and_students_freedom() -> None:
    flights = _flights(np.array([[0.0], [10.0], [20.0]]), np.ones((3, 1, 1)))
    third = np.full((1, 1), 1.0 / 3.0)
    agreed = compare_parts(flights, third, third, np.array([np.inf]))
    assert_close(agreed.covariance, [[100.0 / 3.0]], rtol=1e-9, why="rounding")
    assert_close(agreed.freedom, [2.0], rtol=1e-9, why="rounding")
    assert agreement_check(agreed.agreement).light is Light.AMBER
    two = compare_parts(flights[:1] + flights[2:], third, third, np.array([np.inf]))
    assert agreement_check(two.agreement).light is Light.RED
    # "mass, trim" was said of one vehicle, whose loop bent each record by noise of its own.
    looped = beside_loop(
        agreement_check(two.agreement), loop_check(FeedbackTest("closed", "declared"))
    )
    assert looped.light is Light.RED
    assert looped.what.endswith("bends each by its own noise, which alone may set them apart")
    assert "mass" not in looped.action
    calm = agreement_check(agreed.agreement)
    assert beside_loop(calm, loop_check(FeedbackTest("open", "declared"))) == calm


@pytest.mark.parametrize("informations", [[1.0, 1.0], [4.0, 1.0, 1.0, 1.0]])
def test_scatter_in_doubt_of_few_has_the_freedom_of_the_noise(informations: list[float]) -> None:
    """Student's 12.7 of one freedom made bars 6.5 times as long of 9 in 100 sound fits."""
    weights = np.array(informations)[:, None, None]
    spread = 1.0 / weights.sum(axis=0)
    means = np.append(np.zeros(len(weights) - 1), 1.0)[:, None]
    for apart, agree in ((2.9, True), (8.0, False)):
        found = compare_parts(
            _flights(apart * means, weights), spread, spread, np.array([40.0]), by_halves=False
        )
        assert found.agreement.agree is agree
        assert found.agreement.by_scatter is not None
        said = agreement_check(found.agreement, np.array([100.0]))
        assert ("not beyond doubt" in said.limit) is agree
        if agree:
            # Of a pair the noise's; towards two degrees of freedom those of the scatter.
            share = _freedom(weights[:, 0, 0] / weights.sum()) - 1.0
            eased = 1.0 / (share / 2.0 + (1.0 - share) / 40.0)
            assert_close(found.freedom, [eased], rtol=1e-6, why="bisection of its interval")
        else:
            wide = stats.t.ppf(0.975, found.freedom) * np.sqrt(np.diag(found.covariance))
            assert found.agreement.freedom is not None
            of_scatter = stats.t.ppf(0.975, found.agreement.freedom) * found.agreement.by_scatter
            assert_close(wide, of_scatter, rtol=1e-6, why="noise lengthens no proven scatter")
            assert f"and to ±{wide[0]:.2g} %" in said.what


def test_weights_that_differ_by_a_hair_change_no_interval_at_once() -> None:
    """Three records of one weight took Student's 4.30 in doubt, of nearly one weight 1.96."""
    lengths = []
    for hair in (0.0, 0.05):
        weights = np.array([1.0, 1.0 + hair, 1.0 - hair])[:, None, None]
        spread = 1.0 / weights.sum(axis=0)
        found = compare_parts(
            _flights(np.array([[-1.7], [0.0], [1.7]]), weights),
            spread,
            spread,
            np.array([np.inf]),
            by_halves=False,
        )
        assert found.agreement.records is not None
        assert 0.01 < found.agreement.records < 0.1
        assert found.agreement.reach is not None
        lengths.append(found.agreement.reach[1])
    assert_close(lengths[1], lengths[0], rtol=0.1, why="a twentieth of the weight")


def test_halves_hold_the_same_information_where_the_tail_is_quiet() -> None:
    random = np.random.default_rng(4)
    shared = random.standard_normal((2, 1000, 3))
    shared[:, 200:] = 0.0
    block = RecordBlock.of(shared, np.ones((2, 1000, 1)), random.standard_normal((2, 1000)))
    white = [Autoregression(np.array([1.0]), np.empty(0), 1000, 0)] * 2
    (flight,) = flights_of(noise_heard(white, [block]), [block])
    shares = flight.information @ np.linalg.inv(flight.information.sum(axis=0))
    assert_close(np.trace(shares[0]), 1.5, rtol=0.02, why="a sample is a hundredth of a half")


def test_halves_that_differ_by_little_are_amber_with_the_wider_interval() -> None:
    noise, apart = np.array([0.01, 0.02]), np.array([0.1, 0.02])
    found = Agreement(1, 1e-9, None, noise, apart, reach=1.96 * np.array([noise, apart]))
    near = agreement_check(found, np.array([-5.0, 0.001]))
    assert near.light is Light.AMBER
    assert "up to 10 times and to ±3.9 %" in near.what
    assert agreement_check(found, np.array([-0.5, 1.0])).light is Light.RED
    assert agreement_check(found).light is Light.RED
    both = agreement_check(Agreement(2, 1e-9, 1e-4, noise))
    assert both.what.endswith("(p = 1e-09), and so do records (p = 0.0001)")


def test_one_record_says_that_it_cannot_know() -> None:
    found = agreement_check(Agreement(1, 0.5, None, np.ones(1)))
    assert found.light is Light.GREEN
    assert "One record does not tell how far flights differ" in found.limit
    # What to do stood nowhere, and the reason twice, where nothing could be compared.
    once = Evidence((agreement_check(Agreement(1, None, None, np.ones(1))),), ())
    assert once.lines[1].startswith("[not judged] flown once")
    assert once.lines[1].endswith(" — repeat the manoeuvre in a second record or segment")
    assert once.limits == ()
    evidence = Evidence((found,), ())
    assert evidence.lines == ("Light: green.", f"{found.limit}.")
    assert evidence.verdict.message.endswith(f"; {found.limit[0].lower()}{found.limit[1:]}")
    assert Check.from_dict(found.to_dict()) == found


def test_a_vehicle_that_changes_midway_is_red_and_its_bars_reach_both() -> None:
    same, changed = (
        by_output_error([changed_midway(np.random.default_rng(1), share)[0]])
        for share in (0.0, 0.2)
    )
    assert same.agreement is not None
    assert same.agreement.agree
    light = next(c.light for c in changed.evidence.checks if c.name == "agreement of parts")
    assert light is Light.RED
    low, high = changed.parameters["Lp"].interval95 or (0.0, 0.0)
    assert low < -3.3 < -2.7 < high
    assert changed.agreement is not None
    assert changed.agreement.factor > 3.0


def test_vehicles_apart_widen_bars_of_grey_and_black_boxes() -> None:
    random = np.random.default_rng(2)
    for flown, fitted in ((steps_flown, by_output_error), (arx_flown, by_arx)):
        fit = fitted([flown(random, 0.05)[0] for _ in range(3)])
        assert fit.agreement is not None
        assert fit.agreement.by_scatter is not None
        assert all((p.freedom or 99.0) < 3.0 for p in fit.parameters.values())


def test_alike_parts_have_one_degree_of_freedom_less_than_they_are() -> None:
    for n in (2, 5, 30):
        assert_close(_freedom(np.full(n, 1.0 / n)), n - 1.0, rtol=1e-9, why="a mean of n")
    assert _freedom(np.array([1.0, 0.0])) == 1.0
    assert _freedom(np.zeros(3)) == 1.0  # nothing is told
    assert _freedom(np.array([0.9, 0.05, 0.05])) < 1.1


def test_a_parameter_that_a_record_does_not_see_leaves_its_halves_alone() -> None:
    slopes = np.random.default_rng(7).standard_normal((2, 40, 2))
    unseen = np.concatenate([slopes, np.zeros((2, 40, 1))], axis=2)
    nothing, residual = np.zeros((2, 40, 0)), np.zeros((2, 40))
    with np.errstate(all="raise"):
        halves = [RecordBlock.of(each, nothing, residual).middle for each in (slopes, unseen)]
    assert halves[0] == halves[1]


def test_rounding_below_zero_is_no_noise_of_a_parameter() -> None:
    noise = np.einsum("kl,ij->kilj", np.eye(2), np.diag([1.0, -1e-18]))
    part = RecordParts(np.zeros((2, 2)), np.stack([np.diag([1.0, 0.0])] * 2), noise)
    with np.errstate(all="raise"):
        assert chance_alike([part], np.inf) is not None


def test_doubt_of_a_pair_beside_noise_that_is_known_warns_of_nothing() -> None:
    """Freedom without end met a share of none: NumPy's warning stood on the screen."""
    found = _in_doubt(np.array([1.0, 1.0, 5.0]), np.array([np.inf, 9.0, np.inf]))
    assert found.tolist() == [np.inf, 9.0, 5.0]


def test_degrees_of_freedom_are_those_of_the_width() -> None:
    for freedom in (3.0, 3.7, 11.0, 39.9):
        found = _freedom_of(half_width(LEVEL, freedom), 3.0, 40.0)
        assert_close(found, freedom, rtol=1e-7, why="widths to 1e-9")
    assert _freedom_of(100.0, 3.0, 40.0) == 3.0
    assert _freedom_of(1.0, 3.0, 40.0) == 40.0
