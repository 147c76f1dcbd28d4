"""Tuned gains flown again: measured loops beside promised ones, and gains that do not fly."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from click.testing import CliRunner

import flightid as fid
from flightid.cli.program import program
from flightid.control.autopilots import axis_loop
from flightid.conventions import Light
from flightid.errors import DataError, StudyError, UnknownNameError
from flightid.study.settings import read_settings
from flightid.vehicles import Autopilot, GainFlight, GainFlightOptions, fly_gains, rate_truth
from flightid.vehicles.scenario import advised_runs
from tests.closeness import assert_close

SHORT = GainFlightOptions(record_s=60.0)


@pytest.fixture(scope="module")
def tuning() -> fid.Tuning:
    """Gains of roll for the exact model of the simulated vehicle."""
    truth = rate_truth("roll")
    known = {"Ltphi": truth.gain_rad_s2, "Lp": truth.damping_1_s, "T_m": truth.motor_lag_s}
    plant = fid.load_model("rate_motor_lag", axis="roll").with_values(
        known | {"tau": truth.effective_delay_s()}
    )
    flown = axis_loop("arducopter", "roll", Autopilot().parameters())
    return fid.tune({"roll": plant}, gains={"roll": flown}, nominal=True, band_rad_s=(0.5, 60.0))


def _with_gains(tuning: fid.Tuning, factor: float) -> fid.Tuning:
    (design,) = tuning.designs
    changes = tuple(dataclasses.replace(c, new=c.new * factor) for c in design.changes)
    return fid.Tuning((dataclasses.replace(design, changes=changes),), ())


@pytest.fixture(scope="module")
def flown(tuning: fid.Tuning) -> GainFlight:
    return fly_gains(tuning, options=SHORT)


def _red(flown: GainFlight) -> list[str]:
    return [finding.code for finding in flown.findings if finding.light is Light.RED]


def test_what_the_vehicle_does_not_stand_or_keep_is_red(flown: GainFlight) -> None:
    assert _red(flown) == []
    first = dataclasses.replace(flown.margins[0], slack=-0.1, required="at least 75")
    broken = dataclasses.replace(flown, margins=(first, *flown.margins[1:]))
    assert _red(broken) == ["requirement-broken"]
    assert _red(dataclasses.replace(flown, largest_command={"roll": 1.0})) == ["saturated"]
    lost = dataclasses.replace(flown, lost={"roll, whole loop": "the vehicle fell"})
    assert _red(lost) == ["not-flown"]
    for bad in (broken, lost):
        assert not any(finding.code == "requirements-flown" for finding in bad.findings)


def test_the_flight_shows_the_loops_that_the_true_model_promises(
    tuning: fid.Tuning, flown: GainFlight
) -> None:
    assert set(flown.loops) == {"roll, whole loop", "roll, angle loop"}
    assert flown.gains == tuning.gains
    by_name = {(each.loop, each.name): each for each in flown.margins}
    for loop in ("whole loop", "angle loop"):
        for name, near in (("crossover", 0.03), ("phase margin", 0.03), ("sensitivity peak", 0.03)):
            each = by_name[loop, name]
            assert_close(each.measured.value, each.promised.value, rtol=near,
                         why="a measured response, and a vehicle that is not linear")  # fmt: skip
    codes = {finding.code: finding.light for finding in flown.findings}
    assert codes["requirements-flown"] is Light.GREEN
    assert max(flown.largest_command.values()) < 0.2
    assert "Promised and flown" in str(flown.summary())


@pytest.mark.nightly
def test_gains_that_the_vehicle_does_not_stand_are_red(tuning: fid.Tuning) -> None:
    flown = fly_gains(_with_gains(tuning, 6.0), options=SHORT)
    red = {finding.code for finding in flown.findings if finding.light is Light.RED}
    assert red & {"saturated", "not-flown"}
    assert not any(finding.code == "requirements-flown" for finding in flown.findings)


@pytest.mark.nightly
def test_a_requirement_that_the_flight_breaks_is_red(tuning: fid.Tuning) -> None:
    (design,) = tuning.designs
    asked = dataclasses.replace(design.requirements, phase_margin_deg=75.0)
    strict = fid.Tuning((dataclasses.replace(design, requirements=asked),), ())
    flown = fly_gains(strict, options=SHORT)
    red = [finding for finding in flown.findings if finding.light is Light.RED]
    assert [finding.code for finding in red] == ["requirement-broken"]
    assert "whole loop: phase margin" in red[0].message


def test_nothing_flies_without_sound_gains() -> None:
    with pytest.raises(DataError, match="no gains to fly again"):
        fly_gains(fid.Tuning((), ()))


def test_parameters_go_into_the_autopilot_and_come_out() -> None:
    wanted = {"ATC_RAT_PIT_D": 0.004, "ATC_ANG_YAW_P": 6.0, "INS_GYRO_FILTER": 60.0}
    after = Autopilot().with_parameters(wanted).parameters()
    assert after == Autopilot().parameters() | wanted
    with pytest.raises(UnknownNameError, match="does not take this parameter"):
        Autopilot().with_parameters({"MC_ROLLRATE_P": 0.1})


def test_a_file_of_gains_is_flown_from_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = (
        dataclasses.replace(advised_runs()[0], start_hz=0.4, record_s=20.0, leave_after_s=25.0),
    )
    monkeypatch.setattr("flightid.vehicles.scenario.advised_runs", lambda: short)
    (tmp_path / "gains.param").write_text("ATC_RAT_RLL_P,0.05\n", encoding="utf-8")
    log = tmp_path / "flight.BIN"
    command = ["simulate", "quadrotor", "--json", "--write", str(log)]
    done = CliRunner().invoke(program, [*command, "--gains", str(tmp_path / "gains.param")])
    assert done.exit_code == 0, done.output
    assert log.stat().st_size > 1_000_000
    assert '"damping_1_s"' in done.stdout
    flown = axis_loop("arducopter", "roll", fid.read_log(log).parameters)
    assert_close(flown.gains["ATC_RAT_RLL_P"], 0.05, rtol=1e-6, why="single precision of the log")


def test_a_study_flies_again_what_it_has_flown(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    flight = (
        '[study]\ntitle = "Roll"\n[[segment]]\nname = "s"\nsid_axis = 10\n[[model]]\nname = "m"\n'
        'template = "rate_motor_lag"\nidentify = "s"\nband_rad_s = [1, 50]\n'
        '[flight]\nsimulate = "quadrotor"\n'
    )
    path.write_text(flight + "[fly]\n", encoding="utf-8")
    with pytest.raises(StudyError, match="flies tuned gains"):
        read_settings(path)
    path.write_text(flight + "[tune]\n[fly]\nrecord_s = 90\n", encoding="utf-8")
    settings = read_settings(path)
    assert settings.fly is not None
    assert settings.fly.record_s == 90.0
    (tmp_path / "gains.param").write_text("ATC_RAT_RLL_P,0.05\n", encoding="utf-8")
    path.write_text(flight + 'parameters = "gains.param"\n', encoding="utf-8")
    settings = read_settings(path)
    assert settings.flight is not None
    assert settings.flight.autopilot.rate[0].p == pytest.approx(0.05)
    path.write_text(flight + 'parameters = "none.param"\n', encoding="utf-8")
    with pytest.raises(StudyError, match=r"none\.param"):
        read_settings(path)
