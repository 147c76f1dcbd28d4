"""Every example runs as its text says, in an empty folder, and says what it promises."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent.parent / "examples"


FLIGHTID = str(Path(sys.executable).with_name("flightid"))


def _run(*command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def _script(path: Path, *arguments: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return _run(sys.executable, str(path), *arguments, folder=folder)


@pytest.mark.parametrize("name", ["study.toml", "advised.toml"])
def test_the_rig_studies_find_the_truth(name: str, tmp_path: Path) -> None:
    study = EXAMPLES / "quadrotor_rig" / name
    run = _run(FLIGHTID, "--quiet", "run", str(study), "--output", "out", folder=tmp_path)
    # Exit code 1 would be a red verdict: too many true values outside their intervals, say.
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]
    assert {path.name for path in (tmp_path / "out").iterdir()} >= {
        "report.html",
        "report.txt",
        "results.json",
    }
    results = json.loads((tmp_path / "out" / "results.json").read_text(encoding="utf-8"))
    assert len(results["models"]) == 3


def test_the_rig_flight_is_kept_as_a_log(tmp_path: Path) -> None:
    run = _script(EXAMPLES / "quadrotor_rig" / "fly.py", "flight.BIN", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "flight.BIN").read_bytes()[:2] == b"\xa3\x95"


def test_the_instrument_is_less_biased_than_the_direct_estimate(tmp_path: Path) -> None:
    run = _script(EXAMPLES / "closed_loop_bias" / "compare.py", folder=tmp_path)
    assert run.returncode == 0, run.stderr
    rows = {line.split()[0]: line.split()[1:] for line in run.stdout.splitlines()[2:]}
    direct, instrument = (
        [float(cell) for cell in rows[key]] for key in ("composite", "instrument")
    )
    assert sum(instrument) < 0.4 * sum(direct)
