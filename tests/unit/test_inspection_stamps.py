"""Damaged stamps cost their own samples, not the verdict on the log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from flightid.inspection.stamps import BLOCK, believable, longer_steps
from flightid.logs import Log
from flightid.logs.ulog.reader import UlogSource
from tests.examples import examples
from tests.sweep_log import SweepFlight
from tests.ulog_builder import UlogBuilder


def test_one_damaged_stamp_costs_one_sample() -> None:
    stamps = 100.0 + np.arange(1000) / 250
    for damaged in (1e15, 103.9, 99.0, 0.0, np.nan):
        spoiled = stamps.copy()
        spoiled[500] = damaged
        mask = believable(spoiled)
        assert np.count_nonzero(~mask) == 1
        assert not mask[500]


def test_a_damaged_last_stamp_is_not_believed() -> None:
    stamps = np.append(np.arange(1000) / 250, 1e6)
    assert believable(stamps).tolist() == [True] * 1000 + [False]


def test_of_stamps_that_never_increase_one_is_believed() -> None:
    for stamps in ([3.0, 2.0, 1.0], [2.0, 2.0], [5.0, 5.0, 4.0]):
        assert np.count_nonzero(believable(np.array(stamps))) == 1
    assert believable(np.array([3.0, 1.0, 2.0])).tolist() == [False, True, True]


def test_a_pause_where_blocks_meet_is_one() -> None:
    for last in (BLOCK - 1, BLOCK):
        stamps = np.arange(BLOCK + 3.0)
        stamps[last + 1 :] += 5.0
        assert longer_steps(stamps, 5.0) == [(last, last + 6.0)]


def test_stamps_all_over_the_place_are_not_believed() -> None:
    assert not np.any(believable(np.linspace(0.0, 1e12, 50)))
    assert believable(np.empty(0)).size == 0


@given(st.lists(st.floats(0, 1e5), max_size=60))
@examples(100)
def test_what_is_believed_increases(stamps: list[float]) -> None:
    values = np.array(stamps)
    assert np.all(np.diff(values[believable(values)]) > 0)


@pytest.mark.nightly
def test_a_damaged_log_gets_the_same_verdict(tmp_path: Path) -> None:
    path = SweepFlight(sweep_s=20.0).write(tmp_path)
    intact = fid.inspect_log(path)
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(3)
    for at in rng.integers(len(data) // 10, len(data), 300):
        data[at] ^= 1 << int(rng.integers(0, 8))
    damaged = tmp_path / "damaged.bin"
    damaged.write_bytes(bytes(data))
    inspection = fid.inspect_log(damaged)
    assert abs(inspection.duration_s - intact.duration_s) < 0.1
    assert abs(inspection.phases.airborne_s - intact.phases.airborne_s) < 0.5
    assert {"airborne", "excitation-found"} <= {f.code for f in inspection.findings}


def test_a_log_without_anything_to_judge_says_so_and_claims_no_rest(tmp_path: Path) -> None:
    built = UlogBuilder().format("a:uint64_t timestamp;").announce("a", 0)
    built.sample(0, "Q", 2**63).sample(0, "Q", 1)
    path = tmp_path / "empty.ulg"
    path.write_bytes(bytes(built))
    inspection = fid.inspect_log(Log(path, UlogSource(path)))
    assert {f.code for f in inspection.findings} == {
        "flight-unknown",
        "no-command-logged",
        "motion-unknown",
    }
    assert inspection.bands[0].reason == "mixer command and body rate are not logged"
    assert inspection.duration_s == 0.0
