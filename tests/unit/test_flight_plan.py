"""Flight plans: what a card promises is what the simulated vehicle does with its loops closed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.control.autopilots import axis_loop_of, read_parameters
from flightid.conventions import Light
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.evidence.part_checks import agreement_check
from flightid.findings import Finding
from flightid.inspection.advice import set_bits
from flightid.inspection.flight_phases import FlightPhases, flight_phases
from flightid.planning.axis_guess import _measured, guess_axis
from flightid.planning.flight_findings import flight_findings
from flightid.planning.flown_sweeps import FlownSweeps
from flightid.planning.loop_check import CAREFULLY, MISSED
from flightid.planning.procedures import procedure_of
from flightid.planning.result import AxisSweep
from flightid.planning.settings import settings_of
from flightid.planning.still_rate import still_rate
from flightid.report.flight_card import card_html
from flightid.uncertainty.agreement import Agreement
from flightid.vehicles import (
    Autopilot,
    PilotDoublet,
    SidActivation,
    Turbulence,
    fly,
    write_ardupilot_log,
)
from flightid.vehicles.truth import AXES, COMMANDS, RATES, AxisName
from tests.closeness import assert_close

AIR = Turbulence(rate_rad_s=0.1)
ANGLES = ("phi", "theta", "psi")
SID = ("MAGNITUDE", "F_START_HZ", "F_STOP_HZ", "T_FADE_IN", "T_REC", "T_FADE_OUT")


def ordinary(path: Path, autopilot: Autopilot | None = None) -> Path:
    """A log of sticks alone, a minute of doublets."""
    random, moves, start_s = np.random.default_rng(3), [], 11.0
    while start_s < 60.0:
        axis: AxisName = AXES[int(random.integers(3))]
        size = float(random.uniform(0.05, 0.25)) * (2.0 if axis == "yaw" else 1.0)
        moves.append(PilotDoublet(axis, start_s, size, float(random.uniform(0.3, 1.0))))
        start_s = moves[-1].end_s + float(random.uniform(0.0, 2.0))
    flight = fly(doublets=moves, duration_s=65.0, turbulence=AIR, autopilot=autopilot, seed=3)
    return write_ardupilot_log(flight, path)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ordinary(tmp_path_factory.mktemp("plan") / "quad.bin")


@pytest.fixture(scope="module")
def plan(log: Path) -> fid.SweepPlan:
    return fid.plan_flight(log)


def flown(sweep: AxisSweep) -> fid.Record:
    """The sweep as the simulated vehicle flies it with what the file sets."""
    settings = {each.name: each.value for each in sweep.changes}
    gains = {n: v for n, v in settings.items() if n.startswith("ATC_RAT_")}
    chirp = {name.removeprefix("T_").lower(): settings[f"SID_{name}"] for name in SID}
    names = {"f_start_hz": "start_hz", "f_stop_hz": "stop_hz", "rec": "record_s"}
    names |= {"fade_in": "fade_in_s", "fade_out": "fade_out_s"}
    activation = SidActivation(
        axis=int(settings["SID_AXIS"]),
        start_s=10.0,
        **{names.get(name, name): value for name, value in chirp.items()},
    )
    flight = fly(
        runs=[activation], autopilot=Autopilot().with_parameters(gains), turbulence=AIR, seed=9
    )
    return flight.record(flight.span(activation))


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_simulated_vehicle_does_what_the_card_promises(plan: fid.SweepPlan, place: int) -> None:
    sweep = plan.sweeps[place]
    assert sweep.plan is not None
    assert sweep.guess is not None
    assert sweep.guess.measured
    promised, record = sweep.plan.axes[0], flown(sweep)
    peaks = {
        COMMANDS[place]: promised.peak_control,
        RATES[place]: promised.peak_rate_rad_s,
        ANGLES[place]: promised.peak_attitude_rad,
    }
    for channel, peak in peaks.items():
        reached = float(np.ptp(record[channel])) / 2.0
        assert_close(reached, peak, rtol=0.3, why="asked of the card")
    pair = fid.Record.from_arrays(
        record.time_s, inputs={"x": record["excitation"]}, outputs={"y": record[RATES[place]]},
        units={"y": "rad/s"},
    )  # fmt: skip
    response = fid.estimate_response(
        [pair], inputs="x", outputs="y", band_rad_s=sweep.plan.band_rad_s, n_omega=30,
        window_s=sweep.plan.windows_s, estimator="composite",
    )  # fmt: skip
    assert_close(
        float(response.coherence[0, 0].mean()), sweep.coherence or 0.0, rtol=0.1,
        why="mean over the band; asked is 0.3",
    )  # fmt: skip


@pytest.mark.parametrize("axis", AXES)
def test_a_plan_is_held_to_the_closed_loop_that_the_flight_shows(
    plan: fid.SweepPlan, log: Path, axis: AxisName
) -> None:
    checks = {each.axis: each.guess.check for each in plan.sweeps if each.guess}
    check = checks[axis]
    assert check is not None
    assert check.holds
    assert check.miss < 0.1
    assert check.finding(axis).light is Light.GREEN
    wrong = axis_loop_of(fid.read_log(log), axis)
    wrong = wrong.with_gains({wrong.names["p"]: 2.0 * wrong.values["p"]})
    phases = flight_phases(fid.read_log(log), None)
    told = guess_axis(axis, wrong, "multirotor", "mixer", fid.read_log(log), phases.airborne).check
    assert told is not None
    assert told.finding(axis).light is Light.AMBER


def test_amplitudes_are_those_of_closed_loops(plan: fid.SweepPlan) -> None:
    """With loops taken for open, the attitude limit alone made sweeps ten times too small."""
    sizes = [sweep.amplitude or 0.0 for sweep in plan.sweeps]
    assert all(0.04 < size < 0.3 for size in sizes)


def test_files_set_and_take_back(plan: fid.SweepPlan, log: Path, tmp_path: Path) -> None:
    written = plan.write(tmp_path)
    assert len(written) == 6
    before = fid.read_log(log).parameters
    pitch = read_parameters(tmp_path / "pitch.param")
    assert pitch["SID_AXIS"] == 11.0
    assert pitch["ATC_RAT_PIT_I"] == 0.0
    assert_close(
        pitch["ATC_RAT_RLL_I"], before["ATC_RAT_RLL_I"], rtol=1e-6,
        why="the file of roll had set it to zero; single precision",
    )  # fmt: skip
    assert int(pitch["LOG_BITMASK"]) & 1
    back = read_parameters(tmp_path / "pitch.rollback.param")
    assert back["SID_AXIS"] == 0.0
    for name, value in back.items():
        assert_close(value, before.get(name, 0.0), rtol=1e-6, why="single precision")
    with pytest.raises(OptionError, match="already there"):
        plan.write(tmp_path)


@pytest.mark.parametrize(
    ("vehicle", "autopilot", "file", "said"),
    [
        ("quad", "ardupilot", "roll.param", "SID_AXIS"),
        ("heli", "ardupilot", "yaw.param", "SID_MAGNITUDE"),
        ("quadplane", "ardupilot", "pitch.param", "Q_A_RAT_PIT_I"),
        ("plane", "ardupilot", None, "FBWA"),
        ("quad", "px4", "settings.params", "SDLOG_PROFILE"),
        ("plane", "px4", "settings.params", "FW_AT_SYSID_F1"),
        ("quad", "betaflight", "chirp.txt", "CHIRP"),
    ],
)
def test_every_autopilot_has_a_card(
    tmp_path: Path, vehicle: str, autopilot: str, file: str | None, said: str
) -> None:
    axis = file.split(".")[0] if file and autopilot == "ardupilot" else "roll"
    made = fid.plan_flight(vehicle=vehicle, autopilot=autopilot, axes=(axis,))
    made.write(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert file is None or file in names
    assert said in card_html(made) + "".join(p.read_text() for p in tmp_path.iterdir())
    assert any(each.code == "no-way-back-file" for each in made.findings)
    assert not any("rollback" in name for name in names)


def test_chirps_are_as_asked(tmp_path: Path) -> None:
    band = (2.0 * np.pi, 2.0 * np.pi * 60.0)
    asked = fid.plan_flight(
        vehicle="quad", autopilot="betaflight", axes=("roll", "yaw"), band_rad_s=band,
        amplitude=np.radians(120.0), duration_s=40.0,
    )  # fmt: skip
    # What the autopilot sizes was said to rest on a typical vehicle.
    assert {each.rests_on for each in asked.sweeps} == {"the autopilot, which sizes it"}
    lines = asked.write(tmp_path)[0].read_text().splitlines()
    assert "set chirp_amplitude_roll = 120" in lines
    assert "set chirp_frequency_start_deci_hz = 10" in lines
    assert "set chirp_frequency_end_deci_hz = 600" in lines
    assert "set chirp_time_seconds = 40" in lines
    assert not any("pitch =" in line and "chirp" in line for line in lines)
    usual = fid.plan_flight(vehicle="quad", autopilot="betaflight")
    assert_close(
        asked.flight_time.total_s - usual.flight_time.total_s,
        2 * (2 * 50 + 60) - 3 * (2 * 30 + 60),
        rtol=1e-9, why="two axes of 40 s, or three of 20, twice with 10 s of rest and a take-off",
    )  # fmt: skip
    with pytest.raises(OptionError, match="leaves the autopilot's range"):
        fid.plan_flight(vehicle="quad", autopilot="betaflight", amplitude=20.0)


def test_a_small_amplitude_is_not_rounded_to_nothing() -> None:
    """0.0004 of full stood as SID_MAGNITUDE 0 in a no-go."""
    small = fid.plan_flight(vehicle="quad", axes=("pitch",), amplitude=0.0004)
    assert {each.name: each.value for each in small.sweeps[0].changes}["SID_MAGNITUDE"] == 4e-4


def test_a_set_point_that_stands_still_is_called_that() -> None:
    """A flight by rates told “input 'theta_ref' has no power” of what nobody had asked for."""
    time_s = np.arange(0.0, 20.0, 0.01)
    flown = fid.Record.from_arrays(
        time_s, inputs={"tau_theta": 0.1 * np.sin(3.0 * time_s), "theta_ref": 0.0 * time_s},
        outputs={"q": np.cos(3.0 * time_s)}, units={"theta_ref": "rad", "q": "rad/s"},
    )  # fmt: skip
    loop = SimpleNamespace(output_unit="1")
    with pytest.raises(DataError, match="set-point of the pitch attitude stands still in the air"):
        _measured("pitch", [flown], None, loop)  # type: ignore[arg-type]


def test_helicopters_keep_their_integrator() -> None:
    made = fid.plan_flight(vehicle="heli", axes=("roll",))
    assert not any(each.name.endswith("_I") for each in made.sweeps[0].changes)


def test_time_in_the_air_counts_the_sweep_that_the_settings_ask_of_an_autotune() -> None:
    asked = fid.plan_flight(vehicle="plane", autopilot="px4", duration_s=60.0)
    assert {c.name: c.value for c in asked.sweeps[0].changes}["FW_AT_SYSID_TIME"] == 60.0
    assert asked.flight_time.run_s == (75.0,) * 3, "15 s of rest"


def test_plans_refuse() -> None:
    with pytest.raises(UnknownNameError, match="no way to sweep this vehicle"):
        fid.plan_flight(vehicle="heli", autopilot="px4")
    with pytest.raises(OptionError, match="sweeps no such axis"):
        fid.plan_flight(vehicle="plane", axes=("yaw",))
    with pytest.raises(OptionError, match="FW_AT_SYSID_TIME leaves"):
        fid.plan_flight(vehicle="plane", autopilot="px4", duration_s=121.0)


def test_what_the_stick_moves_is_no_gust() -> None:
    random = np.random.default_rng(0)
    time_s = np.arange(5000) / 100.0
    stick = np.repeat(random.standard_normal(500), 10)
    gusts = 0.1 * random.standard_normal(time_s.size)
    record = fid.Record.from_arrays(
        time_s, inputs={"u": 0.0 * time_s}, outputs={"p": stick + gusts, "p_ref": stick}
    )
    found = still_rate([record])
    assert found is not None
    assert_close(
        float(np.mean(found[1])), 2.0 * 0.1**2 / 100.0, rtol=0.06,
        why="white: 2 σ² dt; nine windows of 500 lines, 2 %",
    )  # fmt: skip
    silent = still_rate(
        [fid.Record.from_arrays(time_s, inputs={"u": stick}, outputs={"p": 0.0 * time_s})]
    )
    assert silent is not None
    assert set(silent[1]) == {1e-12}  # its logarithm stays finite


def test_command_writes_card_and_settings(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # A study names the log and says what is asked for; the command line goes before it.
    study = tmp_path / "study.toml"
    words = '[study]\ntitle = "A"\n[plan]\naxes = ["roll", "pitch"]\nn_records = 1\n'
    study.write_text(f"{words}[log]\npath = '{log}'\n", "utf-8")
    asked = ["--axes", "roll", "--n-records", "3", "--output", str(tmp_path / "out")]
    assert run(["plan", str(study), *asked]) == 0
    shown = capsys.readouterr()
    assert "0.0" in shown.out
    assert any(line.split()[-2:] == ["3", "roll.param"] for line in shown.out.splitlines())
    assert "this flight" in shown.out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "roll.param", "roll.rollback.param", "card.html",
    }  # fmt: skip
    assert run(["plan"]) == 2
    assert "name a LOG" in capsys.readouterr().err
    assert run(["plan", str(log), "--autopilot", "px4"]) == 2
    assert "belongs to --vehicle" in capsys.readouterr().err


def test_masks_are_whole_and_bits_are_never_summed(plan: fid.SweepPlan) -> None:
    mask = next(c.value for c in plan.sweeps[0].changes if c.name == "LOG_BITMASK")
    assert mask > 1e5
    assert f"LOG_BITMASK {mask:.0f}" in card_html(plan)
    assert set_bits({0: "a", 18: "b"}) == (
        "set bits 0 (a), 18 (b) of LOG_BITMASK, and leave its other bits as they are"
    )
    assert "add " not in fid.plan_flight(vehicle="quadplane").logging
    # What the firmware of a log does not have is not written for it.
    known = {"MC_ROLL_P": 6.5}
    px4 = (settings_of(procedure_of("quad", "px4"), "roll", None, each) for each in (known, {}))
    assert [[each.name for each in found] for found in px4] == [[], ["SDLOG_PROFILE"]]


def test_no_go_leaves_no_settings(plan: fid.SweepPlan, tmp_path: Path) -> None:
    fell = replace(plan, findings=(Finding("tipped-over", Light.RED, "it falls over"),))
    with pytest.raises(OptionError, match="no-go"):
        fell.write(tmp_path / "none")
    assert not (tmp_path / "none").exists()
    assert "SID_AXIS 1" not in card_html(fell)
    assert len(fell.write(tmp_path / "forced", write_no_go=True)) == 6
    missed = replace(plan, findings=(Finding(MISSED, Light.AMBER, "yaw: 442% away", CAREFULLY),))
    told = replace(plan, findings=(Finding("axis-measured", Light.GREEN, "as flown"),))
    assert (told.verdict, missed.verdict, fell.verdict) == ("go", "begin small", "no-go")
    # "Verdict: go." stood below "begin with a third of the amplitude".
    typical = fid.plan_flight(vehicle="quad")
    assert any(f.action == CAREFULLY for f in typical.findings)
    assert typical.verdict == "begin small"
    assert 'class="verdict">begin small<' in card_html(missed)


def test_a_fall_an_unknown_rate_and_a_trim_are_said(
    log: Path, plan: fid.SweepPlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = fid.read_log(log)
    phases = FlightPhases(((12.0, 60.0),), True, 61.0, "attitude")
    found = flight_findings(opened, phases, plan.sweeps, 400.0)
    lights = {each.code: each.light for each in found}
    assert lights == {"tipped-over": Light.RED, "loop-rate-typical": Light.AMBER}
    monkeypatch.setattr("flightid.planning.flight_findings.LARGEST_TRIM", 0.0)
    (said,) = flight_findings(opened, replace(phases, tipped_s=None), plan.sweeps[2:], 0.0)
    assert said.code == "trim-let-go"
    assert "with ATC_RAT_YAW_I 0, and the integrator held" in said.message


def test_what_a_log_carries_already_is_not_swept_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log with a good sweep of roll: its model is there, and the next flight is of the others."""
    sweep = SidActivation(
        axis=10, start_s=5.0, magnitude=0.15, start_hz=0.15, stop_hz=12.0,
        fade_in_s=3.0, record_s=30.0, fade_out_s=1.0, leave_after_s=40.0,
    )  # fmt: skip
    path = write_ardupilot_log(fly(runs=[sweep], log_every=2, seed=1), tmp_path / "swept.bin")
    opened = fid.read_log(path)
    made = fid.plan_flight(opened)
    assert made.carried == ("roll",)
    assert [each.axis for each in made.sweeps] == ["pitch", "yaw"]
    (done,) = (each for each in made.findings if each.code == "identified-already")
    assert done.message == "this log can carry a model of roll already"
    # What `run` asks of a model of one record, a plan asks in the same words.
    (once,) = (each for each in made.findings if each.code == "flown-once")
    asked = agreement_check(Agreement(1, None, None, np.ones(1))).finding
    assert (once.light, once.message) == (asked.light, f"roll: {asked.message}")
    assert once.action == f"{asked.action}: flightid plan swept.bin --axes roll"
    assert done.action == "next is flightid tune swept.bin"
    again = {each.code: each for each in fid.plan_flight(opened, axes=("roll",)).findings}
    # The sweep that a model rests on is flown again as it was; a typical vehicle had sized another.
    (same,) = fid.plan_flight(opened, axes=("roll",)).sweeps
    settings = {each.name: each.value for each in same.changes}
    asked_of = ("SID_MAGNITUDE", "SID_F_START_HZ", "SID_F_STOP_HZ", "SID_T_FADE_IN", "SID_T_REC")
    assert [settings[name] for name in asked_of] == [0.15, 0.15, 12.0, 3.0, 30.0]
    assert {"swept-again", "flown-once"} >= set(again) - {"identified-already"}
    (louder,) = fid.plan_flight(opened, axes=("roll",), amplitude=0.2).sweeps
    assert (round(louder.amplitude or 0.0, 6), louder.is_flown_again) == (0.2, False)
    assert again["swept-again"].message.startswith("roll: swept already, and the log can carry")
    assert "identified-already" not in again
    # The plan had sent its reader to `tune` and `inspect`, which had sent him to the plan.
    assert not any("flightid" in each.action for each in again.values())
    axes = ("roll", "pitch", "yaw")
    every = FlownSweeps(("roll", "roll", "yaw"), axes, (*axes, *axes))
    said = [each.message for each in every.findings(opened, ("yaw",))]
    assert said[0] == "this log can carry a model of roll and pitch already"
    assert said[1].startswith("yaw: swept already, and the log can carry a model")
    missed = FlownSweeps(("roll", "yaw"), (), ("roll",), {"roll": "too little coherence"})
    (why,) = missed.findings(opened, ("roll",))
    assert (why.code, why.light) == ("swept-already", Light.AMBER)
    assert why.message.endswith("no model rests on that: too little coherence")
    monkeypatch.setattr("flightid.planning.plan.flown_sweeps", lambda *_: every)
    none = fid.plan_flight(opened)
    assert (none.verdict, none.is_go, none.sweeps) == ("not needed", True, ())
    assert {each.light for each in none.findings} == {Light.GREEN}
    assert run(["plan", str(path), "--output", str(tmp_path / "out")]) == 0
    assert "a model of roll, pitch and yaw" in " ".join(capsys.readouterr().out.split())
    assert not (tmp_path / "out").exists()
    once = replace(every, moved=axes)
    monkeypatch.setattr("flightid.planning.plan.flown_sweeps", lambda *_: once)
    # "Not needed" stood over "repeat the manoeuvre"; a sweep that is repeated rests on itself.
    assert fid.plan_flight(opened).verdict == "once more"
    assert same.rests_on.startswith("the sweep of this log")
    assert louder.rests_on in ("this flight", "a typical vehicle")


def test_a_log_without_the_rate_of_the_controller_is_planned(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = fid.read_log(log)
    silent = {n: v for n, v in opened.parameters.items() if n != "SCHED_LOOP_RATE"}
    monkeypatch.setattr(opened, "parameters", silent)
    codes = {each.code for each in fid.plan_flight(opened, axes=("roll",)).findings}
    told = fid.plan_flight(opened, axes=("roll",), loop_rate_hz=400.0).findings
    assert "loop-rate-typical" in codes
    assert "loop-rate-typical" not in {each.code for each in told}
