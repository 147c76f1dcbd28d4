"""Residual tests against truth: false alarms of good models, and what fires on which fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.validation.residuals.result import ResidualTests

KINDS = ("εε", "uε", "u²ε", "u²ε²", "ε(εu)")
STEP, FREE = "one step ahead", "free run"
Draw = Callable[[np.random.Generator], tuple[np.ndarray, np.ndarray]]
N = 1000


def _white(rng: np.random.Generator) -> np.ndarray:
    return rng.standard_normal(N)


def _coloured(rng: np.random.Generator) -> np.ndarray:
    return signal.lfilter([1.0], [1.0, -0.9], rng.standard_normal(N + 200))[200:]


def _narrow(rng: np.random.Generator) -> np.ndarray:
    lowpass = signal.butter(4, 0.2)
    return signal.lfilter(*lowpass, rng.standard_normal(N + 200))[200:]


def _uniform(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-1.0, 1.0, N)


def _runs(draw: Draw, count: int, **options: object) -> list[ResidualTests]:
    made = []
    for seed in range(count):
        e, u = draw(np.random.default_rng(seed))
        made.append(fid.residual_tests(e, u, **options))  # type: ignore[arg-type]
    return made


def _share(runs: list[ResidualTests], kind: str) -> tuple[float, float, float]:
    """Shares of runs that fail, of p-values below 0.05, and of lags outside the band."""
    every = [test for run in runs for test in run.tests if test.kind == kind]
    # An open loop is called closed by chance, at the test's own rate: nothing is judged then.
    tests = [test for test in every if test.p_value is not None]
    assert len(tests) >= 0.98 * len(every)
    outside = np.mean([test.exceedances / np.count_nonzero(test.judged) for test in tests])
    return (
        float(np.mean([test.verdict == "fail" for test in tests])),
        float(np.mean([test.p_value < 0.05 for test in tests])),
        float(outside),
    )


@pytest.mark.parametrize(
    ("count", "near"), [(10, 0.05), pytest.param(60, 0.02, marks=pytest.mark.nightly)]
)
def test_white_residuals_leave_the_band_at_five_percent_of_lags(count: int, near: float) -> None:
    runs = _runs(lambda rng: (_white(rng), _uniform(rng)), count, horizon=STEP)
    for kind in KINDS:
        # 60 runs of 25 to 51 nearly independent lags: one sigma of the share is below 0.6 %.
        assert abs(_share(runs, kind)[2] - 0.05) < near, kind


GOOD: dict[str, tuple[Draw, str]] = {
    "white, uniform": (lambda rng: (_white(rng), _uniform(rng)), STEP),
    "white, coloured": (lambda rng: (_white(rng), _coloured(rng)), STEP),
    "white, narrow": (lambda rng: (_white(rng), _narrow(rng)), STEP),
    "coloured, coloured": (lambda rng: (_coloured(rng), _coloured(rng)), FREE),
    "coloured, narrow": (lambda rng: (_coloured(rng), _narrow(rng)), FREE),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", GOOD)
def test_false_alarms_of_good_models_over_500_runs(case: str) -> None:
    draw, horizon = GOOD[case]
    runs = _runs(draw, 500, horizon=horizon)
    for kind in KINDS if horizon == STEP else KINDS[1:4]:
        fails, small, outside = _share(runs, kind)
        # Three sigma of a 5 % share over 500 runs is 2.9 %.
        assert small < 0.08, (kind, small)
        assert fails < 0.08, (kind, fails)
        assert 0.035 < outside < 0.07, (kind, outside)
    reds = np.mean([any(item.light == "red" for item in run.findings) for run in runs])
    assert reds < 0.08


@pytest.mark.slow
def test_degrees_of_freedom_of_a_fitted_autoregression_over_500_runs() -> None:
    small = {0: 0, 3: 0}
    for seed in range(500):
        rng = np.random.default_rng(seed)
        y = signal.lfilter([1.0], [1.0, -0.5, 0.3, -0.2], rng.standard_normal(N + 100))[100:]
        past = np.column_stack([y[2:-1], y[1:-2], y[:-3]])
        e = y[3:] - past @ np.linalg.lstsq(past, y[3:], rcond=None)[0]
        for fitted in small:
            test = fid.residual_tests(e, horizon=STEP, maximum_lag=10, fitted_noise=fitted).tests[0]
            small[fitted] += test.p_value < 0.05
    assert small[0] < 12, "without the correction the test is far too lenient: about 1 %"
    assert 10 < small[3] < 40, "with it 5 % of 500 runs, three sigma either way"


FAULTS: dict[str, tuple[Draw, set[str], set[str]]] = {}


def _missing(term: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Draw:
    def draw(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        noise, u = 0.1 * rng.standard_normal(N), _uniform(rng)
        return noise + term(np.roll(u, 1), np.roll(noise, 1)), u

    return draw


# What is missing: which tests must fire, and which must stay silent beyond chance.
FAULTS = {
    "linear": (_missing(lambda u, _: 0.3 * u), {"uε", "u²ε²"}, {"εε", "u²ε", "ε(εu)"}),
    "quadratic": (_missing(lambda u, _: 0.3 * u**2), {"u²ε"}, {"εε", "uε", "ε(εu)"}),
    "bilinear": (_missing(lambda u, e: 0.8 * u * e), {"ε(εu)"}, {"εε", "uε", "u²ε"}),
    "noise": (_missing(lambda _, e: 0.5 * e), {"εε"}, {"uε", "u²ε", "u²ε²"}),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_fires_its_own_test(fault: str) -> None:
    draw, loud, silent = FAULTS[fault]
    count = 12
    fired = Counter(
        str(test.kind)
        for run in _runs(draw, count, horizon=STEP)
        for test in run.tests
        if test.verdict == "fail"
    )
    for kind in loud:
        assert fired[kind] >= count - 1, (kind, fired)
    for kind in silent:
        # Four or more of 12 at 4 % happens in less than 1 of 900 such tests.
        assert fired[kind] <= 3, (kind, fired)


def test_one_lag_however_alone_is_not_forgiven() -> None:
    e, u = FAULTS["linear"][0](np.random.default_rng(1))
    test = fid.residual_tests(e, u, horizon=STEP).test("uε", "e1", "u1")
    assert test.exceedances <= test.exceedance_limit + 3
    assert test.verdict == "fail"
