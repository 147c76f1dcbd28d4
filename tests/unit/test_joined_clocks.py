"""Two files with clocks of their own: offset, drift, interval, and one grid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.errors import DataError, OptionError
from flightid.record.checks import record_findings
from flightid.record.clocks import clock_offset
from flightid.study.proposal import propose_study
from tests.closeness import assert_close

OFFSET_S, DRIFT = 5.4321, 2e-4
RANDOM = np.random.default_rng(7)
TONES = RANDOM.uniform(0.3, 9.0, 12), RANDOM.uniform(0.0, 6.0, 12)


def motion(time_s: np.ndarray) -> np.ndarray:
    """A signal that does not repeat."""
    rates, phases = TONES
    return np.sin(np.outer(time_s, rates) + phases).sum(axis=1)


def signals(*, noise: float, drift: float) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    random = np.random.default_rng(3)
    here, there = np.arange(0, 60, 0.01), np.arange(0, 48, 1 / 73)
    first = motion(here) + noise * random.standard_normal(here.size)
    second = motion(OFFSET_S + (1 + drift) * there) + noise * random.standard_normal(there.size)
    return (here, first), (there, second)


def test_offset_is_found_between_samples_with_an_interval_that_holds_it() -> None:
    found = clock_offset(*signals(noise=0.2, drift=0.0), "p")
    assert found.half_width_s is not None
    assert abs(found.offset_s - OFFSET_S) < found.half_width_s < 2e-3
    assert abs(found.drift) * 48 < 2e-3
    assert found.finding is None
    exact = clock_offset(*signals(noise=0.0, drift=0.0), "p")
    assert_close(exact.offset_s, OFFSET_S, atol=5e-5, why="a parabola through quarters of samples")


def test_drift_is_found_where_it_shows() -> None:
    found = clock_offset(*signals(noise=0.05, drift=DRIFT), "p")
    assert_close(found.drift, DRIFT, rtol=0.1, why="noise of 5 %")
    for there in (0.0, 48.0):
        error = found.offset_s + (1 + found.drift) * there - OFFSET_S - (1 + DRIFT) * there
        assert abs(error) < (found.half_width_s or 0.0)
    with pytest.raises(DataError, match=r"more than clocks do: found drift 69. ppm.*most 500 ppm"):
        clock_offset(*signals(noise=0.0, drift=7e-4), "p")


def test_signals_that_repeat_or_differ_are_refused() -> None:
    time_s = np.arange(0, 40, 0.01)
    with pytest.raises(DataError, match="does not tell the offset"):
        clock_offset((time_s, np.sin(time_s * 3)), (time_s[:3000], np.sin(time_s[:3000] * 3)), "p")
    noise = np.random.default_rng(1).standard_normal(time_s.size)
    with pytest.raises(DataError, match="is not one signal"):
        clock_offset((time_s, motion(time_s)), (time_s, noise), "p")


def write_both(folder: Path) -> tuple[Path, Path]:
    (here, first), (there, second) = signals(noise=0.02, drift=0.0)
    steps = np.sign(np.sin(0.8 * here))
    rows = ["time,u,gyro"] + [
        f"{t:.4f},{u},{p}" for t, u, p in zip(here, steps, first, strict=True)
    ]
    (folder / "rig.csv").write_text("\n".join(rows))
    rows = ["t,gyro,angle [deg]"] + [
        f"{t:.6f},{p},{2 * p}" for t, p in zip(there, second, strict=True)
    ]
    (folder / "mocap.csv").write_text("\n".join(rows))
    return folder / "rig.csv", folder / "mocap.csv"


def test_channels_of_both_files_are_on_one_grid_and_steps_stay(tmp_path: Path) -> None:
    rig, mocap = write_both(tmp_path)
    (record,) = fid.read_records(
        rig, "u", ["angle", "mocap_gyro"], join=[mocap], join_on="gyro", join_time_column="t",
        hold="zero", resample_to_s=0.01,
    )  # fmt: skip
    assert record.unit("angle") == "deg"
    assert set(np.unique(record["u"])) <= {-1.0, 0.0, 1.0}
    inner = slice(100, -100)
    assert_close(
        record["mocap_gyro"][inner],
        motion(record.time_s)[inner],
        atol=0.3,
        why="noise of 2 %, of 12 tones",
    )
    told = record.history[0].options
    assert "clock offset 5.43" in str(told["stamps"])
    assert len(str(told["joined mocap.csv"])) == 64
    (slow,) = fid.read_records(
        rig, "u", "angle", join=[mocap], join_on="gyro", join_time_column="t"
    )
    assert_close(slow.sample_time_s, 1 / 73, rtol=1e-4, why="the slower of input and output")


def test_a_told_offset_is_taken_and_amber(tmp_path: Path) -> None:
    rig, mocap = write_both(tmp_path)
    options = {"join": [mocap], "join_time_column": "t"}
    (record,) = fid.read_records(rig, "u", "angle", clock_offset_s=OFFSET_S, **options)
    assert "clock-offset-told" in [each.code for each in record_findings(record, ["angle"])]
    assert "clock-offset-told" not in [each.code for each in record_findings(record, ["u"])]
    for both in ({}, {"clock_offset_s": 1.0, "join_on": "gyro"}):
        with pytest.raises(OptionError, match="one way"):
            fid.read_records(rig, "u", "angle", **options, **both)
    with pytest.raises(OptionError, match="no second clock"):
        fid.read_records(rig, "u", "gyro", clock_offset_s=1.0)
    with pytest.raises(DataError, match="overlap"):
        fid.read_records(rig, "u", "angle", clock_offset_s=500.0, **options)


def test_a_record_of_a_log_joins_a_table(tmp_path: Path) -> None:
    rig, _ = write_both(tmp_path)
    time_s = np.arange(0, 40, 0.0125)
    flown = fid.Record.from_arrays(
        time_s, outputs={"p": motion(time_s + 8.0)}, units={"p": "rad/s"}, name="flight"
    )
    (record,) = fid.read_records(rig, "u", "p", join=[flown], join_on="gyro=p")
    assert record.unit("p") == "rad/s"
    inner = slice(200, -200)
    truth = motion(record.time_s)[inner]
    assert_close(record["p"][inner], truth, atol=0.02, why="offset within 0.2 ms")
    assert "flight: clock offset " in str(record.history[0].options["stamps"])


def test_a_study_that_is_proposed_joins_by_itself(tmp_path: Path) -> None:
    rig, mocap = write_both(tmp_path)
    made = propose_study(
        [rig], folder=tmp_path, inputs=["u"], outputs=["angle"],
        join=(str(mocap),), join_on="gyro", join_time_column="t", model="rate_motor_lag",
    )  # fmt: skip
    assert 'join = ["mocap.csv"]' in made.lines
    assert sum("Stamps of" in line for line in made.lines) == 1
    assert any("clock offset 5.43" in line for line in made.lines)


def test_stamps_of_a_joined_file_have_a_unit_of_their_own(tmp_path: Path) -> None:
    rig, mocap = write_both(tmp_path)
    options = {"join_on": "gyro", "join_time_column": "t"}
    (told,) = fid.read_records(rig, "u", "angle", join=[mocap], **options)
    heading, *rows = mocap.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    slow = tmp_path / "slow.csv"
    body = [f"{1e3 * float(t):.3f},{p},{angle}" for t, p, angle in cells]
    slow.write_text("\n".join([heading, *body]))
    (same,) = fid.read_records(rig, "u", "angle", join=[slow], join_time_unit="ms", **options)
    assert_close(same["angle"], told["angle"], atol=1e-3, why="the same stamps to a microsecond")
    with pytest.raises(OptionError, match="needed join_time_unit='ms'"):
        fid.read_records(rig, "u", "angle", join=[mocap], units={"t": "ms"}, **options)
    # What the other file's heading says goes before what is declared of stamps here.
    here = tmp_path / "here.csv"
    heading, *rows = rig.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    here.write_text("\n".join([heading, *(f"{1e3 * float(t):.1f},{u},{p}" for t, u, p in cells)]))
    named = tmp_path / "named.csv"
    named.write_text(mocap.read_text().replace("t,", "time [s],", 1))
    (mixed,) = fid.read_records(
        here, "u", "angle", join=[named], join_on="gyro", time_unit="ms"
    )  # fmt: skip
    assert_close(mixed["angle"], told["angle"], atol=1e-3, why="the same stamps")


def test_a_command_names_what_is_wrong_with_a_joined_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig, mocap = write_both(tmp_path)
    asked = ["run", str(rig), "--inputs", "u", "--outputs", "angle", "--join-on", "gyro=angle"]
    assert run([*asked, "--join", "nope.csv"]) == 2
    said = capsys.readouterr().err
    assert "not there: found --join nope.csv; needed a table" in said
    assert "Next: check name and folder" in said
    assert run([*asked, "--join", f"{rig}x"]) == 2
    assert f"Next: {rig.name} is there" in capsys.readouterr().err
    text = mocap.read_text().replace("t,", "x,", 1)
    (tmp_path / "bare.csv").write_text(text)
    assert run([*asked, "--join", str(tmp_path / "bare.csv")]) == 2
    assert "no time column 'time': found columns x, gyro, angle; needed --join-time-column" in (
        capsys.readouterr().err
    )
    noise = tmp_path / "noise.csv"
    random = np.random.default_rng(2).standard_normal((4000, 2))
    np.savetxt(noise, np.c_[np.arange(4000) / 73, random], "%.6g", ",", header="t,rate,angle",
               comments="")  # fmt: skip
    assert run([*asked[:-1], "gyro=rate", "--join", str(noise), "--join-time-column", "t"]) == 2
    assert "Error: 'gyro=rate' of the files is not one signal" in capsys.readouterr().err
