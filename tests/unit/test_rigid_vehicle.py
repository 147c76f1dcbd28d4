"""A vehicle that was declared rigid: no light mode is allowed for, and all else stays."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.control.margins.mode_slack import NEAR_ONE, TAKEN, ModeSlack
from flightid.control.margins.rigid_vehicle import DECLARED, RIGID
from flightid.control.tuning.band_findings import by_modes_alone
from flightid.control.tuning.mode_slacks import clear_from, slacks_of
from flightid.control.tuning.modes_outside import ABOVE_BAND, BELOW_BAND
from flightid.control.tuning.moved_gains import move_gains
from flightid.control.tuning.wider_band import wider_band
from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light
from flightid.study.gain_answer import gains_finding
from flightid.study.reading import TableReader
from flightid.study.tuning import read_tune
from flightid.uncertainty.estimate import Estimate

BOTH_SIDES = (4.0, 100.0)
"""Band outside of which a mode may take margins of the rig on either side."""


def rig(band_rad_s: tuple[float, float], **options: Any) -> fid.PidDesign:
    """A PI controller of a rate behind a motor's lag and a delay."""
    plant = fid.load_model("rate_motor_lag").with_values(
        {"Ltphi": 140.0, "Lp": -4.0, "T_m": 0.05, "tau": 0.02}
    )
    asked = fid.ControllerOptions(controller="pi", loop_rate_hz=200.0)
    return fid.tune_controller(
        plant, controller=asked, nominal=True, band_rad_s=band_rad_s, **options
    )


def vehicle(band_rad_s: tuple[float, float], **options: Any) -> fid.PidDesign:
    """Rate and angle loop of an integrator behind a delay, the gains by hand."""
    plant = fid.load_model("rate_integrator", axis="roll").with_values(
        {"Ltphi": 140.0, "tau": 0.03}
    )
    flown = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    asked = {"nominal": True, "by_hand": {"ATC_ANG_RLL_P": 3.0}}
    return fid.tune_pid(plant, gains=flown, band_rad_s=band_rad_s, **{**asked, **options})


def said(design: fid.PidDesign, code: str) -> list[fid.Finding]:
    return [each for each in design.findings if each.code == code]


def test_what_a_mode_alone_takes_is_promised_of_a_rigid_vehicle(tmp_path: Path) -> None:
    """Of the model alone, whose margins are read inside the band, what is promised is its own."""
    band = (0.1, 40.0)
    free, rigid = rig(band), rig(band, rigid=True)
    assert free.worst_case("loop", "phase margin").estimate.reason == TAKEN["above"]
    (line,) = said(free, "margin-beyond-band")
    assert line.action.endswith(f"; {RIGID}")
    assert not said(free, DECLARED)
    for name in ("phase margin", "gain margin", "sensitivity peak", "disturbance peak"):
        case = rigid.worst_case("loop", name)
        assert case.worst == pytest.approx(case.nominal, rel=1e-12), name
    assert not said(rigid, "margin-beyond-band")
    assert rigid.gains == free.gains, "a search knows of no mode"

    (told,) = said(rigid, DECLARED)
    assert told.light is Light.GREEN
    assert told.message == (
        "declared rigid: no light mode outside 0.1 to 40 rad/s is allowed for in these promises"
    )
    values = json.loads(json.dumps(rigid.to_dict(), default=str))
    assert told.to_dict() in values["findings"]
    assert values["provenance"]["rigid"] is True
    assert told.message in str(rigid.summary())
    file, *_ = rigid.write(tmp_path / "gains.toml")
    assert f"# {told.message}" in file.read_text()
    for design, word in ((rigid, True), (free, False)):
        answer = gains_finding(fid.Tuning((design,), ()), "rig.csv").message
        assert ("that the data allow, declared rigid" in answer) is word


@pytest.mark.parametrize("side", ["below", "above"])
def test_no_declaration_costs_a_promise(side: str) -> None:
    free, rigid = (vehicle(BOTH_SIDES, rigid=each) for each in (False, True))
    gained = 0
    for one, other in zip(free.worst_cases, rigid.worst_cases, strict=True):
        assert one.nominal == other.nominal
        if one.worst is not None and one.nominal is not None:
            better = np.sign(one.nominal - one.worst) or 1.0
            assert other.worst is not None
            assert better * (other.worst - one.worst) >= 0.0, one
        gained += one.worst is None and other.worst is not None
    assert gained
    problem, gains = rigid.problem, _gains_of(rigid)
    for name, slack in slacks_of(problem, gains, BOTH_SIDES, side).items():  # type: ignore[arg-type]
        assert slack.left_db == slack.own_db, name
        assert not slack.has_mode
    flexible = replace(problem, rigid=False)
    wide, rigid_wide = (
        clear_from(each, gains, BOTH_SIDES, side, 6.0)  # type: ignore[arg-type]
        for each in (flexible, problem)
    )
    further = -1.0 if side == "below" else 1.0
    assert all(further * (wide[name] - rigid_wide[name]) >= 0.0 for name in wide)


def test_what_is_read_above_the_band_stays_without_promise() -> None:
    design = rig((0.1, 15.0), rigid=True)
    margin = design.worst_case("loop", "gain margin")
    assert (margin.worst, margin.estimate.reason) == (None, ABOVE_BAND)
    (line,) = said(design, "margin-beyond-band")
    assert line.light is Light.AMBER
    assert line.message.endswith("and nothing is promised of those margins")
    lights = " ".join(f"{each.message} {each.action}" for each in design.findings)
    for word in ("resonance", "light mode there", "swings", "notch"):
        assert word not in lights
    wider = wider_band(design.problem, _gains_of(design), (0.1, 15.0))
    assert wider[1] == "sweep to higher frequencies, until margins are read inside the band"


def test_a_loop_at_one_below_the_band_stays_without_promise() -> None:
    """The angle loop of these gains passes one at 1 to 4 rad/s."""
    design = vehicle((4.0, 900.0), rigid=True)
    case = design.worst_case("angle loop", "phase margin")
    assert (case.worst, case.estimate.reason) == (None, BELOW_BAND)
    (line,) = said(design, "margin-below-band")
    assert line.light is Light.AMBER
    assert "the model's word alone" in line.message
    assert "light mode" not in line.message
    assert RIGID not in line.action
    assert not said(design, "mode-below-band")
    (free,) = said(vehicle((4.0, 900.0)), "mode-below-band")
    assert free.action.endswith(RIGID)
    # From the band on, which the rate loop passes far above, its own margins are promised.
    assert design.worst_case("rate loop", "phase margin").worst is not None


def test_a_mode_within_the_errors_of_the_band_is_still_counted() -> None:
    """An error of 0.3 in the band turns a loop by up to arcsin 0.3, rigid or not."""
    omega = np.geomspace(0.5, 90.0, 40)
    model = fid.load_model("rate_motor_lag", axis="roll").with_values(
        {"Ltphi": 140.0, "Lp": -3.4, "T_m": 0.045, "tau": 0.012}
    )
    data = fid.FrequencyResponse.from_values(
        omega, model.frequency_response(omega), inputs=model.inputs, outputs=model.outputs,
        units=model.units, random_error=np.full((1, 1, 40), 0.01),
    )  # fmt: skip
    right = fid.identify(model, data, correct_bias=False)
    wrong = replace(right)
    errors = right.model_errors["p/tau_phi"]
    far = replace(errors, bound=0.3 + 0.0 * errors.bound)
    wrong.__dict__["model_errors"] = {"p/tau_phi": far}
    loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    flown = loop.with_gains(ATC_RAT_RLL_P=0.08, ATC_RAT_RLL_I=0.08, ATC_RAT_RLL_D=0.002)
    asked: dict[str, Any] = {"draws": 16, "angle_loop": False, "rigid": True}
    asked["by_hand"] = {"ATC_RAT_RLL_P": 0.08}
    designs = [fid.tune_pid(each, gains=flown, **asked) for each in (right, wrong)]
    cases = [each.worst_case("rate loop", "phase margin") for each in designs]
    taken = [each.nominal - each.worst for each in cases]  # type: ignore[operator]
    assert 12.0 < taken[1] - taken[0] < np.degrees(np.arcsin(0.3)) + 3.0

    words = "in the band shown, 0.5 to 90 rad/s, declared rigid: at least"
    assert words in designs[0].findings[0].message
    moved = move_gains(designs[0], {"ATC_RAT_RLL_P": 0.081}, responses=False)
    assert words in moved.finding.message


def test_a_loop_that_is_near_one_above_the_band_promises_no_gain_margin() -> None:
    """Without a mode the loop's own gain stays there, whose phase nobody was shown."""
    slack = ModeSlack.above([0.6j, 0.01], [0.0, 0.0])
    own = -20.0 * np.log10(0.6)
    assert slack.left_db == pytest.approx(own)
    assert slack.takes("gain_margin_db", 6.0)
    assert slack.takes("sensitivity_peak", 6.0)
    assert not slack.takes("phase_margin_deg", 6.0)
    assert slack.reason == NEAR_ONE["above"]
    margin = slack.reached(Estimate("gain margin", 12.0, "dB", 1.0), "gain_margin_db", 6.0)
    assert (margin.interval95, margin.reason) == (None, NEAR_ONE["above"])
    less = slack.reached(Estimate("gain margin", 12.0, "dB", 1.0), "gain_margin_db", 3.0)
    assert less.interval95[0] == pytest.approx(own)  # type: ignore[index]
    below = ModeSlack.below([2.2], [0.0])
    assert not below.takes("disturbance_bandwidth_rad_s", 6.0)
    assert ModeSlack.below([2.2], [0.5]).takes("disturbance_bandwidth_rad_s", 6.0)


@pytest.mark.parametrize(
    ("reason", "alone"),
    [(TAKEN["above"], True), (TAKEN["below"], True), (ABOVE_BAND, False), (BELOW_BAND, False)],
)
def test_the_word_is_asked_for_where_it_would_do(reason: str, alone: bool) -> None:
    lost = Estimate("rate loop: gain margin", 15.0, "dB", reason=reason)
    mode = Estimate("rate loop: phase margin", 60.0, "deg", reason=TAKEN["below"])
    cases = [
        WorstCase("rate loop", "gain margin", lost, None, None, None, "≥ 6"),
        WorstCase("rate loop", "phase margin", mode, None, None, None, "≥ 45"),
    ]
    assert by_modes_alone(cases) is alone


def test_a_study_declares_it() -> None:
    for table, told in (({"rigid": True}, True), ({}, False)):
        assert read_tune(TableReader(dict(table), "tune")).options.rigid is told


def _gains_of(design: fid.PidDesign) -> np.ndarray:
    return np.asarray(design.problem.paths.gains_of(design.loop))  # type: ignore[attr-defined]
