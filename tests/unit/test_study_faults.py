"""A fault behind the fits of a study costs its own part alone, and is named."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run as command
from flightid.progress import shown_by
from flightid.study import document, model_section, uses
from flightid.study.settings import Settings, read_settings
from flightid.study.stage_runner import StageRunner
from flightid.study.taking import take
from flightid.study.task import load_task

MODEL = """
kind = "state-space"
name = "Template"
[states]
p = "rad/s"
[inputs]
lat = "rad"
[outputs]
p = "p"
[parameters]
L0 = { value = 0.0, unit = "1/s^2", status = "fixed" }
Lp = { value = -2.0, unit = "1/s" }
Lq = { value = 0.1, unit = "1/s" }
Llat = { value = 4.0, unit = "1/s^2" }
[equations]
"p'" = "(Lp + Lq)*p + Llat*lat"
"""
REFERENCE = MODEL.replace("{ value = 0.1,", "{ value = 0.0,")
STUDY = """
[study]
title = "Roll"
[fit]
method = "output_error"
[[record]]
name = "a"
path = "a.csv"
hold = "zero"
[[model]]
name = "Roll"
template = "roll.toml"
reference = "reference.toml"
identify = "a"
[model.parameters]
Lp = { value = -2.0, free = false }
[[loop]]
name = "Damper"
model = "Roll"
gains = { lat = { p = 0.1 } }
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    rng = np.random.default_rng(0)
    lat = np.repeat(rng.choice([-0.1, 0.1], 40), 10)
    p = np.zeros(400)
    for k in range(399):
        p[k + 1] = np.exp(-0.04) * p[k] + 2.0 * (1.0 - np.exp(-0.04)) * lat[k]
    p += 0.002 * rng.standard_normal(400)
    rows = [f"{0.02 * k:.2f},{lat[k]},{p[k]}" for k in range(400)]
    (tmp_path / "a.csv").write_text("\n".join(["time [s],lat [rad],p [rad/s]", *rows]), "utf-8")
    (tmp_path / "roll.toml").write_text(MODEL, "utf-8")
    (tmp_path / "reference.toml").write_text(REFERENCE, "utf-8")
    (tmp_path / "study.toml").write_text(STUDY, "utf-8")
    return tmp_path


def test_a_reference_of_zero_ends_no_study(folder: Path) -> None:
    labels: list[str] = []

    def display(label: str, _: int | None) -> SimpleNamespace:
        labels.append(label)
        return SimpleNamespace(advance=lambda *_: None, close=lambda: None)

    with shown_by(display):
        made = fid.run_study(folder / "study.toml")
    # A run goes by the title of its study: the page's files are named by numbers.
    assert labels[0] == made.document.title
    assert not made.faults
    assert "Where that is zero, in percent of the estimate" in str(made.document.sections[0])
    assert (made.output / "report.html").is_file()
    written = fid.load_model(made.output / "models" / "roll.toml")
    assert written.name == "Roll"


def broken(*_: object, **__: object) -> object:
    raise ZeroDivisionError("a planted fault")


def test_a_picture_that_fails_costs_its_section_alone(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(document, "parameter_intervals", broken)
    monkeypatch.setattr(model_section, "modes_blocks", broken)
    monkeypatch.setattr(document, "closed_loop_section", broken)
    assert command(["--quiet", "run", str(folder / "study.toml"), "--all"]) == 1
    text = capsys.readouterr().out
    for name in ("“Result”", "“Modes and derivatives”", "“Damper”"):
        assert f"{name} could not be made: ZeroDivisionError: a planted fault" in text
    assert "Parameters" in text
    assert (folder / "study-output" / "models" / "roll.toml").is_file()


def test_a_use_that_fails_costs_itself_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uses, "close_loop", broken)
    made = fid.run_study(folder / "study.toml")
    assert [each.code for each in made.faults] == ["part-failed"]
    assert "loop “Damper” could not be made" in made.faults[0].message
    results = json.loads((made.output / "results.json").read_text("utf-8"))
    assert results["faults"][0]["light"] == "red"
    assert results["uses"]["files"] == {"Roll": "models/roll.toml"}


@pytest.mark.usefixtures("no_report")
def test_outputs_free_a_model_from_the_other_columns(folder: Path) -> None:
    with_load = MODEL.replace(
        'p = "p"\n[par', 'p = "p"\nay = { expression = "p*3", unit = "1/s" }\n[par'
    )
    assert with_load != MODEL
    (folder / "roll.toml").write_text(with_load, "utf-8")
    with pytest.raises(fid.FlightidError, match="ay"):
        fid.run_study(folder / "study.toml", output=folder / "all")
    told = STUDY.replace('identify = "a"', 'identify = "a"\noutputs = ["p"]')
    (folder / "study.toml").write_text(told, "utf-8")
    made = fid.run_study(folder / "study.toml")
    assert made.identified[0].fit.model.outputs == ("p",)


def test_all_errors_of_a_study_file_are_told_at_once(folder: Path) -> None:
    wrong = STUDY.replace('path = "a.csv"', 'pth = "a.csv"').replace("reference", "refrence", 1)
    (folder / "study.toml").write_text(wrong.replace("gains =", "gain ="), "utf-8")
    with pytest.raises(fid.errors.StudyError, match="the study file has 3 errors") as raised:
        fid.run_study(folder / "study.toml")
    for said in ("[[record]] number 1: there is no key 'pth'", "'refrence'", "write 'gains'"):
        assert said in str(raised.value)
    # A model is not judged by a table that could not be read.
    (folder / "study.toml").write_text(STUDY.replace('"output_error"', '"magic"'), "utf-8")
    with pytest.raises(fid.errors.StudyError, match="magic") as raised:
        fid.run_study(folder / "study.toml")
    assert "band_rad_s" not in str(raised.value)
    missing = STUDY.replace("roll.toml", "rol.toml").replace("a.csv", "b.csv")
    (folder / "study.toml").write_text(missing, "utf-8")
    with pytest.raises(fid.errors.StudyError, match="has 2 errors") as raised:
        fid.run_study(folder / "study.toml")
    assert "the file of record 'a' is not there" in str(raised.value)


@pytest.mark.usefixtures("no_report")
def test_what_holds_for_all_records_is_said_once(folder: Path) -> None:
    told = STUDY.replace("[[record]]", '[defaults.record]\nunits = { p = "rad/s" }\n[[record]]')
    settings = study_settings(folder, told.replace('hold = "zero"\n', ""))
    assert settings.record_files[0].units == {"p": "rad/s"}
    both = told.replace('hold = "zero"', 'hold = "first"\nunits = { lat = "rad" }')
    settings = study_settings(
        folder, both.replace("[defaults.record]", '[defaults.record]\nhold = "zero"')
    )
    assert settings.record_files[0].units == {"p": "rad/s", "lat": "rad"}
    assert settings.record_files[0].shape.hold == "first"
    with pytest.raises(fid.errors.StudyError, match="there is no key 'colour'"):
        study_settings(folder, told.replace("units =", "colour = 1\nunits ="))


def study_settings(folder: Path, text: str) -> Settings:
    (folder / "study.toml").write_text(text, "utf-8")
    return read_settings(folder / "study.toml")


def test_a_pattern_stands_for_all_files_that_match(folder: Path) -> None:
    (folder / "a2.csv").touch()
    (record,) = study_settings(folder, STUDY.replace('"a.csv"', '"a*.csv"')).record_files
    assert [path.name for path in record.paths] == ["a.csv", "a2.csv"]
    with pytest.raises(fid.errors.StudyError, match="path matches no file"):
        study_settings(folder, STUDY.replace('"a.csv"', '"z*.csv"'))


@pytest.mark.nightly
@pytest.mark.usefixtures("no_report")
def test_one_record_may_stand_for_several_files(folder: Path) -> None:
    (folder / "a2.csv").write_bytes((folder / "a.csv").read_bytes())
    (folder / "study.toml").write_text(STUDY.replace('"a.csv"', '"a*.csv"'), "utf-8")
    made = fid.run_study(folder / "study.toml")
    assert list(made.records) == ["a: a", "a: a2"]
    assert len(made.identified[0].fit.records) == 2
    assert {"a.csv", "a2.csv"} <= set(made.files)


@pytest.mark.usefixtures("no_report")
def test_data_compatibility_is_checked_and_applied(folder: Path) -> None:
    time_s = 0.02 * np.arange(1000)
    bias = 0.02
    rows = [f"{t:.2f},0,{np.cos(t) + bias},0,0,{np.sin(t)},0" for t in time_s]
    heading = "time,lat [rad],p [rad/s],q [rad/s],r [rad/s],phi [rad],theta [rad]"
    (folder / "b.csv").write_text("\n".join([heading, *rows]), "utf-8")
    step = '[[conditioning]]\nconsistency = { estimate = ["bias_p"], apply = true }\n[[model]]'
    text = STUDY.replace("[[model]]", step).replace("a.csv", "b.csv")
    settings = study_settings(folder, text)
    task = load_task(settings.models[0])
    taken = take(settings, [task], None, folder, StageRunner())
    found = taken.checks["a"].parameters["bias_p"].value
    assert abs(found - bias) < 1e-3
    (record,) = taken.records["a"].value
    assert abs(np.mean(record["p"] - np.cos(time_s))) < 1e-3
    assert command(["--quiet", "consistency", str(folder / "b.csv"), "--estimate", "bias_p"]) == 0
