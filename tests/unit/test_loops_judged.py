"""What a search raises and what it promises, of three integrators with delay, number by number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from flightid.control.tuning.limits import limits, noise_limit
from flightid.control.tuning.loop_problem import LoopProblem, highest_crossover
from flightid.control.tuning.worst_cases import (
    KINDS,
    NOISE,
    _number,
    _worst,
    to_the_worse,
    worst_cases,
)
from tests.closeness import assert_close
from tests.tuning_loops import integrators_with_delay

Array = NDArray[np.float64]
PLANTS = np.array([140.0, 120.0, 170.0])
DELAYS = np.array([0.03, 0.036, 0.025])
GAINS = np.array([[0.05, 0.08], [0.02, 0.01]])
MORE = {
    "crossover": True, "phase margin": True, "gain margin": True, "gain reduction margin": True,
    "delay margin": True, "sensitivity peak": False, "disturbance bandwidth": True,
    "disturbance peak": False,
}  # fmt: skip


def _problem(**required: object) -> LoopProblem:
    return integrators_with_delay(PLANTS, DELAYS, ("P", "I"), **required)


def _loops(omega: Array, gains: Array) -> tuple[Array, Array, Array]:
    """Plants, controller and loops of one candidate, written out."""
    s = 1j * omega
    plant = PLANTS[:, None] * np.exp(-DELAYS[:, None] * s) / s
    control = gains[0] + gains[1] / s
    return plant, control, control * plant


@pytest.mark.parametrize("objective", ["disturbance", "crossover", "disturbance_bandwidth"])
def test_what_is_raised_is_a_bandwidth_and_little_left_of_a_step(objective: str) -> None:
    problem = _problem(objective=objective)
    judged = problem.judge(GAINS)
    omega = problem.plants.omega_rad_s
    for k, gains in enumerate(GAINS):
        plant, _, loop = _loops(omega, gains)
        left = np.abs(plant / (1.0 + loop)) / omega
        little = -0.5 * np.log(np.trapezoid(left**2, omega, axis=1) / np.pi)
        wanted = little
        if objective != "disturbance":
            field = "crossover_rad_s" if objective == "crossover" else "disturbance_bandwidth_rad_s"
            bandwidth = getattr(judged.metrics["rate loop"], field)[k]
            wanted = np.log(bandwidth) + 0.2 * little
        assert_close(judged.objective[k], wanted, rtol=1e-9, why="the same integral")


def test_noise_is_rms_over_the_band_or_of_its_density() -> None:
    problem = _problem()
    omega = problem.plants.omega_rad_s
    psd = 1e-3 * (1.0 + omega / 100.0)
    limited = replace(problem, noise_psd=psd, noise_limit=0.05)
    judged, known = problem.judge(GAINS), limited.judge(GAINS)
    for k, gains in enumerate(GAINS):
        _, control, loop = _loops(omega, gains)
        power = np.abs(control / (1.0 + loop)) ** 2
        white = np.sqrt(np.trapezoid(power, omega, axis=1) / omega[-1])
        told = np.sqrt(np.trapezoid(power * psd, omega, axis=1) / (2.0 * np.pi))
        assert_close(judged.noise[k], white, rtol=1e-9, why="the same integral")
        assert_close(known.noise[k], told, rtol=1e-9, why="the same integral")
    assert "output noise" not in judged.names
    slack = known.slack[known.names.index("output noise")]
    assert_close(slack, np.clip(np.log(0.05 / known.noise), -20.0, 1.0), rtol=1e-9, why="its log")
    few = limited.with_plants(problem.plants.thinned(3))
    assert few.noise_psd is not None
    assert_close(few.noise_psd, psd[::-1][::3][::-1], rtol=1e-9, why="at the same frequencies")
    assert few.plants.omega_rad_s[-1] == omega[-1]


def test_peaks_have_a_slack_by_bands_and_plants_that_fall_have_none() -> None:
    problem = _problem(sensitivity_peak=1.8)
    judged = problem.judge(GAINS)
    omega = problem.plants.omega_rad_s
    for k, gains in enumerate(GAINS):
        _, _, loop = _loops(omega, gains)
        least = np.min(np.abs(1.0 + loop), axis=1)
        worst = 1.0 + np.log(least) / np.log(1.8)
        assert_close(judged.peaks[0, k].min(axis=1), worst, rtol=1e-9, why="the whole is its bands")
        low = judged.peaks[0, k, :, 0]
        assert np.all(low == 1.0)  # Where the loop is strong nothing is limited.
    assert judged.names[0] == "stability"
    wild = problem.judge(np.array([[0.5, 0.1]]))
    assert wild.slack[0].tolist() == [[-1.0] * 3]
    assert not wild.stable.any()
    assert judged.slack[0].tolist() == [[1.0] * 3] * 2
    some = problem.judge(GAINS, [2, 0])
    assert_close(some.objective, judged.objective[:, [2, 0]], rtol=1e-12, why="the same plants")


def test_the_worst_plant_of_each_number_is_on_the_side_of_its_limit() -> None:
    problem = replace(_problem(), noise_limit=0.06, crossover_limit_rad_s=9.0)
    gains, flown = GAINS
    new, old = problem.judge(gains[None]), problem.judge(flown[None])
    cases, kept = worst_cases(problem, gains, old)
    assert kept.tolist() == (new.slack[:, 0].min(axis=0) >= 0.0).tolist()
    assert [each.name for each in cases] == [*MORE, "noise over gyro noise"]
    asked = {(e.loop, e.field): e for e in limits(problem.requirements, new.metrics, 9.0)}
    for kind, case in zip(KINDS, cases, strict=False):
        values = getattr(new.metrics["rate loop"], kind.field)[0]
        before = getattr(old.metrics["rate loop"], kind.field)[0]
        limit = asked.get(("rate loop", kind.field))
        more = MORE[kind.name] if limit is None else not limit.most
        assert case.nominal == _number(values[0])
        assert case.worst == _worst(values, more), kind.name
        assert (case.flown, case.flown_worst) == (_number(before[0]), _worst(before, more))
        assert case.n_plants == 3
        if limit is not None:
            misses = values > limit.bound if limit.most else values < limit.bound
            assert (case.n_missed, case.met) == (int(misses.sum()), not misses.any()), kind.name
            if misses.any():
                assert case.missed == pytest.approx(values.max() if limit.most else values.min())
    noise = cases[-1]
    assert (noise.nominal, noise.worst) == (new.noise[0, 0], new.noise[0].max())
    assert (noise.flown, noise.flown_worst) == (old.noise[0, 0], old.noise[0].max())
    assert noise.required == noise_limit(0.06).text
    (again, _) = worst_cases(problem, gains, None)
    assert {(each.flown, each.flown_worst) for each in again} == {(None, None)}


def test_numbers_read_above_the_band_are_not_promised() -> None:
    problem = _problem()
    new = problem.judge(GAINS[:1])
    read = new.metrics["rate loop"].phase_crossover_rad_s[0]
    for edge, promised in ((read.max() * 1.001, True), (read.max() * 0.999, False)):
        cases, _ = worst_cases(problem, GAINS[0], None, (0.1, float(edge)))
        margin = next(each for each in cases if each.name == "gain margin")
        assert (margin.estimate.reason == "read above the identified band") is not promised
        assert promised or margin.worst is None


def test_numbers_are_rounded_to_the_side_on_which_their_promise_holds() -> None:
    for kind in (*KINDS, NOISE):
        more = {**MORE, "noise": False}[kind.name]
        low, high = to_the_worse(kind.name, 2.3456), to_the_worse(kind.name, 2.3412)
        assert (low, high) == ((2.34, 2.34) if more else (2.35, 2.35)), kind.name
    assert to_the_worse("disturbance bandwidth over what flew", 2.3456) == 2.34
    assert to_the_worse("sensitivity peak", 2.3412, 2.4) == 2.34
    assert to_the_worse("phase margin", 2.3412, 2.3) == 2.35
    assert to_the_worse("phase margin", 2.3456, 2.3456) == 2.34
    assert to_the_worse("phase margin", None, 2.0) is None


def test_the_highest_of_several_crossovers_is_found() -> None:
    omega = np.geomspace(0.1, 100.0, 4001)
    gain = (2.0 / omega) * (1.0 + 30.0 / (1.0 + ((omega - 20.0) / 1.0) ** 2))
    loops = np.stack([gain, 2.0 / omega, np.full_like(omega, 0.5)]).astype(complex)
    found = highest_crossover(omega, loops)
    # 2/ω (1 + 30/(1 + x²)) = 1 beyond the bump: ω = 22.08...
    beyond = np.roots([1.0, -(2.0 + 40.0), 401.0 + 80.0, -2.0 * (401.0 + 30.0)])
    assert_close(found[0], np.max(beyond.real), rtol=1e-5, why="chords of a fine grid")
    assert_close(found[1], 2.0, rtol=1e-9, why="a line in logarithms")
    assert np.isnan(found[2])


def test_what_flew_is_told_of_the_estimate_and_at_worst_of_plants_that_all_hold() -> None:
    problem = _problem()
    judged = problem.judge(GAINS[:1])
    noise = np.array([[0.5, 0.7, 0.6]])
    table = {
        (True, True, True): (0.5, 0.7), (True, False, True): (0.5, None),
        (True, True, False): (0.5, None), (False, True, True): (None, None),
    }  # fmt: skip
    for stable, (flown, flown_worst) in table.items():
        old = replace(judged, stable=np.array([stable]), noise=noise)
        told = {(each.loop, each.name): each for each in worst_cases(problem, GAINS[0], old)[0]}
        of_noise = told["output", "noise over gyro noise"]
        assert (of_noise.flown, of_noise.flown_worst) == (flown, flown_worst)
        (loop,) = old.metrics
        of_phase = told[loop, "phase margin"]
        values = old.metrics[loop].phase_margin_deg[0]
        assert of_phase.flown == (None if flown is None else values[0])
        assert of_phase.flown_worst == (None if flown_worst is None else values.min())
