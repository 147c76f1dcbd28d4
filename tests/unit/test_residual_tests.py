"""Residual tests: definitions, properties, every form of input, and every refusal."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError, OptionError, ShapeError, UnknownNameError
from flightid.evidence.gather import loop_of_residuals
from flightid.plot.residuals import correlations
from flightid.uncertainty.residual_correlation import (
    cross_correlation,
    independence_portmanteau,
    lag_covariance,
    white_portmanteau,
)
from flightid.validation.residuals.obstacles import is_two_level
from tests.closeness import assert_close

STEP = "one step ahead"
SEEDS = st.integers(min_value=0, max_value=2**32 - 1)


def _pair(seed: int = 0, n: int = 600) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(n), rng.uniform(-1.0, 1.0, n)


def _verification(seed: int = 0) -> fid.Verification:
    rng = np.random.default_rng(seed)
    time_s = np.arange(800) * 0.02
    lag = fid.LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    seen = fid.simulate(lag, fid.Record.from_arrays(time_s, inputs={"u": rng.normal(size=800)}))
    return fid.verify(lag, seen.replace({"y": seen["y"] + 0.05 * rng.standard_normal(800)}))


def test_covariances_of_lags_take_every_lag_of_a_short_record() -> None:
    """Bartlett's sum over all lags of five samples, beside a long coloured series."""
    short = np.array([3.0, -1.0, 0.5, -2.0, 4.0])
    b = lfilter([1.0], [1.0, -0.8], np.random.default_rng(4).standard_normal(4000))
    x = short - short.mean()
    of_a = np.correlate(x, x, "full") / (x @ x)
    of_b = 0.8 ** np.abs(np.arange(-4, 5))
    wanted = np.array([of_a[lag:] @ of_b[: 9 - lag] for lag in range(3)])
    found = lag_covariance((short,), (b,), 3)
    assert_close(found, wanted, atol=0.03, why="a recursion of 4,000 samples")


def test_correlation_is_its_definition() -> None:
    a, b = _pair(1, 50)
    x, y = a - a.mean(), b - b.mean()
    expected = [
        sum(x[t - lag] * y[t] for t in range(50) if 0 <= t - lag < 50) for lag in range(-4, 5)
    ]
    assert_close(
        cross_correlation((a,), (b,), 4),
        np.array(expected) / np.sqrt((x @ x) * (y @ y)),
        atol=1e-13,
        why="the sums written out",
    )


def test_no_lag_spans_two_records_and_each_has_its_own_mean() -> None:
    a, b = _pair(2, 60)
    parts = ((a[:20] + 5.0, a[20:] - 3.0), (b[:20], b[20:] + 9.0))
    x = [part - part.mean() for part in parts[0]]
    y = [part - part.mean() for part in parts[1]]
    at_two = sum(p[:-2] @ q[2:] for p, q in zip(x, y, strict=True))
    norm = np.sqrt(sum(p @ p for p in x) * sum(q @ q for q in y))
    assert_close(
        cross_correlation(*parts, 2)[-1], at_two / norm, atol=1e-13, why="sums over records"
    )


@given(SEEDS, st.integers(min_value=0, max_value=12))
def test_autocorrelation_is_symmetric_and_one_at_zero(seed: int, lag: int) -> None:
    e, _ = _pair(seed, 64)
    values = cross_correlation((e,), (e,), lag)
    assert_close(values, values[::-1], atol=1e-14, why="time runs both ways")
    assert_close(values[lag], 1.0, rtol=1e-12, why="normalised")
    assert np.all(np.abs(values) <= 1.0 + 1e-12)


@given(SEEDS, st.floats(1e-6, 1e6), st.floats(-100.0, 100.0))
def test_tests_do_not_know_units_or_offsets(seed: int, scale: float, offset: float) -> None:
    e, u = _pair(seed, 300)
    one = fid.residual_tests(e, u, horizon=STEP, maximum_lag=5)
    two = fid.residual_tests(
        scale * (e + offset), (u + offset) / scale, horizon=STEP, maximum_lag=5
    )
    for first, second in zip(one.tests, two.tests, strict=True):
        assert_close(second.values, first.values, atol=1e-8, why="normalised about means")
        assert first.verdict == second.verdict


@given(SEEDS, st.integers(min_value=1, max_value=6))
def test_a_delayed_input_moves_the_peak_by_its_delay(seed: int, delay: int) -> None:
    u = np.random.default_rng(seed).standard_normal(400)
    e = np.concatenate([np.zeros(delay), u[:-delay]])
    test = fid.residual_tests(e, u, horizon=STEP, maximum_lag=8).test("uε", "e1", "u1")
    assert test.lags[np.argmax(np.abs(test.values))] == delay
    assert test.verdict == "fail"


def test_product_correlation_pairs_with_the_sample_before() -> None:
    e, u = _pair(4, 200)
    found = fid.residual_tests(e, u, horizon=STEP, maximum_lag=3).test("ε(εu)", "e1", "u1")
    x = e - e.mean()
    product = x * (u - u.mean())
    product -= product.mean()
    expected = [x[1 + k :] @ product[: 199 - k] for k in range(4)]
    norm = np.sqrt((x @ x) * (product @ product))
    assert list(found.lags) == [0, 1, 2, 3]
    assert_close(found.values, np.array(expected) / norm, atol=1e-13, why="E[ε(t) εu(t-1-τ)]")


def test_portmanteau_against_the_formulas() -> None:
    r = np.array([0.1, -0.2])
    assert_close(
        white_portmanteau(r, 100, 1)[0], 100 * 102 * (0.01 / 99 + 0.04 / 98), rtol=1e-13, why="L-B"
    )
    assert white_portmanteau(r, 100, 1)[1] == 1
    statistic, degrees, _ = independence_portmanteau(r, np.array([1.0, 0.5]), 100, 0)
    matrix = np.array([[1.0, 0.5], [0.5, 1.0]])
    assert_close(statistic, 100 * r @ np.linalg.solve(matrix, r), rtol=1e-12, why="inverse form")
    assert degrees == 2


def test_bartlett_variance_of_two_autoregressions() -> None:
    rng = np.random.default_rng(5)
    series = []
    for pole in (0.9, 0.7):
        out = np.zeros(40_000)
        for t, noise in enumerate(rng.standard_normal(out.size - 1), start=1):
            out[t] = pole * out[t - 1] + noise
        series.append((out,))
    expected = (1 + 0.63) / (1 - 0.63)
    assert_close(
        lag_covariance(*series, 1)[0], expected, rtol=0.12, why="sum of 0.63^|k|, 40000 samples"
    )


@pytest.mark.parametrize(
    "signal",
    [
        np.tile([1.0, -1.0, -1.0], 100),
        np.tile([0.2, 0.8, 0.8, 0.2, 0.8, 0.2, 0.2], 50),
        np.where(np.arange(127) < 64, 1.0, -1.0),
    ],
    ids=["unequal", "offset", "one more"],
)
def test_a_two_level_input_is_not_testable_squared(signal: np.ndarray) -> None:
    assert is_two_level((signal,))
    e = np.random.default_rng(0).standard_normal(signal.size)
    tests = fid.residual_tests(e, signal, horizon=STEP, maximum_lag=10)
    for kind in ("u²ε", "u²ε²"):
        test = tests.test(kind, "e1", "u1")
        assert test.verdict == "not testable"
        assert "two levels" in test.reason
        assert test.largest is None
    assert tests.test("uε", "e1", "u1").verdict != "not testable"
    # A test that could find nothing is void, and takes no green away.
    assert "residuals-not-testable" not in {finding.code for finding in tests.findings}


def test_power_beside_a_doublet_is_judged_at_its_nominal_rate() -> None:
    """Sums of few squares have a long tail: 2 of 120 were below 0.1 %."""
    chances = []
    for seed in range(60):
        u = np.zeros(1000)
        u[100:128], u[128:156] = 1.2, -1.2
        e = np.random.default_rng(seed).standard_normal((2, 1000))
        tests = fid.residual_tests(e, u, horizon=STEP, loop="open")
        chances += [tests.test("u²ε²", name, "u1").p_value or 1.0 for name in ("e1", "e2")]
    assert sum(chance < 0.01 for chance in chances) <= 4
    assert sum(chance < 0.001 for chance in chances) == 0


def test_three_levels_are_testable() -> None:
    assert not is_two_level((np.tile([1.0, 0.0, -1.0, -1.0], 50),))


def test_closed_loops_judge_only_past_inputs() -> None:
    e, u = _pair(6)
    fed_back = u + 0.8 * np.concatenate([np.zeros(2), e[:-2]])
    opened = fid.residual_tests(e, fed_back, horizon=STEP, loop="open")
    assert opened.test("uε", "e1", "u1").verdict == "fail"
    assert any("declare loop='closed'" in finding.action for finding in opened.findings)
    assert "residuals-lead-input" in {finding.code for finding in opened.findings}
    # Who said that it is open is believed; where nobody did, the loop is not green.
    assert loop_of_residuals(opened.feedback, opened.findings) is None
    tested = replace(opened.feedback, source="test")
    doubtful = loop_of_residuals(tested, opened.findings)
    assert doubtful is not None
    assert (doubtful.name, doubtful.light) == ("loop", "unknown")
    closed = fid.residual_tests(e, fed_back, horizon=STEP, loop="closed")
    found = fid.residual_tests(e, fed_back, horizon=STEP)
    assert (found.loop, found.feedback.source) == ("closed", "test")
    assert "loop closed: past noise of the outputs" in found.summary().to_text()
    test = closed.test("uε", "e1", "u1")
    assert test.verdict == "pass"
    assert np.array_equal(test.values, found.test("uε", "e1", "u1").values)
    assert test.lags[test.judged].min() == 0
    at_once = u + 0.8 * e
    assert fid.residual_tests(e, at_once, horizon=STEP, loop="closed").test(
        "uε", "e1", "u1"
    ).verdict == "fail"  # fmt: skip
    within = fid.residual_tests(e, at_once, horizon=STEP, loop="closed within the sample")
    assert within.test("uε", "e1", "u1").verdict == "pass"


def test_a_verification_says_its_predictor_and_counts_independence_only() -> None:
    verification = _verification()
    tests = fid.residual_tests(verification)
    assert tests.horizon == "free run"
    assert verification.protocol in tests.predictor
    assert not tests.test("εε", "y").counts
    assert tests.test("uε", "y", "u").counts
    assert "shown, not counted" in str(tests.summary())
    expected = verification.predictions[0].residual("y")
    arrays = fid.residual_tests(
        {"y": expected}, {"u": verification.measured["u"]}, horizon="free run"
    )
    assert_close(
        tests.test("uε", "y", "u").values,
        arrays.test("uε", "y", "u").values,
        atol=1e-12,
        why="the same residuals",
    )
    closed = fid.residual_tests(verification, loop="closed")
    assert closed.test("uε", "y", "u").verdict == "not testable"
    assert "injected excitation" in closed.test("uε", "y", "u").reason


def test_rounding_noise_and_still_channels_are_not_testable() -> None:
    time_s = np.arange(400) * 0.02
    lag = fid.LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    flown = fid.Record.from_arrays(time_s, inputs={"u": np.sin(time_s)})
    tests = fid.residual_tests(fid.verify(lag, fid.simulate(lag, flown)))
    assert {test.verdict for test in tests.tests} == {"not testable"}
    e, _ = _pair(7)
    still = fid.residual_tests(e, np.full(e.size, 0.1), horizon=STEP)
    assert still.test("uε", "e1", "u1").reason == "the input does not change"
    # A browser draws paths of NaN on axes that no trace has.
    drawn = correlations(still, "e1", "u1")
    held = {trace.xaxis for trace in drawn.data}
    assert len(held) == len({test.kind for test in still.tests})
    signs = fid.residual_tests(np.sign(e), _pair(8)[1], horizon=STEP)
    assert "residual has two levels" in signs.test("u²ε²", "e1", "u1").reason


def test_records_outputs_and_inputs_by_name() -> None:
    e, u = _pair(9)
    records = [
        fid.Record.from_arrays(
            np.arange(300) * 0.1,
            inputs={"a": u[part], "b": np.roll(u[part], 50)},
            outputs={"p": e[part], "q": np.roll(e[part], 70)},
        )
        for part in (slice(0, 300), slice(300, 600))
    ]
    tests = fid.residual_tests(records, horizon=STEP)
    assert (tests.outputs, tests.inputs) == (("p", "q"), ("a", "b"))
    assert len(tests.tests) == 2 * (1 + 1 + 2 * 4)
    assert (tests.n_samples, tests.n_records) == (600, 2)
    one = fid.residual_tests(records[0], ["b"], outputs=["q"], horizon=STEP)
    assert len(one.tests) == 5
    assert repr(one).startswith("ResidualTests(1 output, 1 input, 300 samples")
    with pytest.raises(UnknownNameError, match="no such test"):
        one.test("εε", "p")


def test_records_shorter_than_the_order_of_their_colour() -> None:
    e, u = _pair(15)
    e = np.convolve(e, np.ones(4), "same")
    records = [
        fid.Record.from_arrays(
            np.arange(6) * 0.1, inputs={"u": u[part]}, outputs={"e": e[part]}, name=str(start)
        )
        for start in range(0, 600, 6)
        for part in (slice(start, start + 6),)
    ]
    tests = fid.residual_tests(records, horizon="free run", maximum_lag=3)
    assert tests.test("uε", "e", "u").p_value is not None


def test_fitted_parameters_leave_the_degrees_of_freedom() -> None:
    e, u = _pair(10)
    tests = fid.residual_tests(e, u, horizon=STEP, fitted_noise=3, fitted_input=2)
    assert tests.test("εε", "e1").degrees_of_freedom == 22
    assert tests.test("uε", "e1", "u1").degrees_of_freedom == 49
    assert tests.test("u²ε", "e1", "u1").degrees_of_freedom == 51


def test_a_narrow_input_with_many_parameters_is_not_testable() -> None:
    e, _ = _pair(11)
    tone = np.sin(0.3 * np.arange(e.size))
    tests = fid.residual_tests(e, tone, horizon=STEP, fitted_input=30)
    assert "band is too narrow" in tests.test("uε", "e1", "u1").reason


def test_results_are_plain_values_and_pictures() -> None:
    e, u = _pair(12)
    tests = fid.residual_tests(e + 0.5 * np.roll(u, 2), u, horizon=STEP)
    plain = json.loads(json.dumps(tests.to_dict(), allow_nan=False))
    assert plain["schema"] == "flightid.residual_tests/1"
    assert "<table>" in tests._repr_html_()
    assert tests.findings[0].light == "red"
    assert "fail" in repr(tests.test("uε", "e1", "u1"))
    made = correlations(tests, "e1", "u1")
    bars = [trace for trace in made.data if trace.type == "bar"]
    assert len(bars) == 5
    assert_close(bars[1].y, tests.test("uε", "e1", "u1").values, atol=0.0, rtol=1e-15, why="drawn")


@pytest.mark.parametrize(
    ("error", "message", "arguments", "options"),
    [
        (OptionError, "the predictor is not said", (np.ones(9),), {}),
        (OptionError, "the horizon is not known", (np.ones(9),), {"horizon": "far"}),
        (OptionError, "the loop is not known", _pair(), {"horizon": STEP, "loop": "half"}),
        (OptionError, "names choose channels", _pair(), {"horizon": STEP, "outputs": ["e"]}),
        (OptionError, "below one sample", _pair(), {"horizon": STEP, "maximum_lag": 0}),
        (OptionError, "fitted_noise leaves no", _pair(), {"horizon": STEP, "fitted_noise": 25}),
        (OptionError, "fitted_input leaves no", _pair(), {"horizon": STEP, "fitted_input": 51}),
        (
            OptionError,
            "verification has another",
            (_verification(),),
            {"horizon": STEP},
        ),
        (OptionError, "inputs of records are channel", (_verification(), np.ones(3)), {}),
        (DataError, "too short for so many lags", _pair(0, 60), {"horizon": STEP}),
        (DataError, "leaves nothing to test", (np.ones(900),), {"horizon": "free run"}),
        (DataError, "there are no residuals", ({},), {"horizon": STEP}),
        (DataError, "not finite", (np.full(300, np.nan),), {"horizon": STEP}),
        (ShapeError, "does not fit the residuals", (np.ones(9), np.ones(8)), {"horizon": STEP}),
        (ShapeError, "not rows of samples", (np.ones((2, 2, 2)),), {"horizon": STEP}),
        (ShapeError, "not numbers in rows", ([[1.0], [1.0, 2.0]],), {"horizon": STEP}),
        (ShapeError, "named series is one row", ({"e": np.ones((2, 9))},), {"horizon": STEP}),
    ],
)
def test_refusals(
    error: type[Exception], message: str, arguments: tuple, options: dict[str, object]
) -> None:
    with pytest.raises(error, match=message):
        fid.residual_tests(*arguments, **options)


def test_records_of_two_sample_times_are_refused() -> None:
    e, u = _pair(13)
    records = [
        fid.Record.from_arrays(np.arange(e.size) * step, inputs={"u": u}, outputs={"e": e})
        for step in (0.1, 0.2)
    ]
    with pytest.raises(DataError, match="different sample times"):
        fid.residual_tests(records, horizon=STEP)


def test_kernel_refusals() -> None:
    e, _ = _pair(14, 20)
    with pytest.raises(ShapeError, match="two series do not fit"):
        cross_correlation((e,), (e[1:],), 2)
    with pytest.raises(OptionError, match="does not lie within a record"):
        cross_correlation((e,), (e,), 20)
    with pytest.raises(DataError, match="does not change"):
        cross_correlation((e,), (np.zeros(20),), 2)


@pytest.mark.parametrize(("gain", "light"), [(0.018, "green"), (0.05, "amber"), (0.5, "red")])
def test_a_sure_failure_is_red_only_where_it_is_large(gain: float, light: str) -> None:
    rng = np.random.default_rng(4)
    time_s = np.arange(40_000) * 0.02
    flown = fid.Record.from_arrays(time_s, inputs={"u": rng.standard_normal(time_s.size)})
    lag = fid.LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    seen = fid.simulate(lag, flown)
    size = float(np.std(seen["y"]))
    missed = gain * size * np.roll(flown["u"], 7)
    noise = 0.1 * size * rng.standard_normal(time_s.size)
    spoiled = seen.replace({"y": seen["y"] + missed + noise})
    tests = fid.residual_tests(fid.verify(lag, spoiled))
    test = tests.test("uε", "y", "u")
    assert test.verdict.value == "fail"
    part = 100.0 * np.std(missed) / np.std(spoiled["y"])
    assert_close(test.worth_percent, part, rtol=0.02, why="the part that u foretells")
    found = next(f for f in tests.findings if f.code == "residuals-follow-input")
    assert found.light.value == light
    assert "% of y" in found.message


def test_what_its_own_past_foretells_is_the_power_that_a_filter_takes_out() -> None:
    rng = np.random.default_rng(5)
    white = rng.standard_normal(20_000)
    e = np.zeros_like(white)
    for k in range(1, e.size):
        e[k] = 0.8 * e[k - 1] + white[k]
    time_s = np.arange(e.size) * 0.02
    lag = fid.LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    flown = fid.Record.from_arrays(time_s, inputs={"u": rng.standard_normal(e.size)})
    seen = fid.simulate(lag, flown)
    spoiled = seen.replace({"y": seen["y"] + e})
    test = fid.residual_tests(fid.verify(lag, spoiled)).test("εε", "y")
    share = 0.8 * np.std(e) / np.std(spoiled["y"])
    assert_close(test.worth_percent, 100.0 * share, rtol=0.03, why="0.64 of an AR(1)'s power")


def test_in_a_loop_the_residual_is_tested_against_what_was_injected() -> None:
    """x' = −2x + 2u, u = r − 1.5 y, coloured noise on y: the true model is red against u alone."""
    rng = np.random.default_rng(1)
    noise, x = 0.0, 0.0
    held, u, y = np.repeat(rng.choice([-1.0, 1.0], 150), 20), np.zeros(3000), np.zeros(3000)
    a = np.exp(-0.04)
    for k in range(3000):
        noise = 0.95 * noise + 0.1 * rng.standard_normal()
        y[k] = x + noise
        u[k] = held[k] - 1.5 * y[k]
        x = a * x + (1.0 - a) * u[k]
    time_s = np.arange(3000) * 0.02
    flown = fid.Record.from_arrays(
        time_s, inputs={"u": u}, outputs={"y": y}, excitations={"r": held}, hold="zero"
    )
    truth = fid.LinearSystem([[-2.0]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    missed = fid.LinearSystem([[-3.5]], [[2.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    tests = fid.residual_tests(fid.verify(truth, flown))
    assert tests.inputs == ("r",)
    assert tests.test("uε", "y", "r").verdict == "pass"
    assert "Tested against the injected r" in tests.predictor
    assert fid.residual_tests(fid.verify(missed, flown)).test("uε", "y", "r").verdict == "fail"
    assert (
        fid.residual_tests(fid.verify(truth, flown), ["u"]).test("uε", "y", "u").verdict == "fail"
    )
    assert fid.residual_tests(fid.verify(truth, flown), loop="open").inputs == ("u",)


@pytest.mark.parametrize(("pole", "square"), [(0.97, 0.0), (0.95, 0.2)])
def test_no_nonlinearity_is_asked_for_while_the_linear_part_is_wrong(
    pole: float, square: float
) -> None:
    """A 3-2-1-1 answered by a wrong pole is no less correlated with its square than a true u²."""
    random = np.random.default_rng(0)
    u = np.repeat([0.0, 1.0, -1.0, 1.0, -1.0, 0.0], [60, 90, 60, 30, 30, 130])
    u = np.tile(u, 3) if square == 0.0 else random.uniform(-1.0, 1.0, u.size)
    linear = lfilter([0.0, 0.05], [1.0, -pole], u) - lfilter([0.0, 0.05], [1.0, -0.95], u)
    left = linear + square * np.roll(u, 1) ** 2 + 0.01 * random.standard_normal(u.size)
    found = fid.residual_tests(left, u, horizon="free run", loop="open").findings
    asked = [each.action for each in found if each.code == "residuals-follow-input-squared"]
    assert len(asked) == 1
    assert ("an even nonlinearity is missing" in asked[0]) is (square > 0.0)
    assert asked[0].startswith("mend the linear part first") is (square == 0.0)
