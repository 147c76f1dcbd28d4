"""Columns of times: known by name and content, with the unit that their name says."""

from __future__ import annotations

from pathlib import Path

import pytest

from flightid.errors import OptionError
from flightid.record import read_records
from flightid.record.contents import table_contents
from flightid.record.time_question import time_said
from tests.closeness import assert_close

SCALES = {
    "t": 1, "t_s": 1, "T": 1, "Time": 1, "Time (s)": 1, "Time [ms]": 1e3, "time_s": 1, "elapsed": 1,
    "timestamp": 1, "seconds": 1, "TimeUS": 1e6, "timeus": 1e6, "time_us": 1e6, "Time (µs)": 1e6,
    "msec": 1e3, "t_ms": 1e3, "tMs": 1e3, "TimeMS": 1e3, "Timestamp(ms)": 1e3, "%time": 1,
    "time_boot_ms": 1e3, "elapsed time [s]": 1, "timestamp_ns": 1e9, "timeSinceStart": 1,
    "millis": 1e3, "time_min": 1 / 60, "Zeit (ms)": 1e3, "Temps [s]": 1, "Tiempo": 1,
    "Zeit in ms": 1e3, "Tiempo (segundos)": 1,
}  # fmt: skip
OTHERS = ("temperature", "time_of_flight", "tau", "dt", "t1", "timer_count", "u", "t_in")


def write(folder: Path, heading: str, *columns: tuple[float, ...], name: str = "a.csv") -> Path:
    rows = [",".join(f"{cell:.12g}" for cell in row) for row in zip(*columns, strict=True)]
    path = folder / name
    path.write_text("\n".join([heading, *rows]) + "\n")
    return path


def scaled(scale: float, *times: float) -> tuple[float, ...]:
    return tuple(scale * time for time in times)


def test_a_time_is_known_by_its_name_and_unit(tmp_path: Path) -> None:
    for name, scale in SCALES.items():
        path = write(tmp_path, f"{name},y", scaled(scale, 0.0, 0.3, 0.6), (1.0, 2.0, 5.0))
        (record,) = read_records(path)
        assert list(record.channels) == ["y"], name
        assert_close(record.time_s, [0.0, 0.3, 0.6], rtol=1e-9, why=name)
    for name in OTHERS:
        path = write(tmp_path, f"{name},y", (0.0, 0.3, 0.6), (1.0, 2.0, 5.0))
        with pytest.raises(OptionError, match="no time column"):
            read_records(path)


def test_what_was_taken_for_the_time_is_said(tmp_path: Path) -> None:
    path = write(tmp_path, "t_ms,y", (0.0, 300.0, 600.0), (1.0, 2.0, 5.0))
    (record,) = read_records(path)
    assert time_said(record) == "a.csv: time from column 't_ms' (ms)"
    assert "a.csv: time from column 't_ms' (ms)." in table_contents(path).notes
    (told,) = read_records(path, time_unit="s")
    assert_close(told.time_s, [0.0, 300.0, 600.0], rtol=1e-12, why="what is told goes first")


def test_a_time_has_to_rise_and_to_be_the_only_one(tmp_path: Path) -> None:
    y = (1.0, 2.0, 5.0, 2.0)
    still = write(tmp_path, "t_s,y", (0.0, 0.3, 0.3, 0.6), y)
    with pytest.raises(OptionError, match="'t_s' is no time: it does not rise from row 2 to the"):
        read_records(still)
    assert "'t_s' is no time" in table_contents(still).notes[0]
    # One clock in two units is one time; where it starts again, another manoeuvre begins.
    times = (0.0, 0.3, 0.0, 0.3)
    both = write(tmp_path, "elapsed,TimeUS,y", scaled(1.0, *times), scaled(1e6, *times), y)
    first, second = read_records(both, outputs="y")
    assert (first.n_samples, time_said(second)) == (2, "a.csv: time from column 'TimeUS' (us)")
    other = write(tmp_path, "t_s,elapsed,y", (0.0, 0.3, 0.6, 0.9), (0.0, 0.4, 0.6, 0.9), y)
    with pytest.raises(
        OptionError, match=r"several .*'t_s' \(0 to 0.9 s\), 'elapsed' \(0 to 0.9\)"
    ):
        read_records(other)
    assert "several columns" in table_contents(other).notes[0]
    (named,) = read_records(other, time_column="elapsed", resample_to_s=0.3)
    assert list(named.channels) == ["t_s", "y"]
    (channel,) = read_records(other, outputs="elapsed")
    assert_close(channel.time_s, [0.0, 0.3, 0.6, 0.9], rtol=1e-12, why="what is named is no time")
    (degrees, *_) = read_records(
        write(tmp_path, "t [degC],t_s,y", (0.0, 1.0, 3.0, 4.0), (0.0, 0.3, 0.6, 0.9), y)
    )
    assert list(degrees.channels) == ["t", "y"]


def test_round_brackets_hold_units_as_square_ones_do(tmp_path: Path) -> None:
    heading = "Time (ms),p (deg/s),wind(kt),aileron (L),u (min),h (ft),h (m),v (%)"
    columns = [(0.0, 300.0, 600.0), *[(1.0, 2.0, 5.0)] * 7]
    path = write(tmp_path, heading, *columns)
    (record,) = read_records(path)
    assert {name: record.unit(name) for name in record.channels} == {
        "p": "deg/s", "wind": "kt", "aileron (L)": "1", "u (min)": "1", "h (ft)": "ft",
        "h (m)": "m", "v": "%",
    }  # fmt: skip
    assert_close(record.time_s, [0.0, 0.3, 0.6], rtol=1e-12, why="of its heading")
    told = {"p (deg/s)": "rad/s", "h (m)": "km", "Time (ms)": "s"}
    both = read_records(
        path, "v (%)", ["p", "wind (kt)", "h (m)"], units=told, time_column="Time (ms)"
    )[0]
    assert [both.unit(name) for name in ("v", "p", "wind", "h (m)")] == ["%", "rad/s", "kt", "km"]
    assert_close(both.time_s, [0.0, 300.0, 600.0], rtol=1e-12, why="what is told goes first")
