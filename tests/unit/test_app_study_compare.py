"""Two studies side by side on the page: which runs are taken, and what is said of them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from fastapi import HTTPException

import flightid as fid
from flightid.app.rigs import FOLDER
from flightid.app.run_schemas import RunPart
from flightid.app.studies import Studies
from flightid.app.study_compare_routes import _ran
from flightid.app.study_compare_work import make_study_comparison
from flightid.app.study_edits import etag_of, parts_of
from flightid.app.workspace import Workspace
from flightid.errors import ModelError
from flightid.models.saved_files import MODELS
from flightid.study.output import WRITTEN
from tests.sweep_log import SweepFlight

STUDY = (
    '[study]\ntitle = "t"\naircraft = "a"\n'
    '[[record]]\nname = "r"\npath = "../records/{rig}/a.csv"\n'
    '[[model]]\nname = "m"\nstructure = "oe"\ninputs = ["u"]\noutputs = "y"\n'
    'identify = "r"\nnb = 1\nnf = 1\nnk = 1\n'
)
RIG = "a" * 16
PID = (
    '[[controller]]\noutput = "p"\ninput = "tau_phi"\nform = "parallel"\n'
    "sample_time_s = 0.0025\nKp = {Kp}\n"
)


def _results(folder: Path, Lp: float, Kp: float = 0.0) -> Path:
    (folder / MODELS).mkdir(parents=True)
    model = fid.load_model("rate_first_order", axis="roll").with_values({"Ltphi": 40.0, "Lp": Lp})
    fid.write_model(model, folder / MODELS / "roll.toml")
    (folder / WRITTEN).write_text("{}")
    if Kp:
        (folder / "controller.toml").write_text(PID.format(Kp=Kp))
    return folder


def test_parameters_modes_and_margins_of_both_are_told(tmp_path: Path) -> None:
    both = {"monday": _results(tmp_path / "a", -4.0), "friday": _results(tmp_path / "b", -5.0)}
    (section,) = make_study_comparison(both)["sections"]
    parameters, modes = [each for each in section["blocks"] if each["kind"] == "table"]
    (row,) = [each for each in parameters["rows"] if each[0] == "Lp"]
    assert row[2:5] == [-4.0, -5.0, 1.25]
    assert modes["title"] == "Modes, monday and friday"
    tuned = {
        "before": _results(tmp_path / "c", -4.0, Kp=0.1),
        "after": _results(tmp_path / "d", -4.0, Kp=0.2),
    }
    (section,) = make_study_comparison(tuned)["sections"]
    assert section["title"] == "roll"
    *_, margins, picture = section["blocks"]
    assert margins["title"] == "Margins, before and after"
    assert picture["kind"] == "figure"


def test_a_refusal_names_no_path_of_this_machine_and_nothing_the_page_cannot_do(
    tmp_path: Path,
) -> None:
    both = {"monday": _results(tmp_path / "a", -4.0), "friday": _results(tmp_path / "b", -5.0)}
    model = fid.load_model("rate_first_order", axis="yaw").with_values({"Ntpsi": 4.0, "Nr": -1.0})
    (both["friday"] / MODELS / "roll.toml").unlink()
    fid.write_model(model, both["friday"] / MODELS / "yaw.toml")
    with pytest.raises(ModelError, match="fit again") as told:
        make_study_comparison(both)
    assert "monday: roll (p of tau_phi); friday: yaw (r of tau_psi)" in str(told.value)
    assert str(tmp_path) not in str(told.value)
    assert "name the files" not in str(told.value)


def test_a_log_without_a_model_is_not_told_to_write_a_study(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    backstage: Any = SimpleNamespace(workspace=workspace, studies=Studies(workspace))
    log = SweepFlight(sweep_s=5.0, rate_hz=50.0).write(tmp_path)
    workspace.scan()
    (known,) = workspace.index.entries()
    with pytest.raises(HTTPException, match="Its screen Flight says what it lacks") as told:
        _ran(backstage, known.id)
    assert log.name in str(told.value.detail)


def test_a_run_that_is_not_there_or_is_planted_is_named(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    backstage: Any = SimpleNamespace(workspace=workspace, studies=Studies(workspace))

    def refused() -> str:
        with pytest.raises(HTTPException) as told:
            _ran(backstage, RIG)
        return str(told.value.detail)

    assert "no such log or records" in refused()
    (tmp_path / FOLDER / RIG).mkdir(parents=True)
    (tmp_path / FOLDER / RIG / "a.csv").write_text("t,u,y\n0,1,2\n1,0,3\n")
    assert "a.csv has no study" in refused()
    text = STUDY.format(rig=RIG)
    study = workspace.study_path(RIG)
    study.parent.mkdir(exist_ok=True)
    study.write_text(text)
    assert "was not run yet" in refused()
    folder = workspace.result_path(RIG, "run.json").parent / f"run-{'b' * 16}"
    part = RunPart(etag=etag_of(text), parts=parts_of(text), folder=folder.name, title="t",
                   verdict="green", tally="", seconds=1.0, figures=0, sections=[])  # fmt: skip
    workspace.keep_result(RIG, "run", part.model_dump())
    assert "is gone" in refused()
    _results(folder, -4.0)
    assert _ran(backstage, RIG) == ("a.csv", folder, False)
    study.write_text(f"{text}[tune]\npreset = 'firm'\n")
    assert not _ran(backstage, RIG)[2], "no model rests on gains"
    study.write_text(text.replace("nb = 1", "nb = 2"))
    assert _ran(backstage, RIG)[2]
    (folder / MODELS).rename(tmp_path / "elsewhere")
    (folder / MODELS).symlink_to(tmp_path / "elsewhere")
    assert "is gone" in refused()
