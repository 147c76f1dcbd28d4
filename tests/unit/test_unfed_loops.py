"""Advice on feed-forward of loops whose parameters feed nothing forward."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

import flightid as fid
from flightid.review.identity import unfed_loops
from flightid.review.verdicts import judge_flight
from flightid.uncertainty.estimate import Estimate
from tests.ordinary_log import write_ordinary_log


@pytest.fixture
def review(tmp_path: Path) -> fid.FlightReview:
    write_ordinary_log(tmp_path / "flight.bin")
    return fid.review_flight(tmp_path / "flight.bin")


def test_less_feed_forward_is_advised_only_where_there_is_some(review: fid.FlightReview) -> None:
    """It was advised where ATC_RATE_FF_ENAB and every FF were 0."""
    names = ("ATC_RATE_FF_ENAB", "ATC_RAT_RLL_FF", "ATC_RAT_RLL_D_FF")
    off = {**dict.fromkeys(names, 0.0), "ATC_RAT_PIT_FF": 0.0, "ATC_RAT_PIT_D_FF": 0.1}
    flown = SimpleNamespace(
        kind="ardupilot", vehicle="copter", parameters=off, parameter_changes=(), messages={}
    )
    unfed = unfed_loops(cast("fid.Log", flown))
    assert set(unfed) == {"roll rate", "roll attitude", "pitch attitude", "yaw attitude"}
    flown.parameter_changes = (SimpleNamespace(name="ATC_RATE_FF_ENAB"),)
    assert unfed_loops(cast("fid.Log", flown)) == ("roll rate",)
    for reading, value in (("overshoot", 60.0), ("level", 1.5)):
        told = Estimate(reading, value, "%" if value > 9.0 else "1", 0.05 * value)
        for name in ("roll rate", "roll attitude"):
            readings = tuple(told if r.name == reading else r for r in review[name].readings)
            loops = (replace(review[name], readings=readings),)
            said = []
            for fed in ((), unfed):
                seen = replace(review, loops=loops, identity=replace(review.identity, unfed=fed))
                code = f"step-{name.replace(' ', '-')}"
                said.append(next(f.action for f in judge_flight(seen) if f.code == code))
            assert ("forward" in said[0]) is (value < 9.0 or name == "roll attitude")
            assert said[1]
            assert "forward" not in said[1]


def test_px4_feeds_no_attitude_forward_without_its_reference_model() -> None:
    """Its angle loops were advised to be fed less of what nothing feeds them."""
    known = {"MC_ROLL_P": 6.5, "MC_PITCH_P": 6.5, "MC_YAW_P": 2.8, "MC_ROLLRATE_FF": 0.0}
    flown = SimpleNamespace(
        kind="px4", vehicle="copter", parameters=known, parameter_changes=(), messages={}
    )
    assert unfed_loops(cast("fid.Log", flown)) == ("roll rate", "roll attitude", "pitch attitude")
    flown.parameters = {**known, "MC_REF_FF": 0.4}
    assert unfed_loops(cast("fid.Log", flown)) == ("roll rate",)
    flown.parameters = {"MC_ROLLRATE_FF": 0.0}
    assert unfed_loops(cast("fid.Log", flown)) == ("roll rate",)
