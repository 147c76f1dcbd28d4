"""Replay of controllers on simulated, made-up and real logs, and the controllers that logs tell."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid import errors
from flightid.control.autopilots import axis_loop, axis_loop_of, parameters_at, replay
from flightid.control.autopilots.loop_run import LoopFlags
from flightid.logs import DataflashWriter
from flightid.logs.log import Log
from flightid.plot import autopilots as plots
from flightid.vehicles import (
    Autopilot,
    Flight,
    PilotDoublet,
    RateGains,
    SidActivation,
    fly,
    write_ardupilot_log,
)
from tests.closeness import assert_close
from tests.ulog_builder import UlogBuilder

RUN = SidActivation(
    axis=10, start_s=2.0, magnitude=0.1, start_hz=0.8, stop_hz=10.0, fade_in_s=1.0,
    record_s=8.0, fade_out_s=0.5, leave_after_s=10.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(runs=[RUN], doublets=[PilotDoublet("pitch", start_s=1.0, amplitude=0.3)], seed=3)


@pytest.fixture(scope="module")
def log(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Log:
    return fid.read_log(write_ardupilot_log(flight, tmp_path_factory.mktemp("replay") / "sim.BIN"))


def _logged(flight: Flight, folder: Path) -> Log:
    return fid.read_log(write_ardupilot_log(flight, folder / "sim.BIN"))


@pytest.mark.parametrize("axis", ["roll", "pitch", "yaw"])
def test_simulated_copter_is_reproduced_to_single_precision(log: Log, axis: str) -> None:
    found = replay(log, axis)
    assert found.exact
    assert found.setpoint_lag_s == 1 / 400
    for term in found.terms:
        limit = 3e-7 * max(term.rms_logged, 1.0)
        assert_close(term.largest_error, 0.0, atol=limit, why=f"{term.name}: single precision")
    codes = [finding.code for finding in found.findings]
    assert codes[:2] == ["replay-reproduced", "gains-confirmed"]
    assert found.light == "green"
    assert repr(found).startswith(f"Replay(arducopter {axis}, output fit 100 %")


def test_a_span_in_the_middle_starts_from_the_logged_state(log: Log) -> None:
    found = replay(log, "roll", span_s=(14.0, 18.0))
    assert found.time_s[0] > 14.0
    assert found["output"].largest_error < 1e-6


def test_wrong_gains_are_found_out(log: Log) -> None:
    loop = axis_loop_of(log, "roll").with_gains(ATC_RAT_RLL_P=0.12, ATC_RAT_RLL_D=0.0024)
    found = replay(log, "roll", controller=loop)
    codes = {finding.code: finding.message for finding in found.findings}
    assert found.light in ("amber", "red")
    assert "ATC_RAT_RLL_P (by 0.33" in codes["gains-contradicted"]
    assert "P x 0.75" in codes["terms-rescaled"]
    assert "D x 1" in codes["terms-rescaled"]


def test_a_wrong_integral_gain_shows_in_its_own_term(log: Log) -> None:
    found = replay(log, "roll", controller=axis_loop_of(log, "roll").with_gains(ATC_RAT_RLL_I=0.18))
    assert found["I"].rms_error > 0.2 * found["I"].rms_logged
    assert found["P"].largest_error < 1e-6


def test_the_slew_limiter_is_replayed(tmp_path: Path) -> None:
    gains = RateGains(p=0.135, d=0.0036, smax=0.4)
    pilot = Autopilot(rate=(gains, gains, Autopilot().rate[2]))
    flight = fly(runs=[RUN], autopilot=pilot, seed=1)
    assert flight["roll_pid_dmod"].min() < 0.9
    found = replay(_logged(flight, tmp_path), "roll", span_s=(10.0, 25.0))
    assert found["output"].fit_percent is not None
    assert found["output"].fit_percent > 99.9


def test_limits_of_the_mixer_reach_the_integrator_in_the_same_loop(tmp_path: Path) -> None:
    # Saturating sweep: the flag of PIDR is the one that the loop saw.
    run = SidActivation(**{**vars(RUN), "magnitude": 0.9})
    gains = RateGains(i=0.5)
    pilot = Autopilot(rate=(gains, gains, Autopilot().rate[2]))
    flight = fly(runs=[run], autopilot=pilot, seed=1)
    assert flight["pid_limited"].mean() > 0.02
    found = replay(_logged(flight, tmp_path), "roll")
    assert found["I"].largest_error < 1e-6


def test_a_slow_log_is_interpolated_and_says_so(flight: Flight, tmp_path: Path) -> None:
    slow = fly(runs=flight.runs, doublets=flight.doublets, log_every=4, seed=3)
    found = replay(_logged(slow, tmp_path), "roll")
    codes = [finding.code for finding in found.findings]
    assert not found.exact
    assert 95 < (found["output"].fit_percent or 0) < 99.9
    assert {"replay-similar", "gains-confirmed", "terms-rescaled", "log-rate"} <= set(codes)


def test_a_set_point_that_acts_later_is_noticed(tmp_path: Path) -> None:
    loop = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    rng = np.random.default_rng(0)
    setpoint = np.cumsum(rng.standard_normal(800)) * 0.01
    rate = 0.5 * setpoint + 0.01 * rng.standard_normal(800)
    late = np.concatenate([[setpoint[0]] * 3, setpoint[:-3]])
    run = loop.run(late, rate.astype(np.float32))
    writer = DataflashWriter()
    writer.message(0, "ArduCopter V4.6.0 (test)")
    for name, value in {**loop.gains, "SCHED_LOOP_RATE": 400.0}.items():
        writer.parameter(name, value)
    stamps = np.arange(800) * 2500
    columns = {name: run.terms[name] for name in ("Tar", "Err", "P", "I", "D", "FF", "DFF")}
    writer.add("PIDR", stamps, columns | {"Act": rate})
    degrees = {"RDes": np.degrees(setpoint), "R": np.degrees(rate), "ROut": run.output}
    writer.add("RATE", stamps, degrees)
    found = replay(fid.read_log(writer.write(tmp_path / "late.BIN")), "roll")
    assert found.setpoint_lag_s == 3 / 400
    assert found["output"].largest_error < 1e-5
    assert "unexpected-lag" in [finding.code for finding in found.findings]


def _px4_log(path: Path, *, saturated: bool = False) -> tuple[Log, np.ndarray]:
    """A modern PX4 log whose torque set-point is what the controller makes of its inputs."""
    loop = axis_loop("px4_multicopter", "roll", loop_rate_hz=400.0)
    n = 2000
    t = np.arange(n) / 400.0
    setpoint = 0.8 * np.sin(5 * t) + 0.3 * np.sin(17 * t)
    rate = 0.7 * np.sin(5 * t - 0.3)
    acceleration = 0.7 * 5 * np.cos(5 * t - 0.35)
    short = np.where(saturated & (t % 1.0 > 0.4), 0.1 * np.sign(setpoint), 0.0)
    limited = np.column_stack([short > 0, short < 0])
    run = loop.run(setpoint, rate, LoopFlags(acceleration=acceleration, limited=limited))
    builder = UlogBuilder()
    builder.format("vehicle_rates_setpoint:uint64_t timestamp;float roll;float[3] thrust_body;")
    builder.format(
        "vehicle_angular_velocity:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;"
        "float[3] xyz_derivative;"
    )
    builder.format("vehicle_torque_setpoint:uint64_t timestamp;float[3] xyz;")
    builder.format("rate_ctrl_status:uint64_t timestamp;float rollspeed_integ;")
    builder.format(
        "control_allocator_status:uint64_t timestamp;float[3] unallocated_torque;"
        "bool torque_setpoint_achieved;"
    )
    builder.format("vehicle_status:uint64_t timestamp;uint8_t vehicle_type;")
    for name, value in {**loop.gains, "IMU_GYRO_RATEMAX": 400}.items():
        builder.parameter(name, value)
    names = ("vehicle_rates_setpoint", "vehicle_angular_velocity", "vehicle_torque_setpoint")
    for number, name in enumerate((*names, "rate_ctrl_status", "control_allocator_status")):
        builder.announce(name, number)
    builder.announce("vehicle_status", 9).sample(9, "QB", 1_000_000, 1)
    for k in range(n):
        us = 1_000_000 + 2500 * k
        builder.sample(0, "Q4f", us, setpoint[k], 0, 0, -0.5)
        builder.sample(1, "QQ6f", us, us, rate[k], 0, 0, acceleration[k], 0, 0)
        builder.sample(2, "Q3f", us, run.output[k], 0, 0)
        builder.sample(3, "Qf", us, run.terms["I"][k])
        builder.sample(4, "Q3fB", us, short[k], 0, 0, int(short[k] == 0))
    path.write_bytes(bytes(builder))
    return fid.read_log(path), run.output


@pytest.mark.parametrize("saturated", [False, True])
def test_px4_torque_is_reproduced_from_its_topics(tmp_path: Path, saturated: bool) -> None:
    log, output = _px4_log(tmp_path / "a.ulg", saturated=saturated)
    loop = axis_loop_of(log, "roll")
    assert (loop.autopilot, loop.loop_rate_hz) == ("px4_multicopter", 400.0)
    found = replay(log, "roll")
    assert (found["output"].fit_percent or 0) > 99.9
    assert (found["I"].fit_percent or 0) > 99.0
    assert abs(found.setpoint_lag_s) < 5e-4
    assert abs(found.rate_lag_s) < 5e-4
    assert_close(found.logged["output"], output[: found.time_s.size], atol=1e-6, why="as logged")


@pytest.mark.parametrize("axis", ["roll", "pitch", "yaw"])
def test_real_copter_rows_confirm_the_gain_and_say_why_the_rest_is_open(
    shared_data: Path, axis: str
) -> None:
    found = replay(fid.read_log(shared_data / "logs" / "arducopter_457.BIN"), axis)
    codes = [finding.code for finding in found.findings]
    assert {"gains-confirmed", "log-rate", "limit-flag", "integrator-set"} <= set(codes)
    assert not found.exact
    # The log holds the centres of its notches: 58.8 Hz, doubled, with a second harmonic.
    assert len(found.loop.gyro_notches) == 4
    assert found.loop.unknown_notches == ()


@pytest.mark.parametrize(("axis", "least"), [("roll", 92), ("pitch", 82), ("yaw", 98)])
def test_real_px4_log_holds_the_old_controller(shared_data: Path, axis: str, least: float) -> None:
    log = fid.read_log(shared_data / "logs" / "px4_quad_2016.ulg")
    found = replay(log, axis)
    assert found.loop.to_dict()["autopilot"] == "px4_multicopter"
    assert (found["output"].fit_percent or 0) > least
    codes = {finding.code: finding.message for finding in found.findings}
    assert "the vehicle did not fly" in codes["no-thrust"]
    factor = float(re.search(r"P x ([\d.]+)", codes["terms-rescaled"])[1])  # type: ignore[index]
    assert_close(factor, 1.0, atol=0.02, why="the logged P is the one that flew")


def test_what_a_log_lacks_is_named(tmp_path: Path) -> None:
    writer = DataflashWriter()
    writer.message(0, "ArduCopter V4.6.0 (test)")
    writer.parameter("SCHED_LOOP_RATE", 400.0)
    log = fid.read_log(writer.write(tmp_path / "a.BIN"))
    with pytest.raises(errors.DataError, match=r"no ATC_RAT_RLL_P, ATC_RAT_RLL_I.*ATC_ANG_RLL_P"):
        axis_loop_of(log, "roll")
    loop = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    with pytest.raises(errors.DataError, match="no PIDR"):
        replay(log, "roll", controller=loop)


def test_a_log_of_an_unknown_vehicle_is_refused(tmp_path: Path) -> None:
    writer = DataflashWriter()
    writer.message(0, "ArduRover V4.6.0 (test)")
    with pytest.raises(errors.DataError, match="controllers of this vehicle are not known"):
        axis_loop_of(fid.read_log(writer.write(tmp_path / "a.BIN")), "roll")


def test_gains_that_change_in_flight_need_an_instant(tmp_path: Path) -> None:
    loop = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    writer = DataflashWriter()
    writer.message(0, "ArduCopter V4.6.0 (test)")
    for name, value in {**loop.gains, "SCHED_LOOP_RATE": 400.0}.items():
        writer.parameter(name, value)
    writer.parameter("ATC_RAT_RLL_P", 0.2, time_us=5_000_000)
    log = fid.read_log(writer.write(tmp_path / "a.BIN"))
    with pytest.raises(errors.DataError, match=r"changed in flight: found ATC_RAT_RLL_P"):
        axis_loop_of(log, "roll")
    early, late = (axis_loop_of(log, "roll", at_s=t).gains["ATC_RAT_RLL_P"] for t in (1.0, 9.0))
    assert_close([early, late], [0.135, 0.2], rtol=1e-6, why="as they stood")
    assert parameters_at(log, 9.0)["ATC_RAT_RLL_P"] == late


def test_pictures_show_both_and_their_difference(log: Log) -> None:
    found = replay(log, "roll")
    made = plots.replay(found)
    assert {"logged", "replayed", "replayed minus logged"} <= {trace.name for trace in made.data}
    assert made.layout.yaxis.title.text == "roll output"
    bode = plots.controller(found.loop)
    names = {trace.name for trace in bode.data}
    assert {"feedback from raw gyro", "from rate set-point", "ATC_RAT_RLL_P"} <= names
    assert bode.layout.yaxis.title.text == "gain [dB re 1/(rad/s)]"


def test_results_as_plain_values(log: Log) -> None:
    found = replay(log, "roll")
    assert found.to_dict()["schema"] == "flightid.replay/1"
    assert found.loop.to_dict()["schema"] == "flightid.axis_loop/1"
    assert "ATC_RAT_RLL_P" in str(found.loop.summary())
    assert "output" in found._repr_html_()
