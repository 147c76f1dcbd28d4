"""Fits of polynomial structures: recovery, options, findings and refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError, FitError, OptionError, UnitError
from flightid.identification.prediction_error import search
from flightid.identification.prediction_error.starts import polynomial_starts
from flightid.models.sampled.channels import gather_channels
from tests.closeness import assert_close
from tests.polynomial_records import ARMAX, TWO_INPUTS, flown

P = fid.PolynomialModel


def _codes(fit):
    return {finding.code for finding in fit.findings}


@pytest.mark.parametrize("initial", ["estimate", "zero"])
def test_arx_recovers_a_noise_free_system_to_machine_precision(initial):
    record = flown(ARMAX, 0, warm_up=0 if initial == "zero" else 300)
    asked = P.arx("u", "y", na=2, nb=2, offsets="none", initial_state=initial)
    fit = fid.identify(asked, record)
    assert_close(fit.model.theta, [-1.5, 0.7, 1.0, 0.5], atol=1e-13, why="rounding")


@pytest.mark.parametrize(
    "asked",
    [
        P.oe("u", "y", nb=1, nf=1),
        P.bj("u", "y", nb=1, nf=1, nc=1, nd=1),
        P.arx("u", "y", na=1, nb=1),
        P.arx("u", "y", na=1, nb=1, method="iv4"),
    ],
    ids=lambda structure: f"{structure.kind} {structure.method}",
)
def test_a_mean_is_no_trim_where_a_record_begins_away_from_its_working_point(asked):
    """y = 20 + 4 (1 - p)/(q - p) u, switched on at u = 5: means lie off the steady line."""
    u = 5.0 + np.repeat(np.random.default_rng(0).standard_normal(15), 20)
    y = 20.0 + lfilter([0.0, 0.4], [1.0, -0.9], u)
    record = fid.Record.from_arrays(
        np.arange(300) * 0.1, inputs={"u": u}, outputs={"y": y}, hold="zero"
    )
    fit = fid.identify(asked, record)
    assert_close(fit.details.gains["y/u"].value, 4.0, rtol=1e-6, why="no noise")
    point = fit.model.operating_point
    assert_close(point["y"], 20.0 + 4.0 * point["u"], rtol=1e-6, why="a point on the steady line")


@pytest.mark.parametrize(
    "asked",
    [
        P.armax("u", "y", na=2, nb=2, nc=2, offsets="none"),
        P.oe("u", "y", nb=2, nf=2, offsets="none"),
        P.bj("u", "y", nb=2, nf=2, nc=1, nd=1, offsets="none"),
        P.arx("u", "y", na=2, nb=2, offsets="none", method="iv4"),
    ],
    ids=lambda structure: f"{structure.kind} {structure.method}",
)
def test_every_structure_recovers_the_noise_free_plant(asked):
    fit = fid.identify(asked, [flown(ARMAX, 1), flown(ARMAX, 2)])
    above, below = fit.model.transfer("u")
    assert_close(above, [0.0, 1.0, 0.5], atol=1e-9, why="rounding through the iteration")
    assert_close(below, [1.0, -1.5, 0.7], atol=1e-9, why="rounding through the iteration")


def test_two_inputs_with_their_own_denominators_and_delays_are_recovered():
    asked = P.oe(["u", "v"], "y", nb=[2, 3], nf=[2, 1], nk=[1, 3], offsets="none")
    fit = fid.identify(asked, flown(TWO_INPUTS, 3))
    wanted = [1.0, 0.5, 0.3, -0.2, 0.1, -1.5, 0.7, -0.6]
    assert_close(fit.model.theta, wanted, atol=1e-9, why="rounding through the iteration")
    assert list(fit.parameters) == [
        "b1[u]", "b2[u]", "b3[v]", "b4[v]", "b5[v]", "f1[u]", "f2[u]", "f1[v]",
    ]  # fmt: skip


@pytest.mark.parametrize("past", ["estimate", "zero", "backcast"])
def test_box_jenkins_with_noise_lies_within_its_errors(past):
    start = {"backcast": True} if past == "backcast" else {"initial_state": past}
    asked = P.bj(["u", "v"], "y", nb=[2, 3], nf=[2, 1], nk=[1, 3], nc=1, nd=1, **start)
    warm_up = 0 if past == "zero" else 300
    records = [flown(TWO_INPUTS, s, n=1500, noise=0.2, warm_up=warm_up) for s in (4, 5)]
    fit = fid.identify(asked, records)
    truth = TWO_INPUTS.theta
    errors = np.array([p.stderr for p in fit.parameters.values()])
    assert np.all(np.abs(fit.model.theta - truth) < 4.0 * errors)
    assert_close(fit.model.noise_variance, 0.04, rtol=0.1, why="3000 samples")
    assert fit.termination in ("gradient", "step", "cost")


def test_the_minimum_has_no_gradient_and_the_errors_belong_to_it():
    record = flown(ARMAX, 6, n=500, noise=0.5)
    fit = fid.identify(
        P.armax("u", "y", na=2, nb=2, nc=2, initial_state="zero", offsets="none"), record
    )

    def loss(theta):
        point = fit.model.operating_point
        model = P.from_theta(fit.structure, theta, 0.1, operating_point=point)
        return np.sum(fid.predict(model, record, 1, initial_state="zero").residual("y") ** 2)

    here = loss(fit.model.theta)
    assert_close(here, fit.details.criteria.loss * 500, rtol=1e-12, why="the same errors")
    step = 1e-5
    for k in range(6):
        there = [loss(fit.model.theta + sign * step * np.eye(6)[k]) for sign in (1, -1)]
        assert abs(there[0] - there[1]) / (2 * step) < 1e-4 * here
        assert min(there) > here


def test_wrong_delay_and_right_delay_are_told_apart_by_the_loss():
    record = flown(TWO_INPUTS, 7, noise=0.1)
    losses = [
        fid.identify(P.arx(["u", "v"], "y", na=4, nb=4, nk=[1, k]), record).details.criteria.loss
        for k in (1, 3, 5)
    ]
    assert losses[1] < losses[2]


def test_regularised_arx_is_closer_to_the_truth_than_least_squares():
    records = [flown(ARMAX, seed, n=200, noise=1.0) for seed in (11, 12, 13)]
    omega = np.geomspace(0.3, 30.0, 60)
    truth = ARMAX.frequency_response(omega)

    def fits(**options):
        return [fid.identify(P.arx("u", "y", na=15, nb=15, **options), r) for r in records]

    def miss(found):
        return sum(np.linalg.norm(fit.model.frequency_response(omega) - truth) for fit in found)

    plain = fits()
    assert "few-samples" in _codes(plain[0])
    for kernel in ("tc", "dc"):
        smooth = fits(kernel=kernel)
        assert miss(smooth) < 0.75 * miss(plain)
        assert smooth[0].termination == "kernel"
        assert "few-samples" not in _codes(smooth[0])


def test_instruments_are_consistent_where_least_squares_is_not():
    truth = P(("u",), "y", 0.1, b=[[1.0, 0.5]], f=[[1, -1.5, 0.7]], d=[1, -0.9])
    records = [flown(truth, seed, n=3000, noise=0.5) for seed in (9, 10)]
    plain = fid.identify(P.arx("u", "y", na=2, nb=2), records)
    fit = fid.identify(P.arx("u", "y", na=2, nb=2, method="iv4"), records)
    errors = np.array([p.stderr for p in fit.parameters.values()])
    wanted = np.array([-1.5, 0.7, 1.0, 0.5])
    assert np.all(np.abs(fit.model.theta - wanted) < 4.0 * errors)
    assert np.any(np.abs(plain.model.theta - wanted) > 10.0 * errors)


def test_a_pole_that_a_zero_cancels_is_named():
    fit = fid.identify(P.armax("u", "y", na=3, nb=3, nc=2), flown(ARMAX, 12, n=800, noise=0.3))
    assert "pole-zero-cancellation" in _codes(fit)
    barred = {name for name, each in fit.parameters.items() if each.stderr is not None}
    assert barred == {"c1", "c2"}, "bars of what cancels are not Gaussian"
    bare = [root for root in fit.details.roots if root.covariance is None]
    assert {root.kind for root in bare} == {"pole", "zero"}
    assert all(root.natural_frequency.stderr is None for root in bare if root.natural_frequency)
    good = fid.identify(P.armax("u", "y", na=2, nb=2, nc=2), flown(ARMAX, 12, n=800, noise=0.3))
    assert not _codes(good) & {"pole-zero-cancellation", "overfit", "not-converged"}
    truth = P(("u",), "y", 0.1, a=[1, -0.4733], b=[[0.02, 0.09]])
    anywhere = fid.identify(P.arx("u", "y", na=1, nb=2), flown(truth, 0, n=120, noise=0.5))
    (zero,) = (root.z.real for root in anywhere.details.roots if root.kind == "zero")
    assert abs(zero) > 5.0
    assert "pole-zero-cancellation" not in _codes(anywhere), "its error is as large as itself"
    over = fid.identify(P.armax("u", "y", na=2, nb=2, nc=4), flown(ARMAX, 12, n=800, noise=0.3))
    assert "overfit" in _codes(over)


def test_noise_zeros_at_the_circle_are_named_and_kept_inside():
    truth = P(("u",), "y", 0.1, a=[1, -0.5], b=[[1.0]], c=[1, -1.0])
    fit = fid.identify(
        P.armax("u", "y", na=1, nb=1, nc=1, initial_state="zero"),
        flown(truth, 12, n=300, noise=0.5, warm_up=0),
    )
    assert abs(fit.model.c[1]) < 1.0
    flipped = P(("u",), "y", 0.1, a=[1, -0.5], b=[[1.0]], c=[1, -2.0])
    fit = fid.identify(P.armax("u", "y", na=1, nb=1, nc=1), flown(flipped, 12, n=900, noise=0.5))
    # A zero outside has the same spectrum as its reflection.
    assert_close(fit.model.c[1], -0.5, atol=0.15, why="900 samples")


def test_an_unstable_plant_is_legal_and_can_be_held_stable():
    truth = P(("u",), "y", 0.1, a=[1, -1.005], b=[[1.0]])
    record = flown(truth, 13, n=300, noise=0.3, warm_up=0)
    fit = fid.identify(P.arx("u", "y", na=1, nb=1, offsets="none"), record)
    assert fit.model.a[1] < -1.0
    assert "unstable-model" in _codes(fit)
    held = fid.identify(P.arx("u", "y", na=1, nb=1, offsets="none", enforce_stability=True), record)
    assert held.model.a[1] > -1.0
    assert "stability-enforced" in _codes(held)
    with pytest.raises(FitError, match="cannot be run backwards"):
        fid.identify(P.arx("u", "y", na=1, nb=1, offsets="none", backcast=True), record)


def test_roots_gains_and_modes_carry_intervals():
    fit = fid.identify(
        P.armax("u", "y", na=2, nb=2, nc=2, offsets="none"),
        [flown(ARMAX, s, n=1500, noise=0.5) for s in (14, 15)],
    )
    (mode,) = fit.details.modes
    truth = ARMAX.modes()["y/u"][0]
    for found, wanted in (
        (mode.natural_frequency, truth.natural_frequency_rad_s),
        (mode.damping, truth.damping),
        (fit.details.gains["y/u"], 7.5),
    ):
        assert abs(found.value - wanted) < 4.0 * found.stderr
    step = 1e-6
    for k in range(fit.model.theta.size):
        moved = P.from_theta(fit.structure, fit.model.theta + step * np.eye(6)[k], 0.1)
        pole = moved.modes()["y/u"][0].z
        assert_close((pole - mode.z) / step, mode.gradient[k], atol=1e-4, why="difference")
    table = fit.details.roots_table().to_text()
    assert "zero" in table
    assert "±" in table


def test_a_fit_states_horizon_and_initial_state_and_keeps_everything_plain():
    fit = fid.identify(P.armax("u", "y", na=2, nb=2, nc=1), flown(ARMAX, 16, noise=0.2, offset=3.0))
    text = fit.summary().to_text()
    assert "one step ahead from an estimated state" in text
    assert "free run from an estimated state" in text
    values = fit.to_dict()
    assert values["schema"] == "flightid.fit/1"
    assert values["details"]["criteria"]["n_parameters"] == 5
    assert values["provenance"]["offsets"][0]["y"] == pytest.approx(3.0, abs=1.0)
    again = P.from_dict(values["model"])
    np.testing.assert_array_equal(again.covariance, fit.covariance)
    assert "free-run fit" in repr(fit)
    assert "<table" in fit._repr_html_()
    assert fid.predict(fit.model, flown(ARMAX, 17, offset=3.0), "free_run").rms_error["y"] < 1.0


def test_starts_are_systematic_first_then_random_and_reproducible():
    asked = P.armax("u", "y", na=2, nb=2, nc=3, starts=6, seed=5)
    data = gather_channels([flown(ARMAX, 18, noise=0.5)], "y", ("u",), "mean")
    one, two = polynomial_starts(asked, data), polynomial_starts(asked, data)
    assert one.shape == (6, 7)
    np.testing.assert_array_equal(one, two)
    fit = fid.identify(asked, flown(ARMAX, 18, noise=0.5))
    assert sum(m.count for m in fit.minima) <= 6
    assert fit.minima[0].objective == min(m.objective for m in fit.minima)


def test_output_error_of_a_slow_mode_ends_at_the_least_squares() -> None:
    """In coarse noise regressions in lags all led to one minimum, 2 log L of 7 to 20 too low."""
    above, below = [0.0, 0.3, 0.5], np.poly([0.9, 0.82 + 0.2j, 0.82 - 0.2j])
    asked = P.oe("u", "y", nb=2, nf=3, nk=1)
    for seed in (0, 3, 30, 38):
        rng = np.random.default_rng(seed)
        u = np.repeat(rng.choice([-1.0, 1.0], 51), 4)[:200]
        clean = lfilter(above, below, u)
        y = clean + 0.4 * clean.std() * rng.standard_normal(200)
        record = fid.Record.from_arrays(
            0.05 * np.arange(200), inputs={"u": u}, outputs={"y": y}, units={"u": "1", "y": "1"}
        )
        at_truth = fid.identify(
            replace(asked, start=(0.3, 0.5, *map(float, below[1:])), starts=1), record
        )
        fit = fid.identify(asked, record)
        assert fit.minima[0].objective <= at_truth.minima[0].objective * (1.0 + 1e-6)


def test_output_error_has_as_many_starts_as_are_asked_for() -> None:
    """20 starts had been two, the same as 4."""
    asked = P.oe("u", "y", nb=2, nf=3, nk=1, starts=20)
    data = gather_channels([flown(ARMAX, 18, noise=0.5)], "y", ("u",), "mean")
    starts = polynomial_starts(asked, data)
    assert starts.shape == (19, 5)
    assert len({tuple(each) for each in starts}) == 19
    for start in starts[2:]:
        assert np.max(np.abs(np.roots([1.0, *start[2:]]))) < 1.0


def test_a_start_that_comes_near_a_known_end_ends_there() -> None:
    asked = P.armax("u", "y", na=2, nb=2, nc=2, starts=6, seed=5)
    data = gather_channels([flown(ARMAX, 18, noise=0.5)], "y", ("u",), "mean")
    starts = polynomial_starts(asked, data)
    alone = [search._outcomes(asked, data, start[None], [], 0)[0] for start in starts]
    ends = search._outcomes(asked, data, starts, [], 0)
    assert all(not isinstance(end, str) for end in (*alone, *ends))
    theta, cost, triangle = ends[0][0], ends[0][1], ends[0][2].reshape(len(starts[0]), -1).T
    error = np.sqrt(cost / data.output.size)
    shared = [k for k in range(1, 6) if np.array_equal(ends[k][0], theta)]
    assert len(shared) >= 3
    for k in shared:
        away = triangle @ (alone[k][0] - theta)
        assert_close(away / error, 0.0, atol=1e-3, why="both ends are the same minimum")
        assert ends[k][3] < alone[k][3]


def test_few_iterations_are_reported():
    asked = P.armax("u", "y", na=2, nb=2, nc=2, maximum_iterations=1, starts=1)
    fit = fid.identify(asked, flown(ARMAX, 19, noise=0.5))
    assert "not-converged" in _codes(fit)


def test_time_series_without_input():
    truth = P((), "y", 0.1, a=[1, -1.2, 0.5], c=[1, 0.4])
    fit = fid.identify(P.armax((), "y", na=2, nb=0, nc=1), flown(truth, 20, n=3000, noise=1.0))
    errors = np.array([p.stderr for p in fit.parameters.values()])
    assert np.all(np.abs(fit.model.theta - truth.theta) < 4.0 * errors)


def test_data_that_cannot_be_fitted():
    record = flown(ARMAX, 21)
    constant = record.replace({"u": np.full(400, 2.5)})
    asked = P.arx("u", "y", na=2, nb=2)
    with pytest.raises(DataError, match=r"channel 'u' is constant: found 2\.5 from 0 to [\d.]+ s"):
        fid.identify(asked, constant)
    with pytest.raises(DataError, match="too few samples for the orders"):
        fid.identify(asked, flown(ARMAX, 21, n=8))
    with pytest.raises(FitError, match="there is no fit for this model and these data"):
        fid.identify(asked, [])
    twice = fid.Record.from_arrays(
        record.time_s,
        inputs={"u": record["u"], "v": record["u"]},
        outputs={"y": record["y"]},
        units={"y": "rad"},
    )
    with pytest.raises(DataError, match=r"b1\[v\] is a combination"):
        fid.identify(P.arx(["u", "v"], "y", na=2, nb=2), twice)
    tone = record.replace({"u": np.sin(0.5 * np.arange(400))})
    with pytest.raises(DataError, match="cannot tell the coefficients apart"):
        fid.identify(P.arx("u", "y", na=0, nb=4, offsets="none"), tone)
    other = fid.Record.from_arrays(
        np.arange(400) / 20, inputs={"u": record["u"]}, outputs={"y": record["y"]},
        units={"y": "rad"},
    )  # fmt: skip
    with pytest.raises(DataError, match="different sample times"):
        fid.identify(asked, [record, other])
    degrees = fid.Record.from_arrays(
        record.time_s, inputs={"u": record["u"]}, outputs={"y": record["y"]}, units={"y": "deg"}
    )
    with pytest.raises(UnitError, match="another unit in another record"):
        fid.identify(asked, [record, degrees])


@pytest.mark.parametrize(
    ("asked", "lengths"),
    [
        # Each record gives its samples less the longest lag, less one for its own level.
        (P.arx(["u", "v"], "y", na=3, nb=1), (4, 4, 9)),
        # The noise model of instruments costs each record one more.
        (P.arx(["u"], "y", na=1, nb=1, method="iv4"), (4, 4)),
    ],
    ids=["least squares", "instruments"],
)
def test_coefficients_that_leave_no_errors_are_refused(asked, lengths):
    random = np.random.default_rng(0)

    def record(n):
        u, v, y = random.standard_normal((3, n))
        return fid.Record.from_arrays(
            0.1 * np.arange(n), inputs={"u": u, "v": v}, outputs={"y": y}, hold="zero"
        )

    with pytest.raises(DataError, match="leave no errors"):
        fid.identify(asked, [record(n) for n in lengths], loop="open")
    # One sample more in a record leaves one error: bars, and none of them nothing.
    fit = fid.identify(asked, [record(n) for n in (*lengths[:-1], lengths[-1] + 1)], loop="open")
    assert all(each.stderr > 1e-9 for each in fit.parameters.values())


def test_instruments_that_fail_say_so():
    record = flown(ARMAX, 22)
    twice = record.replace({"u": np.sin(0.5 * np.arange(400))})
    with pytest.raises(DataError, match="apart"):
        fid.identify(P.arx("u", "y", na=3, nb=4, method="iv4", offsets="none"), twice)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: P.arx("u", "y", na=-1, nb=2), "na is outside"),
        (lambda: P.arx("u", "y", na=0, nb=0), "no coefficients"),
        (lambda: P.arx(["u", "y"], "y", na=1, nb=1), "named twice"),
        (lambda: P.arx(["u", "v"], "y", na=1, nb=[1]), "nb does not fit"),
        (lambda: P.oe("u", "y", nb=0, nf=2), "denominator alone"),
        (lambda: P.armax("u", "y", na=1, nb=1, nc=1, method="iv4"), "belong to ARX"),
        (lambda: P.arx("u", "y", na=1, nb=1, kernel="tc", method="iv4"), "stands alone"),
        (lambda: P.arx("u", "y", na=1, nb=1, initial_state="guess"), "initial_state is not known"),
        (
            lambda: P.arx("u", "y", na=1, nb=1, initial_state="zero", backcast=True),
            "backcast estimates the initial state",
        ),
        (lambda: P.arx("u", "y", na=1, nb=1, starts=0), "starts is too small"),
    ],
)
def test_structures_outside_their_range(make, words):
    with pytest.raises(OptionError, match=words):
        make()


def test_kernels_too_need_samples():
    with pytest.raises(DataError, match="too few samples for the orders"):
        fid.identify(P.arx("u", "y", na=20, nb=20, kernel="tc"), flown(ARMAX, 23, n=60))


def test_frequency_domain_options_are_refused():
    with pytest.raises(OptionError, match="no such option"):
        fid.identify(P.arx("u", "y", na=1, nb=1), flown(ARMAX, 24), starts=3)


def test_swapped_inputs_and_outputs_are_refused():
    with pytest.raises(OptionError, match="swapped"):
        fid.identify(P.arx("y", "u", na=2, nb=2), flown(ARMAX, 1))


def test_a_regression_needs_no_search_to_be_settled():
    fit = fid.identify(P.arx("u", "y", na=2, nb=2), flown(ARMAX, 1, noise=0.1))
    settled = next(check for check in fit.evidence.checks if check.name == "estimator settled")
    assert (settled.light.value, settled.what) == ("green", "solved without a search")
