"""Readers and the writer of logs at the edges of what a format holds, row by row and bit by bit."""

from __future__ import annotations

import struct
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, OptionError
from flightid.logs.dataflash.layout import MessageLayout, standard_tables, stored
from flightid.logs.dataflash.sdlog2 import TOPICS, _vehicle
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.logs.first_fix import log_start
from flightid.logs.mavlink.messages import telemetry_messages
from flightid.logs.mavlink.reader import (
    _clock,
    _events,
    _findings,
    _longest_run,
    _made_s,
    _rows,
    _stamps,
    _starts,
)
from flightid.logs.ulog.names import changes_of
from tests.closeness import assert_close
from tests.old_px4_log import rates, write_sdlog2

KNOWN = {message.name: message for message in telemetry_messages().values()}


def test_old_px4_messages_have_todays_fields_by_their_number() -> None:
    assert list(TOPICS["OUT0"][1].items()) == [
        (f"Out{k}", (f"output[{k}]", "us")) for k in range(16)
    ]
    names = ("Roll", "Pitch", "Yaw", "Thrust")
    assert [TOPICS["ATTC"][1][each] for each in names] == [(f"control[{k}]", "1") for k in range(4)]
    for field, topic, unit in (
        ("Gyro", "gyro_rad", "rad/s"),
        ("Acc", "accelerometer_m_s2", "m/s^2"),
    ):
        assert [TOPICS["IMU"][1][field + axis] for axis in "XYZ"] == [
            (f"{topic}[{k}]", unit) for k in range(3)
        ]


def test_old_px4_vehicles_by_type_or_by_the_number_of_their_setup() -> None:
    told = {1999: None, 2000: "plane", 3999: "plane", 4000: "copter", 12999: "copter", 13000: None}
    cases: list[tuple[dict[str, float], str | None]] = [
        ({"MAV_TYPE": 1.0, "SYS_AUTOSTART": 4001.0}, "plane"),
        ({"MAV_TYPE": 99.0, "SYS_AUTOSTART": 2001.0}, "plane"),
        ({}, None),
        *(({"SYS_AUTOSTART": float(number)}, vehicle) for number, vehicle in told.items()),
    ]
    for parameters, vehicle in cases:
        source: Any = SimpleNamespace(parameters=parameters)
        assert _vehicle(source) == vehicle, parameters


def test_stamps_of_an_old_px4_log_run_forward_and_rates_with_them(tmp_path: Path) -> None:
    log = fid.read_log(write_sdlog2(tmp_path / "log.bin"))
    assert [each.code for each in log.findings] == []
    record = log.record(names=["tau_phi", "p"])
    assert_close(record["p"][:50], rates(600)[:100:2], atol=1e-5, why="low-passed from 200 Hz")
    cut = tmp_path / "cut.bin"
    cut.write_bytes(b"\x13\x57\x99\x24\x68" + (tmp_path / "log.bin").read_bytes())
    assert [each.code for each in fid.read_log(cut).findings] == ["bytes-skipped"]


def _table(name: str, **columns: object) -> tuple[np.ndarray, np.ndarray]:
    """Arrivals at whole seconds, and rows of a message."""
    rows = np.zeros(len(next(iter(columns.values()))), KNOWN[name].layout)  # type: ignore[arg-type]
    for field, values in columns.items():
        rows[field] = values
    return np.arange(float(len(rows))), rows


def test_every_field_of_telemetry_is_read_as_it_was_sent() -> None:
    for message in KNOWN.values():
        size = 3 * message.layout.itemsize
        rows = np.frombuffer(np.arange(size, dtype=np.uint8).tobytes(), message.layout)
        found = _rows(message, rows, np.arange(3.0))
        told = set()
        for field, unit in message.units.items():
            kind = message.layout[field]
            for place in range(*kind.shape) if kind.shape else [None]:
                name = field if place is None else f"{field}[{place}]"
                told.add(name)
                assert found.units[name] == unit
                if kind.base.kind != "S":
                    sent = rows[field] if place is None else rows[field][:, place]
                    assert np.array_equal(found.read(name), sent.astype(float), equal_nan=True)
        assert set(found.units) == told
    said = np.zeros(1, KNOWN["STATUSTEXT"].layout)
    said["text"] = b"EKF3 ready\0left of the line before"
    assert _rows(KNOWN["STATUSTEXT"], said, np.zeros(1)).words["text"] == ["EKF3 ready"]


@pytest.mark.parametrize(("fall_ms", "runs"), [(4_900, 1), (5_000, 1), (5_001, 2)])
def test_an_autopilot_starts_anew_where_its_clock_falls_by_more_than_five_seconds(
    fall_ms: int, runs: int
) -> None:
    made = np.array([60_000, 61_000, 61_000 - fall_ms, 62_000])
    heard = {"ATTITUDE": _table("ATTITUDE", time_boot_ms=made)}
    starts = _starts(heard)
    assert starts == [-np.inf, 2.0][:runs]
    beats = np.array([0.0, 1.9, 2.0, 3.0, 4.0])
    heard["HEARTBEAT"] = beats, np.zeros(5, KNOWN["HEARTBEAT"].layout)
    kept = _longest_run(heard, starts)["HEARTBEAT"][0]
    assert kept.tolist() == (beats if runs == 1 else beats[2:]).tolist()
    assert ("autopilot-restarted" in [each.code for each in _findings(bytes(9), 0, runs)]) is (
        runs > 1
    )


def test_the_first_of_runs_that_are_as_long_is_read_and_arrivals_begin_with_it() -> None:
    heard = {"HEARTBEAT": (np.arange(4.0), np.zeros(4, KNOWN["HEARTBEAT"].layout))}
    for name, longest in (([-np.inf, 2.0], [0.0, 1.0]), ([-np.inf, 1.0], [1.0, 2.0, 3.0])):
        assert _longest_run(heard, name)["HEARTBEAT"][0].tolist() == longest
    early = {
        **heard,
        "PARAM_VALUE": (np.array([0.5, 3.5]), np.zeros(2, KNOWN["PARAM_VALUE"].layout)),
    }
    kept = _longest_run(early, [-np.inf, 1.0])["PARAM_VALUE"][0]
    assert kept.tolist() == [1.0, 3.5]


@pytest.mark.parametrize(
    ("boot_ms", "told"),
    [([0, 0], False), ([0, 1], True), ([500, 600], True), ([99_999_999_999 % 2**32, 5], True)],
)
def test_stamps_that_are_all_zero_tell_nothing(boot_ms: list[int], *, told: bool) -> None:
    arrived, rows = _table("ATTITUDE", time_boot_ms=boot_ms)
    made = _made_s(rows)
    assert (made is not None) is told
    if made is not None:
        assert made.tolist() == [each / 1e3 for each in boot_ms]
    clock = _clock({"ATTITUDE": (arrived, rows)})
    assert clock == (min(arrived - np.array(boot_ms) / 1e3) if told else 0.0)


def test_stamps_since_1970_are_of_no_start() -> None:
    wide = np.dtype([("time_usec", "<u8")])
    for stamp, told in ((99_999_999_999_999, True), (100_000_000_000_000, False)):
        assert (_made_s(np.array([(stamp,)], wide)) is not None) is told


@pytest.mark.parametrize("late_s", [0.0, 200.0, 2_000.0])
def test_counters_turn_over_at_all_of_their_bits(late_s: float) -> None:
    """What arrives late by less than half a turn, 36 min of 32 bits of µs, is not moved."""
    rows = np.zeros(3, np.dtype([("time_usec", "<u4")]))
    true = np.array([10.0, 4_290.0, 4_300.0])
    rows["time_usec"] = np.round(1e6 * true).astype(np.int64) % 2**32
    found = _stamps(true + 7.0 + late_s, rows, 7.0)
    assert_close(found, true, atol=1e-6, why="µs")


def test_events_of_telemetry_stand_at_their_heartbeats() -> None:
    armed = np.array([0, 0, 128, 129, 1], np.uint8)
    _, beats = _table("HEARTBEAT", base_mode=armed, custom_mode=[0, 4, 4, 4, 5])
    _, said = _table("STATUSTEXT", severity=[0, 6, 7, 9], text=[b"a", b"b", b"c", b"d"])
    tables = {
        "HEARTBEAT": _rows(KNOWN["HEARTBEAT"], beats, 10.0 + np.arange(5.0)),
        "STATUSTEXT": _rows(KNOWN["STATUSTEXT"], said, np.arange(4.0)),
    }
    found = [(each.time_s, each.kind, each.text) for each in _events(tables, None)]
    assert [each for each in found if each[1] == "arming"] == [
        (10.0, "arming", "disarmed"),
        (12.0, "arming", "armed"),
        (14.0, "arming", "disarmed"),
    ]
    assert [each[0] for each in found if each[1] == "mode"] == [10.0, 11.0, 14.0]
    assert [each[2] for each in found if each[1] == "text"] == [
        "emergency: a",
        "info: b",
        "debug: c",
        "debug: d",
    ]


def test_a_change_of_state_is_told_by_its_name_or_number() -> None:
    values = np.array([2, 2, 7, 2])
    found = changes_of(values, np.arange(4.0), "nav_state", "mode", {2: "POSCTL"})
    assert [(each.time_s, each.kind, each.text) for each in found] == [
        (0.0, "mode", "POSCTL"),
        (2.0, "mode", "nav_state 7"),
        (3.0, "mode", "POSCTL"),
    ]
    assert changes_of(values[:0], np.empty(0), "nav_state", "mode", {}) == []


def test_layouts_fit_a_row_of_the_format() -> None:
    told: dict[str, Any] = {"name": "TEST", "type": 200, "format": "Qf", "columns": "TimeUS,V"}
    told |= {"units": "s-", "multipliers": "F-"}
    one = {"format": "Q", "columns": "TimeUS", "units": "s", "multipliers": "F"}
    for fits in ({}, {"type": 0}, {"type": 255}, one, {"columns": "TimeUS," + "x" * 57}):
        assert MessageLayout(**told | fits).name == "TEST"
    for wrong in (
        {"name": "ABCDE"}, {"name": ""}, {"type": 256}, {"type": -1}, {"units": "s"},
        {"multipliers": "F"}, {"columns": "TimeUS"}, {"format": "Qx"},
        {"columns": "TimeUS," + "x" * 58},
    ):  # fmt: skip
        with pytest.raises(OptionError, match="cannot be logged"):
            MessageLayout(**told | wrong)


def test_layouts_hold_sixteen_fields_and_255_bytes() -> None:
    for code, size in (
        ("B" * 16, 19), ("B" * 17, None),
        ("ZZZ" + "Q" * 7 + "B" * 4, 255), ("ZZZ" + "Q" * 7 + "B" * 5, None),
    ):  # fmt: skip
        told = ("TEST", 1, code, ",".join("abcdefghijklmnopq"[: len(code)]))
        rest = ("-" * len(code), "-" * len(code))
        if size:
            made = MessageLayout(*told, *rest)
            assert made.dtype.itemsize == size
            assert made.empty(2)["header"].tolist() == [[0xA3, 0x95, 1]] * 2
        else:
            with pytest.raises(
                OptionError, match="at most 16 fields, 64 characters of labels and 255"
            ):
                MessageLayout(*told, *rest)


def test_numbers_are_stored_within_the_limits_of_their_storage() -> None:
    layout = MessageLayout("TEST", 1, "QcCeELB", "t,c,C,e,E,L,B", "s------", "F------")
    _, multipliers, _ = standard_tables()
    divisors = [layout.divisor(each, multipliers) for each in "tcCeELB"]
    assert divisors == [1e6, 100.0, 100.0, 100.0, 100.0, 1e7, 1.0]
    plain = MessageLayout("TEST", 1, "BBB", "a,b,c", "---", "-XF")
    told = {"-": 0.0, "F": 1e-6}  # No multiplier, one that nobody knows, and a known one.
    assert_close([plain.divisor(each, told) for each in "abc"], [1.0, 1.0, 1e6], rtol=1e-9, why="")
    byte = np.dtype("u1")
    assert stored([0, 255], byte, 1.0, "B").tolist() == [0, 255]
    assert stored([2.54], byte, 100.0, "B").tolist() == [254.0]
    for value in (-1, 256, np.nan):
        with pytest.raises(DataError, match="0 to 255"):
            stored([value], byte, 1.0, "B")
    with pytest.raises(DataError, match=r"found 2.56 to 2.56; needed 0 to 2.55"):
        stored([2.56], byte, 100.0, "B")
    assert stored(["abcd"], np.dtype("S4"), 1.0, "n").tolist() == [b"abcd"]
    with pytest.raises(DataError, match="5 bytes: 'abcde'"):
        stored(["a", "abcde"], np.dtype("S4"), 1.0, "n")


@pytest.mark.parametrize(
    ("counts", "said"),
    [([3, 3], None), ([3, 4], "dropped 1 message while"), ([3, 9, 12], "dropped 9 messages while")],
)
def test_messages_that_the_logger_dropped_are_counted(
    tmp_path: Path, counts: list[int], said: str | None
) -> None:
    writer = DataflashWriter()
    writer.define(MessageLayout("DSF", 199, "QI", "TimeUS,Dp", "s-", "F-"))
    writer.add("DSF", 1_000_000 * np.arange(1, len(counts) + 1), {"Dp": np.array(counts)})
    log = fid.read_log(writer.write(tmp_path / "log.bin"))
    told = [each.message for each in log.findings if each.code == "messages-dropped"]
    assert len(told) == (said is not None)
    assert said is None or said in told[0]


@pytest.mark.parametrize("lost", [1, 4, 11])
def test_a_log_that_ends_within_a_row_keeps_all_rows_before(tmp_path: Path, lost: int) -> None:
    writer = DataflashWriter()
    stamps = 1_000_000 + 10_000 * np.arange(5)
    writer.add("EV", stamps, {"Id": np.arange(5)})
    path = writer.write(tmp_path / "log.bin")
    whole = fid.read_log(path).table("EV")
    assert struct.unpack("<Q", path.read_bytes()[-9:-1]) == (stamps[-1],)
    assert_close(whole.time_s, stamps / 1e6, rtol=1e-12, why="µs")
    path.write_bytes(path.read_bytes()[:-lost])
    cut = fid.read_log(path).table("EV")
    assert cut["Id"].tolist() == [0.0, 1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("week", "ms", "start"),
    [
        ([0, 2400, 2401], [0.0, 86_418_000.0, 5.0], "2026-01-05 00:00:00"),
        ([1], [18_000.0], "1980-01-13 00:00:00"),
        ([0], [86_418_000.0], None),
        ([99_999], [0.0], "3896-07-11 23:59:42"),
        ([100_000], [0.0], None),
    ],
)
def test_a_log_begins_so_long_before_its_first_fix_with_a_date(
    week: list[int], ms: list[float], start: str | None
) -> None:
    """Stamps of 3 s and more: the log began 2 s before the first, and fixes count from there."""
    time_s = 3.0 + np.arange(len(week))
    at_first = int(np.argmax(np.array(week) > 0))
    told = {"GWk": np.array(week), "GMS": np.array(ms) + 1e3 * (2.0 + at_first)}
    for unit, scale in (("1", 1.0), ("s", 1e-3)):
        rows = {"GWk": told["GWk"], "GMS": scale * told["GMS"]}
        found = log_start(_dated("GPS", time_s, rows, {"GWk": "1", "GMS": unit}))
        assert (found and str(found)) == start


def test_a_log_of_px4_begins_by_the_clock_of_its_receiver() -> None:
    stamps = np.array([0.0, 1_767_571_203_500_000.0])
    for topic in ("vehicle_gps_position", "sensor_gps"):
        for values, start in (
            (stamps, "2026-01-05 00:00:00"), (0.0 * stamps, None), (stamps + 1e17, None),
        ):  # fmt: skip
            log = _dated(topic, np.array([3.0, 4.0]), {"time_utc_usec": values}, {})
            found = log_start(log)
            assert (found and str(found)) == start
    assert log_start(_dated("other", np.array([3.0]), {"time_utc_usec": stamps[1:]}, {})) is None
    empty: Any = {"time_utc_usec": stamps[:0]}
    assert log_start(_dated("sensor_gps", stamps[:0], empty, {})) is None


def _dated(name: str, time_s: Any, columns: dict[str, Any], units: dict[str, str]) -> Any:
    """A log of one message that begins at 1 s."""

    class Table(dict[str, Any]):
        unit = staticmethod(units.get)

    table = Table(columns)
    table.time_s = time_s  # type: ignore[attr-defined]

    class OneMessage:
        first_s = 1.0
        messages = MappingProxyType({name: SimpleNamespace(fields=list(columns))})

        def __contains__(self, asked: str) -> bool:
            return asked == name

        def table(self, _: str) -> Any:
            return table

    return OneMessage()
