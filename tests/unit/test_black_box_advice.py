"""Advice, pulse responses, and residual tests of polynomial fits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.conventions import Light
from flightid.errors import DataError, FitError, OptionError
from flightid.evidence import FeedbackTest
from flightid.identification.advice.advice import _delays
from flightid.identification.advice.delays import delays_to_scan
from flightid.identification.prediction_error.linear_regression import (
    LinearRegression,
    regress,
    regress_lags,
)
from flightid.plot import polynomial as plot
from flightid.record.history import Step
from flightid.uncertainty.feedback_result import unless_logged
from tests.closeness import assert_close
from tests.polynomial_records import ARMAX, TWO_INPUTS, flown

P = fid.PolynomialModel


def _codes(item):
    return {finding.code for finding in item.findings}


@pytest.mark.parametrize("levels", [True, False])
def test_products_of_lags_give_the_triangle_s_regression(levels):
    random = np.random.default_rng(0)
    inputs = lfilter([1.0], [1.0, -0.7], random.standard_normal((2, 700)))
    output, lengths, order = 2.0 + random.standard_normal(700), [300, 400], 60
    found = regress_lags(output, inputs, lengths, order, order + 4, levels=levels)
    known = regress(output, inputs, lengths, 0, [order] * 2, [0] * 2, order + 4, levels=levels)
    assert found.n_rows == known.n_rows
    assert_close(found.theta, known.theta, why="the same normal equations", rtol=1e-9)
    assert_close(found.sum_of_squares, known.sum_of_squares, why="the last pivot", rtol=1e-10)
    equal = regress_lags(output, np.vstack([inputs[:1]] * 2), lengths, order, order, levels=levels)
    assert equal.dependent is not None


@pytest.mark.parametrize("levels", [True, False])
def test_an_autoregression_by_products_is_that_of_the_triangle(levels):
    output, none = np.random.default_rng(0).standard_normal(2000), np.empty((0, 2000))
    given = lfilter([1.0], [1.0, -0.9], output) + 3.0, none, [1200, 800], 20, [], []
    found, known = regress(*given, levels=levels), regress(*given, 20, levels=levels)
    assert found.n_rows == known.n_rows
    assert_close(found.theta, known.theta, why="the same normal equations", rtol=1e-9)
    assert_close(found.sum_of_squares, known.sum_of_squares, why="the last pivot", rtol=1e-12)


def test_a_regression_without_finite_numbers_is_a_typed_error():
    ran_away = LinearRegression(np.zeros(2), np.full((3, 3), np.nan), 10, None)
    with pytest.raises(FitError, match="a regression ran away"):
        _ = ran_away.shortest


def test_pulse_responses_recover_the_model_and_its_delays():
    record = flown(TWO_INPUTS, 0, n=1200, noise=0.1)
    found = fid.impulse_response(record, n_lags=50)
    assert found.delays == {"u": 1, "v": 3}
    pulse = np.eye(1, 50)[0]
    for i, name in enumerate(TWO_INPUTS.inputs):
        truth = lfilter(*TWO_INPUTS.transfer(name), pulse)
        assert np.mean(np.abs(found.values[i] - truth) < 1.96 * found.stderr[i]) > 0.85
        step, error = found.step()
        assert np.all(np.abs(step[i] - np.cumsum(truth)) < 5 * error[i])
    text = found.summary().to_text()
    assert "delay" in text
    assert found.to_dict()["schema"] == "flightid.impulse_response/1"
    assert len(plot.impulse_response(found, "v").data) == 6
    assert "delay 3" in repr(found)


def test_intervals_of_pulse_responses_hold_for_coloured_noise():
    inside = []
    truth = lfilter(*ARMAX.transfer("u"), np.eye(1, 40)[0])
    coloured = P(("u",), "y", 0.1, a=ARMAX.a, b=ARMAX.b, c=np.convolve(ARMAX.a, [1, 0.9]))
    for seed in range(20):
        found = fid.impulse_response(flown(coloured, seed, n=900, noise=0.5))
        inside.append(np.abs(found.values[0] - truth) < 1.96 * found.stderr[0])
    # 800 values in dependent rows: 95 % ± 3 %.
    assert 0.92 < np.mean(inside) < 0.98


@pytest.mark.parametrize("kernel", ["tc", "dc"])
def test_a_kernel_smooths_a_short_record(kernel):
    quick = P(("u",), "y", 0.1, a=[1, -0.6], b=[[0.5]], c=[1, -0.6])
    truth = lfilter(*quick.transfer("u"), np.eye(1, 40)[0])
    miss = np.zeros(2)
    for seed in range(4):
        record = flown(quick, seed, n=220, noise=0.5)
        for place, each in enumerate((None, kernel)):
            found = fid.impulse_response(record, kernel=each)
            miss[place] += np.linalg.norm(found.values[0] - truth)
    assert miss[1] < 0.5 * miss[0]


def test_a_slow_pole_outlasts_the_lags():
    rng = np.random.default_rng(1)
    u = np.repeat(np.sign(rng.standard_normal(401)), 2)[:800]
    y = lfilter([0.0, 0.0, 0.1, 0.05], [1.0, -0.99], u) + 0.1 * rng.standard_normal(800)
    record = fid.Record.from_arrays(np.arange(800) / 20, inputs={"u": u}, outputs={"y": y})
    found = fid.impulse_response(record)
    assert found.covariance is None
    assert "outlasts" in found.reason


@pytest.mark.parametrize("seed", [95, 164])
def test_an_end_that_more_lags_do_not_bear_out_is_none(seed):
    """A light mode of steady size: 80 lags took its tail into the lags before and seemed to end."""
    record = light_mode(seed)
    found = fid.impulse_response(record)
    assert found.fitted_lags > 80
    assert found.covariance is None


def light_mode(seed: int) -> fid.Record:
    """Output of a mode that keeps .997 of its size a sample, with white noise."""
    random, t = np.random.default_rng(seed), np.arange(3000) * 0.05
    u = np.repeat(random.standard_normal(750), 4) + 0.3 * random.standard_normal(3000)
    y = lfilter([0.0, 1.0], [1.0, -2.0 * 0.997 * np.cos(0.15), 0.997**2], u)
    y += 0.1 * y.std() * random.standard_normal(3000)
    return fid.Record.from_arrays(t, inputs={"u": u}, outputs={"y": y})


def test_advice_on_a_good_record():
    advice = fid.advise(flown(ARMAX, 2, n=1200, noise=0.3))
    assert advice.excitation_orders == {"u": 50}
    assert advice.delays == {"u": 1}
    assert _codes(advice) == {"delay", "sampling-rate"}
    assert "excitation order 50" in repr(advice)
    assert advice.to_dict()["schema"] == "flightid.advice/1"
    assert "No loop seen: past noise of the outputs" in advice.summary().to_text()


def held(kind: str) -> fid.Record:
    """A rate that a controller steadies, late by a sample: three later it answers, or never."""
    random, n = np.random.default_rng(5), 3000
    gust = 0.02 * lfilter([1.0], [1.0, -0.97], random.standard_normal(n))
    seen = 0.002 * random.standard_normal(n)
    y, u = np.zeros(n), np.zeros(n)
    for k in range(3, n):
        y[k] = 0.95 * y[k - 1] + 0.05 * u[k - 3] + gust[k] if kind == "late" else 0.0
        u[k] = -2.0 * (y[k - 1] if kind == "late" else seen[k])
    return fid.Record.from_arrays(0.01 * np.arange(n), inputs={"u": u}, outputs={"y": y + seen})


@pytest.mark.parametrize("kind", ["late", "bench"])
def test_no_delay_or_rate_is_told_of_a_controller_turned_round(kind: str) -> None:
    """Green: "after 0 samples: nk = 0", "sampled too slowly", of three samples or of none."""
    record = held(kind)
    advice = fid.advise(record)
    codes = _codes(advice)
    assert advice.feedback.may_turn_round, advice.feedback
    assert advice.delays == {"u": None}
    assert "answer-untold" in codes
    assert not codes & {"delay", "delay-unsure", "sampling-rate", "sampled-slowly"}
    assert Light.GREEN not in {each.light for each in advice.findings}
    (untold,) = (each for each in advice.findings if each.code == "answer-untold")
    assert "name what was injected where the file holds it (excitations)" in untold.action
    (untold,) = _delays("y", advice.acts_after, 0.01, advice.feedback, ["sweep"])
    assert untold.action.startswith("fit by way of sweep (excitations), comparing nk from 1 on")
    found = fid.impulse_response(record)
    assert found.delays == {"u": None}
    assert str(found.feedback) in found.summary().to_text()
    assert fid.impulse_response(record, loop="open").delays["u"] is not None
    assert min(delays_to_scan([record], ("u",), "y")) == 1


def test_no_rate_is_told_of_an_output_that_answers_nothing() -> None:
    """Green: "170 times the bandwidth", of an output that had nothing to do with the input."""
    random = np.random.default_rng(1)
    noise = lfilter([1.0], [1.0, -0.97], random.standard_normal(3000))
    unmoved = {"u": random.standard_normal(3000)}
    advice = fid.advise(
        fid.Record.from_arrays(0.01 * np.arange(3000), inputs=unmoved, outputs={"y": noise})
    )
    assert _codes(advice) == {"no-response"}


def test_a_delay_of_a_loop_that_is_not_known_holds_if_it_was_open() -> None:
    random = np.random.default_rng(1)
    u = random.standard_normal(1500)
    y = lfilter([0.5, 0.3], [1.0, -0.6], u) + 0.3 * random.standard_normal(1500)
    record = fid.Record.from_arrays(0.01 * np.arange(1500), inputs={"u": u}, outputs={"y": y})
    (told,) = [each for each in fid.advise(record).findings if each.code == "delay"]
    assert (told.light, told.message[:25]) == (Light.AMBER, "if the loop was open: 'y'")
    (told,) = [e for e in fid.advise(record, loop="open").findings if e.code == "delay"]
    assert told.light is Light.GREEN


def test_advice_sees_poor_related_silent_and_fast_channels():
    t = np.arange(1000)
    noise = np.random.default_rng(3).standard_normal((3, 1000))

    def advise(inputs, y):
        return fid.advise(
            fid.Record.from_arrays(t / 100, inputs=inputs, outputs={"y": y}), n_lags=20
        )

    tone = np.sin(0.2 * t)
    poor = advise({"u": tone}, np.roll(tone, 2) + 0.1 * noise[0])
    assert poor.excitation_orders["u"] <= 4
    assert "poor-excitation" in _codes(poor)
    twins = {"u": noise[0], "v": noise[0] + 0.05 * noise[1]}
    assert "related-inputs" in _codes(advise(twins, noise[2] + np.roll(noise[0], 1)))
    assert "no-response" in _codes(advise({"u": noise[0]}, noise[1]))
    slow = np.sin(0.01 * t) + 1e-3 * noise[1]
    assert "sampled-fast" in _codes(advise({"u": noise[0]}, slow))
    two = np.sign(noise[0])
    assert "two-levels" in _codes(advise({"u": two}, np.roll(two, 1) + noise[1]))


def test_feedback_is_seen_and_its_absence_too():
    rng = np.random.default_rng(4)
    found = []
    for gain in (0.0, 0.6):
        y, u = np.zeros(400), np.zeros(400)
        e, r = rng.standard_normal((2, 400))
        for t in range(1, 400):
            y[t] = 0.7 * y[t - 1] + 0.5 * u[t - 1] + e[t]
            u[t] = r[t] - gain * y[t]
        record = fid.Record.from_arrays(np.arange(400) / 10, inputs={"u": u}, outputs={"y": y})
        found.append("feedback" in _codes(fid.advise(record)))
    assert found == [False, True]
    assert "feedback" not in _codes(fid.advise(record, loop="open"))
    assert "feedback" in _codes(fid.advise(record.declare(loop="closed")))


def test_advice_on_a_log_never_says_that_no_loop_is_seen():
    """An autopilot flies in a loop; where too little noise was to be seen it said so of its log."""
    record = flown(TWO_INPUTS, 0, n=600, noise=0.1)
    assert fid.advise(record).feedback.loop != "closed"
    logged = record.replace(step=Step("Log.record"))
    found = fid.advise(logged)
    assert (found.feedback.loop, found.feedback.source) == ("closed", "log")
    assert "feedback" in _codes(found)
    assert "Loop closed: in an autopilot's log" in found.summary().to_text()
    assert fid.advise(logged, loop="open").feedback.source == "declared"
    seen = FeedbackTest("closed", "test", 1e-9, "u", 0.2)
    assert unless_logged(seen, [logged.history]) is seen


def test_advice_on_a_short_record_says_what_it_left_out():
    advice = fid.advise(flown(ARMAX, 5, n=60, noise=0.3))
    assert advice.response is None
    assert "no-pulse-response" in _codes(advice)


def test_requests_that_cannot_be_met():
    record = flown(ARMAX, 6)
    for verb in (fid.advise, fid.impulse_response):
        with pytest.raises(DataError, match="there is no record"):
            verb([])
        both = fid.Record.from_arrays(
            record.time_s, inputs={"u": record["u"]}, outputs={"y": record["y"], "z": record["y"]}
        )
        with pytest.raises(OptionError, match="output is not said"):
            verb(both)
    with pytest.raises(OptionError, match="there is no input"):
        fid.impulse_response(record, inputs=[])
    with pytest.raises(OptionError, match="lags are outside"):
        fid.impulse_response(record, n_lags=0)
    with pytest.raises(OptionError, match="unknown kernel"):
        fid.impulse_response(record, kernel="ss")
    with pytest.raises(OptionError, match="no lags before the pulse"):
        fid.impulse_response(record, kernel="tc", negative_lags=3)
    with pytest.raises(DataError, match="too few samples for the lags"):
        fid.impulse_response(record, n_lags=150)
    tone = record.replace({"u": np.sin(0.5 * np.arange(400))})
    with pytest.raises(DataError, match="do not determine the response"):
        fid.impulse_response(tone)


def test_residual_tests_take_a_fit_and_count_its_coefficients():
    record = flown(ARMAX, 7, n=1500, noise=0.5)
    good = fid.identify(P.armax("u", "y", na=2, nb=2, nc=2), record)
    tests = fid.residual_tests(good)
    assert (tests.fitted_noise, tests.fitted_input) == (4, 2)
    assert [t.verdict.value for t in tests.tests[:2]] == ["pass", "pass"]
    assert tests.tests[0].degrees_of_freedom == 25 - 4
    poor = fid.identify(P.arx("u", "y", na=1, nb=1), record)
    assert fid.residual_tests(poor).tests[0].verdict.value == "fail"


def test_output_error_and_instruments_promise_independence_only():
    record = flown(ARMAX, 8, n=1500, noise=0.5)
    for asked in (
        P.oe("u", "y", nb=2, nf=2),
        P.arx("u", "y", na=2, nb=2, method="iv4"),
    ):
        tests = fid.residual_tests(fid.identify(asked, record))
        assert not tests.tests[0].counts
        assert tests.test("uε", "y", "u").verdict.value == "pass"
        with pytest.raises(OptionError, match="another predictor"):
            fid.residual_tests(fid.identify(asked, record), horizon="one step ahead")


def test_residuals_of_two_outputs_are_tested_against_each_other():
    rng = np.random.default_rng(9)
    u, e, w = rng.standard_normal((3, 2000))
    y = lfilter([0.0, 1.0], [1, -0.5], u) + e
    z = lfilter([0.0, 0.3], [1, -0.8], u) + w + 0.5 * np.roll(e, 2)
    record = fid.Record.from_arrays(np.arange(2000) / 10, inputs={"u": u}, outputs={"y": y, "z": z})
    fits = [fid.identify(P.bj("u", name, nb=1, nf=1, nc=1, nd=1), record) for name in ("y", "z")]
    tests = fid.residual_tests(fits)
    # The noise of y reaches z two samples later, never the other way round.
    assert tests.test("ε′ε", "z", "y").verdict.value == "fail"
    assert tests.test("ε′ε", "y", "z").verdict.value == "pass"
    assert fid.residual_tests(fits, outputs=["y"]).outputs == ("y",)
    other = fid.identify(P.arx("u", "z", na=1, nb=1), flown(P(("u",), "z", 0.1, b=[[1.0]]), 1))
    with pytest.raises(DataError, match="fits of different records"):
        fid.residual_tests([fits[0], other])


def test_fits_with_other_lags_share_their_common_samples():
    record = flown(TWO_INPUTS, 10, n=900, noise=0.3)
    more = fid.Record.from_arrays(
        record.time_s,
        inputs={"u": record["u"], "v": record["v"]},
        outputs={"y": record["y"], "z": np.roll(record["u"], 1)
                 + np.random.default_rng(1).standard_normal(900)},
    )  # fmt: skip
    fits = [
        fid.identify(P.arx(["u", "v"], "y", na=4, nb=4, nk=[1, 3]), more),
        fid.identify(P.arx("u", "z", na=1, nb=1), more),
    ]
    tests = fid.residual_tests(fits)
    assert tests.n_samples == 900 - 6
    assert_close(tests.fitted_input, 4.0, atol=1e-12, why="a count")


def test_the_pole_zero_map_has_ellipses():
    fit = fid.identify(P.armax("u", "y", na=2, nb=2, nc=2), flown(ARMAX, 11, noise=0.3))
    figure = plot.pole_zero(fit)
    # The circle, two clouds, an ellipse for each pole of the pair and for the zero.
    assert [len([t for t in figure.data if t.xaxis == axis]) for axis in ("x", "x2")] == [6, 6]
    # Beside them the same near: the ellipse of the upper pole fills what it did not.
    near = next(iter(figure.select_xaxes(col=2))).range
    edge = [t for t in figure.data if t.xaxis == "x2" and t.name == "poles" and t.mode == "lines"]
    assert near[0] < min(edge[0].x) < max(edge[0].x) < near[1]
    assert np.ptp(edge[0].x) > 0.1 * np.ptp(near)
    # One title serves both: a second lay on the frame of the left plane.
    assert [(axis.title or {}).get("text") for axis in figure.select_yaxes()] == ["imaginary", None]
