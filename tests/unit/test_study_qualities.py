"""Handling qualities in studies, and closed loops in reports."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import StudyError
from flightid.report.closed_loop import closed_loop_section
from flightid.report.content import Document, Figure, TableBlock
from flightid.report.html import to_html
from flightid.study.settings import read_settings

TRUTH = fid.load_model("attitude_first_order", axis="roll")
STUDY = """
[study]
title = "Roll"
[[record]]
name = "steps"
path = "roll.csv"
[fit]
method = "output_error"
[[model]]
name = "Roll"
template = "attitude_first_order"
axis = "roll"
identify = "steps"
[handling_qualities]
band_rad_s = [0.5, 60.0]
task = "tracking"
"""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    rng = np.random.default_rng(3)
    time_s = np.arange(1200) / 50
    command = 0.02 * np.repeat(np.sign(rng.standard_normal(60)), 20)
    blank = fid.Record.from_arrays(
        time_s, inputs={"tau_phi": command}, outputs={"phi": np.zeros(1200)}
    )
    phi = fid.simulate(TRUTH, blank)["phi"] + 1e-4 * rng.standard_normal(1200)
    rows = ["time [s],tau_phi [1],phi [rad]"]
    rows += [",".join(map(repr, map(float, row))) for row in zip(time_s, command, phi, strict=True)]
    (tmp_path / "roll.csv").write_text("\n".join(rows), encoding="utf-8")
    return written(tmp_path, STUDY)


def written(folder: Path, text: str) -> Path:
    path = folder / "roll.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_study_rates_its_fits(study: Path) -> None:
    found = fid.run_study(study)
    rated = found.qualities["Roll"]
    truth = fid.handling_qualities(TRUTH, band_rad_s=(0.5, 60.0), task="tracking")
    bandwidth, true = rated.bandwidths["roll"].bandwidth, truth.bandwidths["roll"].bandwidth
    assert bandwidth.interval95 is not None
    assert true.value is not None
    assert bandwidth.value == pytest.approx(true.value, rel=0.05)
    assert rated.conditions == {"speed": "hover", "task": "tracking", "attention": "full"}
    assert "Handling qualities of “Roll”" in (found.output / "report.txt").read_text("utf-8")
    results = json.loads((found.output / "results.json").read_text("utf-8"))
    assert results["handling_qualities"]["Roll"]["bandwidths"]["roll"]


def test_axes_are_a_models_own_or_refused_before_any_work(study: Path) -> None:
    axes = '[handling_qualities.axes]\nroll = ["phi", "tau_phi"]\npitch = ["theta", "tau_theta"]\n'
    written(study.parent, STUDY + axes)
    with pytest.raises(StudyError, match="no model gives theta from tau_theta"):
        fid.run_study(study)
    assert not study.with_name("roll-output").exists()
    written(
        study.parent, STUDY + axes.rsplit("pitch", 1)[0] + "[handling_qualities.signs]\nroll=-1"
    )
    settings = read_settings(study).qualities
    assert settings is not None
    assert (settings.pairs, settings.signs) == ({"roll": ("phi", "tau_phi")}, {"roll": -1})
    found = fid.run_study(study).qualities["Roll"]
    # Read with the wrong sign the phase begins half a turn off, and no bandwidth is left.
    assert not found.bandwidths
    assert "no-bandwidth" in [each.code for each in found.findings]


def test_models_without_equations_are_not_rated(study: Path) -> None:
    text = STUDY.replace('template = "attitude_first_order"\naxis = "roll"\n', "")
    text = text.replace('name = "Roll"\n', 'name = "Roll"\nstructure = "arx"\n', 1)
    black = 'inputs = ["tau_phi"]\noutputs = "phi"\nband_rad_s = [1.0, 9.0]\nna=1\nnb=1\nnk=1\n'
    text = text.replace("[handling_qualities]", black + "[handling_qualities]")
    with pytest.raises(StudyError, match="are read off models with equations"):
        fid.run_study(written(study.parent, text))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ('category = "B"', "category is of the standards of vehicle"),
        ('speed = "fast"', "speed is not known"),
        ('vehicle = "boat"', "vehicle is not known"),
        ("n_alpha = 5", "n_alpha is of the standards of vehicle"),
        ('axes.roll = ["phi"]', "channels of roll do not fit"),
        ('axes.heave = ["w", "col"]', "axis is not known"),
        ("signs.roll = 2", "sign of roll does not fit"),
        ("signs.rol = 1", "axis is not known"),
    ],
)
def test_settings_are_checked_to_the_last_key(tmp_path: Path, lines: str, message: str) -> None:
    with pytest.raises(StudyError, match=message):
        read_settings(written(tmp_path, STUDY + lines + "\n"))
    low = STUDY.replace("[0.5, 60.0]", "[0.0, 60.0]")
    with pytest.raises(StudyError, match="band_rad_s is too small"):
        read_settings(written(tmp_path, low))


def test_an_aeroplane_is_rated_by_its_category(tmp_path: Path) -> None:
    text = STUDY.replace('task = "tracking"', 'vehicle = "aeroplane"\naircraft_class = "II"')
    asked = read_settings(written(tmp_path, text + 'n_alpha = 8\ncharts = "own.toml"\n')).qualities
    assert asked is not None
    assert (asked.category, asked.aircraft_class) == ("A", "II")
    assert (asked.n_alpha, asked.charts) == (8.0, str(tmp_path / "own.toml"))


def test_closed_loops_are_told_with_poles_blocks_and_margins() -> None:
    yaw = fid.LinearSystem([[-0.4]], [[2.0]], [[1.0]], [[0.0]], ("ped",), ("r",), [0.05])
    closed = fid.close_loop(yaw, {"ped": {"r": 1.0}}, name="Yaw damper")
    section = closed_loop_section(closed, band_rad_s=(0.1, 100.0))
    assert section.title == "Yaw damper"
    titles = [each.table.title for each in section.blocks if isinstance(each, TableBlock)]
    assert titles[0] == "Poles of Yaw damper"
    assert len([each for each in section.blocks if isinstance(each, Figure)]) == 1
    (part,) = section.sections
    assert part.title == "Loop broken at ped, the others closed"
    page = to_html(Document("Loops", "", (section,)))
    assert "phase margin" in page
    assert "Poles of Yaw damper" in closed._repr_html_()
