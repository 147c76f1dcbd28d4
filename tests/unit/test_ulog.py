"""ULog: every record kind, damage, appended data, hostile bytes."""

from __future__ import annotations

import struct
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid import _native
from flightid.errors import LogFormatError, MissingColumnError
from flightid.logs import Log, read_log
from flightid.logs.ulog.reader import UlogSource
from tests.examples import examples
from tests.ulog_builder import UlogBuilder, flight


def opened(tmp_path: Path, data: bytes) -> UlogSource:
    path = tmp_path / "log.ulg"
    path.write_bytes(data)
    return UlogSource(path)


def kept(log: _native.Ulog) -> int:
    return sum(rows for _, _, rows in log.tables())


def test_columns_nest_with_arrays_and_instances(tmp_path: Path) -> None:
    log = Log("flight.ulg", opened(tmp_path, bytes(flight(50))))
    assert log.messages["gyro"].instances == (0, 1)
    assert log.table("gyro", 1)["xyz[0]"].tolist() == [2.0 * i for i in range(50)]
    assert log.table("gyro", 0)["xyz[1]"].tolist() == [-float(i) for i in range(50)]
    power = log.table("power")
    assert power.columns[:4] == ("timestamp", "esc[0].rpm", "esc[0].volt", "esc[1].rpm")
    assert not [name for name in power.columns if "padding" in name]
    assert power["esc[1].rpm"].tolist() == [i + 1.0 for i in range(50)]
    assert power.text("name")[0] == "abc"
    assert log.messages["gyro"].rate_hz == pytest.approx(250.0)
    assert power.unit("timestamp") == "µs"


def test_read_log_knows_a_ulog_by_its_content(tmp_path: Path) -> None:
    path = tmp_path / "flight.bin"
    path.write_bytes(bytes(flight(3)))
    assert read_log(path).kind == "px4"


def test_all_instances_come_in_file_order(tmp_path: Path) -> None:
    source = opened(tmp_path, bytes(flight(3)))
    assert source.numbers("gyro", "xyz[0]", None).tolist() == [0, 0, 1, 2, 2, 4]
    assert source.rows("gyro", None) == 6


def test_parameters_changes_defaults_lines_and_information(tmp_path: Path) -> None:
    source = opened(tmp_path, bytes(flight(50)))
    log = Log("flight.ulg", source)
    assert log.parameters == {"MC_ROLL_P": 50.5, "MAV_TYPE": 2.0}
    first = log.parameter_changes[0]
    assert (first.name, first.old, first.new) == ("MC_ROLL_P", 6.5, 10.5)
    assert first.time_s == pytest.approx(0.026005)
    assert source.default_parameters == {
        "system": {"MC_ROLL_P": 6.0, "MAV_TYPE": 0.0},
        "airframe": {"MAV_TYPE": 0.0},
    }
    assert [event.text for event in log.events[:2]] == ["info: hello", "warning: tagged"]
    assert source.info["sys_name"] == "PX4"
    assert log.board == "00060000000035353237"
    assert source.multi_info == {"perf": [["ab", "cd"]]}
    assert (log.firmware, log.vehicle, log.kind) == ("PX4 v1.14.3", "copter", "px4")
    assert [round(gap.duration_s, 6) for gap in log.gaps] == [0.012] * 5
    assert [finding.code for finding in log.findings] == ["logger-dropouts"]


def test_modes_and_arming_become_events(tmp_path: Path) -> None:
    built = UlogBuilder().format("vehicle_status:uint64_t timestamp;uint8_t nav_state;")
    built.announce("vehicle_status", 0)
    for index, mode in enumerate([0, 0, 2, 2, 99]):
        built.sample(0, "QB", 1_000_000 * index, mode)
    events = opened(tmp_path, bytes(built)).events
    assert [(e.time_s, e.text) for e in events] == [
        (0.0, "MANUAL"),
        (2.0, "POSCTL"),
        (4.0, "nav_state 99"),
    ]


def test_trailing_padding_may_be_logged_or_not(tmp_path: Path) -> None:
    built = UlogBuilder().format("a:uint64_t timestamp;uint8_t x;uint8_t[3] _padding0;")
    built.announce("a", 0).sample(0, "QB", 1, 5).sample(0, "QB3x", 2, 6).sample(0, "QB4x", 3, 7)
    source = opened(tmp_path, bytes(built))
    assert source.numbers("a", "x", 0).tolist() == [5, 6]
    assert source.skipped[0].reason == "a sample whose length does not fit its definition"


@pytest.mark.parametrize("width", ["B", "H", "I", "Q"])
def test_stamps_of_any_width(tmp_path: Path, width: str) -> None:
    kind = {"B": "uint8_t", "H": "uint16_t", "I": "uint32_t", "Q": "uint64_t"}[width]
    built = UlogBuilder(start_us=0).format(f"a:{kind} timestamp;").announce("a", 0)
    built.sample(0, width, 200).dropout(5)
    source = opened(tmp_path, bytes(built))
    assert source.time_s("a", 0).tolist() == [200e-6]
    assert source.gaps[0].start_s == pytest.approx(200e-6)


def test_a_topic_that_never_stamps_has_no_span(tmp_path: Path) -> None:
    built = UlogBuilder().format("a:uint64_t timestamp;").announce("a", 0)
    built.sample(0, "Q", 0).sample(0, "Q", 0)
    message = opened(tmp_path, bytes(built)).messages["a"]
    assert (message.first_s, message.rate_hz) == (None, None)


def test_unknown_record_types_are_stepped_over_and_reported() -> None:
    built = flight(5)
    built.record("Z", b"from the future").sample(7, "Q3f", 99_999, 1, 2, 3).sync()
    log = _native.Ulog(bytes(built))
    assert kept(log) == 16
    assert [reason for _, _, reason in log.skipped()] == ["a record type that is not known"]


def test_appended_data_is_read_behind_the_cut() -> None:
    built = flight(20)
    cut = built.size + 10
    built.records.append(built.records[-2][:10])  # a sample that the crash cut short
    built.sample(7, "Q3f", 500_000, 1, 2, 3)
    built.appended = (cut,)
    log = _native.Ulog(bytes(built))
    assert kept(log) == 61
    assert log.skipped() == [(cut - 10, cut, "a record is cut where crash data was appended")]
    built.appended = (cut, 10**12, 5)
    assert _native.Ulog(bytes(built)).header()[3] == [cut]


def test_truncation_keeps_whole_records_and_says_so() -> None:
    data = bytes(flight(20))
    # The last record removes a message (5 bytes); the one before it is a sample.
    for cut, samples in ((0, 60), (2, 60), (9, 59)):
        log = _native.Ulog(data[: len(data) - cut])
        assert kept(log) == samples
        assert [reason for _, _, reason in log.skipped()] == (
            ["the file ends inside a record"] if cut else []
        )


def test_not_a_ulog_is_refused() -> None:
    with pytest.raises(LogFormatError, match="not a PX4 ULog log"):
        _native.Ulog(b"something else entirely")
    with pytest.raises(LogFormatError, match="not a PX4 ULog log"):
        _native.Ulog(b"ULog\x01\x12\x35")
    with pytest.raises(LogFormatError, match="incompatible flags 0x6"):
        _native.Ulog(bytes(UlogBuilder(incompatible=6)))


def test_missing_names_are_typed_errors() -> None:
    log = _native.Ulog(bytes(flight(2)))
    with pytest.raises(MissingColumnError, match="no message named"):
        log.gather("magnet", None, [])
    with pytest.raises(MissingColumnError, match='no message named "gyro instance 5"'):
        log.gather("gyro", 5, [])
    with pytest.raises(MissingColumnError, match="no field named"):
        log.gather("gyro", 0, ["abc"])


def test_announced_without_definition_loses_only_its_own_samples() -> None:
    built = UlogBuilder().format("a:uint64_t timestamp;").announce("a", 0).announce("ghost", 1)
    for index in range(100):
        built.sample(0, "Q", index).sample(1, "QQ", index, 5)
    log = _native.Ulog(bytes(built))
    assert kept(log) == 100
    reasons = {reason for _, _, reason in log.skipped()}
    assert reasons == {
        "an announced message has no usable definition",
        "samples of a message that was never announced",
    }


def test_hostile_definitions_stay_small() -> None:
    built = UlogBuilder()
    built.format("n0:")
    for depth in range(1, 16):
        built.format(f"n{depth}:n{depth - 1}[65535] x;")
    built.format("loop:loop x;").format("wide:uint8_t[60000] x;").format("huge:wide[60000] x;")
    for number, name in enumerate(["n15", "loop", "huge", "wide"]):
        built.announce(name, number)
    log = _native.Ulog(bytes(built))
    assert [name for name, _, _ in log.tables()] == ["n15", "wide"]
    assert len(log.columns("wide")) == 60_000
    assert log.columns("n15") == []


@pytest.mark.parametrize("seed", range(6))
def test_damage_costs_only_the_damaged_records(seed: int) -> None:
    built = flight(400)
    starts, number = [], 0
    at = built.size - sum(map(len, built.records))
    for record in built.records:
        starts.append((at, at + len(record), record))
        at += len(record)
    rng = np.random.default_rng(seed)
    data = bytearray(bytes(built))
    first = next(start for start, _, record in starts if record[2:3] == b"D")
    hits = [(int(h), int(h) + 700) for h in rng.integers(first + 200, len(data) - 900, 3)]
    for start, stop in hits:
        data[start:stop] = rng.bytes(stop - start)
    log = _native.Ulog(bytes(data))

    def untouched(start: int, stop: int) -> bool:
        return all(stop <= low or start >= high for low, high in hits)

    samples = [(a, b) for a, b, record in starts if record[2:3] == b"D"]
    number = sum(untouched(a, b) for a, b in samples)
    # In front of each hit one sample may be given up, because its end may be overwritten.
    assert number - len(hits) <= kept(log) <= number
    stamps = log.gather("gyro", 0, ["timestamp"])[0]
    assert np.all(np.diff(stamps) > 0), "no row is garbage"
    assert sum(stop - start for start, stop, _ in log.skipped()) < 3 * 900 + 300


def test_a_damaged_head_costs_one_sample() -> None:
    built = flight(20)
    data = bytearray(bytes(built))
    target = data.index(struct.pack("<HBHQ", 22, ord("D"), 7, 10_000 + 4_000 * 9))
    data[target + 1] ^= 0x40  # its length
    log = _native.Ulog(bytes(data))
    assert kept(log) == 59
    assert log.skipped() == [(target, target + 25, "no record starts here")]


@given(data=st.binary(max_size=400))
@examples(200)
def test_any_bytes_behind_a_header_are_read_or_refused(data: bytes) -> None:
    head = bytes(UlogBuilder())
    for prefix in (b"", head[:16], head, bytes(flight(2))):
        try:
            log = _native.Ulog(prefix + data)
        except LogFormatError:
            continue
        for name, instance, rows in log.tables():
            columns = [column for column, _ in log.columns(name)][:50]
            assert all(len(v) == rows for v in log.gather(name, instance, columns))


@given(flips=st.lists(st.tuples(st.integers(16, 10_000), st.integers(0, 255)), max_size=20))
@examples(200)
def test_every_byte_is_accounted_for(flips: list[tuple[int, int]]) -> None:
    data = bytearray(bytes(flight(30)))
    for at, value in flips:
        data[at % len(data)] = value
    try:
        log = _native.Ulog(bytes(data))
    except LogFormatError:
        return
    ranges = log.skipped()
    assert all(0 <= start < stop <= len(data) for start, stop, _ in ranges)
    assert all(a[1] <= b[0] for a, b in pairwise(ranges)), "in order"
