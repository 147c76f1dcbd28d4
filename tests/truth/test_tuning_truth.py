"""Tuning against closed forms, an independent optimum, python-control and exact poles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, differential_evolution, linprog

import flightid as fid
from flightid.control.autopilots import axis_loop
from flightid.control.margins.stability_count import unstable_poles
from flightid.control.tuning.controller_paths import ControllerPaths
from flightid.control.tuning.gain_search import (
    HEADROOM,
    PENALTY,
    _linear_step,
    _lowest,
    _merit,
    search,
)
from flightid.control.tuning.gain_search_result import GainSearchResult
from flightid.control.tuning.loop_problem import LoopProblem
from flightid.control.tuning.responses import responses
from flightid.control.tuning.sampled_plants import loop_grid, sample_plants
from flightid.identification.uncertain_of import uncertain_of
from flightid.vehicles import rate_truth
from tests.closeness import assert_close
from tests.examples import examples
from tests.tuning_loops import closed_loop_poles, integrators_with_delay, largest_pole

control = pytest.importorskip("control")
DELAY_S, GAIN = 0.03, 140.0
STEP_S = 0.0025


def _solve(problem: LoopProblem) -> GainSearchResult:
    return search(problem, [0], lambda _: None)


def _one(kinds: tuple[str, ...], **required: object) -> LoopProblem:
    return integrators_with_delay(np.array([GAIN]), np.array([DELAY_S]), kinds, **required)


LOOSE = {"sensitivity_peak": 50.0, "gain_margin_db": 0.5, "phase_margin_deg": 5.0}
LOOSE |= {"noise_growth": None, "band_factor": None, "angle_phase_margin_deg": 5.0}


@pytest.mark.parametrize("margin_deg", [30.0, 45.0, 60.0])
def test_phase_margin_of_integrator_and_delay(margin_deg: float) -> None:
    found = _solve(_one(("P",), **{**LOOSE, "phase_margin_deg": margin_deg}))
    # 90° less the delay's phase at the crossover k P.
    exact = np.radians(90.0 - (1 + HEADROOM) * margin_deg) / DELAY_S / GAIN
    assert found.binding == ("rate loop: phase margin",)
    assert_close(found.gains[0], exact, rtol=5e-4, why="grid of the loop")


def test_noise_and_the_ratio_of_the_autopilot_bound_gains_of_integrator_and_delay() -> None:
    free = _one(("P", "I"), **{**LOOSE, "phase_margin_deg": 30.0})
    best = _solve(free)
    noise = float(free.judge(best.gains[None]).noise.max())
    quiet = _solve(replace(free, noise_limit=0.5 * noise))
    assert "output noise" in quiet.binding
    assert quiet.gains[0] < 0.9 * best.gains[0]
    slow = _solve(replace(free, integral_ratio=0.5 * best.gains[1] / best.gains[0]))
    assert_close(
        slow.gains[1] / slow.gains[0], 0.5 * best.gains[1] / best.gains[0], rtol=1e-3, why="bound"
    )
    loop = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    ratios = [ControllerPaths(loop, "raw", False).integral_ratio(each) for each in (1.0, 3.0, None)]
    assert ratios == [1.0, 3.0, np.inf], "ArduCopter's defaults have I = P"


@pytest.mark.parametrize("margin_db", [6.0, 10.0])
def test_gain_margin_of_integrator_and_delay(margin_db: float) -> None:
    found = _solve(_one(("P",), **{**LOOSE, "gain_margin_db": margin_db}))
    exact = np.pi / 2 / DELAY_S / GAIN * 10 ** (-(1 + HEADROOM) * margin_db / 20)
    assert found.binding == ("rate loop: gain margin",)
    assert_close(found.gains[0], exact, rtol=5e-4, why="grid of the loop")


@pytest.mark.parametrize("peak", [1.4, 2.0])
def test_sensitivity_peak_of_integrator_and_delay(peak: float) -> None:
    def excess(gain: float) -> float:
        omega = np.linspace(0.2, 3.0, 40_000) / DELAY_S
        loop = gain * GAIN * np.exp(-1j * omega * DELAY_S) / (1j * omega)
        return float(np.max(1 / np.abs(1 + loop))) - peak ** (1 - HEADROOM)

    exact = brentq(excess, 0.02, 0.3)
    found = _solve(_one(("P",), **{**LOOSE, "sensitivity_peak": peak}))
    assert found.binding == ("rate loop: sensitivity peak",)
    assert_close(found.gains[0], exact, rtol=5e-4, why="grid of the loop")


@pytest.mark.nightly
def test_the_search_finds_the_optimum_that_a_slower_one_finds() -> None:
    problem = _one(("P", "I", "D"), noise_growth=None, band_factor=None)

    def loss(points: np.ndarray) -> np.ndarray:
        judged = problem.judge(np.exp(points.T))
        short = np.minimum(0.0, judged.slack.min(axis=(0, 2)) - 2e-3)
        return -judged.objective[:, 0] - 100.0 * short

    slow = differential_evolution(
        loss, [(-4.0, 0.0), (-4.0, 3.0), (-9.0, -4.0)], seed=1, popsize=10, maxiter=45, tol=1e-8,
        vectorized=True, updating="deferred",
    )  # fmt: skip
    quick = _solve(problem)
    assert quick.exists
    reached = float(problem.judge(quick.gains[None]).objective[0, 0])
    assert reached > -slow.fun - 0.01, "within 1 % of the global optimum"


def test_an_independent_pi_optimum() -> None:
    """Integrator with delay: the least square of the rate after a step, on 45° and a peak of 2."""

    def left(p: float, ratio: float) -> float:
        omega = np.geomspace(1e-3, 3e3, 1000)
        s = 1j * omega
        plant = GAIN * np.exp(-DELAY_S * s) / s
        loop = p * (1 + ratio / s) * plant
        if 1 / np.abs(1 + loop).min() > 2.0:
            return np.inf
        crossover = np.interp(0.0, -np.log(np.abs(loop)), omega)
        phase = np.interp(crossover, omega, np.unwrap(np.angle(loop)))
        if np.degrees(phase) + 180.0 < 45.0:
            return np.inf
        return float(np.trapezoid(np.abs(plant / (1 + loop) / omega) ** 2, omega))

    table = [
        (left(p, ratio), p, ratio)
        for p in np.linspace(0.11, 0.17, 16)
        for ratio in np.linspace(1.5, 6.0, 16)
    ]
    best, p, ratio = min(table)
    found = _solve(_one(("P", "I"), noise_growth=None, band_factor=None))
    assert_close(left(*found.gains * [1, 1 / found.gains[0]]), best, rtol=0.02, why="grid of 3 %")
    assert_close(found.gains[0], p, rtol=0.05, why="grid of the independent search")
    assert_close(found.gains[1] / found.gains[0], ratio, rtol=0.15, why="a flat optimum")


@given(
    gains=st.tuples(st.floats(0.02, 0.6), st.floats(0.0, 3.0), st.floats(0.0, 0.03)),
    angle=st.floats(1.0, 25.0),
    damping=st.floats(-8.0, 6.0),
    delay_s=st.floats(0.003, 0.06),
)
@examples(60)
def test_the_count_is_that_of_the_exact_poles(
    gains: tuple[float, float, float], angle: float, damping: float, delay_s: float
) -> None:
    lag = fid.LinearSystem(
        [[-20.0, 0.0], [140.0, damping]], [[20.0], [0.0]], [[0.0, 1.0]], [[0.0]],
        ("tau_phi",), ("p",), [delay_s],
    )  # fmt: skip
    plants = sample_plants([lag], ["p"], ["tau_phi"], STEP_S, hold_in_model=False)
    loop = axis_loop("arducopter", "roll", loop_rate_hz=1 / STEP_S).with_gains(
        ATC_RAT_RLL_P=gains[0], ATC_RAT_RLL_I=gains[1], ATC_RAT_RLL_D=gains[2], ATC_ANG_RLL_P=angle
    )
    omega = loop_grid(STEP_S, 1500)
    rate, turned = (each[0, 0, 0] for each in plants.responses(omega))
    paths = ControllerPaths(loop, "filtered", True)
    values, terms = paths.gains_of(loop), paths.forward(omega)
    inner = values[:-1] @ paths.feedback(omega) * rate
    outer = values[-1] * paths.angle(omega) * (values[:-1] @ terms[:-1] + terms[-1]) * turned
    for whole, loops in ((False, inner), (True, inner + outer)):
        poles = closed_loop_poles(plants, 0, loop, angle=whole)
        sizes = np.abs(poles if whole else np.delete(poles, np.argmin(np.abs(poles - 1.0))))
        if np.min(np.abs(sizes - 1.0)) < 2e-5:
            continue  # on the circle within rounding: either answer is right
        counted = int(unstable_poles(omega, 1.0 + loops, plants.unstable[0]))
        if counted == -1:
            # Too coarse to tell is never taken for stable, and said of poles at the circle alone.
            assert np.min(np.abs(sizes - 1.0)) < 1e-3
            continue
        assert counted == np.count_nonzero(sizes > 1.0)


def test_margins_are_those_of_python_control() -> None:
    truth = rate_truth("roll")
    flown = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    design = fid.tune_pid(
        truth.system(), gains=flown, gyro="raw", band_rad_s=(0.5, 120.0), nominal=True,
        angle_loop=False,
    )  # fmt: skip
    assert design.exists
    omega = np.geomspace(0.5, 0.99 * np.pi / STEP_S, 3_000)
    # The model's delay is taken to hold half a sample already, so python-control is given that.
    shifted = sample_plants([truth.system()], ["p"], ["tau_phi"], STEP_S, hold_in_model=True)
    loop = (
        design.loop.feedback(omega, gyro="raw", with_hold=False)
        * shifted.responses(omega)[0][0, 0, 0]
    )
    gain_margin, phase_margin, *_ = control.stability_margins(control.frd(loop, omega))
    assert_close(
        design.worst_case("rate loop", "phase margin").nominal or 0.0, phase_margin, rtol=2e-3,
        why="grids of both",
    )  # fmt: skip
    assert_close(
        design.worst_case("rate loop", "gain margin").nominal or 0.0, 20 * np.log10(gain_margin),
        rtol=2e-3, why="grids of both",
    )  # fmt: skip


def _chain(poles: list[float]) -> fid.LinearSystem:
    """First-order lags one after the other; equal ones have one mode together."""
    a = np.diag(poles) + np.diag(np.ones(len(poles) - 1), -1)
    b, c = np.eye(len(poles), 1), np.eye(len(poles))[::-1][:1]
    return fid.LinearSystem(a, b, c, [[0.3]], ("tau_phi",), ("p",), [0.017])


@pytest.mark.parametrize("poles", [[-20.0, -4.0], [-20.0, 2.0, -0.3], [-7.0, -7.0, -7.0]])
def test_sampled_plants_respond_as_their_matrices_do(poles: list[float]) -> None:
    plants = sample_plants([_chain(poles)], ["p"], ["tau_phi"], STEP_S, hold_in_model=False)
    omega = loop_grid(STEP_S, 300)
    rate, angle = (each[0, 0, 0] for each in plants.responses(omega))
    (system,), late = plants.systems, np.exp(-1j * omega * STEP_S * plants.delays[0][0])
    exact = system.frequency_response(omega)[:, 0] * late
    exact *= np.exp(1j * omega * plants.advances_s[0][0])
    assert_close(np.array([rate, angle]), exact, rtol=1e-12, why="one response, delayed")


def test_steps_are_those_of_the_recursion() -> None:
    """The exact controller, sample by sample, around the sampled plant."""
    truth, flown = rate_truth("roll"), axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    plants = sample_plants([truth.system()], ["p"], ["tau_phi"], STEP_S, hold_in_model=False)
    time_s, values = responses(plants, [flown], 0, "filtered")["rate step"]
    a, b, c, *_ = plants.systems[0].state_space()
    state, outputs, rates = np.zeros(len(a)), [0.0] * int(plants.delays[0][0]), []
    v = flown.values
    alpha = {r: STEP_S / (STEP_S + 1 / (2 * np.pi * v[r])) for r in ("fltt", "fltd")}
    target = last = slope = integral = 0.0
    for _ in time_s:
        rate = float(c[0] @ state)
        rates.append(rate)
        target += alpha["fltt"] * (1.0 - target)
        error = target - rate
        slope += alpha["fltd"] * ((error - last) / STEP_S - slope)
        integral += v["i"] * error * STEP_S
        last = error
        outputs.append(v["p"] * error + integral + v["d"] * slope)
        state = a @ state + b[:, 0] * outputs.pop(0)
    assert_close(values[0], rates, atol=2e-4, why="a span of 8 s that leaves slow modes 1e-4")


@pytest.mark.nightly
@given(
    effect=st.floats(20.0, 800.0),
    damping=st.floats(-10.0, 5.0),
    lag_s=st.floats(0.01, 0.2),
    delay_s=st.floats(0.004, 0.25),
    doubt=st.floats(0.002, 0.25),
)
@examples(4, fewest=2)
def test_designs_are_stable_for_every_plant_or_there_are_none(
    effect: float, damping: float, lag_s: float, delay_s: float, doubt: float
) -> None:
    model = fid.load_model("rate_motor_lag", axis="roll").with_values(
        {"Ltphi": effect, "Lp": damping, "T_m": lag_s, "tau": delay_s}
    )
    omega = np.geomspace(0.5, 120.0, 30)
    data = fid.FrequencyResponse.from_values(
        omega, model.frequency_response(omega), inputs=model.inputs, outputs=model.outputs,
        units=model.units, random_error=np.full((1, 1, 30), doubt),
    )  # fmt: skip
    fit = fid.identify(model, data, correct_bias=False)
    flown = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    design = fid.tune_pid(fit, gains=flown, draws=10)
    if not design.exists:
        assert design.binding
        assert design.findings[0].code == "no-gains"
        return
    drawn = [fit.model, *uncertain_of(fit).draws(10, 0)]
    plants = sample_plants(drawn, ["p"], ["tau_phi"], STEP_S, hold_in_model=True)
    assert not np.any(plants.advances_s)
    for row in range(len(plants)):
        for angle in (False, True):
            assert largest_pole(plants, row, design.loop, angle=angle) < 1.0


def test_a_step_is_the_best_of_all_rows_though_few_are_asked() -> None:
    random = np.random.default_rng(1)
    asked = []
    for size in (0.01, 0.1, 0.5):
        limits, levels = random.uniform(-0.02, 0.3, (2, 40))
        slopes = random.standard_normal((2, 40, 3))
        low, high = -size * np.ones(3), size * np.ones(3)
        step = _linear_step((limits, levels, *slopes), low, high)
        assert step is not None
        rows = np.vstack([
            np.column_stack([-slopes[0], np.zeros(40), -np.ones(40)]),
            np.column_stack([-slopes[1], np.ones(40), np.zeros(40)]),
        ])  # fmt: skip
        whole = linprog(
            [0.0, 0.0, 0.0, -1.0, PENALTY], A_ub=rows, b_ub=np.concatenate([limits, levels]),
            bounds=[*zip(low, high, strict=True), (None, None), (0.0, None)],
        )  # fmt: skip
        found = _merit((limits + slopes[0] @ step)[None], (levels + slopes[1] @ step)[None])
        asked.append(np.sum(_lowest(limits, slopes[0], low, high) < 0.0))
        assert_close(found[0], -whole.fun, rtol=1e-9, atol=1e-9, why="the same linear programme")
    assert asked == sorted(asked)
    assert asked[0] < 10
