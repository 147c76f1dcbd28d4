"""Tables without headings, objects, derived channels and gaps on a grid that was asked for."""

from __future__ import annotations

import struct
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from flightid import Record, read_records, run_study, write_records
from flightid.cli.program import run
from flightid.errors import DataError, FileFormatError, OptionError, UnknownNameError
from flightid.record.contents import table_contents
from flightid.study.proposal import propose_study

TIME_S = np.arange(600) * 0.1
U = np.where(np.sin(0.4 * TIME_S + 0.02 * TIME_S**2) > 0, 1.0, -1.0)


def _y() -> np.ndarray:
    y = np.zeros(TIME_S.size)
    for k in range(1, y.size):
        y[k] = 0.8 * y[k - 1] + 0.2 * U[k - 1]
    return y + 0.01 * np.random.default_rng(4).standard_normal(y.size)


def _bare(folder: Path, keep: np.ndarray | None = None) -> Path:
    rows = np.column_stack([TIME_S, U, _y()])
    path = folder / "bare.csv"
    np.savetxt(path, rows if keep is None else rows[keep], "%.8g", ",")
    return path


@pytest.mark.parametrize("suffix", ["csv", "mat", "parquet"])
def test_a_unit_at_the_end_of_a_name_is_read_said_and_gives_way(
    tmp_path: Path, suffix: str
) -> None:
    """Letters that may stand for something else say nothing; a heading and a word go first."""
    names = ["time", "u_mps", "q_deg_s", "T_m", "az_m_per_s2", "r_dps [rad/s]"]
    rows = np.arange(24.0).reshape(4, 6)
    rows[:, 1:] **= 2
    path = tmp_path / f"a.{suffix}"
    if suffix == "csv":
        np.savetxt(path, rows, "%.8g", ",", header=",".join(names), comments="")
    elif suffix == "mat":
        names[-1] = "r_radps"
        scipy.io.savemat(path, dict(zip(names, rows.T, strict=True)))
    else:
        pq.write_table(pa.table(dict(zip(names, rows.T, strict=True))), path)
    (record,) = read_records(path)
    units = {name: channel.unit for name, channel in record.channels.items()}
    last = next(name for name in units if name.startswith("r_"))
    assert units == {
        "u_mps": "m/s", "q_deg_s": "deg/s", "T_m": "1", "az_m_per_s2": "m/s^2", last: "rad/s",
    }  # fmt: skip
    assert record.channels["u_mps"].note == "read as m/s from the heading u_mps"
    assert record["u_mps"].tolist() == rows[:, 1].tolist()
    said = " ".join(table_contents(path).notes)
    assert "Read from the headings: u_mps as m/s, q_deg_s as deg/s, az_m_per_s2 as m/s^2" in said
    (told,) = read_records(path, others={"u": "u_mps"}, units={"u": "ft/s"})
    assert told.unit("u") == "ft/s"
    assert told.channels["u"].is_declared
    assert "its name says m/s" in told.channels["u"].note


@pytest.mark.parametrize("suffix", ["csv", "mat", "parquet"])
def test_columns_get_names_in_their_order(tmp_path: Path, suffix: str) -> None:
    rows = np.array([[0.0, 1.0, 4.0], [0.1, 2.0, 5.0], [0.2, 3.0, 6.0]])
    path = tmp_path / f"bare.{suffix}"
    if suffix == "mat":
        scipy.io.savemat(path, {"y": rows})
    elif suffix == "parquet":
        pq.write_table(pa.table({str(k): rows[:, k] for k in range(3)}), path)
    else:
        np.savetxt(path, rows, "%.8g", ",")
    (record,) = read_records(path, "u", "y", column_names=["time,u [deg/s]", "y"])
    assert record["u"].tolist() == [1.0, 2.0, 3.0]
    assert record["y"].tolist() == [4.0, 5.0, 6.0]
    assert record.unit("u") == "deg/s"
    with pytest.raises(OptionError, match="2 names for 3 columns"):
        read_records(path, column_names=["time", "u"])


def test_names_replace_headings_and_keep_the_first_samples(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,a [V],a\n0,1,2\n1,3,4\n")
    (record,) = read_records(path, column_names=["time,u,y"])
    assert record["u"].tolist() == [1.0, 3.0]
    path.write_text("1;1,5;NA\n2;2,5;3\n")
    (record,) = read_records(path, "u", column_names=["time,u,y"])
    assert record["u"].tolist() == [1.5, 2.5]


@pytest.mark.parametrize("row", ["0;1,5;2", "2024-05-01T10:00:00,1,2", "0,NA,"])
def test_a_file_without_headings_says_so_and_offers_names(tmp_path: Path, row: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"{row}\n{row}\n")
    with pytest.raises(FileFormatError, match=r"no heading row.*--columns time,u,y"):
        read_records(path)


def test_derived_channels_have_the_values_and_units_of_their_formulas(tmp_path: Path) -> None:
    path = tmp_path / "motors.csv"
    path.write_text("ms,m1 [rpm],m2 [rpm],p\n0,5,1,2\n100,7,2,4\n200,9,3,6\n")
    (record,) = read_records(
        path, ["roll", "half"], "rate", time_column="t", units={"p": "deg/s", "t": "s"},
        derive={"roll": "m1 - m2", "half": "roll/2", "rate": "where(p > 0, p, -p)", "t": "ms/1000"},
    )  # fmt: skip
    assert record["half"].tolist() == [2.0, 2.5, 3.0]
    assert record["rate"].tolist() == [2.0, 4.0, 6.0]
    assert [record.unit(name) for name in ("roll", "half", "rate")] == ["rpm", "rpm", "deg/s"]
    assert record.history[0].options["derived roll"] == "m1 - m2"


@pytest.mark.parametrize(
    ("formula", "error", "said"),
    [
        ("__import__('os')", OptionError, "is no formula"),
        ("m1 - p", OptionError, "subtracts 'rpm' and 'deg/s'"),
        ("m1 + m9", UnknownNameError, "no column of this name: found m9"),
        ("2", OptionError, "has no length"),
    ],
)
def test_a_formula_that_cannot_be_is_refused(
    tmp_path: Path, formula: str, error: type[Exception], said: str
) -> None:
    path = tmp_path / "motors.csv"
    path.write_text("time,m1 [rpm],p [deg/s]\n0,5,1\n1,7,2\n")
    with pytest.raises(error, match=said):
        read_records(path, derive={"d": formula})
    with pytest.raises(OptionError, match="name of its own"):
        read_records(path, derive={"m1": "2*m1"})


def test_a_record_that_flightid_wrote_takes_no_columns(tmp_path: Path) -> None:
    path = write_records(Record.from_arrays([0.0, 1.0], outputs={"p": [1, 2]}), tmp_path / "a.nc")
    with pytest.raises(OptionError, match="derive"):
        read_records(path, derive={"d": "2*p"})


def test_a_gap_is_bridged_up_to_a_length_and_parts_records_beyond(tmp_path: Path) -> None:
    keep = np.ones(600, dtype=bool)
    keep[100:103] = keep[300:350] = False
    path = _bare(tmp_path, keep)
    asked = {"column_names": ["time,u,y"], "resample_to_s": 0.1}
    assert [item.name for item in read_records(path, **asked)] == ["bare[0]", "bare[1]", "bare[2]"]
    first, second = read_records(path, max_gap_s=1.0, **asked)
    assert (first.n_samples, second.n_samples) == (300, 250)
    straight = np.linspace(_y()[99], _y()[103], 5)
    np.testing.assert_allclose(first["y"][99:104], straight, rtol=0, atol=2e-3)


def test_manoeuvres_of_one_file_become_a_study_that_runs(tmp_path: Path) -> None:
    keep = np.ones(600, dtype=bool)
    keep[400:450] = False
    bare = _bare(tmp_path, keep)
    made = propose_study(
        [bare], folder=tmp_path, column_names=["time,u,y"], resample_to_s=0.1,
        derive={"v": "2*u"}, inputs=["v"], outputs=["y"], model="rate_first_order",
    )  # fmt: skip
    assert [line for line in made.lines if line.startswith("manoeuvre")] == [
        'manoeuvre = "bare[0]"',
        'manoeuvre = "bare[1]"',
    ]
    assert 'derive = { v = "2*u" }' in made.lines


def test_the_command_line_names_and_derives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = ["--columns", "time,u,y", "--derive", "v=2*u", "--time-unit", "ms"]
    told[1] = "time,u (%),y (deg/s)"
    code = run(["response", str(_bare(tmp_path)), "--input", "v", "--outputs", "y (deg/s)", *told])
    shown = capsys.readouterr()
    assert code == 0, shown.err
    assert "y       v      (deg/s)/%" in shown.out


def test_a_study_names_derives_and_globs(tmp_path: Path) -> None:
    (tmp_path / "flights").mkdir()
    for name in ("b", "a"):
        _bare(tmp_path).rename(tmp_path / "flights" / f"{name}.csv")
    study = tmp_path / "study.toml"
    study.write_text(
        '[study]\ntitle = "glob"\n[[record]]\nname = "all"\npath = "flights/[ab].csv"\n'
        'column_names = "time,u,y"\nderive = { v = "2*u" }\n[[model]]\nname = "m"\n'
        'structure = "arx"\ninputs = ["v"]\noutputs = "y"\nidentify = "all"\nna = [1]\nnb = [1]\n'
        "nk = [1]\n"
    )
    run_study(study, output=tmp_path / "out")
    report = (tmp_path / "out" / "report.txt").read_text()
    assert report.index("all: a") < report.index("all: b")


def test_of_many_files_the_one_at_fault_is_named(tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.csv" for name in "abc"]
    for path in paths:
        path.write_text("time,u,y\n0,1,2\n1,2,3\n2,3,4\n3,4,5\n")
    paths[1].write_text("time,u,y\n0,1,2\n1,2,3\n1.5,3,4\n3,4,5\n")
    with pytest.raises(DataError, match=r"^b\.csv: time stamps are not uniform: found.*Next: "):
        propose_study(paths, folder=tmp_path)


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def _timetable(path: Path) -> Path:
    """A level 5 file as MATLAB writes it: an array, a timetable, and what that refers to."""
    scipy.io.savemat(path, {"x": np.arange(3.0)})
    opaque = _element(6, struct.pack("<II", 17, 0)) + _element(1, b"data") + _element(1, b"MCOS")
    held = _element(6, struct.pack("<II", 13, 0)) + _element(5, struct.pack("<ii", 1, 1))
    held += _element(1, b"") + _element(6, struct.pack("<I", 0xDD000000))
    opaque += _element(1, b"timetable") + _element(14, held)
    rest = _element(6, struct.pack("<II", 9, 0)) + _element(5, struct.pack("<ii", 1, 8))
    rest += _element(1, b"") + _element(2, bytes(8))
    path.write_bytes(path.read_bytes() + _element(14, opaque) + _element(14, rest))
    return path


@pytest.mark.parametrize("level", ["5", "7.3"])
def test_a_timetable_is_named_with_the_way_out_of_it(tmp_path: Path, level: str) -> None:
    path = tmp_path / "rig.mat"
    if level == "5":
        _timetable(path)
    else:
        with h5py.File(path, "w", userblock_size=512) as file:
            file["x"] = np.arange(3.0)
            file["data"] = np.zeros((1, 6), dtype=np.uint32)
            file["data"].attrs["MATLAB_class"] = np.bytes_("timetable")
            file["data"].attrs["MATLAB_object_decode"] = np.int32(3)
    with pytest.raises(OptionError, match=r"columns x;.*data is a MATLAB timetable.*writetable"):
        read_records(path)
    (record,) = read_records(path, sample_time_s=0.1)
    assert list(record.channels) == ["x"]


def test_a_formula_that_divides_by_zero_is_named_with_its_row(tmp_path: Path) -> None:
    path = tmp_path / "zero.csv"
    path.write_text("time,u,y\n0,2,1\n1,0,3\n2,4,5\n")
    with pytest.raises(DataError, match=r"derived channel 'w' is not finite: 'y / u'") as caught:
        read_records(path, outputs="w", derive={"w": "y / u"})
    assert "found y = 3, u = 0 in row 2 of 3" in str(caught.value)
    (guarded,) = read_records(path, outputs="w", derive={"w": "where(u > 0, y / u, 0)"})
    assert guarded["w"].tolist() == [0.5, 0.0, 1.25]
