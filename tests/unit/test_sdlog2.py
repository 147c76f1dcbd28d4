"""PX4's logs before ULog: today's topics, stamps of TIME, channels of the maps of PX4."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import flightid as fid
from tests.closeness import assert_close
from tests.old_px4_log import rates, write_sdlog2


def test_messages_have_todays_names_and_the_stamps_before_them(tmp_path: Path) -> None:
    log = fid.read_log(write_sdlog2(tmp_path / "sess001.px4log"))
    assert (log.kind, log.vehicle, log.firmware) == ("px4", "copter", "PX4 01234567 (sdlog2)")
    attitude = log.table("vehicle_attitude")
    assert_close(attitude.time_s, 10.0 + 0.005 * np.arange(600), atol=1e-9, why="TIME, µs")
    assert np.array_equal(attitude["rollspeed"], rates(600).astype(np.float32))
    assert log.messages["actuator_controls_0"].count == 300
    assert log.parameters == {"MAV_TYPE": 2.0, "MC_ROLLRATE_P": np.float32(0.15)}
    assert [(each.time_s, each.text) for each in log.events] == [
        (10.0, "disarmed"),
        (11.5, "armed"),
    ]
    assert not log.skipped


def test_channels_come_by_the_maps_of_px4(tmp_path: Path) -> None:
    record = fid.read_log(write_sdlog2(tmp_path / "log.bin")).record(names=["tau_phi", "p", "az"])
    assert_close(record.sample_rate_hz, 100.0, rtol=1e-9, why="commands at half of 200 Hz")
    assert record.unit("p") == "rad/s"
    assert_close(
        record["tau_phi"], 0.01 * rates(600)[::2][: record.n_samples], atol=1e-8, why="copy"
    )
    assert_close(record["az"][20:-20], -9.81, atol=1e-4, why="a constant")


def test_a_cut_log_keeps_what_is_whole_and_rows_before_time_are_left_out(tmp_path: Path) -> None:
    path = write_sdlog2(tmp_path / "log.bin")
    content = path.read_bytes()
    first = content.index(b"\xa3\x95\x81")
    lost = content[:first] + content[first + 11 : -40]
    path.write_bytes(lost)
    log = fid.read_log(path)
    assert_close(log.table("vehicle_attitude").time_s[0], 10.005, atol=1e-9, why="TIME, µs")
    assert 590 <= log.messages["vehicle_attitude"].count < 600
    assert log.gaps == ()


def test_a_pause_of_the_logger_is_a_gap_between_its_stamps(tmp_path: Path) -> None:
    log = fid.read_log(write_sdlog2(tmp_path / "log.bin", pause_s=2.0))
    (gap,) = log.gaps
    assert_close(np.array([gap.start_s, gap.stop_s]), [11.495, 13.5], atol=1e-9, why="TIME, µs")
