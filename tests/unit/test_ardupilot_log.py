"""A simulated flight as a DataFlash log: what ArduCopter would have written, and its skews."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pymavlink import mavutil

import flightid as fid
from flightid import _native, errors
from flightid.logs.log import Log
from flightid.vehicles import Flight, SidActivation, fly, write_ardupilot_log
from flightid.vehicles.ardupilot_log import POWER_UP_US
from tests.closeness import assert_close

FLOAT32 = "the log keeps single precision"
RUNS = tuple(
    SidActivation(
        axis=axis,
        start_s=2.0 + 14.0 * number,
        magnitude=0.1,
        start_hz=0.8,
        stop_hz=10.0,
        fade_in_s=1.0,
        record_s=10.0,
        fade_out_s=0.5,
        leave_after_s=12.0,
    )
    for number, axis in enumerate((10, 11, 12))
)
COMMANDS = {10: ("PIDR", "ROut"), 11: ("PIDP", "POut"), 12: ("PIDY", "YOut")}


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly(runs=RUNS, seed=5)


@pytest.fixture(scope="module")
def log(flight: Flight, tmp_path_factory: pytest.TempPathFactory) -> Log:
    return fid.read_log(write_ardupilot_log(flight, tmp_path_factory.mktemp("log") / "sim.BIN"))


def _pid_sum(log: Log, message: str) -> np.ndarray:
    table = log.table(message)
    return sum(table[name] for name in ("P", "I", "D", "FF", "DFF"))  # type: ignore[return-value]


@pytest.mark.parametrize("run", RUNS, ids=lambda run: f"axis {run.axis}")
def test_output_minus_pid_is_the_target_of_the_loop_before(log: Log, run: SidActivation) -> None:
    message, field = COMMANDS[run.axis]
    rate, sid = log.table("RATE"), log.table("SIDD")
    excess = rate[field] - _pid_sum(log, message)
    target = np.zeros(len(rate))
    # SIDD stands on its own stamps; each belongs to the last gyro sample before it.
    row = np.searchsorted(rate.time_s, sid.time_s, side="right") - 1
    mine = (sid.time_s >= run.start_s + 10) & (sid.time_s <= run.end_s + 10)
    target[row[mine]] = sid["Targ"][mine]
    during = (rate.time_s >= run.start_s + 10) & (rate.time_s <= run.end_s + 10)
    same, before = np.flatnonzero(during)[1:], np.flatnonzero(during)[1:] - 1
    assert_close(excess[same], target[before], atol=1e-7, why=FLOAT32)
    assert np.abs(excess[same] - target[same]).max() > 1e-4
    others = [axis for axis in COMMANDS if axis != run.axis]
    for axis in others:
        idle = rate[COMMANDS[axis][1]] - _pid_sum(log, COMMANDS[axis][0])
        assert_close(idle[same], 0.0, atol=1e-7, why="nothing is injected on the other axes")


def test_chirp_reconstructs_the_logged_target(log: Log) -> None:
    sid, starts = log.table("SIDD"), log.table("SIDS")
    for run, start_s in zip(RUNS, starts.time_s, strict=True):
        mine = (sid.time_s >= start_s) & (sid.time_s <= start_s + 12)
        settings = (run.magnitude, run.start_hz, run.stop_hz, run.record_s)
        design, _ = _native.ardupilot_chirp(
            sid["Time"][mine] - 1.0, *settings, run.fade_in_s, run.fade_out_s, None, True
        )
        assert_close(
            sid["Targ"][mine], design, atol=1e-5 * run.magnitude, why="the autopilot's own formula"
        )


def test_columns_carry_the_flight(flight: Flight, log: Log) -> None:
    rate = log.table("RATE")
    assert rate.unit("R") == "deg/s"
    assert_close(np.radians(rate["R"]), flight["gyro_filtered_x"], atol=1e-6, why=FLOAT32)
    assert_close(rate["POut"], flight["tau_theta"], atol=1e-7, why=FLOAT32)
    assert_close(rate.time_s, flight.time_s + POWER_UP_US * 1e-6, atol=1e-9, why="stamps in µs")
    assert_close(log.table("SIDD").time_s[0] % 0.0025, 0.0009, atol=1e-9, why="written later")
    assert_close(log.table("PIDR")["Act"], flight["gyro_filtered_x"], atol=1e-6, why=FLOAT32)
    assert log.table("RCOU")["C1"].min() >= 1000


def test_log_says_what_flew(log: Log) -> None:
    assert log.vehicle == "copter"
    assert log.firmware.startswith("ArduCopter V4.6.0")
    assert log.parameters["INS_GYRO_FILTER"] == 80
    assert log.parameters["SID_AXIS"] == 12
    assert list(log.table("SIDS")["Ax"]) == [10, 11, 12]
    assert list(log.table("MODE")["ModeNum"]) == [0, 25, 0, 25, 0, 25, 0]


@pytest.mark.parametrize(("log_every", "bits"), [(1, 3), (2, 1), (4, 2), (8, 0)])
def test_log_rate_is_that_of_the_bit_mask(tmp_path: Path, log_every: int, bits: int) -> None:
    flight = fly(duration_s=3.0, log_every=log_every)
    log = fid.read_log(write_ardupilot_log(flight, tmp_path / "sim.BIN"))
    assert int(log.parameters["LOG_BITMASK"]) & 3 == bits
    assert log.table("RATE").time_s[1] - log.table("RATE").time_s[0] == pytest.approx(
        0.0025 * log_every
    )


def test_other_rates_are_refused(tmp_path: Path) -> None:
    with pytest.raises(errors.OptionError, match="the flight cannot be written"):
        write_ardupilot_log(fly(duration_s=1.0, log_every=3), tmp_path / "sim.BIN")
    assert not list(tmp_path.iterdir())


@pytest.mark.nightly
def test_pymavlink_reads_the_same(log: Log) -> None:
    reader = mavutil.mavlink_connection(str(log.path))
    targets = []
    while (message := reader.recv_match(type=["SIDD"])) is not None and len(targets) < 2000:
        targets.append(message.Targ)
    assert_close(targets, log.table("SIDD")["Targ"][:2000], atol=1e-12, why="the same bytes")
    reader.close()
