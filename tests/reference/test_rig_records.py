"""Subspace models of real rigs with default options, beside what peers make of the same halves."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.study.proposal.order_scans import ProposedScans, record_file
from flightid.study.stage_runner import StageRunner

RIGS = {
    "exchanger": (["q_flow"], ["th_out"]),
    "evaporator": (["u1", "u2", "u3"], ["y1", "y2", "y3"]),
    "robot_arm": (["u"], ["y"]),
}


def _halves(folder: Path, name: str) -> tuple[fid.Record, fid.Record]:
    inputs, outputs = RIGS[name]
    (record,) = fid.read_records(
        folder / "records" / f"{name}.csv", inputs=inputs, outputs=outputs, sample_time_s=1.0
    )
    middle = record.n_samples // 2 - 0.5
    return record.segment(-1.0, middle), record.segment(middle, record.duration_s + 1.0)


def _unseen(folder: Path, name: str, *, refine: bool) -> tuple[fid.Fit, dict[str, float]]:
    first, second = _halves(folder, name)
    fit = fid.identify(fid.InnovationsModel.subspace(*map(tuple, RIGS[name]), refine=refine), first)
    return fit, dict(fid.predict(fit, second).fit_percent)


@pytest.mark.parametrize(("name", "least"), [("exchanger", 46.0), ("robot_arm", 94.0)])
def test_free_run_on_the_unseen_half(shared_data: Path, name: str, least: float) -> None:
    fit, percent = _unseen(shared_data, name, refine=False)
    assert min(percent.values()) > least
    # Without feedthrough the exchanger runs at 15 %: it answers at once.
    assert bool(np.any(fit.model.d)) is (name == "exchanger")


@pytest.mark.slow
def test_the_evaporator_runs_as_well_as_its_peer(shared_data: Path) -> None:
    """N4SID of sippy (AICc, f = 15) free-runs the second half at 61, 58 and 56 %."""
    _, percent = _unseen(shared_data, "evaporator", refine=True)
    for name, peer in {"y1": 61.0, "y2": 58.0, "y3": 56.0}.items():
        assert percent[name] >= peer, (name, percent)


@pytest.mark.parametrize("output", ["y1", "y2", "y3"])
def test_all_inputs_drive_the_evaporator(shared_data: Path, tmp_path: Path, output: str) -> None:
    """u2 is coherent with y1 over 0.29 decades, u1 with y3 over as much."""
    inputs, outputs = (tuple(each) for each in RIGS["evaporator"])
    path = os.path.relpath(shared_data / "records" / "evaporator.csv", tmp_path)
    lines = ["[[record]]", 'name = "half"', f'path = "{path}"', "sample_time_s = 1.0"]
    half = record_file([*lines, "span_s = [0.0, 3152.0]"], tmp_path)
    scans = ProposedScans(half, half, inputs, outputs, (), StageRunner())
    assert scans.driving((output,), (0.0166, 0.628)) == inputs
