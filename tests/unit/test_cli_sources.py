"""What commands take as a model, records with units, and joint fits."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.output import Exit
from flightid.cli.program import run
from flightid.errors import FileFormatError, ModelError
from tests.closeness import assert_close

TRUTH = fid.load_model("rate_first_order").with_values({"Lp": -4.0, "Ltphi": 60.0})


def flown(path: Path, seed: int = 0) -> Path:
    time_s = np.arange(3000) * 0.02
    drive = 0.1 * np.sin(0.09 * time_s**2 + seed)
    drive += 0.02 * np.random.default_rng(seed).standard_normal(len(time_s))
    driven = fid.Record.from_arrays(
        time_s, inputs={"tau_phi": drive}, units={"tau_phi": "1"}, hold="first"
    )
    seen = fid.simulate(TRUTH, driven, noise=fid.Noise(sensor={"p": 0.01}, seed=seed))
    return fid.write_records(seen, path)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fit as a file of its own, as JSON, and in a folder like a study's."""
    folder = tmp_path_factory.mktemp("fits")
    record = fid.read_records(flown(folder / "flight.parquet"))
    fit = fid.identify(TRUTH, record)
    (folder / "study-output" / "models").mkdir(parents=True)
    fid.write_model(fit, folder / "study-output" / "models" / "roll.toml")
    fid.write_model(fit, folder / "roll.toml")
    (folder / "fit.json").write_text(json.dumps(fit.to_dict()))
    return folder


@pytest.mark.parametrize("name", ["roll.toml", "fit.json", "study-output"])
def test_every_command_takes_every_form_of_a_fit(
    name: str, saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, flight = str(saved / name), str(saved / "flight.parquet")
    once = ["--duration", "1", "--rate", "20"]
    for words in (
        ["modes", model],
        ["verify", model, flight],
        ["simulate", "model", model, "--input", "tau_phi=step:0.1", *once],
        ["export", model, str(tmp_path / "roll.c"), "--sample-time-s", "1/100"],
        ["fly", model, *once],
    ):
        assert run([*words, "--json"]) == 0, words
        assert json.loads(capsys.readouterr().out)
    loaded = fid.load_model(model).estimated
    assert loaded is not None
    wanted = fid.load_model(str(saved / "roll.toml")).estimated
    assert_close(loaded.covariance, wanted.covariance, rtol=1e-15, why="the same numbers")
    assert loaded.evidence.keys() == wanted.evidence.keys()


def test_what_holds_no_model_is_refused_with_a_way_on(saved: Path, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"this folder holds no model.*Next: run a study"):
        fid.load_model(tmp_path)
    for name in ("a.toml", "b.toml"):
        (tmp_path / name).write_text((saved / "roll.toml").read_text())
    with pytest.raises(ModelError, match=r"not clear which model.*Next: name one, for.*a\.toml"):
        fid.load_model(tmp_path)
    (tmp_path / "results.json").write_text('{"schema": "flightid.study/1"}')
    with pytest.raises(ModelError, match=r"holds no fitted model.*flightid.study/1.*models folder"):
        fid.load_model(tmp_path / "results.json")
    (tmp_path / "results.json").write_text("{")
    with pytest.raises(FileFormatError, match="a saved fit is no JSON"):
        fid.load_model(tmp_path / "results.json")


def test_intervals_at_another_level(saved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["modes", str(saved / "roll.toml"), "--level", "0.5"]) == 0
    narrow = capsys.readouterr().out
    assert "50 %" in narrow
    assert run(["modes", str(saved / "roll.toml")]) == 0
    assert capsys.readouterr().out != narrow


def test_a_joint_fit(saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["identify", str(saved / "flight.parquet"), "--model", "rate_first_order"]
    words += ["--method", "joint", "--band", "0.5", "8"]
    assert run([*words, "--records", str(flown(tmp_path / "b.nc", 2)), "--json"]) in (0, 1)
    told = json.loads(capsys.readouterr().out)
    assert told["method"] == "joint"
    assert_close(told["parameters"]["Lp"]["value"], -4.0, rtol=0.02, why="a quiet sensor")
    assert run(words) == 2
    assert "--method joint and --records belong together" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("arx", ["--na", "1", "--nb", "2", "--method", "iv4"]),
        ("bj", ["--starts", "2"]),
        ("subspace", ["--order", "1", "--method", "n4sid"]),
        ("narx", ["--output-lags", "1", "--input-lags", "2", "--stop", "bic"]),
    ],
)
def test_models_without_equations(
    kind: str, options: list[str], saved: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    target = tmp_path / "found.toml"
    words = ["identify", str(saved / "flight.parquet"), "--kind", kind, *options]
    assert run([*words, "--write", str(target), "--json"]) in (0, 1)
    assert json.loads(capsys.readouterr().out)["schema"] == "flightid.fit/1"
    assert fid.load_model(target).outputs == ("p",)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--kind", "arx", "--nc", "2"], "--nc is no order of arx"),
        (["--kind", "arx", "--na", "1", "--na", "2"], "--na takes one number"),
        (["--kind", "narx"], "kind narx needs --output-lags"),
        (["--kind", "narx", "--na", "2"], "--na is no option of"),
        ([], "name a model with equations by --model, or a --kind without"),
    ],
)
def test_kinds_that_do_not_fit(
    words: list[str], said: str, saved: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", str(saved / "flight.parquet"), *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert run(["lower-order", str(saved / "roll.toml")]) == 2
    assert "needs --kind: Equivalent system. Choose of short_period," in capsys.readouterr().err


def test_units_of_a_table(saved: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = fid.read_records(saved / "flight.parquet")[0]
    columns = np.column_stack([record.time_s, record["tau_phi"], np.degrees(record["p"])])

    def table(heading: str) -> str:
        path = tmp_path / "flight.csv"
        np.savetxt(path, columns, delimiter=",", header=f"time,tau_phi,{heading}", comments="")
        return str(path)

    words = ["verify", str(saved / "roll.toml"), table("p [deg/s]"), "--hold", "first"]
    assert run(words) == 0
    assert "p converted from deg/s to rad/s" in capsys.readouterr().err
    assert run(["verify", str(saved / "roll.toml"), table("p"), "--units", "p=deg/s"]) == 0
    capsys.readouterr()
    assert run(["verify", str(saved / "roll.toml"), table("p")]) == 2
    said = capsys.readouterr().err
    assert "head the column 'p [rad/s]' in the file, or read it with --units p=rad/s" in said
    assert run(["verify", str(saved / "roll.toml"), table("p [m]")]) == 2
    assert "found m; needed rad/s" in capsys.readouterr().err


def test_the_cut_off_of_a_control_is_that_of_what_was_flown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hands = np.random.default_rng(1).standard_normal(6000)
    flown = fid.Record.from_arrays(np.arange(6000) * 0.02, inputs={"lat": hands})
    fid.write_records(flown, tmp_path / "flight.parquet")
    words = ["pilot-cutoff", str(tmp_path / "flight.parquet"), "--channel", "lat", "--json"]
    assert run(words) == Exit.DONE
    told = json.loads(capsys.readouterr().out)
    # White: half of the power lies below half of Nyquist's frequency.
    assert told["cutoff"]["value"] == pytest.approx(0.5 * np.pi / 0.02, rel=0.05)


def test_disk_margins_of_feedback_are_those_of_its_broken_loop(
    capsys: pytest.CaptureFixture[str],
) -> None:
    model = fid.load_model("rate_motor_lag")
    words = ["rate_motor_lag", "--feedback", "tau_phi=p:0.02", "--json"]
    assert run(["disk-margin", *words]) in (Exit.DONE, Exit.RED)
    told = json.loads(capsys.readouterr().out)
    assert told["alpha"]["value"] == fid.disk_margin(model, controller=0.02).alpha.value
    run(["disturbance-rejection", *words])
    told = json.loads(capsys.readouterr().out)
    expected = fid.disturbance_rejection(model, controller=0.02).peak.value
    assert told["peak"]["value"] == pytest.approx(expected, rel=1e-6)
