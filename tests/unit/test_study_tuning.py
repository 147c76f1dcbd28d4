"""Gains in studies and from the command line."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import flightid as fid
from flightid import ControllerOptions
from flightid.cli.output import Exit
from flightid.cli.program import run
from flightid.conditioning import flip_sign
from flightid.conventions import Light, Role
from flightid.errors import DataError, StudyError
from flightid.evidence.evidence import Check, Evidence
from flightid.study.actuator_range import input_ranges
from flightid.study.record_files import RecordFile, load_records
from flightid.study.settings import read_settings
from flightid.study.tuning import TuneSettings, _controllers, _without_errors, tune_models
from tests.closeness import assert_close

STUDY = """
[study]
title = "Roll"
[flight]
simulate = "quadrotor"
seed = 4
log_every = 4
[[flight.sweep]]
axis = 10
start_s = 5.0
start_hz = 0.1
stop_hz = 12.0
record_s = 60.0
fade_out_s = 1.0
leave_after_s = 75.0
[[segment]]
name = "sweep"
sid_axis = 10
[response]
estimator = "instrument"
window_s = [20]
n_omega = 40
[[model]]
name = "Roll rate"
template = "rate_motor_lag"
axis = "roll"
identify = "sweep"
band_rad_s = [2.0, 60.0]
parameters.T_m = { maximum = 0.15 }
[tune]
noise_growth = 3.0
draws = 12
angle_loop = false
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "roll.toml"
    path.write_text(STUDY, encoding="utf-8")
    return path


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_gains_whose_answer_fails_are_not_written(
    form: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three files of gains were there already, and JSON ended well, where the screen failed."""
    target, log = tmp_path / "gains.param", tmp_path / "flight.BIN"
    log.touch()

    def write(_: object, path: Path, *__: object, **___: object) -> tuple[Path, ...]:
        path.touch()
        return (path,)

    def fail(*_: object) -> None:
        raise ValueError("no answer")

    tuning = SimpleNamespace(to_dict=dict, sound=(1,), left_out={}, findings=())
    study = SimpleNamespace(
        tuning=tuning,
        faults=(),
        output=tmp_path,
        document=None,
        settings=SimpleNamespace(level=0.95),
    )
    monkeypatch.setattr("flightid.cli.tune.taken_study", lambda *_, **__: (log, None, ()))
    monkeypatch.setattr("flightid.cli.tune._without_gains", lambda _: False)
    monkeypatch.setattr("flightid.study.run_study", lambda *_, **__: study)
    monkeypatch.setattr("flightid.cli.tune._write", write)
    monkeypatch.setattr("flightid.study.answer.short_document", fail)
    assert run(["--quiet", "tune", str(log), "--write", str(target), *form]) == Exit.FAULT
    assert not target.exists()


@pytest.mark.nightly
def test_a_study_is_tuned_from_its_log_and_its_models_beside_it(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "gains.param"
    code = run(["--quiet", "tune", str(study), "--write", str(target), "--json"])
    told = json.loads(capsys.readouterr().out)
    assert code == 0, told["findings"]
    assert told["schema"] == "flightid.tuning/1"
    gains = told["designs"]["roll"]["gains"]
    assert gains["ATC_RAT_RLL_P"]["flown"] == pytest.approx(0.09)
    assert gains["ATC_RAT_RLL_P"]["new"] > 0.1
    assert list(tmp_path.glob("gains*.rollback.param"))
    results = json.loads((tmp_path / "roll-output" / "results.json").read_text(encoding="utf-8"))
    assert results["tuning"]["designs"]["roll"]["exists"]
    made = tmp_path / "roll-output"
    assert "Roll gains" in (made / "report.txt").read_text(encoding="utf-8")
    shown = (made / "report.txt").read_text(encoding="utf-8")
    assert f"flightid tune roll.toml --write {target}" in " ".join(shown.split())

    file, log = str(made / "models" / "roll_rate.toml"), str(made / "flight.bin")
    quick = ["--draws", "12", "--no-angle-loop", "--json"]
    code = run(["--quiet", "tune", file, "--log", log, *quick])
    assert code in (0, 1)
    assert list(json.loads(capsys.readouterr().out)["designs"]) == ["roll"]
    assert run(["--quiet", "tune", file]) == 2
    assert "name the flight with --log" in capsys.readouterr().err


def test_settings_are_read_and_checked(study: Path) -> None:
    asked = read_settings(study).tune
    assert asked is not None
    assert asked.requirements.noise_growth == 3.0
    assert asked.options.draws == 12
    study.write_text(STUDY + "luck = 1\n", encoding="utf-8")
    with pytest.raises(StudyError, match="there is no key 'luck'"):
        read_settings(study)


def test_records_get_a_pid_of_its_own_with_their_modes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One command from a rig's file to modes and gains; models say the whole command."""
    random = np.random.default_rng(2)
    u = np.repeat(random.choice([-1.0, 1.0], 150), 4)
    # s² + 2·0.3·2 s + 4, of held inputs, every 0.1 s.
    num, den, _ = cont2discrete(([4.0], [1.0, 1.2, 4.0]), 0.1)
    y = lfilter(num.ravel(), den, u) + 0.01 * random.standard_normal(u.size)
    rows = "".join(
        f"{0.1 * k:.1f},{a},{b:.8g}\n" for k, (a, b) in enumerate(zip(u, y, strict=True))
    )
    (tmp_path / "rig.csv").write_text(f"time,u,y\n{rows}", encoding="utf-8")
    file = str(tmp_path / "rig.csv")
    assert run(["tune", file, "--draws", "12"]) == 0
    said = capsys.readouterr()
    assert "gains of a PID of its own, --controller pi_d" in said.err
    assert "controller.toml and controller.c: close the loop" in said.out.replace(
        "\n           ", " "
    )
    (row,) = [each for each in said.out.splitlines() if "oscillation" in each]
    omega, zeta = (float(row.split()[-4 + place]) for place in (1, 2))
    assert_close([omega, zeta], [2.0, 0.3], rtol=0.02, why="the rig's own")
    folder = tmp_path / "rig-output"
    assert {"controller.c", "controller.toml"} <= {each.name for each in folder.iterdir()}
    assert run(["tune", str(folder)]) == 2
    assert f"flightid tune {folder} --controller pi_d" in capsys.readouterr().err


def test_models_stand_where_there_are_no_gains(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Everything that was found is shown, and why there are no gains; the report lies there."""
    random = np.random.default_rng(2)
    u = np.repeat(random.choice([-1.0, 1.0], 100), 4)
    y = lfilter([0.0, 0.2], [1.0, -0.8], u) + 0.05 * random.standard_normal(u.size)
    rows = "".join(
        f"{0.1 * k:.1f},{a},{b:.6g}\n" for k, (a, b) in enumerate(zip(u, y, strict=True))
    )
    (tmp_path / "rig.csv").write_text(f"time,u,y\n{rows}", encoding="utf-8")

    def refuse(*_: object, **__: object) -> None:
        raise DataError("planted", found="no errors", action="lower nf and nb by 1")

    monkeypatch.setattr("flightid.study.tuning.tune_controller", refuse)
    assert run(["tune", str(tmp_path / "rig.csv")]) == Exit.RED
    said = capsys.readouterr()
    assert "Models" in said.out
    assert "predicts" in said.out
    found = [line for line in said.out.splitlines() if "no gains: planted: found no errors" in line]
    assert len(found) == 1
    assert "lower nf and nb by 1" in said.out
    assert "could not be made" not in said.out
    (headline,) = [line for line in said.out.splitlines() if line.startswith("Answer: ")]
    assert headline.startswith("Answer: red ("), "as the exit code says"
    assert "report.html" in said.err
    assert (tmp_path / "rig-output" / "report.html").is_file()


def test_no_loop_is_asked_for_where_none_could_have_gains() -> None:
    """DaISy's evaporator: name a loop, then declare the loop open, then there were no errors."""
    checks = (Check("residuals", Light.AMBER, "inputs foretell errors", "raise the orders"),)
    lost = SimpleNamespace(covariance=None, evidence=Evidence(checks, ()))
    told = _without_errors([lost, lost])
    assert told is not None
    assert told.found == "inputs foretell errors"
    assert told.action == "raise the orders"
    assert _without_errors([lost, SimpleNamespace(covariance=np.eye(2))]) is None
    assert _without_errors([fid.load_model("rate_motor_lag", axis="roll")]) is None


def test_records_alone_hold_no_gains() -> None:
    class Model:
        inputs, outputs = ("tau_phi",), ("p",)

    class Item:
        class fit:  # noqa: N801
            model = Model()

        verifications: dict[str, object] = {}  # noqa: RUF012

    with pytest.raises(StudyError, match="cannot be tuned without the log"):
        tune_models([Item()], None, TuneSettings())  # type: ignore[list-item]
    assert tune_models([], None, TuneSettings()) is None


def test_gains_without_any_model_say_that_there_is_none() -> None:
    """And not that models have several inputs."""
    asked = ControllerOptions(controller="pi_d")
    with pytest.raises(StudyError, match="no model was made, so no gains"):
        _controllers([], asked, None)  # type: ignore[arg-type]


def test_limits_are_proposed_from_measured_samples_of_steps_that_ring(tmp_path: Path) -> None:
    noise = np.random.default_rng(3)
    time_s = 0.02 * np.arange(1500) + 4e-4 * noise.standard_normal(1500)
    u = np.repeat(noise.choice([-2.0, -1.0, 0.5, 2.0], 60), 25)
    u[1300:] *= 3.0
    rows = np.column_stack([time_s, u, np.roll(u, 1)])
    path = tmp_path / "rig.csv"
    np.savetxt(path, rows, delimiter=",", header="time,u [V],y", comments="")
    file = RecordFile(
        name="fit", path=(path.name,), paths=(path,), resample_to_s=0.02, span_s=(1.0, 20.0)
    )
    records = load_records(file, {"u": Role.INPUT, "y": Role.OUTPUT})
    items: Any = [SimpleNamespace(training=(), unfitted=records)]
    # On the new grid they ring beyond what was measured; beyond the span the steps are larger.
    low, high = input_ranges(items)["u"]
    assert low < -2.05
    assert high > 2.05
    assert input_ranges(items, [file]) == {"u": (-2.0, 2.0)}
    items[0].unfitted = [each.to_units(u="mV") for each in records]
    assert input_ranges(items, [file]) == {"u": (-2000.0, 2000.0)}
    # What was done to an input afterwards is told as it stands.
    items[0].unfitted = [flip_sign(each, ["u"]) for each in records]
    assert input_ranges(items, [file]) == input_ranges(items)
