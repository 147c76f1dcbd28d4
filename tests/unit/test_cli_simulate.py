"""``flightid simulate model`` and ``flightid export``: from the command line to files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.errors import OptionError, UnknownNameError
from flightid.plot.simulation import simulated_history
from flightid.vehicles.pilot_inputs import stick_record
from tests.closeness import assert_close


def test_a_step_as_the_library_has_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "step.csv"
    words = ["simulate", "model", "short_period", "--input", "elevator=step:0.02", "--write"]
    words += [str(path), "--value", "Mq=-3", "--duration", "4", "--rate", "50", "--json"]
    assert run(words) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)
    assert "Wrote" in said.err
    back = fid.read_records(path, inputs=["elevator"], outputs=["q", "alpha"])[0]
    model = fid.load_model("short_period").with_values({"Mq": -3.0})
    driven = stick_record({"elevator": "rad"}, {"elevator": "step:0.02"}, duration_s=4.0,
                          sample_rate_hz=50.0)  # fmt: skip
    wanted = fid.simulate(model, driven)
    assert np.array_equal(back["q"], wanted["q"])
    assert back.unit("q") == "rad/s"


def test_records_noise_and_pages(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    driven = stick_record({"elevator": "rad"}, {"elevator": "3211:0.02:0.3"}, duration_s=5.0,
                          sample_rate_hz=50.0)  # fmt: skip
    flown = fid.simulate(fid.load_model("short_period"), driven)
    source = fid.write_records(flown, tmp_path / "flown.parquet")
    page, out = tmp_path / "page.html", tmp_path / "again.nc"
    words = ["simulate", "model", "short_period", str(source), "--sensor", "q=0.001"]
    words += ["--process", "q=0.002", "--gust", "alpha=0.01:0.8", "--seed", "3"]
    words += ["--html", str(page), "--write", str(out)]
    assert run(words) == 0
    assert "q" in capsys.readouterr().out
    assert page.read_text().startswith("<!DOCTYPE html>")
    found = fid.read_records(out)[0]
    noise = fid.Noise({"q": 0.001}, {"q": 0.002}, {"alpha": (0.01, 0.8)}, 3)
    again = fid.simulate(fid.load_model("short_period"), flown, noise=noise)
    assert np.array_equal(found["q"], again["q"])


def test_a_nonlinear_model_rests_at_its_trim(tmp_path: Path) -> None:
    path = tmp_path / "quad.csv"
    words = ["simulate", "model", "quadrotor_6dof", "--duration", "1", "--write", str(path)]
    assert run([*words, "--input", "tau_phi=pulse:0.01:0.1:0.2", "--substeps", "2"]) == 0
    found = fid.read_records(path, inputs=["F"], outputs=["p", "w"])[0]
    assert found["F"][0] > 1.0
    assert np.abs(found["p"]).max() > 1e-3


def test_black_boxes_fly_too(tmp_path: Path) -> None:
    model = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -0.5], b=[[1.0]])
    path = fid.write_model(model, tmp_path / "arx.toml")
    out = tmp_path / "y.csv"
    words = ["simulate", "model", str(path), "--rate", "10", "--input", "u=step:1:0"]
    assert run([*words, "--write", str(out)]) == 0
    found = fid.read_records(out, inputs=["u"], outputs=["y"])[0]
    wanted = 2.0 * (1.0 - 0.5 ** np.arange(100))
    assert_close(found["y"], wanted, rtol=1e-12, why="closed form of a first-order recursion")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--input", "elevator"], "must be NAME=VALUE"),
        (["--input", "elevator=step:1", "--input", "elevator=step:2"], "each name once"),
        (["--value", "Mq=fast"], "is no number"),
        (["--gust", "q=1"], "gust on q is not a deviation and a time"),
        (["--input", "rudder=step:1"], "a shape has no input"),
        (["--input", "elevator=jump:1"], "cannot be read"),
        (["--input", "elevator=step:x"], "holds no numbers"),
        (["--input", "elevator=pulse:1:0"], "has no meaning"),
        (["--input", "elevator=pulse:1:-1"], "has no meaning"),
        (["--duration", "0"], "0.0 is not in the range x>0"),
        (["--duration", "1e-3"], "no usable length"),
    ],
)
def test_what_cannot_be_flown(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["simulate", "model", "short_period", *words]) == 2
    assert said in capsys.readouterr().err


def test_options_that_exclude_each_other(tmp_path: Path, capsys) -> None:
    record = stick_record({"elevator": "rad"}, {}, duration_s=1.0, sample_rate_hz=10.0)
    source = str(fid.write_records([record, record], tmp_path / "a.parquet"))
    start = ["simulate", "model", "short_period", source]
    for words, said in (
        (["--input", "elevator=step:1"], "give it or RECORDS"),
        (["--run", "1"], "--run belongs to logs"),
        (["--write", str(tmp_path / "a.csv")], "a .csv holds one record"),
    ):
        assert run([*start, *words]) == 2
        assert said in capsys.readouterr().err
    arx = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -0.5], b=[[1.0]])
    path = fid.write_model(arx, tmp_path / "arx.toml")
    assert run(["simulate", "model", str(path), "--value", "a9=3"]) == 2
    assert "a9" in capsys.readouterr().err


SHAPES = {
    "step:2:0.5": [0, 2, 2, 2, 2, 2, 2, 2],
    "pulse:2:0.5:0.5": [0, 2, 0, 0, 0, 0, 0, 0],
    "doublet:1:1:0.5": [0, 1, 1, -1, -1, 0, 0, 0],
    "3211:1:0.5:0": [1, 1, 1, -1, -1, 1, -1, 0],
    "modified_3211:1.2:0.5:0": [0.8, 0.8, 0.8, -1.2, -1.2, 1.1, -1.1, 0],
}


@pytest.mark.parametrize("shape", SHAPES)
def test_shapes(shape: str) -> None:
    made = stick_record({"u": "1"}, {"u": shape}, duration_s=4.0, sample_rate_hz=2.0)
    assert made["u"].tolist() == SHAPES[shape]


def test_sines_and_sweeps() -> None:
    made = stick_record({"u": "1", "v": "1"}, {"u": "sine:2:3:0", "v": "sweep:0.5:1:10"},
                        duration_s=40.0, sample_rate_hz=50.0)  # fmt: skip
    assert_close(made["u"], 2 * np.sin(3 * made.time_s), atol=1e-7, why="the sine itself")
    assert 0.45 < np.abs(made["v"]).max() <= 0.5 + 1e-12
    with pytest.raises(UnknownNameError, match="a shape has no input"):
        stick_record({"u": "1"}, {"w": "step:1"}, duration_s=1.0, sample_rate_hz=10.0)
    with pytest.raises(OptionError, match="cannot be read"):
        stick_record({"u": "1"}, {"u": "sweep:1:2"}, duration_s=1.0, sample_rate_hz=10.0)


def test_the_picture_shows_measured_beside_simulated() -> None:
    driven = stick_record({"elevator": "rad"}, {"elevator": "step:0.02"}, duration_s=2.0,
                          sample_rate_hz=50.0)  # fmt: skip
    flown = fid.simulate(fid.load_model("short_period"), driven)
    names = [trace.name for trace in simulated_history(flown, flown).data]
    assert names.count("measured") == names.count("simulated") == len(flown.outputs)
    assert names.count("input") == 1


def test_export_from_the_command_line(tmp_path: Path, capsys) -> None:
    path = tmp_path / "sp.c"
    words = ["export", "short_period", str(path), "--sample-time-s", "0.01", "--value", "Mq=-3"]
    assert run([*words, "--tunable", "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert plain["options"]["tunable"] is True
    assert plain["files"] == [str(path), str(path.with_suffix(".h"))]
    assert '"Mq", "1/s", (-3.0)' in path.read_text()
    unit = tmp_path / "sp.fmu"
    words = ["export", "short_period", str(unit), "--sample-time-s", "0.01", "--no-compile"]
    assert run([*words, "--interface", "co-simulation"]) == 0
    assert "co-simulation" in capsys.readouterr().out
    aero = tmp_path / "aero.xml"
    words = ["export", "fixed_wing_lateral", str(aero), "--mass", "1247", "--inertia", "ixx=1421"]
    words += ["--inertia", "iyy=4067", "--inertia", "izz=4786", "--trim", "u=53.645"]
    assert run([*words, "--property", "rudder=fcs/rudder-left-pos-rad"]) == 0
    assert "fcs/rudder-left-pos-rad" in aero.read_text()
    capsys.readouterr()
    assert run([*words, "--tunable"]) == 2
    assert "--tunable is no option of format jsbsim" in capsys.readouterr().err
    assert run(["export", "short_period", str(tmp_path / "sp.xyz")]) == 2
    assert "format of an export is not known" in capsys.readouterr().err
