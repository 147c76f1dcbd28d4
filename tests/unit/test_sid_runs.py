"""Runs located, the injection proven or contradicted, and the chirp put into records."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Axis, Role
from flightid.errors import OptionError
from flightid.logs.self_check import chirp_clock, mixer_residual
from tests.closeness import assert_close
from tests.mixer_sweep_log import write_sweep


def test_runs_are_located_with_their_settings(tmp_path: Path) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin", starts_s=(2.0, 20.0)))
    assert len(log.sid_runs) == 2
    run = log.sid_runs[1]
    assert (run.axis, run.point, run.body_axis, run.unit) == (10, "mixer", Axis.ROLL, "1")
    stamps, clock, _ = chirp_clock(log, run)
    assert (stamps[0], stamps.size) == (run.start_s, run.n_rows)
    assert np.all(np.diff(clock) > 0.0)
    assert_close(run.start_s, 20.0, atol=2e-3, why="written within the loop that starts the mode")
    assert_close(run.chirp_span_s, (21.0, 33.0), atol=2e-3, why="one second of silence, then T_REC")
    assert (run.f_start_hz, run.f_stop_hz, run.fade_in_s, run.record_s) == (0.5, 5.0, 2.0, 12.0)
    assert all(r.is_complete for r in log.sid_runs)


def test_a_run_that_was_broken_off_says_so(tmp_path: Path) -> None:
    path = write_sweep(tmp_path / "a.bin", divider=4)
    content = path.read_bytes()
    path.write_bytes(content[: int(0.6 * len(content))])
    (run,) = fid.read_log(path).sid_runs
    assert not run.is_complete


def test_plane_has_no_silence_before_its_chirp(tmp_path: Path) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin", firmware="ArduPlane V4.7.0 (sweep)"))
    assert log.sid_runs[0].delay_s == 0.0


@pytest.mark.parametrize(
    ("axis", "command", "body"),
    [(10, "ROut", Axis.ROLL), (11, "POut", Axis.PITCH), (12, "YOut", Axis.YAW)],
)
@pytest.mark.parametrize("lag_loops", [0, 1, 2])
def test_a_mixer_sweep_is_proven_with_its_axis_and_lag(
    tmp_path: Path, axis: int, command: str, body: Axis, lag_loops: int
) -> None:
    path = write_sweep(tmp_path / "a.bin", axis=axis, injected=command, lag_loops=lag_loops)
    log = fid.read_log(path)
    check = log.check_injection(log.sid_runs[0])
    assert check.is_proven
    assert check.injected is not None
    assert check.injected.axis == body
    assert check.sign == 1
    assert_close(
        check.injected.lag_loops, lag_loops, atol=1e-3, why="whole loops, single precision"
    )
    assert_close(check.injected.gain, 1.0, rtol=1e-5, why="the chirp itself, in single precision")
    assert check.findings[0].code == "injection-proven"


def test_the_lag_is_found_between_rows_of_a_decimated_log(tmp_path: Path) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin", divider=4))
    check = log.check_injection(log.sid_runs[0])
    assert check.is_proven
    assert check.injected is not None
    assert_close(
        check.injected.lag_loops, 1.0, atol=0.02, why="a quarter of a row: from interpolation"
    )


def test_a_reversed_injection_is_proven_with_its_sign(tmp_path: Path) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin", sign=-1.0))
    check = log.check_injection(log.sid_runs[0])
    assert check.is_proven
    assert check.sign == -1


def test_the_residual_of_a_mixer_sweep_is_the_chirp_of_the_loop_before(tmp_path: Path) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin"))
    found = mixer_residual(log, Axis.ROLL, 1 / 400)
    assert found is not None
    residual = found[1][2 * 400 : 16 * 400]
    targ = log.table("SIDD")["Targ"][: 14 * 400]
    assert_close(residual[1:], targ[:-1], atol=3e-8, why="four single-precision terms")
    other = mixer_residual(log, Axis.PITCH, 1 / 400)
    assert other is not None
    assert_close(other[1], 0.0, atol=3e-8, why="no injection on pitch")


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"axis": 7, "injected": None}, "injection-upstream"),
        ({"axis": 7, "injected": "ROut"}, "injection-contradicted"),
        ({"axis": 11, "injected": "ROut"}, "injection-contradicted"),
        ({"axis": 10, "injected": None}, "injection-contradicted"),
        ({"axis": 13, "injected": None}, "injection-unchecked"),
        ({"axis": 10, "pid": False}, "injection-unchecked"),
    ],
)
def test_what_is_not_proven_is_not_called_proven(
    tmp_path: Path, options: dict[str, object], code: str
) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin", **options))  # type: ignore[arg-type]
    check = log.check_injection(log.sid_runs[0])
    assert not check.is_proven
    assert check.findings[0].code == code


def test_a_record_of_a_run_holds_the_chirp_when_it_acted(tmp_path: Path) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin", lag_loops=1))
    record = log.record(sid_run=0)
    assert record.channels["excitation"].role == Role.EXCITATION
    assert_close(record.sample_rate_hz, 400.0, rtol=1e-6, why="the rate of RATE")
    found = mixer_residual(log, Axis.ROLL, 1 / 400)
    assert found is not None
    rows = np.searchsorted(found[0], record.time_s - 1e-4)
    injected = found[1][rows]
    assert_close(
        record["excitation"], injected, atol=2e-5, why="the lag is estimated to 1e-3 of a loop"
    )
    assert "proven" in record.channels["excitation"].note
    assert_close(record.duration_s, 12.0, atol=0.01, why="the chirp without the silent tail")


def test_an_unproven_chirp_keeps_its_stamps_and_says_so(tmp_path: Path) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin", pid=False))
    record = log.record(sid_run=log.sid_runs[0])
    assert "not proven" in record.channels["excitation"].note


def test_an_excitation_in_degrees_becomes_radians(tmp_path: Path) -> None:
    path = write_sweep(tmp_path / "a.bin", axis=7, injected=None, magnitude=10.0)
    record = fid.read_log(path).record(sid_run=0)
    assert record.unit("excitation") == "rad/s"
    assert_close(np.max(record["excitation"]), np.radians(10), rtol=1e-2, why="10 deg/s amplitude")


def test_a_run_that_is_not_there_is_refused(tmp_path: Path) -> None:
    log = fid.read_log(write_sweep(tmp_path / "a.bin"))
    with pytest.raises(OptionError, match="no such system-identification run"):
        log.record(sid_run=1)
