"""Axes beside those that are tuned: not swept is no failure, swept without a model is one."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import flightid as fid
from flightid.cli import proposals
from flightid.control.autopilots import axis_loop
from flightid.control.tuning.result import UntouchedAxis
from flightid.conventions import Light
from flightid.findings import Finding, worst
from flightid.study.gain_answer import gains_finding
from flightid.study.other_axes import with_other_axes
from flightid.study.stage_runner import StageResult

GUSTS = "what was injected explains too little of the rate"


@pytest.fixture(scope="module")
def yaw() -> fid.Tuning:
    plant = fid.load_model("rate_integrator", axis="yaw").with_values({"Ntpsi": 40.0, "tau": 0.03})
    made = fid.tune(
        {"yaw": plant},
        gains={"yaw": axis_loop("arducopter", "yaw", loop_rate_hz=400.0)},
        nominal=True,
        angle_loop=False,
        band_rad_s=(0.5, 60.0),
        requirements=fid.TuningRequirements(noise_growth=None),
        draws=8,
    )
    others = tuple(UntouchedAxis(axis, "no model of it") for axis in ("roll", "pitch"))
    return dataclasses.replace(made, untouched=others)


def _log(swept: str = "", reason: str = "", action: str = "") -> Any:
    """As inspected: a sweep of the axes that are named, whose band is missing for a reason."""
    bands = [
        SimpleNamespace(
            axis=axis, input="tau", span=0.0 if reason else 30.0, reason=reason,
            band_rad_s=None if reason else (1.0, 30.0),
        )
        for axis in ("roll", "pitch", "yaw")
    ]  # fmt: skip
    flown = [
        SimpleNamespace(axis=axis, kind="sid", is_sweep=True) for axis in ("yaw", *swept.split())
    ]
    judged = [Finding("no-band-roll", Light.AMBER, "roll: no usable band", action)]
    return SimpleNamespace(bands=bands, excitations=flown, findings=judged)


def _told(tuning: fid.Tuning, log: Any, *models: Any) -> fid.Tuning:
    staged = [StageResult(each, "") for each in models]
    made = with_other_axes(StageResult(tuning, ""), StageResult(log, ""), staged)
    assert made is not None
    return made


def test_axes_that_nobody_swept_are_told_and_are_no_failure(
    yaw: fid.Tuning, tmp_path: Path
) -> None:
    made = _told(yaw, _log())
    told = "roll, pitch: not swept, gains left as flown"
    assert made.refused == ()
    assert worst(made.findings) is worst(dataclasses.replace(made, untouched=()).findings)
    assert [str(each) for each in made.findings][-1] == f"[green] {told}"
    assert told in str(made.summary())
    path, *_ = made.write(tmp_path / "gains.param")
    assert f"# {told}\n" in path.read_text("utf-8"), "nobody who loads it knew of the others"
    assert gains_finding(made, "study.toml").message.endswith(f"; {told}")
    beside = made.to_dict()["untouched"]
    assert beside == [{"axis": axis, "reason": "not swept"} for axis in ("roll", "pitch")]


def test_an_axis_that_was_swept_in_vain_is_red(yaw: fid.Tuning, tmp_path: Path) -> None:
    made = _told(yaw, _log("roll", GUSTS, "sweep harder"))
    (red,) = made.refused
    assert red.finding.light is Light.RED
    assert red.reason == f"it was swept, but carries no model: {GUSTS}"
    assert red.action == "sweep harder"
    assert [each.axis for each in made.untouched] == ["pitch"]
    path, *_ = made.write(tmp_path / "gains.param")
    assert f"# roll is not in this file, its gains stay as flown: {red.reason}" in path.read_text()
    # A sweep that carries a model which the study leaves out is a choice.
    chosen = _told(yaw, _log("roll"))
    assert chosen.refused == ()
    assert [each.reason for each in chosen.untouched] == [
        "no model of it in this study",
        "not swept",
    ]


def test_a_model_that_could_not_be_fitted_is_red(yaw: fid.Tuning) -> None:
    why = Finding("model-refused", Light.RED, "not identified: no coherence", "fly longer")
    lost: Any = SimpleNamespace(settings=SimpleNamespace(axis="pitch"), fit=None, left_out=(why,))
    made = _told(yaw, _log("pitch"), lost)
    assert [(e.axis, e.reason, e.action) for e in made.refused] == [
        ("pitch", why.message, why.action)
    ]


def test_what_was_not_swept_has_no_light_on_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    axes = ("pitch", "yaw")
    calm = [
        Finding("not-swept", Light.GREEN, f"{axis}: no model, no sweep", "fly") for axis in axes
    ]
    failed = Finding("no-model", Light.RED, "roll: no model, the band is narrow")
    made: Any = SimpleNamespace(said=(), findings=(failed, *calm))
    proposals.note_of(made)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["red: roll: no model, the band is narrow", "pitch, yaw: no model, no sweep"]
