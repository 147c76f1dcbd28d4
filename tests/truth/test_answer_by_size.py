"""Quadratic drag is told from damping by its harmonics, and the error bound holds small motion.

The truth is stepped here: a damped rate with drag, moved by a sweep in straight lines.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.control.tuning.size_findings import answers_by_size
from flightid.control.tuning.structure_error import errors_of
from flightid.conventions import Light
from flightid.identification.answers_of_records import by_size_of
from flightid.identification.frequency_domain import answer_by_size
from flightid.identification.frequency_domain.answer_by_size import size_terms
from flightid.record.history import Step
from tests.closeness import assert_close
from tests.strangers.gains import structure_of

STEP_S, INNER, RECORD_S = 0.02, 3, 60.0
EFFECT, DAMPING, DRAG = 60.0, 2.0, 0.5


def flown(seed: int, drag: float, gust: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """A sweep and the rate that answers it, with noise and gusts that last half a second."""
    r = np.random.default_rng(seed)
    n = round(RECORD_S / STEP_S)
    time_s = np.arange(n) * STEP_S
    fade = np.clip(np.minimum(time_s, RECORD_S - time_s) / 2.0, 0.0, 1.0)
    u = 0.08 * fade * signal.chirp(time_s, 0.1, RECORD_S, 5.0, method="logarithmic")
    keep = np.exp(-STEP_S / 0.5)
    moved = signal.lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], gust * r.standard_normal(n))
    y, p = np.zeros(n), 0.0
    for k in range(n - 1):
        y[k] = p
        for j in range(INNER):
            push = EFFECT * (u[k] + (u[k + 1] - u[k]) * (j + 0.5) / INNER) + moved[k]
            middle = p + 0.5 * STEP_S / INNER * (push - DAMPING * p - drag * p * abs(p))
            p += STEP_S / INNER * (push - DAMPING * middle - drag * middle * abs(middle))
    y[-1] = p
    return u, y + 0.01 * r.standard_normal(n)


def term_of(seed: int, drag: float, inputs: int = 1) -> tuple[float, float] | None:
    u, y = flown(seed, drag)
    time_s = np.arange(len(u)) * STEP_S
    linear = signal.lsim(([EFFECT], [1.0, DAMPING]), u, time_s)[1]
    instruments = [np.vstack([u] * inputs)]
    found = size_terms(instruments, [y[None]], [(y - linear)[None]], STEP_S, 6.0, DAMPING)
    if found is None:
        return None
    slope = found[0].slope
    return slope.value, slope.stderr


def test_the_term_is_the_drag_within_its_errors() -> None:
    slope, stderr = term_of(1, DRAG)  # type: ignore[misc]
    assert slope < -5.0 * stderr
    assert abs(slope + DRAG) < 3.0 * stderr


def test_a_linear_rate_has_none() -> None:
    found = [term_of(seed, 0.0) for seed in range(6)]
    ratios = [each[0] / each[1] for each in found if each is not None]
    assert np.max(np.abs(ratios)) < 3.0
    assert 0.3 < np.std(ratios) < 2.0


@pytest.mark.parametrize("fitted", [0.2, -0.3])
def test_a_linear_answer_that_outlasts_the_memory_is_none(fitted: float) -> None:
    """A structure without the lag leaves slow modes whole, and short records have short windows."""
    ratios = []
    for seed in range(3):
        r = np.random.default_rng(seed)
        u = 0.05 * np.repeat(r.choice([-1.0, 1.0], 94), 8)
        time_s = np.arange(len(u)) * STEP_S
        lagged = [EFFECT], np.polymul([1.0, 1.0], [0.09, 1.0])
        y, made = (
            signal.lsim(each, u, time_s, interp=False)[1]
            for each in (lagged, ([EFFECT], [1.0, fitted]))
        )
        y = y + signal.lfilter([0.005], [1.0, -0.9], r.standard_normal(len(u)))
        rows = [np.array([each - each.mean()]) for each in (u, y, y - made)]
        found = size_terms([rows[0]], [rows[1]], [rows[2]], STEP_S, 1.0, 0.4)
        assert found is not None
        ratios.append(found[0].ratio)
    assert max(ratios) < 3.0


def test_samples_are_left_out_behind_a_low_pass_without_phase() -> None:
    """What is slow stays where it is; what would come back as slow is gone."""
    k = np.arange(1201)
    slow, fast = np.sin(0.1 * k), np.sin((2.0 * np.pi / 4.0 + 0.1) * k)
    inside = slice(20, -20)  # the filter's reach at the ends
    found = answer_by_size._thinned(np.array([slow, fast]), 4)
    assert_close(found[0, inside], slow[::4][inside], why="its ripple", atol=0.005)
    assert np.max(np.abs(found[1, inside])) < 0.005


def test_more_inputs_than_samples_tell_are_not_asked() -> None:
    assert term_of(1, DRAG, inputs=12) is None


def recorded(u: np.ndarray, y: np.ndarray, *, injected: bool = False) -> fid.Record:
    return fid.Record.from_arrays(
        np.arange(len(u)) * STEP_S,
        inputs={"tau_phi": u},
        outputs={"p": y},
        excitations={"injected": u} if injected else None,
        units={"p": "rad/s"},
        hold="first",
    )


def swept(seed: int, drag: float, injected: bool = False) -> fid.Record:
    record = recorded(*flown(seed, drag), injected=injected)
    return record.declare(loop="closed" if injected else "open")


@pytest.mark.parametrize("drag", [DRAG, 0.0])
@pytest.mark.parametrize(
    "method", ["output_error", pytest.param("filter_error", marks=pytest.mark.slow)]
)
def test_fits_of_records_in_time_are_asked_as_responses_are(method: str, drag: float) -> None:
    """Gains of them carried nothing of it: the test was one of responses alone."""
    fit = fid.identify(structure_of("published"), swept(3, drag), method=method)
    bound = errors_of(fit)["p/tau_phi"]
    found = [*answers_by_size(fit, ["p/tau_phi"], bound.band_rad_s)]
    assert [each.light for each in found] == ([Light.AMBER] if drag else [])
    own, omega = fit.model_errors["p/tau_phi"], bound.omega_rad_s
    assert bool(np.all(bound.bound > own.bound)) is bool(drag)
    if drag:
        small = EFFECT / (1j * omega + DAMPING)
        error = np.abs(small / fit.model.frequency_response(omega)[0, 0] - 1.0)
        inside = (omega > 2.0) & (omega < 15.0)
        assert np.all(bound.bound[inside] > error[inside])


def test_records_of_an_autopilots_log_are_asked_by_what_was_injected_alone() -> None:
    """It closes a loop, whether a test sees that or not: its inputs hold noise of the outputs."""
    bench = recorded(*flown(3, DRAG))
    asked = [
        [*by_size_of(fid.identify(structure_of("published"), each, method="output_error"))]
        for each in (bench, bench.replace(step=Step("Log.record")))
    ]
    assert asked == [["p/tau_phi"], []]


@pytest.mark.parametrize("drag", [DRAG, 0.0])
def test_a_prewhitened_response_is_asked_by_what_was_injected(drag: float) -> None:
    response = fid.estimate_response(
        swept(3, drag, injected=True), band_rad_s=(1.2, 25.0), estimator="prewhitened"
    )
    fit = fid.identify(fid.load_model("rate_first_order", axis="roll"), response)
    assert fit.left is not None
    assert [*fit.left.by_size] == (["p/tau_phi"] if drag else [])


@pytest.mark.parametrize("drag", [DRAG, 0.0])
def test_bounds_reach_small_motion_and_gains_are_told(drag: float) -> None:
    record = swept(3, drag)
    model = fid.load_model("rate_first_order", axis="roll")
    fit = fid.identify(model, fid.estimate_response(record, band_rad_s=(1.2, 25.0)))
    bound = fit.model_errors["p/tau_phi"]
    omega = bound.omega_rad_s
    small = EFFECT / (1j * omega + DAMPING)
    error = np.abs(small / fit.model.frequency_response(omega)[0, 0] - 1.0)
    inside = (omega > 2.0) & (omega < 15.0)
    assert np.all(bound.bound[inside] > error[inside])
    found = [*answers_by_size(fit, ["p/tau_phi"], bound.band_rad_s)]
    assert [each.light for each in found] == ([Light.AMBER] if drag else [])
    sized = fit.left.by_size.get("p/tau_phi")
    assert (sized is not None) is bool(drag)
    if sized is not None:
        less = bound.bound - np.interp(omega, sized.omega_rad_s, sized.share)
        assert np.any(less[inside] < error[inside]), "noise alone does not reach it"
    again = pickle.loads(pickle.dumps(fit.left))
    assert [*again.by_size] == [*fit.left.by_size], "what is known goes along, records do not"
