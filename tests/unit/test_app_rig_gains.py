"""Gains of a rig on the local page: a PID of its own, as `flightid tune STUDY` gives it."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

pytest.importorskip("fastapi", reason="the extra app is not installed")

from flightid import run_study
from flightid.app import gain_work
from flightid.app.gain_work import _margins
from flightid.app.study_edits import KeyEdit, edited
from flightid.control.tuning.worst_cases import WorstCase
from flightid.errors import OptionError
from flightid.export.gains import write_gains
from flightid.uncertainty.estimate import Estimate

STUDY = """
[study]
title = "A rig"

[[record]]
name = "fit"
path = "../records/rig.csv"

[[model]]
name = "Speed"
structure = "oe"
nb = 1
nf = 1
nk = 1
identify = ["fit"]
inputs = "u"
outputs = "y"

[[model]]
name = "Both"
structure = "oe"
nb = 1
nf = 1
nk = 1
identify = ["fit"]
inputs = ["u", "v"]
outputs = "z"
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rig")
    for name in ("records", "studies"):
        (folder / name).mkdir()
    noise = np.random.default_rng(2)
    u, v = (np.repeat(noise.integers(0, 2, 150), 10) * 2.0 - 1.0 for _ in range(2))
    y = lfilter([0.0, 0.2], [1.0, -0.9], u) + 0.01 * noise.standard_normal(1500)
    z = lfilter([0.0, 0.1], [1.0, -0.8], u + v) + 0.01 * noise.standard_normal(1500)
    rows = np.column_stack([np.arange(1500) * 0.02, u, v, y, z])
    np.savetxt(folder / "records" / "rig.csv", rows, delimiter=",", header="time,u,v,y,z",
               comments="")  # fmt: skip
    path = folder / "studies" / "rig.toml"
    path.write_text(STUDY)
    return path


@pytest.mark.parametrize(
    ("start", "first"),
    [
        (STUDY, [KeyEdit(("tune", "controller"), "pi_d")]),
        ('[study]\ntitle = "A flight"\n[log]\npath = "a.bin"\n', []),
    ],
)
def test_the_first_slider_that_is_moved_keeps_the_plants(start: str, first: list[KeyEdit]) -> None:
    """It writes the table [tune]; plants were worked out anew for that."""
    moved = edited(start, [*first, KeyEdit(("tune", "by_hand"), {"Kp": 1.0})])
    back = edited(moved, [KeyEdit(("tune", "by_hand"), None)])
    assert gain_work.plants_key(start) == gain_work.plants_key(moved) == gain_work.plants_key(back)
    for other in (KeyEdit(("tune", "preset"), "firm"), KeyEdit(("tune", "controller"), "pi")):
        assert gain_work.plants_key(edited(moved, [other])) != gain_work.plants_key(moved)


@pytest.mark.slow
def test_a_rig_has_the_controller_that_the_command_gives_it(study: Path, tmp_path: Path) -> None:
    gain_work.make_gains(study, tmp_path)
    version = gain_work.gains_version(study, STUDY)
    (kept,) = tmp_path.glob(f"gains-{version}*")
    told = json.loads(kept.read_text())
    # Of the model of two inputs no loop was chosen: that of one is closed, all are offered.
    (axis,) = told["axes"]
    assert (axis["axis"], told["loops"]) == ("y", ["y/u", "z/u", "z/v"])
    ran = run_study(study, output=tmp_path / "out", tune={"controller": "pi_d"}).tuning
    assert ran is not None
    assert {each["name"]: each["value"] for each in axis["sliders"]} == ran["y"].gains
    (tmp_path / "own").mkdir()
    written = {
        path.name: path.read_text()
        for end in ("toml", "c")
        for path in write_gains(ran, tmp_path / "own" / f"gains.{end}")
    }
    assert {each["name"]: each["text"] for each in told["files"]} == written
    assert written.keys() == {"gains.toml", "gains.c", "gains.h"}
    worst = ran["y"].worst_case("loop", "phase margin")
    (row,) = [each for each in axis["margins"] if each["name"] == "phase margin"]
    assert (row["nominal"], row["worst"]) == (worst.nominal, worst.shown_worst[0])
    # Gains by hand are a key of the study as well; the records tell what its input went through.
    by_hand = {"Kp": 1.0, "Ki": 2.0, "Kd": 0.0}
    asked = edited(STUDY, [KeyEdit(("tune", "by_hand"), by_hand)])
    (held,) = gain_work.gains_of(study, asked).axes
    tune = {"controller": "pi_d", "by_hand": by_hand}
    again = run_study(study, output=tmp_path / "out", tune=tune).tuning
    assert again is not None
    assert [each["message"] for each in held.model_dump()["findings"]] == [
        each.message for each in again["y"].findings
    ]
    assert {each.name: each.value for each in held.sliders} == by_hand
    assert [each.found for each in held.sliders] == [*ran["y"].gains.values()]
    assert told["ranges"]["u"] == [-1.0, 1.0]
    (said,) = [each for each in axis["findings"] if each["code"] == "limits-untold"]
    assert "in the records u went from -1 to 1" in said["message"]
    with pytest.raises(OptionError, match="a loop that is not closed"):
        gain_work.gains_of(study, edited(STUDY, [KeyEdit(("tune", "by_hand"), {"z/Kp": 1.0})]))
    # Each choice of the form is a key of the study; another loop of the same file.
    clicks = [
        KeyEdit(("tune", "controller"), "pi"),
        KeyEdit(("tune", "loops"), ["z/v"]),
        KeyEdit(("tune", "output_high"), 2.0),
    ]
    (other,) = gain_work.gains_of(study, edited(STUDY, clicks)).axes
    assert (other.axis, [each.name for each in other.sliders]) == ("z", ["Kp", "Ki"])


@pytest.mark.slow
def test_loops_of_several_inputs_are_chosen_before_anything_is_tuned(study: Path) -> None:
    alone = STUDY[: STUDY.index("[[model]]")] + STUDY[STUDY.rindex("[[model]]") :]
    told = gain_work.gains_of(study, alone)
    assert (told.axes, told.loops) == ([], ["z/u", "z/v"])
    assert told.refusal.startswith("choose the loops to close")


def test_a_requirement_without_a_number_has_its_reason() -> None:
    """It binds as others do: a row of it was left out where the estimate has no crossing."""
    none = Estimate("loop: gain margin", None, "dB", None, "no crossing in the band of the loop")
    moved: Any = SimpleNamespace(
        worst_cases=[WorstCase("loop", "gain margin", none, None, None, None, "≥ 6")]
    )
    (row,) = _margins(moved)
    assert (row.required, row.nominal, row.untold) == ("≥ 6", None, none.reason)
