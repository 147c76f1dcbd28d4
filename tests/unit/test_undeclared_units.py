"""Logs that declare no units: by the firmware's age, and by a check that needs none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.inspection.signals import map_of, places
from flightid.logs.scale_check import ScaleCheck, check_scales
from flightid.record.checks import record_findings
from tests.old_log import write_old_log

DEGREES = 180.0 / np.pi


@pytest.mark.parametrize(
    ("firmware", "scale"),
    [("ArduCopter V3.4.6 (test)", DEGREES), ("APM:Copter V3.3.3 (test)", 100.0 * DEGREES)],
)
def test_rates_are_in_the_units_of_the_firmwares_age(
    tmp_path: Path, firmware: str, scale: float
) -> None:
    log = fid.read_log(
        write_old_log(tmp_path / "old.bin", firmware, rate_scale=scale, seconds=30.0)
    )
    record = log.record(names=["tau_phi", "p", "q", "r", "phi"])
    assert np.std(record["q"]) == pytest.approx(0.3 / np.sqrt(2), rel=0.03)
    assert np.ptp(record["phi"]) == pytest.approx(0.42, abs=0.05)
    assert record_findings(record) == ()
    found = {finding.code: finding.light for finding in fid.inspect_log(log).findings}
    assert found["no-units"] is Light.AMBER
    assert "scale-contradicted" not in found
    compared = {(each.first, each.second) for each in check_scales(log, map_of(log))}
    pairs = (("RATE.R", "IMU.GyrX"), ("RATE.P", "IMU.GyrY"), ("RATE.Y", "IMU.GyrZ"))
    assert compared == {*pairs, ("RATE.R", "ATT.Roll")}
    assert [each.label for each in places(log, "q")] == ["RATE.P", "IMU.GyrY"]
    assert [each.label for each in places(log, "q", most=1)] == ["RATE.P"]


def test_no_age_is_claimed_where_no_version_is_told(tmp_path: Path) -> None:
    path = write_old_log(tmp_path / "o.bin", "Mine", rate_scale=DEGREES, seconds=5.0)
    (said,) = (each for each in fid.read_log(path).findings if each.code == "no-units")
    assert "as Copter 3.4 stored them, for no version" in said.message
    assert "hundredths" not in said.message


def test_rates_in_hundredths_are_told_where_they_are_logged(tmp_path: Path) -> None:
    firmware, words = "APM:Copter V3.3.3 (test)", "RATE in hundredths of a deg/s and its commands"
    path = write_old_log(tmp_path / "o.bin", firmware, rate_scale=100.0 * DEGREES, seconds=2.0)
    other = tmp_path / "other.bin"
    other.write_bytes(path.read_bytes().replace(b"RATE", b"RATX"))
    told = [
        words in each.message
        for log in (path, other)
        for each in fid.read_log(log).findings
        if each.code == "no-units"
    ]
    assert told == [True, False]


@pytest.mark.parametrize("scale", [1.0, 1.1 * DEGREES])
def test_a_scale_that_is_wrong_is_red_with_the_factor(tmp_path: Path, scale: float) -> None:
    """Firmware that says 3.4 and stores something else."""
    path = write_old_log(tmp_path / "o.bin", "ArduCopter V3.4.6", rate_scale=scale, seconds=30.0)
    inspection = fid.inspect_log(path)
    said = [f for f in inspection.findings if f.code == "scale-contradicted"]
    assert {finding.light for finding in said} == {Light.RED}
    assert f"{DEGREES / scale:.4g} times the turning of RATE.P" in " ".join(f.message for f in said)
    assert inspection.findings[0] == said[0]
    assert "nothing-excited" not in {finding.code for finding in inspection.findings}
    record = fid.read_log(path).record(names=["tau_theta", "q"])
    assert [finding.code for finding in record_findings(record)] == ["scale-contradicted"]


@pytest.mark.parametrize(
    ("factor", "correlation", "said"),
    [
        (1.04, 1.0, None), (0.96, 1.0, None), (1.06, 1.0, "1.06 times"), (0.94, 1.0, "0.94 times"),
        (1.0, -1.0, "-1 times"), (55.0, 1.0, "degrees"), (60.0, 1.0, "degrees"),
        (1 / 55.0, 1.0, "degrees"), (1 / 60.0, 1.0, "degrees"), (30.0, 1.0, "30 times"),
    ],
)  # fmt: skip
def test_a_scale_may_be_a_twentieth_off(
    factor: float, correlation: float, said: str | None
) -> None:
    found = ScaleCheck("p", "GYR", "RATE", factor, correlation, 100).finding
    assert (found is None) is (said is None)
    if found is not None and said is not None:
        assert said in found.message
        assert ("degrees" in found.message) is (said == "degrees")
