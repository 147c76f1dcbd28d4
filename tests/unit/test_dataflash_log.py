"""DataFlash logs as a `Log`: opening by content, tables, parameters, events, damage, refusals."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid import _native
from flightid.conventions import Light
from flightid.errors import (
    DataError,
    LogFormatError,
    MissingColumnError,
    OptionError,
    ShapeError,
    UnknownNameError,
)
from flightid.logs import DataflashWriter, MessageLayout
from flightid.logs.dataflash.writer import _stamps
from tests.examples import examples

TIME_US = np.arange(0, 1_000_000, 10_000)


def _writer() -> DataflashWriter:
    writer = DataflashWriter()
    writer.message(0, "ArduCopter V4.7.0 (test)")
    writer.parameter("ATC_RAT_RLL_P", 0.135)
    writer.parameter("ATC_RAT_RLL_P", 0.15, time_us=500_000)
    for instance in (0, 1):
        writer.add("IMU", TIME_US, {"I": instance, "GyrX": instance + TIME_US / 1e6})
    writer.add("MODE", [1000], {"Mode": [25], "ModeNum": [25], "Rsn": [1]})
    writer.add("EV", [2000, 900_000], {"Id": [10, 11]})
    writer.add("ERR", [3000, 4000], {"Subsys": [12, 12], "ECode": [1, 0]})
    return writer


@pytest.fixture
def log(tmp_path: Path) -> fid.Log:
    return fid.read_log(_writer().write(tmp_path / "any.name"))


def test_a_log_tells_what_it_holds(log: fid.Log) -> None:
    assert (log.kind, log.vehicle, log.firmware) == (
        "ardupilot",
        "copter",
        "ArduCopter V4.7.0 (test)",
    )
    info = log.messages["IMU"]
    assert (info.count, info.instances, info.fields["GyrX"]) == (200, (0, 1), "rad/s")
    assert info.rate_hz == pytest.approx(100.0)
    assert log.duration_s == pytest.approx(0.99)
    assert log.skipped == ()
    assert "0 bytes skipped" in repr(log)
    assert "IMU" in log.summary().to_text()
    assert log.to_dict()["schema"] == "flightid.log/1"


def test_tables_know_instances_units_and_frames(log: fid.Log) -> None:
    table = log.table("IMU", 1)
    np.testing.assert_array_equal(table["GyrX"], np.float32(1 + TIME_US / 1e6))
    assert (len(table), table.unit("AccX"), table.instance) == (100, "m/s^2", 1)
    assert len(log.table("IMU")) == 200
    assert table.to_pandas().shape == (100, 15)
    assert log.table("PARM").text("Name") == ["ATC_RAT_RLL_P"] * 2
    assert not table["GyrX"].flags.writeable


def test_columns_read_together_are_those_read_alone(tmp_path: Path) -> None:
    # Rows of several blocks, not a whole number of them.
    time_us = np.arange(1001) * 2500
    writer = DataflashWriter()
    writer.add("IMU", time_us, {"I": time_us // 2500 % 2, "GyrX": time_us / 1e6, "EG": 7})
    path = writer.write(tmp_path / "a.bin")
    together = fid.read_log(path).table("IMU", 1).arrays()
    assert list(together) == list(fid.read_log(path).table("IMU").columns)
    alone = fid.read_log(path).table("IMU", 1)
    for name, values in together.items():
        np.testing.assert_array_equal(values, alone[name])
    np.testing.assert_array_equal(together["GyrX"], np.float32(time_us[1::2] / 1e6))
    assert list(alone.arrays(["EG", "GyrX", "EG"])) == ["EG", "GyrX"]
    assert alone.arrays(["EG"])["EG"] is alone["EG"]
    with pytest.raises(MissingColumnError, match="no such field"):
        alone.arrays(["EG", "none"])


def test_a_file_that_has_become_shorter_is_refused(tmp_path: Path) -> None:
    path = _writer().write(tmp_path / "a.bin")
    log = fid.read_log(path)
    with path.open("r+b") as file:
        file.truncate(5000)
    # Where the pages are gone the read itself meets it; what is left of the last page is zeros.
    for _ in range(2):
        with pytest.raises(LogFormatError, match="the log changed while it was read"):
            log.table("IMU")["GyrX"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes are of Unix")
def test_what_cannot_be_mapped_is_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    feeder = threading.Thread(target=pipe.write_bytes, args=(SMALL,))
    feeder.start()
    file = _native.open_dataflash(str(pipe))
    feeder.join()
    assert file.size() == len(SMALL)


def test_parameters_are_final_and_changes_are_kept(log: fid.Log) -> None:
    assert log.parameters["ATC_RAT_RLL_P"] == pytest.approx(0.15)
    (change,) = log.parameter_changes
    assert (change.time_s, change.name) == (0.5, "ATC_RAT_RLL_P")
    assert (change.old, change.new) == (pytest.approx(0.135), pytest.approx(0.15))


def test_events_are_in_words_and_in_order(log: fid.Log) -> None:
    assert [(event.kind, event.text) for event in log.events] == [
        ("text", "ArduCopter V4.7.0 (test)"),
        ("mode", "SYSTEMID (mode 25, reason 1)"),
        ("arming", "armed (event 10)"),
        ("error", "crash check, code 1"),
        ("error", "crash check, resolved"),
        ("arming", "disarmed (event 11)"),
    ]


def test_silence_of_all_messages_is_a_gap(tmp_path: Path) -> None:
    writer = DataflashWriter()
    writer.add("RATE", np.concatenate([TIME_US, TIME_US + 3_000_000]), {"R": 0.0})
    (gap,) = fid.read_log(writer.write(tmp_path / "a.bin")).gaps
    assert (gap.start_s, gap.stop_s) == (0.99, 3.0)


def test_damage_is_reported(tmp_path: Path) -> None:
    content = _writer().to_bytes()
    path = tmp_path / "a.bin"
    path.write_bytes(content[:10_000] + b"damage" * 10 + content[10_000:])
    log = fid.read_log(path)
    assert sum(item.size for item in log.skipped) >= 60
    assert [finding.code for finding in log.findings] == ["bytes-skipped"]


def test_a_log_that_is_cut_inside_a_message_says_so(tmp_path: Path) -> None:
    """What it costs is judged by the flight (`test_log_end.py`)."""
    path = tmp_path / "a.bin"
    path.write_bytes(_writer().to_bytes()[:-5])
    (cut,) = fid.read_log(path).findings
    assert (cut.code, cut.light) == ("log-cut", Light.UNKNOWN)
    assert cut.message.startswith("the file ends inside a message")


def test_columns_that_are_not_there_are_refused(log: fid.Log) -> None:
    with pytest.raises(MissingColumnError, match="the log holds no such message"):
        log.table("RATES")
    with pytest.raises(MissingColumnError, match="message IMU has no such instance"):
        log.table("IMU", 7)
    with pytest.raises(MissingColumnError, match="message IMU has no such field"):
        log.table("IMU")["Gyr"]
    with pytest.raises(MissingColumnError, match="holds text"):
        log.table("MSG")["Message"]
    with pytest.raises(MissingColumnError, match="holds numbers"):
        log.table("IMU").text("GyrX")
    with pytest.raises(MissingColumnError, match="message FMT has no stamp"):
        _ = log.table("FMT").time_s


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"", "an empty file"),
        (b"\x1f\x8b\x08rest", "gzip"),
        (b"PK\x03\x04rest", "zip"),
        (b"FMT, 128, 89", "text log"),
        (b"time,p,q\n0,1,2\n", "text of no known kind"),
        (b"\x00\x01secret", "found bytes of no known kind; needed"),
        (b"\xa3\x95 but no message", "without one message"),
    ],
)
def test_what_is_no_log_is_named(tmp_path: Path, content: bytes, found: str) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(content)
    with pytest.raises(LogFormatError, match=found):
        fid.read_log(path)


def test_a_file_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        fid.read_log(tmp_path / "none.bin")


def test_what_cannot_be_logged_is_refused() -> None:
    writer = DataflashWriter()
    with pytest.raises(UnknownNameError, match="no such message to write"):
        writer.add("NONE", [0], {})
    with pytest.raises(UnknownNameError, match="no such field to fill"):
        writer.add("RATE", [0], {"Rol": 1.0})
    with pytest.raises(ShapeError, match="does not fit its stamps"):
        writer.add("RATE", [0, 1], {"R": [1.0, 2.0, 3.0]})
    with pytest.raises(DataError, match="storage cannot hold"):
        writer.add("EV", [0], {"Id": [300]})
    with pytest.raises(DataError, match="storage cannot hold"):
        writer.add("EV", [0], {"Id": [np.nan]})
    with pytest.raises(DataError, match="stamps cannot be logged"):
        writer.add("EV", [-1], {"Id": [3]})
    for wrong in ([[1], [2]], [1.5], [True], ["1"]):
        with pytest.raises(DataError, match="stamps cannot be logged"):
            _stamps(wrong)
    with pytest.raises(DataError, match="text that is too long"):
        writer.message(0, "x" * 65)
    with pytest.raises(DataError, match="nothing to write"):
        DataflashWriter().to_bytes()


def test_layouts_that_contradict_themselves_are_refused() -> None:
    with pytest.raises(OptionError, match="cannot be logged"):
        MessageLayout("BAD", 200, "Qf", "TimeUS", "s-", "F-")
    for name in ("", "LONGS"):
        with pytest.raises(OptionError, match="cannot be logged"):
            MessageLayout(name, 200, "Q", "TimeUS", "s", "F")
    for name in ("A", "FOUR"):
        assert MessageLayout(name, 200, "Q", "TimeUS", "s", "F").dtype.itemsize == 3 + 8
    writer = DataflashWriter()
    with pytest.raises(OptionError, match="cannot be defined"):
        writer.define(MessageLayout("OWN", 75, "Qf", "TimeUS,x", "s-", "F-"))


def test_a_layout_of_ones_own_is_written_and_read(tmp_path: Path) -> None:
    writer = DataflashWriter()
    writer.define(MessageLayout("OWN", 200, "QE", "TimeUS,x", "sm", "FB"))
    writer.add("OWN", [1, 2], {"x": [1.25, 2.5]})
    table = fid.read_log(writer.write(tmp_path / "a.bin")).table("OWN")
    assert (table["x"].tolist(), table.unit("x")) == ([1.25, 2.5], "m")


def test_layouts_of_one_name_are_read_apart_and_said(tmp_path: Path) -> None:
    content = b""
    for kind, formats in enumerate(("QE", "Qf", "QBB"), 200):
        writer = DataflashWriter()
        labels = ",".join(("TimeUS", "x", "y")[: len(formats)])
        writer.define(
            MessageLayout(
                "OWN", kind, formats, labels, "s--"[: len(formats)], "F--"[: len(formats)]
            )
        )
        writer.add("OWN", [1, 2, 3][: kind - 199], {"x": [kind - 199] * (kind - 199)})
        content += writer.to_bytes()
    (tmp_path / "three.bin").write_bytes(content)
    log = fid.read_log(tmp_path / "three.bin")
    counts = {name: info.count for name, info in log.messages.items() if name.startswith("OWN")}
    assert counts == {"OWN": 1, "OWN~2": 2, "OWN~3": 3}
    assert set(log.table("OWN~3").columns) == {"TimeUS", "x", "y"}
    (said,) = (each for each in log.findings if each.code == "layout-changed")
    assert said.message.endswith("inside the file: OWN~2, OWN~3")


SMALL = _writer().to_bytes()


@examples(150)
@given(st.data())
def test_damaged_logs_never_break_the_reader(data: st.DataObject) -> None:
    content = bytearray(SMALL)
    for _ in range(data.draw(st.integers(0, 8))):
        place = data.draw(st.integers(0, len(content) - 1))
        content[place] = data.draw(st.integers(0, 255))
    del content[data.draw(st.integers(1, len(content))) :]
    try:
        file = _native.index_dataflash(bytes(content))
    except LogFormatError:
        return
    for index, (_, _, rows) in enumerate(file.tables()):
        file.describe(index)
        widths = [width for *_, width in file.fields(index)]
        columns = file.columns(index, list(range(len(widths))), None)
        assert [values.size for values in columns] == [rows * width for width in widths]
    skipped = sum(stop - start for start, stop, _ in file.skipped())
    assert 0 <= skipped <= len(content) == file.size()


def test_a_column_that_was_read_is_not_read_again(tmp_path: Path) -> None:
    """An inspection asks for stamps and rates some sixty times, each time by a table of its own."""
    log = fid.read_log(_writer().write(tmp_path / "a.bin"))
    first, second = log.table("IMU", 0), log.table("IMU", 0)
    assert first["GyrX"] is second["GyrX"]
    assert first.time_s is second.time_s
    assert first["GyrX"] is not log.table("IMU", 1)["GyrX"]
    with pytest.raises(ValueError, match="read-only"):
        second["GyrX"][0] = 1.0
