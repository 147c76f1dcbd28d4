"""Parquet and netCDF round trips lose nothing, and a changed or damaged file is refused."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flightid.conventions import Role
from flightid.errors import DataError, FileFormatError, OptionError, UnitError
from flightid.record import Channel, Record, Step, read_records, write_records
from flightid.record.formats import netcdf

SUFFIXES = [".parquet", ".nc"]
CELLS = st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False)
TEXT = st.text(max_size=12)
STEPS = st.builds(Step, TEXT, st.dictionaries(TEXT, CELLS | TEXT, max_size=3), TEXT)
UNITS = st.sampled_from(["1", "rad/s", "deg", "ft/s^2", "V", "degC"])


@st.composite
def records(draw: st.DrawFn) -> Record:
    count = draw(st.integers(2, 20))
    names = draw(
        st.lists(
            st.text(min_size=1, max_size=8).filter(lambda x: x != "time_s" and "\x00" not in x),
            max_size=4,
            unique=True,
        )
    )
    values = st.lists(
        st.floats(allow_nan=False, allow_infinity=False), min_size=count, max_size=count
    )
    time_s = draw(st.floats(-1e3, 1e3)) + draw(st.floats(1e-3, 1e2)) * np.arange(count)
    record = Record.from_arrays(
        time_s,
        others={name: draw(values) for name in names},
        trim={name: draw(st.floats(-1e300, 1e300)) for name in names[:2]},
        name=draw(TEXT),
        history=draw(st.lists(STEPS, max_size=2)),
    )
    channels = [Channel(n, draw(UNITS), draw(st.sampled_from(Role)), draw(TEXT)) for n in names]
    return record.replace(channels=channels)


def assert_same(found: Record, expected: Record) -> None:
    assert found.name == expected.name
    assert found.channels == expected.channels
    assert list(found.channels) == list(expected.channels)
    assert found.trim == expected.trim
    assert found.history == expected.history
    assert found.time_s.tobytes() == expected.time_s.tobytes()
    for name in expected.channels:
        assert found[name].tobytes() == expected[name].tobytes()


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(items=st.lists(records(), min_size=1, max_size=3))
@settings(
    max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_round_trip_is_bit_exact(tmp_path: Path, suffix: str, items: list[Record]) -> None:
    path = write_records(items, tmp_path / f"flight{suffix}")
    back = read_records(path)
    assert len(back) == len(items)
    for found, expected in zip(back, items, strict=True):
        assert_same(found, expected)


def _record(**options: object) -> Record:
    time_s = np.arange(50) / 25
    return Record.from_arrays(
        time_s,
        inputs={"tau": np.sin(time_s)},
        outputs={"p": np.cos(time_s)},
        units={"p": "rad/s"},
        **options,
    )


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_stored_channels_can_be_selected_and_given_roles(tmp_path: Path, suffix: str) -> None:
    path = write_records(_record(), tmp_path / f"flight{suffix}")
    (found,) = read_records(path, outputs={"roll_rate": "p"}, units={"roll_rate": "rad/s"})
    assert found.outputs == ("roll_rate",)
    assert found.unit("roll_rate") == "rad/s"
    assert found.history[-1].operation == "read_records"
    with pytest.raises(UnitError, match=r"'p' contradicts the file: found rad/s; needed deg/s"):
        read_records(path, outputs=["p"], units={"p": "deg/s"})


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_long_histories_fit(tmp_path: Path, suffix: str) -> None:
    steps = [Step("conditioning.detrend", {"order": i, "why": "x" * 200}) for i in range(1000)]
    record = _record(history=steps)
    assert_same(read_records(write_records(record, tmp_path / f"a{suffix}"))[0], record)


def test_other_programs_read_the_files(tmp_path: Path) -> None:
    record = _record()
    frame = pd.read_parquet(write_records([record, record], tmp_path / "a.parquet"))
    assert list(frame.columns) == ["time_s", "record", "tau", "p"]
    assert frame["record"].tolist() == [0] * 50 + [1] * 50
    path = write_records(record, tmp_path / "a.nc")
    with xr.open_dataset(path, group="record_0000", engine="h5netcdf", decode_times=False) as data:
        assert data["p"].attrs["units"] == "rad/s"
        assert data["p"].values.tolist() == record["p"].tolist()


def test_history_of_numpy_numbers_is_stored_as_numbers(tmp_path: Path) -> None:
    record = _record(history=[Step("x", {"order": np.int64(3)})])
    (found,) = read_records(write_records(record, tmp_path / "a.nc"))
    assert found.history[0].options == {"order": 3}


def test_what_an_extra_installs_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record = Record.from_arrays([0.0, 0.5], outputs={"p": [0.1, 0.3]})
    path = write_records(record, tmp_path / "a.parquet")
    for name in ("pyarrow.parquet", "xarray"):
        monkeypatch.setitem(sys.modules, name, None)
    for call in (
        lambda: write_records(record, tmp_path / "b.parquet"),
        lambda: read_records(path),
        lambda: record.dataset,
    ):
        with pytest.raises(OptionError, match=r"is not installed.*pip install 'flightid\["):
            call()
    assert [each.name for each in tmp_path.iterdir()] == ["a.parquet"]


def test_refusals_to_write(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no record to write"):
        write_records([], tmp_path / "a.nc")
    with pytest.raises(OptionError, match=r"found \.xlsx; needed \.parquet or \.nc"):
        write_records(_record(), tmp_path / "a.xlsx")
    bad = _record(history=[Step("x", {"order": object()})])
    with pytest.raises(DataError, match="a value that cannot be stored"):
        write_records(bad, tmp_path / "a.nc")
    assert not list(tmp_path.iterdir())


def test_changed_parquet_is_refused(tmp_path: Path) -> None:
    path = write_records(_record(), tmp_path / "a.parquet")
    table = pq.read_table(path)
    pq.write_table(table.slice(1), path)
    with pytest.raises(FileFormatError, match="49 rows where the labels say 50"):
        read_records(path)
    pq.write_table(table.drop_columns(["p"]), path)
    with pytest.raises(FileFormatError, match=r"no column \['p'\]"):
        read_records(path)


def test_records_of_one_file_are_read_in_one_opening(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each opening looks through all objects: sixteen records took sixteen times as long."""
    opened = []
    plain = netcdf.plain_datasets

    def counted(path: Path) -> AbstractContextManager[Mapping[str, h5py.Dataset]]:
        opened.append(path)
        return plain(path)

    monkeypatch.setattr(netcdf, "plain_datasets", counted)
    counts = []
    for n in (2, 7):
        path = write_records([_record()] * n, tmp_path / f"{n}.nc")
        opened.clear()
        assert len(read_records(path)) == n
        counts.append(len(opened))
    assert counts[0] == counts[1]


def test_changed_netcdf_is_refused(tmp_path: Path) -> None:
    path = write_records(_record(), tmp_path / "a.nc")
    with h5py.File(path, "a") as file:
        del file["record_0000/p"]
    with pytest.raises(FileFormatError, match=r"lacks variables .* found no p"):
        read_records(path)
    path = write_records(_record(), tmp_path / "b.nc")
    with h5py.File(path, "a") as file:
        del file["record_0000/p"]
        file["record_0000/p"] = np.zeros(3)
    with pytest.raises(FileFormatError, match="other lengths than 50"):
        read_records(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "text of the labels is no JSON"),
        ("[]", "labels in a.parquet are damaged"),
        ('{"schema": "flightid.records/1", "records": [{}]}', "damaged: found KeyError"),
        ('{"schema": "flightid.records/9"}', "another schema"),
        ("[" * 100_000, "text of the labels is no JSON"),
    ],
)
def test_damaged_labels_are_refused(tmp_path: Path, text: str, message: str) -> None:
    table = pa.table({"time_s": [0.0, 1.0]}).replace_schema_metadata({"flightid": text})
    pq.write_table(table, tmp_path / "a.parquet")
    with pytest.raises(FileFormatError, match=message):
        read_records(tmp_path / "a.parquet")


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_truncation_is_a_typed_error(tmp_path: Path, suffix: str) -> None:
    content = write_records(_record(), tmp_path / f"a{suffix}").read_bytes()
    cut = tmp_path / f"cut{suffix}"
    for length in range(8, len(content), 97):
        cut.write_bytes(content[:length])
        with pytest.raises((FileFormatError, DataError)):
            read_records(cut)
