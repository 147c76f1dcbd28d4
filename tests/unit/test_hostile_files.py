"""Small files that ask for much: each is a typed error, and none takes memory or time first."""

from __future__ import annotations

import io
import struct
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

import flightid as fid
from flightid.errors import DataError, FileFormatError, FlightidError, OptionError
from flightid.logs.channels.channel_map import channel_map
from flightid.reading import VARIABLE, memory_budget, parse_json, parse_toml, require_memory
from flightid.record.contents import table_contents
from flightid.record.formats.csv import read_columns
from flightid.record.formats.matlab_bytes import inflated

SECONDS = 2.0


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def _matrix(kind: int, shape: tuple[int, ...], *parts: bytes) -> bytes:
    head = _element(6, struct.pack("<II", kind, 0))
    head += _element(5, struct.pack(f"<{len(shape)}i", *shape)) + _element(1, b"x")
    return _element(14, head + b"".join(parts))


def _level5(*elements: bytes) -> bytes:
    return b"MATLAB 5.0".ljust(124) + struct.pack("<H", 0x0100) + b"IM" + b"".join(elements)


def _names(*names: bytes) -> bytes:
    joined = b"".join(name.ljust(8, b"\0") for name in names)
    return struct.pack("<HHi", 5, 4, 8) + _element(1, joined)


def _nested(depth: int) -> bytes:
    made = _matrix(6, (1, 2), _element(9, bytes(16)))
    for _ in range(depth):
        made = _matrix(1, (1, 1), made)
    return made


MATLAB = {
    "structures without fields": _matrix(2, (1 << 30, 1 << 30), _names()),
    "many structures": _matrix(2, (1 << 15, 1 << 15), _names(b"a", b"b")),
    "many cells": _matrix(1, (1 << 30, 4)),
    "negative shape": _matrix(6, (-1, 4), _element(9, bytes(32))),
    "deep cells": _nested(40),
    "cut element": _matrix(6, (1, 2), struct.pack("<II", 9, 1 << 31)),
    "bomb": _element(15, zlib.compress(bytes(64 << 20), 9)),
}


@pytest.fixture
def small_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "16")


@pytest.mark.usefixtures("small_budget")
@pytest.mark.parametrize("content", MATLAB.values(), ids=MATLAB)
def test_matlab_files_that_declare_what_they_do_not_hold(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mat").write_bytes(_level5(content))
    begun = time.process_time()
    with pytest.raises(FileFormatError):
        fid.read_records(tmp_path / "a.mat")
    assert time.process_time() - begun < SECONDS


@pytest.mark.parametrize("compressed", [False, True])
def test_inflated_matlab_files_hold_what_was_written(compressed: bool) -> None:
    file, given = io.BytesIO(), {"a": np.arange(5.0), "s": {"b": np.eye(3), "c": "text"}}
    scipy.io.savemat(file, given, do_compression=compressed)
    found = scipy.io.loadmat(inflated("a.mat", file.getvalue())[0])
    assert (found["a"] == given["a"]).all()
    assert (found["s"]["b"][0, 0] == np.eye(3)).all()


def test_hdf5_fill_values_take_no_memory(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        for name in ("time", "p", "q"):
            file.create_dataset(name, (1 << 26,), "f8", chunks=(1 << 20,), fillvalue=1.0)
    assert (tmp_path / "a.nc").stat().st_size < 10_000
    with pytest.raises(FileFormatError, match="declares more than is read into memory"):
        fid.read_records(tmp_path / "a.nc")


def test_hdf5_links_that_fan_out_end(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.nc", "w") as file:
        groups = [file.create_group(f"g{index}") for index in range(12)]
        for outer in groups:
            for index, inner in enumerate(groups):
                outer[f"to{index}"] = inner
    begun = time.process_time()
    with pytest.raises(FlightidError):
        fid.read_records(tmp_path / "a.nc")
    assert time.process_time() - begun < SECONDS


def test_parquet_lists_are_no_numbers_and_long_texts_are_kept_once(tmp_path: Path) -> None:
    table = pa.table({"time": [0.0, 1.0], "x": [[1.0] * 1000, [2.0]]})
    pq.write_table(table, tmp_path / "a.parquet")
    with pytest.raises(DataError, match="type list<"):
        fid.read_records(tmp_path / "a.parquet", outputs="x")
    label = "x" * (1 << 16)
    times = [*np.arange(20.0), *np.arange(20.0)]
    table = pa.table({"time": times, "p": times, "record": [label] * 20 + ["b"] * 20})
    pq.write_table(table, tmp_path / "b.parquet")
    found = fid.read_records(tmp_path / "b.parquet", outputs="p")
    assert [record.n_samples for record in found] == [20, 20]


def test_the_budget_is_stated_and_settable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert memory_budget() == 2048 << 20
    monkeypatch.setenv(VARIABLE, "1")
    require_memory("a", 1 << 20)
    with pytest.raises(FileFormatError, match=rf"found 2 MiB; needed at most 1 MiB.*{VARIABLE}"):
        require_memory("a", 2 << 20)
    for text in ("", "-1", "0", "a", "9" * 9):
        monkeypatch.setenv(VARIABLE, text)
        with pytest.raises(OptionError, match="no amount of memory"):
            memory_budget()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_csv_as_the_world_writes_it(tmp_path: Path, encoding: str) -> None:
    text = (
        '# from a logger\n"time";"p; left [deg/s]";day;"Größe (°)";Weg\n'
        "0;0,5;2024-05-01T10:00:00;1;vor\n1;1,5;2024-05-01T10:00:01;2;zurück\n"
        "2;-2,5e0;2024-05-01T10:00:02;3;– €\n"
    )
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    (record, *_) = fid.read_records(
        tmp_path / "a.csv", others=["p; left", "day", "Größe"], units={"day": "s"}
    )
    assert record.unit("Größe") == "deg"
    is_windows = encoding == "cp1252"
    assert record.history[0].options.get("encoding") == ("Windows-1252" if is_windows else None)
    told = " ".join(table_contents(tmp_path / "a.csv").notes)
    assert ("a.csv is no UTF-8: read as Windows-1252." in told) is is_windows
    assert read_columns(tmp_path / "a.csv").raw("Weg").tolist() == ["vor", "zurück", "– €"]
    assert record["p; left"].tolist() == [0.5, 1.5, -2.5]
    assert record.unit("p; left") == "deg/s"
    assert record["day"].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize("columns", [5_000, pytest.param(20_000, marks=pytest.mark.nightly)])
def test_a_heading_without_end_is_refused_and_many_columns_are_read(
    tmp_path: Path, columns: int
) -> None:
    (tmp_path / "a.csv").write_text("a" * (2 << 20) + ",b\n1,2\n")
    with pytest.raises(FileFormatError, match=r"line 1 of a\.csv is longer than a row can be"):
        fid.read_records(tmp_path / "a.csv")
    names = [f"c{index}" for index in range(columns)]
    rows = [",".join(["time", *names]), *(",".join([str(k)] * (columns + 1)) for k in range(2))]
    (tmp_path / "b.csv").write_text("\n".join(rows))
    begun = time.process_time()
    (record,) = fid.read_records(tmp_path / "b.csv", outputs=names[:3])
    assert record.n_samples == 2
    assert time.process_time() - begun < SECONDS


DOCUMENTS = {
    "brackets": "x = " + "[" * 100_000,
    "tables": "x = " + "{a=" * 100_000,
    "dotted": "[" + ".".join("a" * 100) + "]\nb = 1",
    "digits": "x = " + "9" * 5000,
    "hexadecimal": "x = 0x" + "f" * 5000,
    "bytes": "\udcff",
    "long": "#" * (2 << 20),
}


@pytest.mark.parametrize("text", DOCUMENTS.values(), ids=DOCUMENTS)
@pytest.mark.parametrize(
    "read", [fid.load_model, fid.run_study, channel_map], ids=["model", "study", "channels"]
)
def test_toml_of_strangers(tmp_path: Path, text: str, read: Callable[[Path], object]) -> None:
    path = tmp_path / "a.toml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(FlightidError, match=r"no TOML|nested too deep|longer than"):
        read(path)


@pytest.mark.parametrize("text", ["[" * 100_000, "1" * 5000, "{", "\udcff"])
def test_json_of_strangers(text: str) -> None:
    with pytest.raises(FileFormatError, match="no JSON"):
        parse_json(text.encode("utf-8", "surrogateescape"), "a fit", "fit.json")


def test_depth_is_refused_whatever_python_allows() -> None:
    assert sys.getrecursionlimit() > 500
    deep = "[" * 300 + "]" * 300
    with pytest.raises(FileFormatError, match="nested deeper than 64"):
        parse_toml(f"x = {deep}", "a model", "a.toml")


def _grown_log(kind: str) -> bytes:
    """Less than a MiB, of which more than that comes."""
    seeds = Path(__file__).parents[2] / "fuzz" / "seeds"
    if kind == "printed":
        return b"FMT, 200, 67, TXT, Z, Text\n" + 20_000 * b"TXT,a\n"
    if kind == "telemetry":
        link = (seeds / "telemetry" / "link.tlog").read_bytes()
        return link * (900_000 // len(link))
    flight = (seeds / "blackbox" / "flight.bbl").read_bytes().split(b"E\xff")[0]
    frames = flight[flight.index(b"\n", flight.rindex(b"\nH ") + 1) + 1 :]
    return flight + frames * (900_000 // len(frames))


@pytest.mark.parametrize("kind", ["blackbox", "printed", "telemetry"])
def test_logs_that_grow_keep_to_the_budget(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "grown"
    path.write_bytes(_grown_log(kind))
    assert path.stat().st_size < 1 << 20
    monkeypatch.setenv(VARIABLE, "1")
    with pytest.raises(FileFormatError, match="declares more than is read into memory"):
        fid.read_log(path)
    monkeypatch.setenv(VARIABLE, "64")
    assert fid.read_log(path).messages
