"""Bags of ROS 1 and ROS 2 as records: values, stamps, one grid, and what they are refused for."""

from __future__ import annotations

import re
import sqlite3
import struct
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.errors import DataError, FileFormatError, OptionError, UnknownNameError
from flightid.record.contents import table_contents
from flightid.record.formats.ros import read_columns
from tests.bag_builder import Flight, write_bag1, write_db3, write_mcap
from tests.closeness import assert_close

FLIGHT = Flight()
RATE = "/imu/rate.x"
WRITERS: dict[str, Callable[[Path], Path]] = {
    "a.mcap": write_mcap,
    "plain.mcap": partial(write_mcap, chunked=False),
    "a.bag": write_bag1,
    "b.bag": partial(write_bag1, packing="bz2"),
    "folder": write_db3,
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_container_holds_the_same_numbers(name: str, tmp_path: Path) -> None:
    table = read_columns(WRITERS[name](tmp_path / name))
    assert set(table.lengths) == {
        *(f"/imu/rate.{axis}" for axis in "xyz"),
        *("/imu/some[0]", "/imu/some[1]", "/imu/spread[0]", "/imu/spread[1]", "/imu/ok"),
        "/cmd/data",
    }
    assert np.array_equal(table.column(RATE), FLIGHT.rates)
    assert np.array_equal(table.column("/imu/rate.z"), -FLIGHT.rates)
    assert set(table.column("/imu/some[1]")) == {8.0}
    assert set(table.column("/imu/spread[1]")) == {4.0}
    assert np.array_equal(table.column("/cmd/data"), FLIGHT.commands)


def test_stamps_of_headers_go_before_those_of_the_recorder(tmp_path: Path) -> None:
    clock = read_columns(write_mcap(tmp_path / "a.mcap")).clock
    assert clock is not None
    for name, said, rate_hz in ((RATE, "of the headers", 100), ("/cmd/data", "no header", 50)):
        found = clock(name)
        assert said in found.said
        assert_close(
            found.time_s, np.arange(found.time_s.size) / rate_hz, atol=1e-7, why="ns stamps"
        )


def test_a_headers_clock_of_its_own_is_moved_and_said(tmp_path: Path) -> None:
    clock = read_columns(write_mcap(tmp_path / "a.mcap", Flight(late_ns=5_000_000_000))).clock
    assert clock is not None
    assert "moved by 5 s" in clock(RATE).said
    assert_close(clock(RATE).time_s[0], 5.0, atol=1e-7, why="the recorder saw it 5 s later")


def test_topics_go_to_the_grid_of_the_slowest_and_the_history_says_how(tmp_path: Path) -> None:
    path = write_bag1(tmp_path / "a.bag")
    (record,) = fid.read_records(path, inputs="/cmd/data", outputs={"p": RATE}, hold="zero")
    assert_close(record.sample_time_s, 0.02, rtol=1e-6, why="stamps of the command")
    assert np.array_equal(record["cmd.data"], FLIGHT.commands)
    assert record.hold == "zero"
    reading, resampling = record.history[0].options, record.history[-1].options
    assert "/cmd: stamps of the recorder" in str(reading["stamps"])
    assert resampling["cmd.data"] == "previous value"
    assert resampling["p"] == "value at the instant"
    (fast,) = fid.read_records(path, inputs="/cmd/data", outputs=RATE, resample_to_s=0.01)
    assert_close(
        fast["imu.rate.x"], FLIGHT.rates[: fast.n_samples], atol=1e-5, why="its own stamps"
    )


def test_a_bag_whose_few_columns_move_needs_no_names(tmp_path: Path) -> None:
    (record,) = fid.read_records(write_db3(tmp_path / "bag"))
    assert set(record.channels) == {"cmd.data", "imu.rate.x", "imu.rate.z"}


def test_formulas_take_columns_of_a_topic_and_not_of_two(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap")
    twice = "2*/imu/rate.x / 2 - /imu/rate.z"
    (record,) = fid.read_records(path, outputs="d", derive={"d": twice})
    assert_close(record["d"], 2 * FLIGHT.rates[: record.n_samples], atol=1e-5, why="formula")
    with pytest.raises(OptionError, match="clocks of their own"):
        fid.read_records(path, outputs="d", derive={"d": f"{RATE} - /imu/ok + /cmd/data"})


def test_contents_list_what_moves_with_rates_and_stamps(tmp_path: Path) -> None:
    table = table_contents(write_mcap(tmp_path / "a.mcap"))
    assert [row[0] for row in table.rows] == [RATE, "/imu/rate.z", "/cmd/data"]
    assert_close(table.rows[2][3], 50.0, rtol=1e-6, why="rate of the command")
    assert any("6 columns that never move" in note for note in table.notes)


def test_inspect_and_run_take_a_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_db3(tmp_path / "bag")
    assert run(["inspect", str(folder)]) == 0
    assert "/imu/rate.x" in capsys.readouterr().out
    (tmp_path / "plain").mkdir()
    assert run(["inspect", str(tmp_path / "plain")]) == 2
    assert "no ROS 2 bag" in capsys.readouterr().err


def test_a_cut_bag_gives_what_is_whole_and_says_so(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", chunked=False)
    path.write_bytes(path.read_bytes()[:-2000])
    table = read_columns(path)
    assert 300 < table.lengths[RATE] < FLIGHT.n_rates
    assert "it was cut" in table.advice


def test_old_bags_without_definitions_ask_for_the_extra_or_read_with_it(tmp_path: Path) -> None:
    folder = write_db3(tmp_path / "old", defined=False)
    if find_spec("rosbags") is None:
        with pytest.raises(OptionError, match=r"flightid\[ros\]"):
            read_columns(folder)
    else:  # the shipped Float64 is that of the command; this IMU is not the shipped one
        assert np.array_equal(read_columns(folder).column("/cmd/data"), FLIGHT.commands)


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        (b"float64 x", b"Vector3 x", "contains itself"),
        (b"float64 x", b"Nothing x", "is not defined"),
        (b"float64 x", b"float ??x", "is not one"),
        (b"float64 x", b"a/B[9000] x", "is not defined"),
    ],
)
def test_a_definition_that_is_none_leaves_its_topic_out(
    old: bytes, new: bytes, found: str, tmp_path: Path
) -> None:
    path = write_mcap(tmp_path / "a.mcap", chunked=False)
    content = path.read_bytes()
    at = content.index(old)
    # The schema's lengths follow the text.
    record = content.rindex(b"\x03", 0, content.index(b"sensor_msgs/msg/Imu"))
    grown = len(new) - len(old)
    text = content.index(b"std_msgs/Header header") - 4
    patched = bytearray(content)
    struct.pack_into("<Q", patched, record + 1, _at(content, record + 1, "Q") + grown)
    struct.pack_into("<I", patched, text, _at(content, text, "I") + grown)
    path.write_bytes(bytes(patched[:at]) + new + bytes(patched[at + len(old) :]))
    table = read_columns(path)
    assert set(table.lengths) == {"/cmd/data"}
    assert re.search(f"/imu left out.*({found})", table.advice)


def _at(content: bytes, place: int, letter: str) -> int:
    return int(struct.unpack_from("<" + letter, content, place)[0])


def test_a_bag_in_which_nothing_moves_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="a column that moves"):
        fid.read_records(write_mcap(tmp_path / "a.mcap", Flight(n_rates=1)))


def test_names_that_are_not_there_are_told_by_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match=r"/imu/rate\.x"):
        fid.read_records(write_mcap(tmp_path / "a.mcap"), outputs="/imu/rate.w")


def test_other_databases_and_huge_chunks_are_refused(tmp_path: Path) -> None:
    base = sqlite3.connect(tmp_path / "other.db3")
    base.execute("CREATE TABLE people(name)")
    base.commit()
    base.close()
    with pytest.raises(FileFormatError, match=r"no ROS 2 bag.*tables people"):
        fid.read_records(tmp_path / "other.db3")
    path = write_mcap(tmp_path / "a.mcap")
    content = bytearray(path.read_bytes())
    chunk = content.index(b"\x06", 8)
    struct.pack_into("<Q", content, chunk + 9 + 16, 1 << 40)
    path.write_bytes(bytes(content))
    with pytest.raises(FileFormatError, match="more than is read into memory"):
        fid.read_records(path)


@pytest.mark.parametrize(
    "words", [["response"], ["identify", "--kind", "arx"], ["polynomial", "--kind", "arx"]]
)
def test_every_verb_takes_columns_by_their_names_in_a_bag(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_mcap(tmp_path / "a.mcap")
    named = [words[0], str(path), *words[1:], "--inputs", "/cmd/data", "--outputs", RATE]
    run(named)
    said = capsys.readouterr()
    assert "no such channel" not in said.err
    assert "imu.rate.x" in said.out
