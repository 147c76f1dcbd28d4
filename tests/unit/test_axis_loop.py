"""Autopilots' controllers: parameters by name, versions, ranges, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flightid import errors
from flightid.control.autopilots import (
    AUTOPILOTS,
    AXES,
    LoopFlags,
    LoopState,
    axis_loop,
    defaults,
    gain_ranges,
)
from flightid.control.autopilots.angle_law import angle_law
from flightid.control.autopilots.arducopter import ArduCopterLoop
from flightid.control.autopilots.gyro_notches import (
    GyroNotches,
    ardupilot_notches,
    pid_notch,
    px4_notches,
)
from flightid.control.autopilots.parameter_table import parameter_entries
from flightid.vehicles import Autopilot
from tests.closeness import assert_close

COPTER = {**defaults("arducopter", "roll"), "SCHED_LOOP_RATE": 400.0}
OMEGA = np.array([1.0, 20.0, 100.0])


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_metadata_is_consistent(autopilot: str, axis: str) -> None:
    for entry in parameter_entries(autopilot, axis):
        low, high = entry.range.low, entry.range.high
        assert low < high
        assert 0 < entry.range.increment <= high - low
        assert len(entry.name) <= 16
        assert "{" not in entry.name
        zero_is_off = entry.range.default == 0.0
        assert zero_is_off or entry.range.default in entry.range, entry
    loop = axis_loop(autopilot, axis, loop_rate_hz=400.0)
    assert set(gain_ranges(autopilot, axis)) <= set(loop.gains)
    assert set(loop.basis(OMEGA)[1]) <= set(loop.ranges)


def test_gains_are_changed_by_the_autopilots_names() -> None:
    loop = axis_loop("arducopter", "roll", COPTER)
    changed = loop.with_gains({"ATC_RAT_RLL_D": 0.004}, ATC_RAT_RLL_P=0.2)
    assert (changed.gains["ATC_RAT_RLL_P"], changed.gains["ATC_RAT_RLL_D"]) == (0.2, 0.004)
    assert loop.gains["ATC_RAT_RLL_P"] == 0.135
    with pytest.raises(errors.UnknownNameError, match="ATC_RAT_PIT_P"):
        loop.with_gains(ATC_RAT_PIT_P=0.2)


def test_old_firmware_has_one_filter_on_the_error() -> None:
    old = {k: v for k, v in COPTER.items() if k[-4:] not in ("FLTT", "FLTE", "FLTD", "PDMX")}
    loop = axis_loop("arducopter", "roll", old | {"ATC_RAT_RLL_FILT": 20.0})
    assert loop.gains["ATC_RAT_RLL_FILT"] == 20.0
    assert "ATC_RAT_RLL_FLTT" in loop.assumed
    new = axis_loop("arducopter", "roll", COPTER).with_gains(
        ATC_RAT_RLL_FLTE=20.0, ATC_RAT_RLL_FLTT=0.0, ATC_RAT_RLL_FLTD=0.0
    )
    assert_close(loop.feedback(OMEGA), new.feedback(OMEGA), rtol=1e-12, why="FILT is FLTE")


def test_px4_without_gain_k_is_the_old_controller() -> None:
    known = {k: v for k, v in defaults("px4_multicopter", "roll").items() if k[-2:] != "_K"}
    loop = axis_loop("px4_multicopter", "roll", known, loop_rate_hz=250.0)
    slope = loop.basis(OMEGA, with_hold=False)[0][2] / loop.gyro_response(OMEGA)
    exact = (1 - np.exp(-1j * OMEGA / 250.0)) * 250.0
    assert_close(slope, exact, rtol=1e-12, why="difference between loops, no filter")


def test_px4_gain_k_multiplies_all_but_feed_forward() -> None:
    loop = axis_loop("px4_multicopter", "roll", loop_rate_hz=400.0).with_gains(MC_ROLLRATE_FF=0.1)
    double = loop.with_gains(MC_ROLLRATE_K=2.0)
    assert_close(double.feedback(OMEGA), 2 * loop.feedback(OMEGA), rtol=1e-12, why="K scales PID")
    difference = double.forward(OMEGA) - 2 * loop.forward(OMEGA)
    hold = (1 - np.exp(-1j * OMEGA / 400)) / (1j * OMEGA / 400)
    assert_close(difference, -0.1 * hold, rtol=1e-9, why="FF is not scaled")


def test_plane_scales_feedback_with_dynamic_pressure_and_feed_forward_with_speed() -> None:
    slow, fast = (
        axis_loop("arduplane", "roll", loop_rate_hz=50.0, airspeed_scale=scale)
        for scale in (1.0, 0.5)
    )
    assert_close(fast.feedback(OMEGA), slow.feedback(OMEGA) / 4, rtol=1e-12, why="1/V²")
    only = {"RLL_RATE_P": 0.0, "RLL_RATE_I": 0.0}
    ratio = fast.with_gains(only).forward(OMEGA) / slow.with_gains(only).forward(OMEGA)
    assert_close(ratio, np.full(3, 0.5), rtol=1e-12, why="1/V")


@pytest.mark.parametrize(("axis", "degrees"), [("roll", 110_000), ("yaw", 27_000)])
def test_angle_controller_brakes_with_half_the_acceleration(axis: str, degrees: float) -> None:
    loop = axis_loop("arducopter", axis, loop_rate_hz=400.0)
    assert isinstance(loop, ArduCopterLoop)
    most = np.radians(min(degrees / 200, 720.0 if axis == "roll" else 120.0))
    linear = most / 4.5**2
    small, edge, large = loop.rate_setpoint([0.5 * linear, linear, 2.0 * linear])
    assert_close([small, edge], [2.25 * linear, 4.5 * linear], rtol=1e-12, why="proportional")
    assert_close(large, np.sqrt(2 * most * 1.5 * linear), rtol=1e-12, why="square root")
    flown = Autopilot().to_native()["acceleration_rad_s2"][0 if axis == "roll" else 2]
    assert_close(flown, most, rtol=2e-3, why="the simulated autopilot plans as the real one")
    free = loop.with_gains({loop.names["acceleration"]: 0.0}).rate_setpoint(2.0 * linear)
    assert_close(free, [9.0 * linear], rtol=1e-12, why="no bound")


@pytest.mark.parametrize(
    ("autopilot", "axis", "parameters", "degrees"),
    [
        ("arducopter", "roll", {"ATC_ANG_RLL_P": 9.0, "ATC_ACCEL_R_MAX": 110_000.0}, 550 / 81),
        ("arduheli", "pitch", {"ATC_ANG_PIT_P": 9.0, "ATC_ACC_P_MAX": 1_100.0}, 550 / 81),
        ("arducopter", "yaw", {"ATC_ANG_YAW_P": 4.0, "ATC_ACCEL_Y_MAX": 27_000.0}, 120 / 16),
        (
            "arducopter", "roll",
            {"ATC_ANG_RLL_P": 9.0, "ATC_ACCEL_R_MAX": 110_000.0, "ATC_RATE_R_MAX": 45.0}, 5.0,
        ),
        ("arducopter", "roll", {"ATC_ANG_RLL_P": 9.0, "ATC_ACCEL_R_MAX": 0.0}, np.inf),
        ("px4_multicopter", "roll", {"MC_ROLL_P": 4.0, "MC_ROLLRATE_MAX": 70.0}, 17.5),
        ("arduplane", "pitch", {"PTCH2SRV_TCONST": 0.5, "PTCH2SRV_RMAX_DN": 20.0}, 10.0),
        ("px4_fixed_wing", "roll", {"FW_R_TC": 0.4, "FW_R_RMAX": 70.0}, 28.0),
        ("arduplane", "pitch", {"PTCH2SRV_TCONST": 0.5, "Q_ENABLE": 1.0}, None),
        ("betaflight", "roll", {"rc_rates": 100.0}, None),
    ],
)  # fmt: skip
def test_angle_controllers_are_proportional_up_to_what_their_parameters_say(
    autopilot: str, axis: str, parameters: dict[str, float], degrees: float | None
) -> None:
    found = angle_law(autopilot, parameters, axis)
    assert (None if found is None else np.degrees(found.proportional_to_rad)) == (
        degrees if degrees is None else pytest.approx(degrees, rel=1e-9)
    )


def test_run_goes_on_from_a_given_state() -> None:
    loop = axis_loop("arducopter", "roll", COPTER)
    rng = np.random.default_rng(1)
    setpoint, rate = rng.standard_normal((2, 200)).cumsum(axis=1) * 0.01
    whole = loop.run(setpoint, rate, single_precision=False)
    row = 99
    terms = {name: values[row] for name, values in whole.terms.items()}
    state = loop.state(terms, setpoint[row])  # type: ignore[attr-defined]
    rest = loop.run(setpoint[100:], rate[100:], LoopFlags(start=state), single_precision=False)
    assert_close(rest.output, whole.output[100:], atol=1e-14, why="nothing is forgotten")
    still = loop.run([0.0], [0.0], LoopFlags(start=LoopState(integrator=0.2)))
    assert_close(still.output, [0.2], rtol=1e-6, why="the integrator stays")


def test_moving_notches_are_named_and_fixed_ones_are_in_the_view() -> None:
    notch = {"INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_MODE": 3.0, "INS_HNTCH_REF": 1.0}
    found = ardupilot_notches(notch, 2000.0)
    assert found.sections == ()
    assert "telemetry" in found.unknown[0]
    loop = axis_loop("arducopter", "roll", COPTER | notch)
    assert loop.unknown_notches == found.unknown
    fixed = notch | {"INS_HNTCH_REF": 0.0, "INS_HNTCH_FREQ": 80.0, "INS_HNTCH_BW": 20.0}
    found = ardupilot_notches(fixed | {"INS_HNTCH_ATT": 40.0}, 2000.0)
    assert (len(found.sections), found.unknown) == (2, ())
    loop = axis_loop("arducopter", "roll", COPTER | fixed, gyro_rate_hz=2000.0)
    at = 2 * np.pi * np.array([80.0, 160.0])
    plain = axis_loop("arducopter", "roll", COPTER, gyro_rate_hz=2000.0)
    depth = np.abs(loop.gyro_response(at) / plain.gyro_response(at))
    assert_close(depth, [0.01, 0.01], rtol=0.2, why="40 dB at the harmonics")


def test_notches_on_target_and_error_come_from_the_filter_table() -> None:
    table = {
        "FILT2_TYPE": 1.0, "FILT2_NOTCH_FREQ": 30.0, "FILT2_NOTCH_Q": 2.0, "FILT2_NOTCH_ATT": 40.0,
    }  # fmt: skip
    assert pid_notch(table, 0.0) == pid_notch(table, 1.0) == (0.0, 0.0, 0.0)
    center, quality, depth = pid_notch(table, 2.0)
    assert (center, depth) == (30.0, 40.0)
    assert_close(quality, 12 / 7, rtol=1e-12, why="15 Hz below 30 Hz, in octaves")
    loop = axis_loop("arducopter", "roll", COPTER | table | {"ATC_RAT_RLL_NEF": 2.0})
    plain = axis_loop("arducopter", "roll", COPTER)
    at = [2 * np.pi * 30.0]
    ratio = loop.feedback(at) / plain.feedback(at)
    assert_close(np.abs(ratio), [0.01], rtol=1e-6, why="40 dB at its centre")


def test_px4_dynamic_notches_are_named() -> None:
    assert px4_notches({}, 4000.0) == GyroNotches()
    assert "follows the motors" in px4_notches({"IMU_GYRO_DNF_EN": 1.0}, 4000.0).unknown[0]


@pytest.mark.parametrize(
    ("arguments", "options", "kind", "match"),
    [
        (("emuflight", "roll"), {}, errors.OptionError, "autopilot is not known"),
        (("arducopter", "heave"), {}, errors.OptionError, "axis is not known"),
        (("arducopter", "roll"), {}, errors.OptionError, "rate of the controller is not known"),
        (
            ("arducopter", "roll", {"SCHED_LOOP_RATE": 400.0}),
            {},
            errors.DataError,
            "no ATC_RAT_RLL_P, ATC_RAT_RLL_I",
        ),
        (
            ("arducopter", "roll", COPTER),
            {"gyro_rate_hz": 100.0},
            errors.OptionError,
            "rates of loop and gyro",
        ),
        (
            ("arducopter", "roll", COPTER | {"ATC_RAT_RLL_P": float("nan")}),
            {},
            errors.DataError,
            "not a finite number",
        ),
        (
            ("arduplane", "roll"),
            {"loop_rate_hz": 50.0, "airspeed_scale": 0.0},
            errors.OptionError,
            "airspeed scaling",
        ),
        (
            ("px4_fixed_wing", "roll"),
            {"loop_rate_hz": 50.0, "airspeed_scale": -1.0},
            errors.OptionError,
            "airspeed scaling",
        ),
    ],
)
def test_refuses_what_is_no_controller(
    arguments: tuple[str, str], options: dict[str, float], kind: type[Exception], match: str
) -> None:
    with pytest.raises(kind, match=match):
        axis_loop(*arguments, **options)  # type: ignore[arg-type]


def test_refuses_signals_and_frequencies_without_meaning() -> None:
    loop = axis_loop("arducopter", "roll", COPTER)
    with pytest.raises(errors.OptionError, match="no response at these frequencies"):
        loop.feedback([0.0, 1.0])
    with pytest.raises(errors.ShapeError, match="do not belong together"):
        loop.run(np.zeros(4), np.zeros(5))
    with pytest.raises(errors.DataError, match="not finite"):
        loop.run(np.zeros(4), np.full(4, np.nan))
    odd = replace(loop, gyro_rate_hz=1000.0)
    with pytest.raises(errors.OptionError, match=r"2\.5 samples in a loop"):
        odd.run(np.zeros(4), np.zeros(10), gyro="raw")
    px4 = axis_loop("px4_multicopter", "roll", loop_rate_hz=400.0)
    with pytest.raises(errors.ShapeError, match="a value for each loop"):
        px4.run(np.zeros(4), np.zeros(4), LoopFlags(thrust=np.zeros(3)))


@pytest.mark.parametrize("autopilot", ["arduplane", "px4_fixed_wing"])
def test_planes_have_no_angle_controller_for_yaw(autopilot: str) -> None:
    loop = axis_loop(autopilot, "yaw", loop_rate_hz=100.0)
    with pytest.raises(errors.OptionError, match="no angle controller"):
        loop.angle([1.0])
    roll = axis_loop(autopilot, "roll", loop_rate_hz=100.0)
    assert_close(roll.angle([1.0]).real, [1 / roll.values["angle_tc"]], rtol=1e-3, why="1/TCONST")


def test_a_helicopters_integrator_leaks_two_percent_a_loop_down_to_its_floor() -> None:
    loop = axis_loop("arduheli", "roll", loop_rate_hz=400.0)
    only = {name: 0.0 for name in loop.gains if name[-2:] in ("_P", "_D", "FF")}
    loop = loop.with_gains(only | {"ATC_RAT_RLL_I": 0.5, "ATC_RAT_RLL_ILMI": 0.0})
    growth = 0.5 * 0.1 / 400.0
    settled = loop.run(np.full(4000, 0.1), np.zeros(4000)).output[-1]
    assert_close(settled, growth / 0.02, rtol=1e-4, why="leak and growth in balance")
    held = loop.with_gains(ATC_RAT_RLL_ILMI=0.05).run(np.full(8000, 0.1), np.zeros(8000))
    assert_close(held.output[-1], 0.05 + growth / 0.02, rtol=1e-3, why="only the excess leaks")


def test_double_and_triple_notches_stand_beside_the_centre() -> None:
    notch = {
        "INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_MODE": 0.0, "INS_HNTCH_FREQ": 80.0,
        "INS_HNTCH_BW": 40.0, "INS_HNTCH_ATT": 40.0, "INS_HNTCH_HMNCS": 1.0,
    }  # fmt: skip
    spread = 40.0 / (32 * 80.0)
    for options, offsets in ((0.0, [0.0]), (1.0, [-spread, spread]), (16.0, [0, -spread, spread])):
        sections = ardupilot_notches(notch | {"INS_HNTCH_OPTS": options}, 2000.0).sections
        # b1 = −2 cos(ω0) s and 1 + a2 = 2 s, with s = 1/(1 + α); α = sin(ω0)/(2 Q).
        centers = [np.arccos(-b1 / (1 + a2)) * 2000 / (2 * np.pi) for _, b1, _, _, a2 in sections]
        expected = 80.0 * (1 + np.array(offsets))
        assert_close(centers, expected, rtol=1e-9, why="bandwidth over 32 to each side")
        octaves = 2 * np.log2(80.0 / (80.0 - 20.0 / len(offsets)))
        quality = 2 ** (octaves / 2) / (2**octaves - 1)
        alpha = (1 - sections[0][4]) / (1 + sections[0][4])
        exact = np.sin(2 * np.pi * expected[0] / 2000) / (2 * quality)
        assert_close(alpha, exact, rtol=1e-9, why="each takes its share of the bandwidth")
    assert ardupilot_notches(notch | {"INS_HNTCH_FREQ": 970.0}, 2000.0).sections == ()
