"""Parameter files: what is written is read back, and nothing that flew is lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid import errors
from flightid.control.autopilots.parameter_files import (
    GainChange,
    read_parameters,
    write_ardupilot_parameters,
    write_px4_parameters,
)

NAMES = st.from_regex(r"[A-Z][A-Z0-9_]{0,15}", fullmatch=True)
VALUES = st.floats(-1e6, 1e6, width=32)
CHANGES = [
    GainChange("ATC_RAT_RLL_P", 0.11, 0.135, "phase margin 45 deg"),
    GainChange("ATC_RAT_RLL_D", 0.0031),
]


@given(values=st.dictionaries(NAMES, VALUES, min_size=1, max_size=20))
@pytest.mark.parametrize("write", [write_ardupilot_parameters, write_px4_parameters])
def test_round_trip_keeps_single_precision(
    write, values: dict[str, float], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("param") / "gains.param"
    found = read_parameters(write(values, path).path)
    assert {k: np.float32(v) for k, v in found.items()} == {
        k: np.float32(v) for k, v in values.items()
    }


@pytest.mark.parametrize("write", [write_ardupilot_parameters, write_px4_parameters])
def test_rollback_holds_the_old_values_that_are_known(write, tmp_path: Path) -> None:
    written = write(CHANGES, tmp_path / "roll.param", notes=["from log 7\nand a model"])
    assert written.rollback == tmp_path / "roll.rollback.param"
    assert read_parameters(written.rollback) == {"ATC_RAT_RLL_P": 0.135}
    assert read_parameters(written.path) == {"ATC_RAT_RLL_P": 0.11, "ATC_RAT_RLL_D": 0.0031}
    text = written.path.read_text()
    assert "was 0.135" in text
    assert "# from log 7 and a model" in text


def test_no_rollback_without_old_values(tmp_path: Path) -> None:
    assert write_ardupilot_parameters({"A": 1.0}, tmp_path / "a.param").rollback is None
    assert [p.name for p in tmp_path.iterdir()] == ["a.param"]


def test_a_file_that_exists_is_kept(tmp_path: Path) -> None:
    write_ardupilot_parameters(CHANGES, tmp_path / "a.param")
    with pytest.raises(errors.OptionError, match="already there"):
        write_ardupilot_parameters({"A": 2.0}, tmp_path / "a.param")
    (tmp_path / "a.param").unlink()
    with pytest.raises(errors.OptionError, match=r"a\.rollback\.param"):
        write_ardupilot_parameters(CHANGES, tmp_path / "a.param")
    write_ardupilot_parameters(CHANGES[1:], tmp_path / "a.param", overwrite=True)


def test_qgroundcontrol_columns_and_types(tmp_path: Path) -> None:
    changes = {"MC_ROLLRATE_P": 0.15, "IMU_GYRO_RATEMAX": 400.0}
    text = write_px4_parameters(changes, tmp_path / "a.params", integers=["IMU_GYRO_RATEMAX"]).path
    rows = [line.split("\t") for line in text.read_text().splitlines() if line[0] != "#"]
    assert rows == [
        ["1", "1", "MC_ROLLRATE_P", "0.15", "9"],
        ["1", "1", "IMU_GYRO_RATEMAX", "400", "6"],
    ]


@pytest.mark.parametrize("name", ["Atc", "", "A" * 17, "A,B", "A\nB"])
def test_refuses_names_that_no_autopilot_has(name: str) -> None:
    with pytest.raises(errors.OptionError, match="not a parameter's name"):
        GainChange(name, 1.0)


def test_refuses_what_is_not_a_number_and_nothing_at_all(tmp_path: Path) -> None:
    with pytest.raises(errors.OptionError, match="finite"):
        GainChange("A", float("nan"))
    with pytest.raises(errors.OptionError, match="no parameter"):
        write_ardupilot_parameters({}, tmp_path / "a.param")


@pytest.mark.parametrize(
    ("text", "match"),
    [("A,B,C", "not a parameter"), ("A,x", "no number"), ("A,nan", "no finite")],
)
def test_names_the_line_that_cannot_be_read(tmp_path: Path, text: str, match: str) -> None:
    (tmp_path / "a.param").write_text(f"GOOD,1\n{text}\n")
    with pytest.raises(errors.FileFormatError, match=f"line 2 of a.param .*{match}"):
        read_parameters(tmp_path / "a.param")


def test_reads_the_forms_of_other_ground_stations(tmp_path: Path) -> None:
    (tmp_path / "a.parm").write_text("A 1\nB\t2 # x\nC=3\n\n# D,4\n1 1 E 5 9\n")
    assert read_parameters(tmp_path / "a.parm") == {"A": 1, "B": 2, "C": 3, "E": 5}


def test_refuses_a_file_that_is_far_too_large(tmp_path: Path) -> None:
    path = tmp_path / "a.param"
    with path.open("wb") as stream:
        stream.truncate(20_000_000)
    with pytest.raises(errors.FileFormatError, match="too large"):
        read_parameters(path)
