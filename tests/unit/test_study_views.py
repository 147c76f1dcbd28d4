"""Filters to try and fields to plot as keys of a study: the page's numbers, and refusals."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

import flightid as fid
from flightid.app import compare_work, filter_work, work
from flightid.app.compare_schemas import PlanWishes
from flightid.app.plot_layouts import keep_layout
from flightid.app.plot_schemas import PlotLayout
from flightid.app.pyramid import Pyramid
from flightid.app.study_edits import KeyEdit, edited, parts_of
from flightid.app.workspace import Workspace
from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.findings import Finding
from flightid.review.next_step import FlownStep
from flightid.study.faults import Faults
from flightid.study.settings import read_settings
from flightid.study.stage_runner import StageRunner
from flightid.study.views import view_log
from tests.unit.test_filter_review import _write

ASKED = {"INS_GYRO_FILTER": 25.0, "INS_HNTCH_ENABLE": 1.0}
PLAN = {"axes": ["roll"], "amplitude": 0.05}
SERIES = ["GYR.GyrX", "=GYR.GyrX - GYR.GyrY", "NOT.There"]
BARE = '[study]\ntitle = "Shaken"\n[log]\npath = "shaken.bin"\n'


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As clicks of the page write it."""
    folder = tmp_path_factory.mktemp("views")
    _write(folder / "shaken.bin", tone=0.6, white=0.01, esc=False)
    clicks = [
        KeyEdit(("filters",), {"parameters": ASKED}),
        KeyEdit(("plot",), [{"series": SERIES}, {"layout": "../plots/rates.toml"}]),
        KeyEdit(("plan",), PLAN),
    ]
    workspace = Workspace(folder.parent)
    keep_layout(workspace, PlotLayout(name="rates", panes=[["GYR.GyrZ"], ["=-GYR.GyrZ"]]))
    (folder / "study.toml").write_text(edited(BARE, clicks), encoding="utf-8")
    return folder / "study.toml"


def test_keys_of_a_study_give_the_numbers_of_the_page(study: Path, tmp_path: Path) -> None:
    log = study.parent / "shaken.bin"
    settings, runner = read_settings(study), StageRunner()
    opened = runner.stage("log", fid.read_log, log)
    tried, plots, plan = view_log(settings.views, opened, runner, Faults(), tmp_path)
    page = filter_work.try_filters(log, ASKED)
    assert tried is not None
    for mine, shown in zip(tried.axes, page["axes"], strict=True):
        numbers = mine.phase_edited_deg, 100.0 * mine.noise_edited
        assert numbers == (shown["phase_edited_deg"], shown["noise_edited_percent"])
    assert [f.message for f in tried.findings] == [each["message"] for each in page["findings"]]
    assert len(page["files"]) == 2
    for file in page["files"]:
        assert (tmp_path / file["name"]).read_text("utf-8") == file["text"]
    # A formula of fields, as the page draws it; what the log lacks is named, and the others stand.
    plot, *panes = plots
    # A layout that the page keeps is named, and brings its panes.
    assert [[each.name for each in pane.series] for pane in panes] == [["GYR.GyrZ"], ["-GYR.GyrZ"]]
    # The plan of the page, with its files.
    shown = compare_work.make_plan(log, PlanWishes.model_validate(PLAN).given())
    assert plan is not None
    assert [each.axis for each in plan.sweeps] == ["roll"]
    assert [each.amplitude for each in plan.sweeps] == [e["amplitude"] for e in shown["rows"]]
    assert plan.sweeps[0].amplitude == pytest.approx(0.05)
    assert plan.verdict == shown["verdict"]
    worst = [each["message"] for each in shown["findings"] if each["light"] == shown["light"]]
    assert shown["why"] == ("" if shown["light"] == "green" else worst[0])
    assert not any(each["untold"] for each in shown["rows"])
    written = {path.name: path.read_text("utf-8") for path in (tmp_path / "plan").iterdir()}
    assert written.keys() == {"card.html", *(each["name"] for each in shown["files"])}
    assert all(written[each["name"]] == each["text"] for each in shown["files"])
    unit = work.make_formula(log, "GYR.GyrX - GYR.GyrY", tmp_path / "levels.npy")
    assert [each.name for each in plot.series] == ["GYR.GyrX", "GYR.GyrX - GYR.GyrY"]
    assert plot.series[1].unit == unit
    drawn = Pyramid.read(tmp_path / "levels.npy")
    np.testing.assert_array_equal(plot.series[1].values, drawn.values)
    assert "NOT" in plot.findings[0].message
    # Neither models nor gains rest on them.
    before, after = (parts_of(each) for each in (BARE, study.read_text("utf-8")))
    assert (before.models, before.gains) == (after.models, after.gains)
    assert before.views != after.views


@pytest.mark.slow
def test_a_run_reports_filters_and_fields(study: Path) -> None:
    ran = fid.run_study(study)
    told = json.loads((ran.output / "results.json").read_text("utf-8"))
    page = filter_work.try_filters(study.parent / "shaken.bin", ASKED)
    assert told["plots"][0]["rows"][1]["field"] == "GYR.GyrX - GYR.GyrY"
    assert told["tried"]["axes"][0]["phase_edited_deg"] == page["axes"][0]["phase_edited_deg"]
    text = (ran.output / "report.txt").read_text("utf-8")
    assert "Filters tried" in text
    assert "GYR.GyrX - GYR.GyrY" in text
    assert {each["name"] for each in page["files"]} <= {p.name for p in ran.output.iterdir()}


@pytest.mark.parametrize(
    ("said", "refusal"),
    [
        ("[[plot]]\nseries = []", "a plot shows nothing"),
        ('[[plot]]\nseries = ["Roll"]', "names no field of a log"),
        ('[[plot]]\nseries = ["= ATT.Roll +"]', "no formula of fields"),
        ("[filters]\nparameters = { A = 'b' }", "parameters"),
        ("[filters]", "parameters"),
        ('[[plot]]\nseries = ["ATT.Roll"]\nlayout = "a.toml"', "series and a layout"),
        ('[plan]\nvehicle = "heli"', "vehicle is the log's to tell"),
        ("[plan]\namplitude = -1.0", "amplitude"),
    ],
)
def test_a_study_refuses_views_that_name_nothing(tmp_path: Path, said: str, refusal: str) -> None:
    study = tmp_path / "study.toml"
    head = '[study]\ntitle = "A"\n'
    study.write_text(f'{head}[log]\npath = "a.bin"\n{said}\n', encoding="utf-8")
    with pytest.raises(FlightidError, match=refusal):
        read_settings(study)
    study.write_text(f'{head}[[record]]\nname = "a"\npath = "a.csv"\n{said}\n', encoding="utf-8")
    with pytest.raises(FlightidError, match="of a log, and there is none"):
        read_settings(study)


def test_the_page_says_what_a_comparison_left_to_fly_as_the_command_does(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Twenty numbers as promised, one loop not judged: nothing "of it could be judged", it said."""
    log: Any = SimpleNamespace(sid_runs=[1])
    monkeypatch.setattr(compare_work, "kept_log", lambda _: log)
    monkeypatch.setattr(compare_work, "inspect_log", lambda _: "inspected")
    monkeypatch.setattr(compare_work, "carried_axes", {"inspected": ("roll",)}.__getitem__)
    action = "fly a minute of quick moves of the roll stick by 13 deg at once"
    beyond = Finding("beyond", Light.UNKNOWN, "roll attitude: not compared", f"{action}, and …")
    loop = SimpleNamespace(name="roll attitude", action=action)
    made: Any = SimpleNamespace(
        findings=(Finding("promise-kept", Light.GREEN, "20 numbers"), beyond),
        kept=None, changes=(), before=(loop,), after=(loop,), set_otherwise=(),
    )  # fmt: skip
    step = FlownStep(tmp_path / "gains-1.param", tmp_path / "gains-2.param", None)
    *_, left, last = compare_work._with_next(made, step, tmp_path / "step-1.bin")
    assert left.action == ""
    assert last.message == (
        "step-1.bin flew gains-1.param; what was judged is as promised, not judged: roll attitude"
    )
    assert last.action.startswith(f"load gains-1.param and {action}; then drop its log here")
    made.set_otherwise = ("INS_GYRO_FILTER",)
    *_, last = compare_work._with_next(made, step, tmp_path / "step-1.bin")
    assert last.action.startswith("set INS_GYRO_FILTER as before and fly gains-1.param again")


def test_a_table_more_takes_no_comment_from_the_one_below() -> None:
    below = "\n# Windows are chosen\n# by the record.\n[response]\nn_omega = 60\n"
    text = f"[[segment]]\nname = 'a'\n# of a\n{below}"
    more = KeyEdit(("segment", 1), {"name": "b", "span_s": [1.0, 2.0]})
    made = edited(text, [more])
    assert made.endswith(f'name = "b"\nspan_s = [1.0, 2.0]\n{below}')
    assert made.startswith("[[segment]]\nname = 'a'\n# of a\n\n[[segment]]\n")
    inner = f"[[model]]\nname = 'a'\n[model.response]\nn_omega = 9\n{below}"
    made = edited(inner, [KeyEdit(("model", 1), {"name": "b"})])
    assert made.endswith(f'[[model]]\nname = "b"\n{below}')
