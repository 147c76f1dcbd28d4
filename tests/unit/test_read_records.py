"""Foreign files become records only by what is declared; traps are refused."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import xarray as xr

from flightid.errors import DataError, FileFormatError, OptionError, UnitError, UnknownNameError
from flightid.evidence.gather import FitFacts, gather_evidence
from flightid.record import read_records
from flightid.record.contents import table_contents
from flightid.record.formats.csv import read_columns
from flightid.record.time_question import time_question, time_said
from flightid.surface import as_key, speaking
from flightid.units import canonical
from tests.closeness import assert_close


def _csv(folder: Path, text: str, name: str = "roll.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


ROWS = "\n".join(f"{k / 10:.1f},{k},{k * k}" for k in range(10))


def test_csv_with_units_in_the_headings(tmp_path: Path) -> None:
    path = _csv(tmp_path, "# from a rig\ntime [s],tau,p [deg/s]\n" + ROWS)
    (record,) = read_records(path, inputs=["tau"], outputs={"rate": "p"})
    assert record.unit("rate") == "deg/s"
    assert record.channels["rate"].note == "column p"
    assert record["rate"].tolist() == [float(k * k) for k in range(10)]
    assert record.history[0].options["sha256"]


def test_csv_with_a_row_of_units(tmp_path: Path) -> None:
    rows = "\n".join(f"{100 * k};{k};{k}" for k in range(10))
    path = _csv(tmp_path, "time;tau;p\nms;;rad/s\n" + rows)
    (record,) = read_records(path, inputs=["tau"], outputs=["p"])
    assert (record.unit("p"), record.unit("tau")) == ("rad/s", "1")
    assert_close(record.sample_time_s, 0.1, rtol=1e-12, why="100 ms")


def test_brackets_without_a_unit_stay_part_of_the_name(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time,y [first]\n0,1\n1,2\n")
    assert read_records(path, outputs=["y [first]"])[0].outputs == ("y [first]",)


def test_csv_numbers_are_read_to_the_last_bit(tmp_path: Path) -> None:
    values = np.random.default_rng(0).standard_normal(300) * 10.0 ** np.arange(-150, 150)
    text = "time,y\n" + "\n".join(f"{k},{value!r}" for k, value in enumerate(values.tolist()))
    (record,) = read_records(_csv(tmp_path, text), outputs=["y"])
    assert record["y"].tobytes() == values.tobytes()


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_csv_of_every_line_end_in_many_blocks(tmp_path: Path, end: str) -> None:
    numbers = np.random.default_rng(1).standard_normal(70_000)
    rows = [f"{0.01 * k:.2f},{value!r},r{k // 35_000}" for k, value in enumerate(numbers.tolist())]
    text = end.join(["# note", "time,p,record", *rows])
    (tmp_path / "a.csv").write_bytes(text.encode())
    first, second = read_records(tmp_path / "a.csv", outputs=["p"])
    assert (first.name, second.name) == ("r0", "r1")
    np.testing.assert_array_equal(np.concatenate([first["p"], second["p"]]), numbers)


def test_without_roles_every_numeric_column_is_other(tmp_path: Path) -> None:
    (record,) = read_records(_csv(tmp_path, "time,a,b\n" + ROWS))
    assert list(record.channels) == ["a", "b"]
    assert {str(c.role) for c in record.channels.values()} == {"other"}


def test_a_gap_in_time_or_a_record_column_makes_several_records(tmp_path: Path) -> None:
    stamps = np.concatenate([np.arange(20), np.arange(40, 70)]) / 10
    text = "time,p\n" + "\n".join(f"{t:.1f},{t}" for t in stamps)
    found = read_records(_csv(tmp_path, text), outputs=["p"])
    assert [(r.name, r.n_samples) for r in found] == [("roll[0]", 20), ("roll[1]", 30)]
    text = "time,p,record\n" + "\n".join(f"{k % 10},{k},{'ab'[k // 10]}" for k in range(20))
    found = read_records(_csv(tmp_path, text), outputs=["p"])
    assert [(r.name, r.n_samples) for r in found] == [("a", 10), ("b", 10)]
    found = read_records(_csv(tmp_path, text), outputs=["p"], record_column=None)
    assert [(r.name, r.n_samples) for r in found] == [("roll[0]", 10), ("roll[1]", 10)]
    numbers = text.replace("a\n", "1\n").replace("b", "2").replace("record", "exp")
    found = read_records(_csv(tmp_path, numbers), outputs=["p"], record_column="exp")
    assert [r.name for r in found] == ["1", "2"]
    backward = text.replace("\n3,3", "\n1.5,3")
    with pytest.raises(DataError, match="not uniform"):
        read_records(_csv(tmp_path, backward), outputs=["p"], record_column=None)


def test_jittered_stamps_need_a_stated_grid(tmp_path: Path) -> None:
    stamps = np.arange(200) / 50 + np.random.default_rng(1).uniform(-2e-3, 2e-3, 200)
    text = "time,p\n" + "\n".join(f"{t!r},{float(np.sin(t))!r}" for t in stamps.tolist())
    path = _csv(tmp_path, text)
    with pytest.raises(DataError, match=r"not uniform.*to_uniform"):
        read_records(path, outputs=["p"])
    (record,) = read_records(path, outputs=["p"], resample_to_s=0.02)
    assert_close(record["p"][5:-5], np.sin(record.time_s)[5:-5], atol=1e-5, why="spline")
    assert record.history[-1].operation == "conditioning.to_uniform"


@pytest.mark.parametrize(
    ("scale", "said"),
    [
        (1.0, "read, resample_to_s=0.02, or by"),
        (1e3, "resample_to_s=0.02 time_unit='ms' where stamps are in ms (20 s"),
        (1e6, "resample_to_s=0.02 time_unit='us' where stamps are in us (20000 s"),
    ],
)
def test_jittered_milliseconds_are_asked_about(tmp_path: Path, scale: float, said: str) -> None:
    """Stamps 20 ms apart with jitter were to be resampled to a base of 20 s."""
    stamps = np.arange(200) / 50 + np.random.default_rng(1).uniform(-2e-3, 2e-3, 200)
    rows = "\n".join(f"{scale * t!r},{k % 7}" for k, t in enumerate(stamps.tolist()))
    path = _csv(tmp_path, f"time,p\n{rows}")
    with pytest.raises(DataError) as refused:
        read_records(path, outputs=["p"])
    assert said in str(refused.value)
    if scale > 1.0:
        unit = "ms" if scale < 1e6 else "us"
        (record,) = read_records(path, outputs=["p"], resample_to_s=0.02, time_unit=unit)
        assert record.sample_time_s == 0.02


def _staircase(folder: Path) -> Path:
    """A PRBS of steps each half second with its ramp, logged at stamps that jitter, in ms."""
    random = np.random.default_rng(3)
    stamps = np.arange(200) * 100.0
    stamps[1:] += random.integers(-4, 5, 199)
    steps = np.repeat(random.choice([-1.0, 1.0], 40), 5)
    rows = [f"{t:.0f};{u};{t / 1000}" for t, u in zip(stamps, steps, strict=True)]
    return _csv(folder, "t;u;y\n" + "\n".join(rows).replace(".", ","))


def test_held_inputs_with_jittered_stamps_stay_steps_at_their_own_rate(tmp_path: Path) -> None:
    path = _staircase(tmp_path)
    asked = {"inputs": ["u"], "outputs": ["y"], "time_column": "t", "units": {"t": "ms"}}
    (held,) = read_records(path, **asked, resample_to_s=0.1, hold="zero")
    assert (held.hold, set(held["u"])) == ("zero", {-1.0, 1.0})
    assert set(np.flatnonzero(np.diff(held["u"])) % 5) <= {3, 4}
    assert_close(held["y"], held.time_s, atol=1e-6, why="a line comes through")
    (seen,) = read_records(path, **asked, resample_to_s=0.1)
    assert set(seen["u"]) == {-1.0, 1.0}, "two levels are steps"
    words = {"hold": "zero", "interpolation": {"u": "band-limited"}}
    (smooth,) = read_records(path, **asked, resample_to_s=0.1, **words)
    assert "low-pass" not in str(smooth.history)
    assert len(set(smooth["u"])) > 50
    (coarse,) = read_records(path, **asked, resample_to_s=0.2, hold="zero")
    assert coarse.hold == "band_limited"
    assert "low-pass" in str(coarse.history)
    (kept,) = read_records(
        path, **asked, resample_to_s=0.2, hold="zero", interpolation={"u": "previous"}
    )
    assert (kept.hold, set(kept["u"])) == ("zero", {-1.0, 1.0})


def test_outliers_go_before_the_base_is_made(tmp_path: Path) -> None:
    text = _staircase(tmp_path).read_text().splitlines()
    text[51] = ";".join([*text[51].split(";")[:2], "900"])
    path = _csv(tmp_path, "\n".join(text))
    asked = {"outputs": ["y"], "time_column": "t", "units": {"t": "ms"}, "resample_to_s": 0.1}
    (spoiled,) = read_records(path, **asked)
    (clean,) = read_records(path, **asked, outliers={"half_width": 4})
    assert_close(clean["y"], clean.time_s, atol=0.02, why="a line bridges the outlier")
    assert np.max(np.abs(spoiled["y"] - spoiled.time_s)) > 800.0
    assert clean.history[1].options["y"] == 1


def test_milliseconds_are_asked_about_and_never_taken_for_seconds(tmp_path: Path) -> None:
    path = _staircase(tmp_path)
    asked = {"inputs": ["u"], "outputs": ["y"], "time_column": "t"}
    with pytest.raises(OptionError, match=r"rows are 100 s apart \(0\.01 Hz\).*t = 'ms'"):
        read_records(path, **asked, resample_to_s=0.1)
    with pytest.raises(UnitError, match="is none of time: found V"):
        read_records(path, **asked, units={"t": "V"})
    (doubtful,) = read_records(path, **asked, resample_to_s=100.0)
    question = time_question(doubtful)
    assert question is not None
    assert "is it ms?" in question.message
    for unit, step_s in (("s", 100.0), ("ms", 0.1)):
        (sure,) = read_records(path, **asked, units={"t": unit}, resample_to_s=step_s)
        assert time_question(sure) is None
    assert "declare time_unit='ms', or 's'" in time_said(doubtful)
    with speaking(as_key):
        assert 'declare time_unit = "ms", or' in time_said(doubtful)
    assert any(f"is it ms? — {question.action}." in said for said in table_contents(path).notes)
    for step, unit, rows, asked_about in ((0.5, "2 kHz", 1300, True), (0.5, "2 Hz", 200, False)):
        lines = [f"{step * k},{k % 7}" for k in range(rows)]
        (read,) = read_records(_csv(tmp_path, "\n".join(["t,y", *lines])), outputs=["y"])
        assert (time_question(read) is not None) is asked_about, unit
    checks = gather_evidence(
        FitFacts([doubtful], ("u",), ("y",), (), (), "", {}, loop="open")
    ).checks
    assert [check.light.value for check in checks if check.name == "time base"] == ["amber"]


@pytest.mark.parametrize(
    ("text", "options", "error", "message"),
    [
        ("x,p\n0,1\n1,2\n", {}, OptionError, "no time column 'time': found columns x, p"),
        ("time,p\n0,1\n1,2\n", {"sample_time_s": 1.0}, OptionError, "stated twice"),
        ("t,p\n0,1\n1,2\n", {"sample_time_s": -1.0}, OptionError, "not positive"),
        ("time,p\n0,1\n1,2\n", {"outputs": ["q"]}, UnknownNameError, "found q; needed one of time"),
        (
            "time,p\n0,1\n1,2\n",
            {"inputs": ["p"], "outputs": ["p"]},
            OptionError,
            "named twice: found p",
        ),
        (
            "time,p\n0,1\n1,2\n",
            {"outputs": ["p"], "units": {"q": "rad"}},
            UnknownNameError,
            "declared for no channel: found q",
        ),
        ("time,p\n0,a\n1,b\n", {"outputs": ["p"]}, DataError, "does not hold real numbers"),
        ("time,p\n0,1\n1,\n2,3\n", {"outputs": ["p"]}, DataError, "not finite: found 1 of 3"),
        ("time,p\n0,1\n1\n", {}, FileFormatError, "line 3 has 1 cells where the heading has 2"),
        ("time,p\n0,1\n1,2,3\n", {}, FileFormatError, "line 3 has more cells"),
        ('time,p\n0,1\n1,"2\n', {}, FileFormatError, "line 3 has a quote without its end"),
        ("time,p\n0,a\n1,1\n", {"outputs": ["p"]}, DataError, "does not hold real numbers"),
        ("time,p\n0,1\n1,a\n", {"outputs": ["p"]}, DataError, "does not hold real numbers"),
        ("time,p\n", {}, FileFormatError, "holds headings only"),
        ("# nothing\n", {}, FileFormatError, "holds no row"),
        ("0,1\n1,2\n", {}, FileFormatError, "no heading row"),
        ("time,p;q\n0,1;2\n", {}, FileFormatError, "several delimiters: found ',' and ';'"),
        ("time,p,p\n0,1,2\n", {}, FileFormatError, "two columns of one name: found p"),
    ],
)
def test_csv_refusals(
    tmp_path: Path, text: str, options: dict, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=re.escape(message)):
        read_records(_csv(tmp_path, text), **options)


def test_files_of_no_known_format_are_refused(tmp_path: Path) -> None:
    for content in (b"\x00\x01\x02", b"\xa3\x95\x80\x80"):
        (tmp_path / "a.bin").write_bytes(content)
        with pytest.raises(FileFormatError, match="of no format that holds records"):
            read_records(tmp_path / "a.bin")
    (tmp_path / "a.bin").write_bytes(b"")
    with pytest.raises(FileFormatError, match=r"a\.bin is an empty file"):
        read_records(tmp_path / "a.bin")
    # A byte that neither UTF-8 nor Windows-1252 knows.
    (tmp_path / "a.csv").write_bytes(b"time,p\x81\n0,1\n")
    with pytest.raises(FileFormatError, match=r"a\.csv is not text"):
        read_records(tmp_path / "a.csv")


def test_parquet_of_another_writer(tmp_path: Path) -> None:
    stamps = pd.date_range("2026-01-01", periods=100, freq="10ms")
    frame = pd.DataFrame({"time": stamps, "p [rad/s]": np.arange(100.0)})
    frame.to_parquet(tmp_path / "a.parquet")
    (record,) = read_records(tmp_path / "a.parquet", outputs=["p"])
    assert record.unit("p") == "rad/s"
    assert_close(record.sample_time_s, 0.01, rtol=1e-12, why="10 ms")
    schema = pa.schema(
        [("time", pa.float64()), pa.field("p", pa.float32(), metadata={"unit": "V"})]
    )
    pq.write_table(pa.table([[0.0, 1.0], [1.0, 2.0]], schema=schema), tmp_path / "b.parquet")
    assert read_records(tmp_path / "b.parquet", outputs=["p"])[0].unit("p") == "V"


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab_arrays_and_structures(tmp_path: Path, compressed: bool) -> None:
    time = np.arange(30) / 10
    content = {
        "time": time,
        "y": np.column_stack([time, time**2]),
        "data": {"u": np.sin(time), "label": "text"},
        "cells": np.array([1, "a"], dtype=object),
    }
    scipy.io.savemat(tmp_path / "a.mat", content, do_compression=compressed)
    (record,) = read_records(
        tmp_path / "a.mat", inputs={"u": "data.u"}, outputs=["y_1", "y_2"], units={"u": "V"}
    )
    assert record["y_2"].tolist() == (time**2).tolist()
    assert record["u"].tolist() == np.sin(time).tolist()
    assert record.unit("u") == "V"


def test_matlab_7_3(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        for name, values in (("time", np.arange(5.0)), ("data/p", np.arange(5.0) ** 2)):
            item = file.create_dataset(name, data=values[None, :])
            item.attrs["MATLAB_class"] = np.bytes_("double")
        text = file.create_dataset("label", data=np.zeros((1, 5), np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
    (record,) = read_records(tmp_path / "a.mat")
    assert list(record.channels) == ["data.p"]
    assert record["data.p"].tolist() == [0, 1, 4, 9, 16]


def test_matlab_refusals(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "a.mat", {"label": "text"})
    with pytest.raises(FileFormatError, match="holds no numeric array"):
        read_records(tmp_path / "a.mat")
    scipy.io.savemat(tmp_path / "b.mat", {"time": np.arange(100.0)})
    content = (tmp_path / "b.mat").read_bytes()
    for length in range(140, len(content), 50):
        (tmp_path / "b.mat").write_bytes(content[:length])
        with pytest.raises(FileFormatError, match=r"not a whole MATLAB file|no numeric array"):
            read_records(tmp_path / "b.mat")


def test_columns_of_another_length_are_refused(tmp_path: Path) -> None:
    scipy.io.savemat(tmp_path / "a.mat", {"time": np.arange(5.0), "p": np.arange(4.0)})
    with pytest.raises(DataError, match="not as long as the time: found 4 samples; needed 5"):
        read_records(tmp_path / "a.mat", outputs=["p"])
    scipy.io.savemat(tmp_path / "b.mat", {"time": np.arange(5.0), "record": np.arange(4.0)})
    with pytest.raises(FileFormatError, match="'record' is not as long"):
        read_records(tmp_path / "b.mat")


@pytest.mark.parametrize("format", ["NETCDF3_CLASSIC", "NETCDF4"])
def test_netcdf_of_another_writer(tmp_path: Path, format: str) -> None:
    data = xr.Dataset(
        {
            "p": ("time", np.arange(9.0), {"units": "deg/s"}),
            "w": ("time", np.ones(9), {"units": "?"}),
        },
        coords={"time": ("time", np.arange(9.0), {"units": "seconds since 2026-01-01"})},
    )
    engine = "scipy" if format == "NETCDF3_CLASSIC" else "h5netcdf"
    data.to_netcdf(tmp_path / "a.nc", format=format, engine=engine)
    (record,) = read_records(tmp_path / "a.nc", outputs=["p"])
    assert record.unit("p") == "deg/s"
    with pytest.raises(UnitError, match=r"unit of column 'w' is not known: found '\?'"):
        read_records(tmp_path / "a.nc", outputs=["w"])
    assert read_records(tmp_path / "a.nc", outputs=["w"], units={"w": "1"})[0].unit("w") == "1"


def test_hdf5_that_points_elsewhere_is_refused(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(b"12345678" * 4)
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file.create_dataset("time", (1, 4), "f8", external=[(str(secret), 0, 32)])
    with pytest.raises(FileFormatError, match="keeps samples in other files"):
        read_records(tmp_path / "a.mat")
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file.create_dataset("time", (4,), "f8", external=[(str(secret), 0, 32)])
    with pytest.raises(FileFormatError, match="keeps samples in other files"):
        read_records(tmp_path / "a.nc")
    with h5py.File(tmp_path / "b.mat", "w", userblock_size=512) as file:
        file["time"] = h5py.ExternalLink(str(tmp_path / "a.nc"), "time")
    with pytest.raises(FileFormatError, match="holds no numeric array"):
        read_records(tmp_path / "b.mat")


def test_absurd_sizes_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file.create_dataset("time", (1, 1 << 40), "f8", chunks=(1, 1 << 20))
    with pytest.raises(FileFormatError, match="declares more than is read into memory"):
        read_records(tmp_path / "a.mat")


def test_absurd_nesting_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        group = file
        for _ in range(20):
            group = group.create_group("inner")
    with pytest.raises(FileFormatError, match="too many or too deeply nested"):
        read_records(tmp_path / "a.mat")


def test_damaged_hdf5_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.nc").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(200))
    with pytest.raises(FileFormatError, match="not a whole HDF5 file"):
        read_records(tmp_path / "a.nc")
    (tmp_path / "b.nc").write_bytes(b"CDF\x01" + b"\xff" * 60)
    with pytest.raises(FileFormatError, match="not a whole netCDF file"):
        read_records(tmp_path / "b.nc")
    (tmp_path / "a.parquet").write_bytes(b"PAR1" + bytes(60) + b"PAR1")
    with pytest.raises(FileFormatError, match="not a whole Parquet file"):
        read_records(tmp_path / "a.parquet")


def test_shared_records_are_readable(shared_data: Path) -> None:
    folder = shared_data / "records"
    (arm,) = read_records(folder / "robot_arm.csv", ["u"], ["y"], sample_time_s=1.0)
    assert (arm.n_samples, arm.sample_time_s) == (1024, 1.0)
    (player,) = read_records(
        folder / "CD_player_arm.csv", ["u1", "u2"], ["y1", "y2"], sample_time_s=1.0
    )
    assert player.n_samples == 2048
    (heli,) = read_records(
        folder / "trex550_hover_forward.csv",
        ["d_lat", "d_lon", "d_ped", "d_col"],
        {"p": "p_radps", "q": "q_radps", "r": "r_radps"},
        time_column="t_s",
        units={"p": "rad/s", "q": "rad/s", "r": "rad/s"},
    )
    assert_close(heli.sample_rate_hz, 100.0, rtol=1e-9, why="100 Hz")
    assert len(heli.inputs) == 4


def test_a_declared_unit_goes_over_a_heading_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "roll.csv"
    path.write_text("time,p [deg],n [m/s2]\n0,1,1\n1,2,2\n2,1,3\n", "utf-8")
    (record,) = read_records(path, outputs=["p", "n"], units={"p": "rad", "n": "m/s^2"})
    assert record.unit("p") == "rad"
    assert record.channels["p"].note == "unit declared as rad; the file says deg"
    assert record.channels["p"].is_declared
    assert not record.channels["n"].is_declared


def test_g_is_what_the_model_makes_of_it(tmp_path: Path) -> None:
    path = tmp_path / "loads.csv"
    path.write_text("time,nz [g],ny [g0],m [g]\n0,1,0.1,1\n1,1.1,0.2,2\n2,0.9,0.1,3\n", "utf-8")
    (record,) = read_records(path, outputs=["nz", "ny", "m"])
    made = record.to_units(nz="m/s^2", ny="ft/s2", m="kg")
    assert made["nz"][0] == pytest.approx(9.80665)
    assert made["ny"][0] == pytest.approx(0.1 * 9.80665 / 0.3048)
    assert made["m"][0] == pytest.approx(1e-3)
    assert record.to_units(nz="1")["nz"].tolist() == [1.0, 1.1, 0.9]
    with pytest.raises(UnitError, match="channel nz of record 'loads' cannot be converted"):
        record.to_units(nz="rad")


@pytest.mark.parametrize(
    ("spelling", "unit"),
    [
        ("ft/s2", "ft/s^2"),
        ("deg/s/s", "deg/s^2"),
        ("deg/s2", "deg/s^2"),
        ("kts", "kt"),
        ("KTAS", "kt"),
        ("fps", "ft/s"),
        ("slug*ft2", "slug*ft^2"),
        ("psf", "lbf/ft^2"),
        ("nd", "1"),
    ],
)
def test_spellings_of_test_reports_are_read(spelling: str, unit: str) -> None:
    assert canonical(spelling) == canonical(unit)


def test_a_quoted_heading_may_hold_a_line_end(tmp_path: Path) -> None:
    """RFC 4180, section 2.6: it was refused as "2 cells where the heading has 4"."""
    path = tmp_path / "names.csv"
    path.write_text('time,"a ""b""\nc",y\n0,1,2\n0.1,3,4\n', encoding="utf-8")
    columns = read_columns(path)
    assert list(columns.lengths) == ["time", 'a "b" c', "y"]
    assert list(columns.load("y")) == [2.0, 4.0]
    path.write_text('time,"a\n0,1\n0.1,3\n', encoding="utf-8")
    with pytest.raises(FileFormatError, match="opens a quote that does not end"):
        read_columns(path)
