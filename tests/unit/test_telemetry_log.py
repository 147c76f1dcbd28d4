"""Telemetry logs against pymavlink, which packs the frames here."""

import struct
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import LogFormatError
from flightid.logs.mavlink.messages import telemetry_messages
from flightid.logs.mavlink.reader import ARDUPILOT, ARMED, AUTOPILOTS, NO_AUTOPILOT, VEHICLES
from flightid.logs.ulog.names import AIRFRAMES

mavlink = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
START_US = 1_700_000_000_000_000


def _telemetry(n: int = 200, *, old: bool = False, signed: bool = False, damage: int = 0) -> bytes:
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    if signed:
        link.signing.secret_key = bytes(32)
        link.signing.sign_outgoing = True
    out = []
    for at in range(n):
        boot_ms = 50_000 + 100 * at
        messages = [
            mavlink.MAVLink_heartbeat_message(2, 3, 0x80 if at > 10 else 0, 5, 4, 3),
            mavlink.MAVLink_attitude_message(boot_ms, 0.1 * np.sin(at), 0.0, 0.2, 0.5, 0.0, 0.0),
            mavlink.MAVLink_vfr_hud_message(0.0, 1.0, 90, 40, 3.0, 0.0),
            mavlink.MAVLink_param_value_message(
                b"ATC_RAT_RLL_P", 0.135 if at < 9 else 0.15, 9, 5, 0
            ),
            mavlink.MAVLink_system_time_message(1, 2),
            mavlink.MAVLink_statustext_message(6, f"line {at}".encode()),
        ]
        for place, message in enumerate(messages):
            stamp = START_US + 1000 * boot_ms + 3000 * (at % 3) + place
            out.append(struct.pack(">Q", stamp) + message.pack(link, force_mavlink1=old))
    if damage:
        out[damage] = out[damage][:12] + b"\x99" + out[damage][13:]
    return b"".join(out)


def _open(folder: Path, content: bytes) -> fid.Log:
    path = folder / "2026-11-23 12-00-00.tlog"
    path.write_bytes(content)
    return fid.read_log(path)


def test_telemetry_is_called_so_with_modes_by_name(tmp_path: Path) -> None:
    log = _open(tmp_path, _telemetry())
    review = fid.review_flight(log)
    assert [span.mode for span in review.identity.modes] == ["LOITER"]
    assert ("vehicle", "telemetry of a copter") in review.flight().rows
    assert "card" in next(f.action for f in review.findings if f.code == "no-set-points")
    assert not any("faster" in finding.action for finding in review.findings)


@pytest.mark.parametrize("how", [{}, {"old": True}, {"signed": True}])
def test_frames_come_back(tmp_path: Path, how: dict[str, bool]) -> None:
    log = _open(tmp_path, _telemetry(**how))
    assert (log.kind, log.vehicle) == ("mavlink", "copter")
    attitude = log.table("ATTITUDE")
    np.testing.assert_allclose(attitude["roll"], 0.1 * np.sin(np.arange(200)), rtol=1e-6)
    np.testing.assert_array_equal(attitude.time_s, (50_000 + 100 * np.arange(200)) / 1e3)
    # What tells no time of its own: by arrival, on the autopilot's clock.
    late = log.table("VFR_HUD").time_s - attitude.time_s
    np.testing.assert_allclose(late, 0.003 * (np.arange(200) % 3), atol=1e-4)
    assert log.parameters == {"ATC_RAT_RLL_P": pytest.approx(0.15)}
    assert [round(change.old, 3) for change in log.parameter_changes] == [0.135]
    assert [e.text for e in log.events if e.kind == "arming"] == ["disarmed", "armed"]
    assert log.table("STATUSTEXT").text("text")[7] == "line 7"
    assert [f.code for f in log.findings] == ["telemetry"]


def test_damaged_frame_is_left_out_and_said(tmp_path: Path) -> None:
    log = _open(tmp_path, _telemetry(damage=7))
    assert len(log.table("ATTITUDE")) == 199
    assert len(log.table("VFR_HUD")) == 200
    assert {f.code for f in log.findings} == {"telemetry", "bytes-skipped"}


@pytest.mark.parametrize("how", [{}, {"old": True}, {"signed": True}])
def test_a_frame_that_the_end_of_the_file_cuts_is_no_damage(
    tmp_path: Path, how: dict[str, bool]
) -> None:
    """A ground station that is switched off ends its file so: "look for gaps" was said of it."""
    content = _telemetry(n=20, **how)
    last = len(content) - content.rindex(content[:4])
    for kept in (*range(1, 13), last - 14, last - 1):
        log = _open(tmp_path, content[: len(content) - last + kept])
        assert [f.code for f in log.findings] == ["telemetry", "log-cut"], kept
    assert log.findings[1].message == "the file ends inside a frame"
    damaged = _telemetry(n=20, damage=7, **how)
    for stray in (damaged, damaged[:-3]):
        codes = [f.code for f in _open(tmp_path, stray).findings]
        assert codes == ["telemetry", "bytes-skipped"]


def _run(n: int, started_s: float, first_ms: int, roll: float) -> bytes:
    """A run of attitude, airspeed and outputs, whose clock began `started_s` after the first's."""
    link, out = mavlink.MAVLink(None, srcSystem=1, srcComponent=1), []
    for boot_ms in first_ms + 100 * np.arange(n):
        messages = [
            mavlink.MAVLink_heartbeat_message(2, 3, 0x80, 5, 4, 3),
            mavlink.MAVLink_attitude_message(int(boot_ms), roll, 0.0, 0.2, 0.5, 0.0, 0.0),
            mavlink.MAVLink_vfr_hud_message(roll, 1.0, 90, 40, 3.0, 0.0),
            mavlink.MAVLink_servo_output_raw_message(int(1000 * boot_ms) % 2**32, 0, *[1500] * 8),
        ]
        stamp = START_US + round(1e6 * started_s) + 1000 * int(boot_ms)
        out += [struct.pack(">Q", stamp) + each.pack(link) for each in messages]
    return b"".join(out)


@pytest.mark.parametrize("longest", [0, 1])
def test_of_several_runs_of_the_autopilot_the_longest_is_read(tmp_path: Path, longest: int) -> None:
    sizes = (300, 100) if longest == 0 else (100, 300)
    runs = _run(sizes[0], 0.0, 50_000, 0.1), _run(sizes[1], 150.0, 1_000, 0.3)
    log = _open(tmp_path, _telemetry(n=9) + b"".join(runs))
    begun = (50.0, 1.0)[longest]
    for name, field in (("ATTITUDE", "roll"), ("VFR_HUD", "airspeed")):
        table = log.table(name)
        assert len(table) == sizes[longest] + 9 * (longest == 0)
        np.testing.assert_allclose(table[field][-90:], (0.1, 0.3)[longest], rtol=1e-6)
        assert table.time_s[0] == pytest.approx(begun, abs=1e-3)
        assert table.time_s[-1] == pytest.approx(begun + 0.1 * (sizes[longest] - 1), abs=1e-3)
    assert "ATC_RAT_RLL_P" in log.parameters, "parameters stay"
    said = next(f.message for f in log.findings if f.code == "autopilot-restarted")
    assert "2 runs" in said


def test_counters_of_microseconds_turn_over(tmp_path: Path) -> None:
    log = _open(tmp_path, _run(300, 0.0, 2**32 // 1000 - 10_000, 0.1))
    np.testing.assert_allclose(
        log.table("SERVO_OUTPUT_RAW").time_s, log.table("ATTITUDE").time_s, atol=1e-3
    )
    assert {f.code for f in log.findings} == {"telemetry"}


def test_no_autopilot_is_refused(tmp_path: Path) -> None:
    link = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    beat = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(link)
    with pytest.raises(LogFormatError, match="no autopilot"):
        _open(tmp_path, 5 * (struct.pack(">Q", START_US) + beat))


@pytest.mark.parametrize("message", telemetry_messages().values(), ids=lambda m: m.name)
def test_table_agrees_with_the_definitions(message: object) -> None:
    peer = getattr(mavlink, f"MAVLink_{message.name.lower()}_message")
    assert (message.id, message.seed) == (peer.id, peer.crc_extra)
    assert list(message.layout.names) == list(peer.ordered_fieldnames)
    assert message.layout.itemsize == peer.unpacker.size


def test_numbers_are_those_of_mavlink() -> None:
    kinds = {
        "FIXED_WING": "plane", "HELICOPTER": "heli", "GROUND_ROVER": "rover", "QUADROTOR": "copter",
        "COAXIAL": "copter", "HEXAROTOR": "copter", "OCTOROTOR": "copter", "TRICOPTER": "copter",
    }  # fmt: skip
    assert {getattr(mavlink, f"MAV_TYPE_{name}"): kind for name, kind in kinds.items()} == AIRFRAMES
    telemetry = kinds | {"HELICOPTER": "copter", "DODECAROTOR": "copter"}
    assert {
        getattr(mavlink, f"MAV_TYPE_{name}"): each for name, each in telemetry.items()
    } == VEHICLES
    assert (ARDUPILOT, ARMED, NO_AUTOPILOT) == (
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        mavlink.MAV_MODE_FLAG_SAFETY_ARMED,
        mavlink.MAV_AUTOPILOT_INVALID,
    )
    assert AUTOPILOTS == {ARDUPILOT: "ArduPilot", mavlink.MAV_AUTOPILOT_PX4: "PX4"}
