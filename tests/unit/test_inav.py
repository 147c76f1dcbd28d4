"""INAV: its controller against its own arithmetic, its logs, its chirps, its gains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.control.autopilots import (
    GainChange,
    axis_loop,
    axis_loop_of,
    read_parameters,
    write_parameters,
)
from flightid.control.autopilots.from_log import autopilot_of
from flightid.control.autopilots.notch_tracking import Centre, NotchTracking
from flightid.errors import DataError
from flightid.inspection.carried import carried_axes
from flightid.inspection.rate_chirps import chirps
from flightid.logs.blackbox.settings import settings_of
from flightid.study.proposal import propose_study
from tests import inav_flight as inav
from tests.closeness import assert_close

SETTINGS = settings_of(inav.header(inav.GAINS))
THROTTLE = inav.Quad().throttle
TRACKING = NotchTracking(throttle=Centre(THROTTLE, THROTTLE, THROTTLE))


def _noise(n: int = 600) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    target = np.cumsum(3.0 * rng.standard_normal((n, 3)), axis=0)
    return target, 0.8 * target + 5.0 * rng.standard_normal((n, 3))


def test_a_gain_is_worth_what_the_firmware_makes_of_it() -> None:
    """FP_PID_RATE_P_MULTIPLIER 31, I 4, D 1905, and 7270 of the control derivative."""
    settings = {
        "mc_p_roll": 40,
        "mc_i_roll": 75,
        "mc_d_roll": 25,
        "mc_cd_roll": 60,
        "looptime": 500,
    }
    roll = axis_loop("inav", "roll", settings)
    assert roll.loop_rate_hz == 2000.0
    made = roll.run(np.radians([100.0, 100.0]), np.zeros(2)).terms
    turned = roll.run(np.zeros(2), np.radians([0.0, 1.0])).terms
    for found, by_hand in (
        (made["P"][0], 0.12903225806),  # 40 / 31 · 100 deg/s / 1000
        (turned["D"][1], -0.02624671916),  # 25 / 1905 · 1 deg/s · 2000 Hz / 1000
    ):
        assert_close(found, by_hand, why="arithmetic by hand", rtol=1e-9)


def test_terms_are_those_of_the_firmware() -> None:
    """P, I, D and CD of each axis, TPA, filters and I-term relax at work; and the linear view."""
    target, rate = _noise()
    firmware = inav.Controller(inav.GAINS, THROTTLE)
    rows = [firmware.step(*both) for both in zip(target, rate, strict=True)]
    for place, axis in enumerate(inav.AXES):
        loop = axis_loop("inav", axis, SETTINGS, notch_tracking=TRACKING)
        made = loop.run(np.radians(target[:, place]), np.radians(rate[:, place]))
        for kind, name in enumerate(("P", "I", "D", "FF")):
            exact = np.array([row[kind][place] for row in rows])
            close = 1e-11 * max(float(np.abs(exact).max()), 1.0)
            assert_close(1e3 * made.terms[name], exact, why="rounding", atol=close)
    loop = axis_loop("inav", "roll", SETTINGS, notch_tracking=TRACKING)
    time_s, omega = np.arange(8000) / 2000.0, 2.0 * np.pi * 10.0
    wave = np.sin(omega * time_s)
    last = slice(6000, 8000)
    basis = np.column_stack([wave, np.cos(omega * time_s), np.ones(8000)])[last]
    for run, told in (
        (loop.run(np.zeros(8000), wave), -loop.feedback([omega], gyro="filtered", with_hold=False)),
        (loop.run(1e-3 * wave, np.zeros(8000)), 1e-3 * loop.forward([omega], with_hold=False)),
    ):
        found = np.linalg.lstsq(basis, run.output[last], rcond=None)[0]
        settled = 3e-3 * abs(told[0])  # the integral of the start
        assert_close(found[:2], [told[0].real, told[0].imag], why="settled", atol=settled)


def _log(folder: Path, lengths_s: float = 3.0, **changes: str) -> fid.Log:
    """Chirps cut after some seconds on each axis, without a vehicle: set-point and fields alone."""
    told = inav.schedule(1, lengths_s)
    rng = np.random.default_rng(1)
    flown = {name: 5.0 * rng.standard_normal(told[0].shape) for name in ("gyro", *"PIDF", "sum")}
    content = inav.blackbox({"target": told[0], **flown}, inav.Quad(), told[1:], **changes)
    path = folder / "LOG00007.TXT"
    path.write_bytes(content)
    return fid.read_log(path)


def test_a_log_is_read_whole_with_battery_end_and_axes(tmp_path: Path) -> None:
    log = _log(tmp_path)
    assert (log.kind, log.vehicle, autopilot_of(log)) == ("inav", "copter", "inav")
    assert not log.skipped
    assert not log.findings, "its end tells why it was disarmed"
    table = log.table("main")
    assert_close(table["vbat"][0], 15.8, why="hundredths of a volt", rtol=1e-12)
    assert_close(table["amperage"][0], 14.2, why="hundredths of an ampere", rtol=1e-12)
    record = log.record(names=["q", "q_ref", "thrust"])
    assert_close(record["q"][:9], -np.radians(table["gyroADC[1]"][:9]), why="y is left", atol=1e-12)
    assert_close(record["q_ref"][:9], -np.radians(table["axisRate[1]"][:9]), why="y", atol=1e-12)
    assert_close(record["thrust"][0], THROTTLE, why="from 1000", atol=1e-9)
    review = fid.review_flight(log)
    assert review.identity.gains["roll"] == {
        "mc_p_roll": 40.0, "mc_i_roll": 75.0, "mc_d_roll": 25.0, "mc_cd_roll": 60.0,
    }  # fmt: skip
    assert review.identity.battery is not None
    assert_close(review.identity.battery.start_v, 15.8, why="volts", rtol=1e-12)


def test_chirps_are_found_by_their_fields(tmp_path: Path) -> None:
    log = _log(tmp_path, 4.0)
    found = chirps(log)
    assert [each.axis for each in found] == ["roll", "pitch", "yaw"]
    assert_close(found[0].span_s, [7.0, 11.0], why="after the settling", atol=0.01)
    assert_close(found[0].low_hz, 2.0, why="its start", atol=0.02)
    assert_close(found[0].size_deg_s, inav.CHIRP_DEG_S, why="its size", rtol=0.02)
    record = log.record(names=["p", "chirp", "p_ref"], span_s=found[0].span_s)
    assert_close(
        np.abs(record["chirp"]).max(), np.radians(inav.CHIRP_DEG_S), why="its size", rtol=0.02
    )
    # Cut towards zero in the log: 1 % too small, and what answers it seemed 1 % too large.
    slope = (record["p_ref"] @ record["chirp"]) / (record["chirp"] @ record["chirp"])
    assert_close(slope, 1.0, why="half of what was cut is given back", atol=2e-3)


def test_gains_are_those_of_the_header_and_go_back(tmp_path: Path) -> None:
    loop = axis_loop_of(_log(tmp_path), "pitch")
    assert [loop.gains[f"mc_{gain}_pitch"] for gain in ("p", "i", "d", "cd")] == [44, 75, 25, 60]
    assert [(s.name, s.settings) for s in loop.filter_stages()] == [
        ("dterm_lpf_hz", "PT2 at 90 Hz")
    ]
    assert "TPA leaves 96 % of P and D" in " ".join(loop.unmodelled)
    made = write_parameters("inav", [GainChange("mc_p_pitch", 50, 44)], tmp_path / "gains.txt")
    assert "set mc_p_pitch = 50" in made.path.read_text().splitlines()
    assert made.rollback is not None
    assert read_parameters(made.rollback) == {"mc_p_pitch": 44.0}
    old = {"Firmware revision": "INAV 2.5.2 (a) F7"}
    with pytest.raises(DataError, match=r"INAV 3 or newer"):
        autopilot_of(_log(tmp_path, **old))


def test_a_plan_of_its_flight_is_by_stick_with_its_settings(tmp_path: Path) -> None:
    plan = fid.plan_flight(vehicle="quad", autopilot="inav", axes=("roll",))
    (file,) = [each for each in plan.write(tmp_path) if "rollback" not in each.name]
    lines = file.read_text().splitlines()
    assert "set mc_cd_roll = 0" in lines
    assert "set blackbox_rate_denom = 2" in lines


@pytest.mark.slow
def test_gains_from_chirps_of_a_simulated_flight_keep_their_margins(tmp_path: Path) -> None:
    """Two chirps of 20 s an axis, logged in whole degrees a second, to gains of all three axes."""
    quad, told = inav.Quad(), inav.schedule(2)
    flown = inav.fly(quad, inav.GAINS, told[0], seed=1)
    path = tmp_path / "LOG00012.TXT"
    path.write_bytes(inav.blackbox(flown, quad, told[1:]))
    inspection = fid.inspect_log(path)
    assert carried_axes(inspection) == inav.AXES
    for band in inspection.bands:
        assert band.span > 12.0
        assert band.coherence is not None
        assert band.coherence > 0.9
    made = propose_study([path], folder=tmp_path, tune=True)
    tuning = fid.run_study(made.write(tmp_path / "study.toml"), output=tmp_path / "out").tuning
    assert tuning is not None
    assert tuple(each.axis for each in tuning.designs) == inav.AXES
    for place, design in enumerate(tuning.designs):
        gains = {name: design.gains[f"mc_{name}_{design.axis}"] for name in ("p", "i", "d")}
        promised = design.worst_case("rate loop", "phase margin").worst
        assert promised is not None
        assert promised > 44.0
        assert promised < inav.phase_margin(quad, gains, place) < promised + 12.0
