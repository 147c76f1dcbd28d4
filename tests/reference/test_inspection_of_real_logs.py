"""The verdicts that an expert would give on real logs."""

from __future__ import annotations

from pathlib import Path

import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.inspection import Inspection


def red(inspection: Inspection) -> set[str]:
    return {finding.code for finding in inspection.findings if finding.light is Light.RED}


def test_arducopter_457_is_too_short_and_too_slow(shared_data: Path) -> None:
    inspection = fid.inspect_log(shared_data / "logs" / "arducopter_457.BIN")
    assert red(inspection) == {"too-short", "rate-too-low"}
    assert inspection.phases.airborne_s == pytest.approx(24.7, abs=0.5)
    assert inspection.phases.tipped_s == pytest.approx(75.0, abs=0.5)
    slow = next(f for f in inspection.findings if f.code == "rate-too-low")
    assert "no model above 1 Hz" in slow.message
    assert "2 Hz at the very most" in slow.message
    assert "LOG_BITMASK 2504671" in slow.action
    assert any(f.code == "saturated" and "RCOU.C3" in f.message for f in inspection.findings)


def test_arducopter_470_never_left_the_ground(shared_data: Path) -> None:
    inspection = fid.inspect_log(shared_data / "logs" / "arducopter_470dev_ground.BIN")
    assert red(inspection) == {"not-airborne", "nothing-excited", "rate-too-low"}


def test_px4_2016_was_moved_by_hand(shared_data: Path) -> None:
    # 69 s with body rates up to 2.7 rad/s, but thrust 0, every output at PWM_DISARMED (900 us).
    inspection = fid.inspect_log(shared_data / "logs" / "px4_quad_2016.ulg")
    assert red(inspection) == {"motors-off"}
    assert inspection.duration_s == pytest.approx(69.0, abs=0.2)
    assert {e.kind for e in inspection.excitations} == {"hand"}
    limited = next(f for f in inspection.findings if f.code == "rate-limited")
    assert "SDLOG_PROFILE 25" in limited.action
    means = {rate.message: rate.mean_hz for rate in inspection.rates}
    assert means["vehicle_attitude"] == pytest.approx(94, abs=1)
    assert means["actuator_controls_0"] == pytest.approx(47, abs=1)
    assert means["sensor_combined"] == pytest.approx(248, abs=1)


@pytest.mark.parametrize("name", ["px4_esc_status.ulg", "arducopter_457.BIN"])
def test_the_coherence_that_is_named_was_measured(shared_data: Path, name: str) -> None:
    inspection = fid.inspect_log(shared_data / "logs" / name)
    # Flown in pieces with gaps between: windows that they hold give a coherence, and no zero.
    told = {band.axis: band.largest_coherence or 0.0 for band in inspection.bands}
    assert list(told) == ["roll", "pitch", "yaw"]
    assert 0.5 < max(told.values()) < 1.0
    assert min(told.values()) > 0.1
