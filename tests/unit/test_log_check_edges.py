"""Checks of logs against themselves at both sides of every limit, on streams made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.conventions import Axis, Light
from flightid.logs import scale_check, self_check
from flightid.logs.blackbox import stick_rates
from flightid.logs.scale_check import ScaleCheck
from flightid.logs.self_check import AxisCheck
from tests.handmade_log import HandmadeLog

Array = np.ndarray
DEGREE = 180.0 / np.pi


def test_windows_of_turning_hold_ten_samples_and_lie_in_what_is_shared() -> None:
    def stream(step: float, start: float, stop: float) -> tuple[Array, Array]:
        stamps = np.arange(start, stop + 0.5 * step, step)
        return stamps, 0.0 * stamps

    for steps, span, window, first, count in (
        ((0.01, 0.01), None, 0.3, 1.0, 25),
        ((0.01, 0.05), None, 0.5, 1.0, 400),
        ((0.01, 0.02), (2.0, 99.0), 0.3, 2.0, 323),
        ((0.04, 0.01), (0.0, 1e4), 0.4, 1.0, 500),
    ):
        long = 25.01 * window if count == 25 else 200.1
        streams = [stream(steps[0], 0.0, first + long), stream(steps[1], 1.0, first + long + 9.0)]
        edges = scale_check._edges(streams, span)
        assert edges is not None
        assert edges[0] == first
        assert np.diff(edges) == pytest.approx(window)
        assert len(edges) - 1 == count
    short = [stream(0.01, 0.0, 7.4)] * 2
    assert scale_check._edges(short, None) is None
    assert scale_check._edges(short, (9.0, 8.0)) is None
    most = scale_check._edges([(np.array([0.0, 0.01, 0.02, 5e3]), np.zeros(4))] * 2, None)
    assert most is not None
    assert len(most) == 5001


def test_turning_is_the_integral_of_a_rate_between_edges() -> None:
    stamps = np.array([0.0, 1.0, 1.5, 4.0])
    found = scale_check._turned(
        (stamps, np.array([2.0, 4.0, 0.0, 1.0])), np.array([0.0, 1.0, 1.5, 4.0])
    )
    assert found == pytest.approx([3.0, 1.0, 1.25])


def attitude(seconds: float = 60.0) -> tuple[Array, Array, Array]:
    """Angles and body rates of a motion of all three axes at 100 Hz, by the kinematics."""
    t = np.arange(0.0, seconds, 0.01)
    angles = np.array([0.5 * np.sin(1.1 * t), 0.4 * np.sin(0.7 * t + 1.0), 0.9 * np.sin(0.5 * t)])
    turned = np.array(
        [0.55 * np.cos(1.1 * t), 0.28 * np.cos(0.7 * t + 1.0), 0.45 * np.cos(0.5 * t)]
    )
    (phi, theta, _), (d_phi, d_theta, d_psi) = angles, turned
    rates = np.array(
        [
            d_phi - np.sin(theta) * d_psi,
            np.cos(phi) * d_theta + np.sin(phi) * np.cos(theta) * d_psi,
            np.cos(phi) * np.cos(theta) * d_psi - np.sin(phi) * d_theta,
        ]
    )
    return t, angles, rates


def test_rates_turn_as_the_attitude_does() -> None:
    t, angles, rates = attitude()
    told = [(name, (t, each)) for name, each in zip("abc", angles, strict=True)]
    for axis, quantity in enumerate("pqr"):
        found = scale_check._beside_attitude(axis, quantity, ("w", (t, rates[axis])), told, None)
        assert found is not None
        assert (found.first, found.second, found.n_windows) == ("w", "abc"[axis], 199)
        assert found.factor == pytest.approx(1.0, abs=2e-3)
        assert found.correlation > 0.9999
        assert found.finding is None
        twice = ("v", (t, -2.0 * rates[axis]))
        both = scale_check._compared(quantity, ("w", (t, rates[axis])), twice, (0.0, 9.0))
        assert both is not None
        assert (both.first, both.second) == ("w", "v")
        assert (both.factor, both.correlation, both.n_windows) == (
            pytest.approx(2.0),
            pytest.approx(-1.0),
            30,
        )
    # Below 0.02 of what a stream counts nothing turns; below nine tenths nothing is alike.
    turns = np.tile([1.0, -1.0], 20)
    for level, is_told in ((0.021, True), (0.019, False)):
        both = scale_check._check("p", "a", "b", (turns * level * 0.3, turns * 1e-4), 0.3)
        assert (both is not None) is is_told
    stamps = 0.01 * np.arange(6001)
    for level, is_told in ((0.021, True), (0.019, False)):
        rate = ("w", (stamps, level * (-1.0) ** np.floor(stamps / 0.3 + 1e-9)))
        angle = ("b", (stamps, np.cumsum(rate[1][1]) * 0.01))
        still = ("c", (stamps, 0.0 * stamps))
        assert (scale_check._compared("p", rate, rate, None) is not None) is is_told
        beside = scale_check._beside_attitude(0, "p", rate, [angle, still, still], None)
        assert (beside is not None) is is_told
    other = np.tile([1.0, 1.0, -1.0, -1.0], 10)
    for share, is_told in ((0.47, True), (0.49, False)):
        found = scale_check._check("p", "a", "b", (turns, turns + share * other), 0.3)
        assert (found is not None) is is_told


def test_a_factor_is_contradicted_beyond_its_noise_and_a_twentieth() -> None:
    def said(factor: float, correlation: float = 1.0, n: int = 100) -> str:
        found = ScaleCheck("p", "a", "b", factor, correlation, n).finding
        assert found is None or (found.light, found.code) == (Light.RED, "scale-contradicted")
        return "" if found is None else found.message

    for factor, is_one in ((1.0501, False), (1.0499, True), (0.9501, True), (0.9499, False)):
        assert (said(factor) == "") is is_one
    # A correlation of 0.96 lets 4 % and three errors of sqrt(1 - 0.96²)/10 more pass.
    scatter = 1.0 + 3.0 * 0.28 / 10.0
    for factor, is_one in (
        (1.05 / 0.96 * scatter * 1.001, False),
        (1.05 / 0.96 * scatter * 0.999, True),
        (0.95 * 0.96 / scatter * 1.001, True),
        (0.95 * 0.96 / scatter * 0.999, False),
    ):
        assert (said(factor, 0.96) == "") is is_one
    assert said(1.0, -1.0) == "b shows -1 times the turning of a (correlation 1.000)"
    hint = ": degrees beside radians"
    for factor, is_hinted in (
        (DEGREE, True),
        (1.0 / DEGREE, True),
        (DEGREE * 1.049, True),
        (DEGREE * 1.051, False),
        (DEGREE * 0.951, True),
        (DEGREE * 0.949, False),
        (2.0, False),
    ):
        assert said(factor).endswith(hint) is is_hinted


def test_curves_of_sticks_are_the_firmwares() -> None:
    """Half and full stick, worked out by hand from the firmware's lines."""
    for curve, header, half, full in (
        # 200 * rate * expo'd stick / (1 - stick * super).
        ("Betaflight", (100.0, 0.0, 0.0), 100.0, 200.0),
        ("Betaflight", (100.0, 50.0, 0.0), 100.0 / 0.75, 400.0),
        ("Betaflight", (100.0, 0.0, 40.0), 200.0 * (0.5 * 0.125 * 0.4 + 0.5 * 0.6), 200.0),
        ("Betaflight", (210.0, 0.0, 0.0), 100.0 * (2.1 + 1.454), 200.0 * (2.1 + 1.454)),
        ("Betaflight", (200.0, 0.0, 0.0), 200.0, 400.0),
        ("RaceFlight", (40.0, 0.0, 0.0), 200.0, 400.0),
        ("RaceFlight", (40.0, 50.0, 20.0), 400.0 * 0.85 * 0.5 * 1.25, 400.0 * 1.5),
        ("KISS", (100.0, 0.0, 0.0), 100.0, 200.0),
        ("KISS", (100.0, 50.0, 40.0), 200.0 * (0.125 * 0.4 + 0.5 * 0.6) / 0.75, 400.0),
        ("Actual", (7.0, 67.0, 0.0), 35.0 + 600.0 * 0.25, 670.0),
        ("Actual", (7.0, 67.0, 50.0), 35.0 + 300.0 * (0.5**5 * 0.5 + 0.25), 670.0),
        ("Actual", (70.0, 67.0, 50.0), 350.0, 700.0),
        ("Quick", (100.0, 60.0, 0.0), 100.0 / (1.0 - 0.5 * (1.0 - 200.0 / 600.0)), 600.0),
        ("Quick", (100.0, 10.0, 0.0), 100.0, 200.0),
        ("Quick", (0.5, 0.1, 0.0), 1.0, 2.0),
        (
            "Quick",
            (100.0, 60.0, 30.0),
            100.0 / (1.0 - (0.125 * 0.3 + 0.5 * 0.7) * (1.0 - 200.0 / 600.0)),
            600.0,
        ),
    ):
        found = stick_rates.stick_rate(curve, np.array([0.5, 1.0, -0.5, 0.0]), *header)
        assert found == pytest.approx([half, full, -half, 0.0]), (curve, header)
    assert stick_rates.stick_rate("Betaflight", np.array([1.0]), 100, 100, 0)[0] == 1998.0
    quick = stick_rates.CURVES["Quick"][1]
    assert quick(np.array([0.5]), 0.5, 0.1, 0.0) == pytest.approx([1.0])
    assert stick_rates.stick_rate("Betaflight", np.array([-0.2]), 255, 255, 0)[0] == pytest.approx(
        -200.0 * (2.55 + 14.54 * 0.55) * 0.2 / 0.49
    )
    near = stick_rates.stick_rate("RaceFlight", np.array([0.5]), 40, 50, 20)
    (_, early), (_, expo) = stick_rates.CURVES["RaceFlight"], stick_rates.CURVES["Quick"]
    assert early(np.array([0.5]), 40.0, 50.0, 20.0) == pytest.approx(near / 1.25 * 1.5)
    made = expo(np.array([0.5, -1.0]), 100.0, 60.0, 30.0)
    assert made == pytest.approx(
        [200.0 * (0.125 * 0.3 + 0.5 * 0.7) / (1.0 - 0.5 * (2.0 / 3.0)), -600.0]
    )
    for name in ("KISS", "Quick"):
        most = stick_rates.CURVES[name][0](np.array([1.0]), 100.0, 1e9, 0.0)
        steep = {"KISS": 200.0 / 0.01, "Quick": 200.0 / 0.01}[name]
        assert most == pytest.approx(steep, rel=1e-5)


def test_the_curve_that_p_terms_bear_out_is_taken() -> None:
    rng = np.random.default_rng(0)
    sticks = 500.0 * np.clip(rng.standard_normal((3, 400)) * 0.4, -1.0, 1.0)
    rates = rng.standard_normal((3, 400)) * 50.0
    header = {
        f"{name}[{k}]": v + k
        for name, v in (("rc_rates", 10.0), ("rates", 60.0), ("rc_expo", 30.0))
        for k in range(3)
    }
    for place, (name, curves) in enumerate(stick_rates.CURVES.items()):
        for curve in curves:
            asked = np.array(
                [curve(sticks[k] / 500.0, 10.0 + k, 60.0 + k, 30.0 + k) for k in range(3)]
            )
            terms = 0.7 * (np.clip(asked, -1998.0, 1998.0) - rates)
            for told in ({}, {"rates_type": float(place)}):
                found = stick_rates.stick_rates(sticks, rates, terms, header | told)
                assert found is not None
                assert found.curve == name
                assert found.explained == pytest.approx(1.0)
                assert found.set_points == pytest.approx(np.clip(asked, -1998.0, 1998.0))
    still = np.vstack([0.0 * terms[:2], terms[2:]])
    assert stick_rates.stick_rates(sticks, rates, still, header) is None
    one = np.vstack([0.0 * terms[:1], terms[1:2], 0.0 * terms[2:]])
    assert stick_rates.stick_rates(sticks, rates, one, header) is not None
    lacking = {key: each for key, each in header.items() if key != "rates[2]"}
    assert stick_rates.stick_rates(sticks, rates, terms, lacking) is None
    old = {"rc_rate": 1.0, "rc_rate_yaw": 2.0, "rc_expo": 3.0, "rc_yaw_expo": 4.0}
    old |= {f"rates[{k}]": 5.0 + k for k in range(3)}
    assert [stick_rates._told(old, k) for k in range(3)] == [
        (1.0, 5.0, 3.0),
        (1.0, 6.0, 3.0),
        (2.0, 7.0, 4.0),
    ]
    error, other = np.array([1.0, 0.0]), np.array([3.0, 4.0])
    assert stick_rates._explained(error, other) == pytest.approx(0.36)
    assert stick_rates._explained(1e-3 * error, 1e-3 * other) == pytest.approx(0.36)
    assert stick_rates._explained(error, -other) == pytest.approx(-0.36)
    assert stick_rates._explained(0.0 * error, other) == 0.0
    for share, is_borne_out in ((0.9, True), (0.899, False)):
        assert stick_rates.StickRates("x", other, share).is_borne_out is is_borne_out


def test_rows_of_one_loop_are_paired() -> None:
    """Loops of 10 ms: from two tenths of a loop before to eight tenths after."""
    stamps = np.array([1.0, 1.01, 1.02])
    for late, known in (
        (-0.0021, [(0, 1), (1, 2)]),
        (-0.0019, [(0, 0), (1, 1)]),
        (0.0079, [(0, 0), (1, 1)]),
        (0.0081, [(1, 0)]),
    ):
        rows, others = self_check.paired_rows(stamps[:2], stamps + late, 0.01)
        assert list(zip(rows.tolist(), others.tolist(), strict=True)) == known
    rows, others = self_check.paired_rows(np.array([1.0, 5.0]), np.array([1.001]), 0.01)
    assert (rows.tolist(), others.tolist()) == ([0], [0])


def test_the_time_of_a_loop() -> None:
    log: Any = HandmadeLog("ardupilot")
    assert self_check.loop_time(log) == 0.0025
    log.with_table("ANG", [0.0, 1.0, 2.0], Dt=np.array([0.002, 0.004, 0.005]))
    type(log.table("ANG")).__contains__ = lambda table, name: name in table._columns
    assert self_check.loop_time(log) == 0.004
    log.parameters["SCHED_LOOP_RATE"] = 300.0
    assert self_check.loop_time(log) == 1.0 / 300.0
    log.parameters["SCHED_LOOP_RATE"] = 0.0
    log.with_table("ANG", [0.0], Dt=np.array([0.0]))
    assert self_check.loop_time(log) == 0.0025


def test_projections_and_delays_of_a_chirp() -> None:
    chirp = np.array([3.0, 4.0])
    assert self_check._projection(np.array([1.0, 0.0]), chirp) == pytest.approx((0.6, 3.0 / 25.0))
    assert self_check._projection(np.array([1.0, 0.0]), 0.0 * chirp) == (0.0, 0.0)
    t = np.arange(0.0, 5.0, 0.01)

    def spline(at: Array) -> Array:
        return np.sin(2.0 * np.pi * (at + 0.5 * at**2))

    for loops in (-1.9, -0.3, 1.0, 3.8):
        left = -0.4 * spline(t - loops * 0.004)
        assert self_check._best_lag(left, t, spline, 0.004) / 0.004 == pytest.approx(
            loops, abs=1e-3
        )


def swept(gain: float = 0.5, lag_loops: float = 1.0, seconds: float = 10.0) -> tuple[Any, Any]:
    """A log in which a chirp was added to the terms of roll, and its run."""
    t = 20.0 + np.arange(0.0, seconds, 0.01)
    clock = t - 20.0

    def chirp(at: Array) -> Array:
        return np.where(at > 0.0, np.sin(2.0 * np.pi * (0.5 * at + 0.2 * at**2)), 0.0)

    log: Any = HandmadeLog("ardupilot")
    terms = {"P": np.sin(t), "I": 0.1 * t, "D": np.cos(t), "FF": 0.0 * t + 0.2}
    total = sum(terms.values())
    log.with_table("RATE", t, ROut=total + gain * chirp(clock - 0.01 * lag_loops), POut=total)
    log.with_table("PIDR", t + 0.001, **terms).with_table("PIDP", t + 0.001, **terms)
    log.with_table("SIDD", t + 0.002, Time=clock, Targ=chirp(clock))
    log.parameters["SCHED_LOOP_RATE"] = 100.0
    type(log.table("RATE")).__contains__ = lambda table, name: name in table._columns
    run = SimpleNamespace(
        start_s=20.0, stop_s=20.0 + seconds, delay_s=1.0, record_s=seconds - 2.0,
        point="mixer", body_axis=Axis.ROLL, axis=10,
    )  # fmt: skip
    return log, run


def test_what_reached_the_mixer_is_measured_on_each_axis() -> None:
    log, run = swept()
    roll = self_check._check_axis(log, run, Axis.ROLL, 0.01)
    pitch = self_check._check_axis(log, run, Axis.PITCH, 0.01)
    assert roll is not None
    assert roll.gain == pytest.approx(0.5, rel=2e-3)
    assert roll.lag_loops == pytest.approx(1.0, abs=0.02)
    assert roll.lag_s == pytest.approx(0.01 * roll.lag_loops)
    assert roll.correlation > 0.9999
    assert pitch is not None
    assert (pitch.correlation, pitch.gain, pitch.lag_s, pitch.lag_loops) == (0.0,) * 4
    assert pitch.residual_rms < 1e-12
    assert self_check._check_axis(log, run, Axis.YAW, 0.01) is None
    run.record_s = 0.095
    assert self_check._check_axis(log, run, Axis.ROLL, 0.01) is None
    run.record_s = 0.115
    assert self_check._check_axis(log, run, Axis.ROLL, 0.01) is not None
    whole = self_check.check_injection(*swept(gain=1.0))
    assert (whole.is_proven, whole.sign, whole.loop_time_s) == (True, 1, 0.01)
    assert whole.findings[0].code == "injection-proven"
    turned = self_check.check_injection(*swept(gain=-1.0))
    assert turned.sign == -1
    none = self_check.check_injection(*swept(gain=0.0))
    assert (none.sign, none.is_proven) == (0, False)
    assert none.findings[0].code == "injection-contradicted"


def test_stamps_of_a_chirp_are_those_of_its_run_and_its_clock_goes_on() -> None:
    log: Any = HandmadeLog("ardupilot")
    stamps = np.array([19.94, 19.96, 20.0, 20.1, 20.2, 21.0, 21.1])
    clock = np.array([0.0, 0.0, 0.1, 0.2, 0.2, 0.3, 0.4])
    log.with_table("SIDD", stamps, Time=clock, Targ=np.arange(7.0))
    run: Any = SimpleNamespace(start_s=20.0, stop_s=21.0)
    found = self_check.chirp_clock(log, run)
    assert [each.tolist() for each in found] == [
        [19.96, 20.0, 20.1, 21.0],
        [0.0, 0.1, 0.2, 0.3],
        [1.0, 2.0, 3.0, 5.0],
    ]


def test_a_proof_needs_gain_correlation_and_quiet_axes() -> None:
    run: Any = SimpleNamespace(point="mixer", body_axis=Axis.ROLL, axis=10)

    def check(axis: Axis, rms: float, correlation: float, gain: float, loops: float) -> AxisCheck:
        return AxisCheck(axis, rms, correlation, gain, 0.01 * loops, loops)

    quiet = check(Axis.PITCH, 1e-9, 0.0, 0.0, 0.0)
    for correlation, gain, is_proven in (
        (1.0, 1.0, True),
        (0.9991, 1.0, True),
        (0.9989, 1.0, False),
        (1.0, 1.019, True),
        (1.0, 0.981, True),
        (1.0, 1.021, False),
        (1.0, 0.979, False),
    ):
        roll = check(Axis.ROLL, 1.0, correlation, gain, 1.0)
        assert self_check._is_proven(run, (roll, quiet), roll) is is_proven, (correlation, gain)
    assert self_check._is_proven(run, (quiet,), None) is False
