"""``flightid identify --reduce``: the smaller model and the path to it, as text and as JSON."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.log_parts import log_records
from flightid.cli.program import run
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.inspection import Inspection
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.responses.store import read_response
from flightid.study.proposal import propose_study
from flightid.vehicles import PilotDoublet, SidActivation, fly, write_ardupilot_log

STEP_S = 0.01


def recorded(folder: Path) -> Path:
    """A roll rate that integrates its command: no damping worth the name, and some noise."""
    truth = fid.load_model("rate_first_order", axis="roll").with_values({"Lp": -1e-5})
    time_s = np.arange(2000) * STEP_S
    command = 0.1 * np.sign(np.sin(2.0 * np.pi * time_s / 1.7))
    driven = fid.Record.from_arrays(time_s, inputs={"tau_phi": command}, units={"tau_phi": "1"})
    flown = fid.simulate(truth, driven, units={"p": "rad/s"})
    noise = np.random.default_rng(4).standard_normal(len(time_s))
    return fid.write_records(flown.replace({"p": flown["p"] + 0.05 * noise}), folder / "flight.nc")


def test_a_parameter_goes_and_the_path_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["identify", str(recorded(tmp_path)), "--model", "rate_first_order", "--axis", "roll"]
    words += ["--method", "output_error", "--reduce"]
    assert run(words) == 0
    said = capsys.readouterr()
    assert "Lp" in said.out.split("Reduction of")[1]
    assert "fixed" in said.out.split("Reduction of")[0]
    assert "3 to 2 free parameters" in said.err
    assert run([*words, "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert plain["schema"] == "flightid.reduction/1"
    assert [step["name"] for step in plain["path"] if step["accepted"]] == ["Lp"]


def test_an_output_that_files_do_not_hold_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An aeroplane without an accelerometer: neither the error nor --outputs helped."""
    truth = fid.load_model("fixed_wing_lateral")
    time_s = np.arange(600) * 0.02
    moved = {
        name: 0.05 * np.sign(np.sin(rate * time_s))
        for name, rate in (("aileron", 2.1), ("rudder", 1.3))
    }
    driven = fid.Record.from_arrays(
        time_s, inputs=moved, units=dict.fromkeys(moved, "rad"), hold="zero"
    )
    units = {"beta": "rad", "p": "rad/s", "r": "rad/s", "phi": "rad", "ay": "m/s^2"}
    flown = fid.simulate(truth, driven, units=units)
    noise = 1e-3 * np.random.default_rng(5).standard_normal((600, 4))
    names = [*moved, "beta", "p", "r", "phi"]
    table = np.column_stack([time_s, *(flown[name] for name in names)])
    table[:, 3:] += noise
    path = tmp_path / "flown.csv"
    head = "time [s],aileron [rad],rudder [rad],beta [rad],p [rad/s],r [rad/s],phi [rad]"
    np.savetxt(path, table, delimiter=",", header=head, comments="")
    words = ["identify", str(path), "--model", "fixed_wing_lateral", "--hold", "zero"]
    words += ["--method", "output_error"]
    assert run(words) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "found ay" in told
    assert "leave it out: --outputs beta,p,r,phi" in told
    assert run([*words, "--outputs", "beta,p,r,phi", "--json"]) in {0, 1}
    found = json.loads(capsys.readouterr().out)
    assert list(found["model"]["outputs"]) == ["beta", "p", "r", "phi"]


def test_columns_stand_for_the_channels_of_equations(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`run` and `tune` took them; `identify --inputs` was "no option of a response"."""
    flown = fid.read_records(recorded(tmp_path))[0]
    table = np.column_stack([flown.time_s, flown["tau_phi"], flown["p"]])
    path = tmp_path / "rig.csv"
    np.savetxt(path, table, delimiter=",", header="t [s],u [1],y [rad/s]", comments="")
    words = ["identify", str(path), "--model", "rate_first_order", "--axis", "roll", "--json"]
    words += ["--method", "output_error", "--inputs"]
    assert run([*words, "u", "--outputs", "y"]) == 0
    own = json.loads(capsys.readouterr().out)
    whole = ["identify", str(tmp_path / "flight.nc"), *words[2:-1]]
    assert run(whole) == 0
    named = json.loads(capsys.readouterr().out)
    found, told = (each["parameters"]["Ltphi"]["value"] for each in (own, named))
    assert found == pytest.approx(told, rel=1e-6)
    assert run([*words, "u,y", "--outputs", "y"]) == 2
    assert "the inputs of these equations are tau_phi" in capsys.readouterr().err
    log = tmp_path / "flight.bin"
    writer = DataflashWriter()
    writer.parameter("SCHED_LOOP_RATE", 400.0)
    writer.write(log)
    assert run(["identify", str(log), *words[2:], "u", "--outputs", "y"]) == 2
    assert "is a log, whose channels have names of their own" in capsys.readouterr().err


def test_structures_stand_side_by_side(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The vehicle only integrates: its damping is worth less than the parameter that it costs."""
    words = ["compare-structures", str(recorded(tmp_path)), "--axis", "roll", "--json"]
    words += ["--method", "output_error", "--model", "rate_first_order"]
    assert run([*words, "--model", "rate_integrator"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["best"] == "rate_integrator"
    assert 0.0 < made["rows"]["rate_first_order"]["criterion"] < 2.0
    assert made["rows"]["rate_integrator"]["light"] == "green"
    # Of a log its inspection counts, as in identify, which called the same fit by another light.
    phases = FlightPhases(((0.0, 9.0),), True, None, "")
    doubt = Finding("slow", Light.AMBER, "logged slowly")
    seen = Inspection("a", "px4", "", "copter", 9.0, (), phases, (), (), (), (), (doubt,))
    verb = "flightid.cli.compare_structures.inspections_of"
    monkeypatch.setattr(verb, lambda _files: [seen])
    assert run([*words, "--model", "rate_integrator"]) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["rows"]["rate_integrator"]["light"] == "amber"
    assert run(words) == 2
    assert "two structures or more" in capsys.readouterr().err


def test_a_log_gives_its_sweep_and_its_instrument_as_the_study_of_it_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "flight.BIN"
    sweep = SidActivation(
        axis=10, start_s=3.0, start_hz=0.5, stop_hz=8.0, fade_in_s=1.0, record_s=16.0,
        fade_out_s=1.0, leave_after_s=20.0,
    )  # fmt: skip
    doublet = PilotDoublet("roll", start_s=26.0, amplitude=0.2)
    write_ardupilot_log(fly(runs=[sweep], doublets=[doublet], duration_s=36.0, seed=2), log)
    asked = ["response", str(log), "--inputs", "tau_phi", "--outputs", "p", "--json"]
    kept_as = tmp_path / "response.nc"
    assert run([*asked, "--hold", "zero", "--write", str(kept_as)]) in (0, 1)
    assert read_response(kept_as).input_shape.hold == "zero"
    capsys.readouterr()
    assert run(asked) in (0, 1)
    alone = capsys.readouterr()
    assert "flight.BIN: roll sweep, 14.0 to 30.0 s" in alone.err
    assert run([*asked, "--run", "0", "--estimator", "instrument"]) in (0, 1)
    by_hand = capsys.readouterr()
    assert "roll sweep" not in by_hand.err
    for key in ("response", "coherence", "estimator"):
        assert json.loads(alone.out)[key] == json.loads(by_hand.out)[key]
    study = propose_study([log], folder=tmp_path).text
    kept = log_records(fid.read_log(log), ["tau_phi", "p"], ["tau_phi"], "unseen")
    assert kept is not None
    assert [record.name for record in kept] == ["roll flying"]
    start_s = kept[0].time_s[0]
    assert f"span_s = [{round(start_s, 3)}" in study
    assert log_records(fid.read_log(log), ["tau_psi", "r"], ["tau_psi"], "flown") is None
