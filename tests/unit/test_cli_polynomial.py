"""``flightid polynomial``: a fit and a scan from files."""

from __future__ import annotations

import json

import numpy as np
import pytest

import flightid as fid
from flightid.cli import main
from tests.polynomial_records import ARMAX, flown


@pytest.fixture
def files(tmp_path):
    paths = []
    for seed in (0, 1):
        path = tmp_path / f"run{seed}.parquet"
        fid.write_records(flown(ARMAX, seed, n=600, noise=0.3), path)
        paths.append(str(path))
    return paths


def _run(capsys, *arguments):
    """Exit code and what was written to both streams."""
    with pytest.raises(SystemExit) as leave:
        main(["polynomial", *arguments])
    return (leave.value.code, *capsys.readouterr())


def test_a_fit_with_validation(files, capsys):
    code, out, err = _run(
        capsys, files[0], "--na", "2", "--nb", "2", "--nc", "2", "--validation", files[1], "--json"
    )
    assert code == 0, err
    values = json.loads(out)
    assert values["schema"] == "flightid.fit/1"
    assert abs(values["parameters"]["a1"]["value"] + 1.5) < 0.05
    assert "free run" in err


def test_a_scan(files, capsys):
    code, out, err = _run(
        capsys, files[0], "--scan", "--na", "2", "--nb", "2", "--nc", "1", "--validation", files[1]
    )
    assert code == 0, err
    assert "ranked by free run" in out


def test_a_scan_tells_what_makes_its_best_red(tmp_path, capsys):
    random = np.random.default_rng(0)
    u = random.standard_normal(1000)
    y = 2.0 * u + 0.02 * random.standard_normal(1000)
    record = fid.Record.from_arrays(0.01 * np.arange(1000), inputs={"u": u}, outputs={"y": y})
    path = str(fid.write_records(record, tmp_path / "gain.parquet"))
    words = [path, "--scan", "--kind", "arx", "--na", "1", "--nb", "1", "--validation", path]
    code, _, err = _run(capsys, *words)
    assert code == 1
    assert "The best, of itself: [red] whether a loop is closed cannot be told" in err
    assert "nk 0" in _run(capsys, *words, "--nk", "0")[1]


def test_what_is_missing_is_said(files, capsys):
    code, _, err = _run(capsys, files[0], "--scan")
    assert code == 2
    assert "--validation" in err
