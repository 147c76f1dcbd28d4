"""What a study does with its models: files that commands take, exports, loops, conditions."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.output import Exit
from flightid.cli.program import run as command
from flightid.errors import StudyError
from flightid.report.text import to_text
from flightid.study.settings import read_settings

STUDY = """
[study]
title = "Uses"
[[record]]
name = "flown"
path = "flown.parquet"
[fit]
method = "output_error"
[[model]]
name = "Roll, slow"
template = "rate_first_order"
axis = "roll"
identify = "flown"
condition = "slow"
[[model]]
name = "Roll, fast"
template = "rate_first_order"
axis = "roll"
identify = "flown"
condition = "fast"
[[model]]
name = "Recursion"
structure = "subspace"
order = 1
inputs = "tau_phi"
outputs = "p"
identify = "flown"
band_rad_s = [2.0, 20.0]
[[export]]
model = "Roll, slow"
path = "roll.c"
sample_time_s = 0.0025
[[loop]]
name = "Rate feedback"
model = "Roll, slow"
gains = { tau_phi = { p = 0.02 } }
draws = 20
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("uses")
    truth = fid.load_model("rate_first_order", axis="roll").with_values({"Lp": -6.0})
    time_s = np.arange(1500) * 0.02
    rng = np.random.default_rng(2)
    sweep = 0.1 * np.sin(0.5 * time_s**2) + 0.02 * rng.standard_normal(time_s.size)
    driven = fid.Record.from_arrays(time_s, inputs={"tau_phi": sweep}, units={"tau_phi": "1"})
    record = fid.simulate(truth, driven, units={"p": "rad/s"})
    noisy = record.replace({"p": record["p"] + 0.05 * rng.standard_normal(time_s.size)})
    fid.write_records(noisy, place / "flown.parquet")
    (place / "study.toml").write_text(STUDY, encoding="utf-8")
    return place


@pytest.fixture(scope="module")
def study(folder: Path) -> fid.Study:
    return fid.run_study(folder / "study.toml", output=folder / "out")


def test_every_fit_leaves_as_a_file_with_its_covariance(study: fid.Study) -> None:
    assert study.uses.files == {
        "Roll, slow": "models/roll_slow.toml",
        "Roll, fast": "models/roll_fast.toml",
        "Recursion": "models/recursion.toml",
    }
    for item in study.identified:
        assert item.fit is not None
        loaded = fid.load_model(study.output / study.uses.files[item.name])
        assert loaded.inputs == item.fit.model.inputs
        assert loaded.estimated is not None
    roll = study.identified[0].fit
    assert roll is not None
    again = fid.load_model(study.output / "models" / "roll_slow.toml")
    assert np.array_equal(again.estimated.covariance, roll.carried)


def test_commands_take_the_files(
    study: fid.Study, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = str(folder / "flown.parquet")
    for name in ("roll_slow", "recursion"):
        file = str(study.output / "models" / f"{name}.toml")
        # Red where the fit is: its modes rest on it.
        assert command(["--quiet", "modes", file, "--json"]) in (Exit.DONE, Exit.RED)
        assert json.loads(capsys.readouterr().out)["modes"]
        assert command(["--quiet", "verify", file, flown]) == 0
        assert "Theil coefficient" in capsys.readouterr().out
        assert command(["--quiet", "simulate", "model", file, flown]) == 0
        capsys.readouterr()
    both = [str(study.output / "models" / f"{name}.toml") for name in ("roll_slow", "recursion")]
    assert command(["--quiet", "verify", both[0], flown, "--against", both[1]]) in (0, 1)
    assert "Comparison(2 models" in capsys.readouterr().out


def test_identify_writes_a_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--quiet", "identify", str(folder / "flown.parquet"), "--model", "rate_first_order"]
    target = folder / "own.toml"
    assert command([*words, "--method", "output_error", "--write", str(target)]) in (0, 1)
    assert fid.load_model(target).estimated is not None
    assert "Wrote" in capsys.readouterr().err


def test_exports_loops_and_conditions_stand_in_the_report(study: fid.Study) -> None:
    assert {path.name for path in (study.output / "export").iterdir()} == {"roll.c", "roll.h"}
    ((_, closed),) = study.uses.loops
    assert closed.name == "Rate feedback"
    assert study.uses.conditions is not None
    text = to_text(study.document)
    for title in ("Flight conditions", "Rate feedback", "Files"):
        assert f"\n{title}\n" in text
    uses = json.loads((study.output / "results.json").read_text(encoding="utf-8"))["uses"]
    assert uses["exported"][0]["files"] == ["export/roll.c", "export/roll.h"]
    assert list(uses["loops"]) == ["Rate feedback"]


@pytest.mark.nightly
def test_a_controller_of_blocks_and_its_qualities_are_stages(
    folder: Path, study: fid.Study
) -> None:
    gain = '[{ kind = "gain", inputs = "p", outputs = "tau_phi", value = [[-0.02]] }]'
    text = STUDY.replace("gains = { tau_phi = { p = 0.02 } }", f"block = {gain}")
    text += '[handling_qualities]\nsources = ["fit", "response", "loop"]\n'
    text += '[handling_qualities.axes]\nroll = ["p", "tau_phi"]\n'
    (folder / "blocks.toml").write_text(text, encoding="utf-8")
    cache: dict[str, object] = {}
    made = fid.run_study(folder / "blocks.toml", output=folder / "blocks", cache=cache)
    ((_, closed),), ((_, gains),) = made.uses.loops, study.uses.loops
    assert list(map(str, closed.poles)) == list(map(str, gains.poles))
    assert set(made.qualities) == {"Roll, slow", "Roll, fast", "Rate feedback"}
    again = fid.run_study(folder / "blocks.toml", output=folder / "blocks", cache=cache)
    assert not again.carried_out
    assert {"loop: Rate feedback", "handling qualities: Roll, slow"} <= set(again.from_cache)
    (folder / "blocks.toml").write_text(text.replace("-0.02", "-0.03"), encoding="utf-8")
    turned = fid.run_study(folder / "blocks.toml", output=folder / "blocks", cache=cache)
    assert set(turned.carried_out) == {
        "loop: Rate feedback",
        "handling qualities: Rate feedback",
    }


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "gains = { tau_phi = { p = 0.02 } }",
            'block = [{ kind = "luck" }]',
            "one of complementary",
        ),
        ("gains = { tau_phi = { p = 0.02 } }", 'block = [{ kind = "delay" }]', "keys do not fit"),
        (
            "draws = 20",
            'block = [{ kind = "delay", inputs = "p", outputs = "p_f", delay_s = 0.1 }]',
            "beside blocks",
        ),
        ('path = "roll.c"', 'path = "../roll.c"', "a name without a folder"),
        ('model = "Roll, slow"\npath', 'model = "Roll"\npath', "there is no such model to use"),
        ("gains = { tau_phi = { p = 0.02 } }", "", "gains is missing"),
        ("{ p = 0.02 }", '{ p = "much" }', "tables of numbers by name"),
        ("[[loop]]", "[rotor]\nmodel = 'Recursion'\n[[loop]]", "rotor_speed_rad_s is missing"),
    ],
)
def test_uses_that_do_not_fit_are_refused(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in STUDY
    path = tmp_path / "study.toml"
    path.write_text(STUDY.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(StudyError, match=re.escape(said)):
        read_settings(path)


def test_two_models_of_one_condition_are_refused(folder: Path) -> None:
    path = folder / "same.toml"
    path.write_text(STUDY.replace('"fast"', '"slow"'), encoding="utf-8")
    with pytest.raises(StudyError, match="two models are of one flight condition"):
        fid.run_study(path, output=folder / "same")
    assert not (folder / "same").exists()
