"""`flightid verify`: a thin face of the verb."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from tests.closeness import assert_close


@pytest.fixture
def flown(tmp_path: Path) -> Path:
    model = fid.load_model("rate_first_order").with_values({"Lp": -4.0})
    time_s = np.arange(500) * 0.01
    record = fid.Record.from_arrays(time_s, inputs={"tau_phi": 0.1 * np.sign(np.sin(3 * time_s))})
    seen = fid.simulate(model, record, units={"p": "rad/s"})
    path = tmp_path / "flight.parquet"
    fid.write_records([seen], path)
    return path


def test_values_make_the_model_and_the_code_is_the_verdict(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.html"
    assert run(["verify", "rate_first_order", str(flown), "--value", "Lp=-4", "--json",
                "--html", str(page)]) == 0  # fmt: skip
    plain = json.loads(capsys.readouterr().out)
    assert_close(plain["theil"]["p"], 0.0, atol=1e-9, why="the model is the truth")
    assert "Verification" in page.read_text()
    assert run(["verify", "rate_first_order", str(flown), "--value", "Lp=-60"]) == 1
    assert "[red] p: Theil coefficient" in capsys.readouterr().out


def test_options_reach_the_verb(flown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = [
        "--initial-state",
        "estimate",
        "--no-state-bias",
        "--hold",
        "zero",
        "--value",
        "Lp=-4",
    ]
    assert run(["verify", "rate_first_order", str(flown), *options]) == 0
    shown = capsys.readouterr().out
    assert "steps between samples" in shown
    assert "initial state solved for" in shown
    assert "state biases" not in shown


def test_a_value_without_number_is_explained(
    flown: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["verify", "rate_first_order", str(flown), "--value", "Lp"]) == 2
    assert "must be NAME=VALUE" in capsys.readouterr().err


def test_residual_tests_on_demand(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = fid.read_records(flown)[0]
    noise = 0.02 * np.random.default_rng(0).standard_normal(record.n_samples)
    path = tmp_path / "noisy.parquet"
    fid.write_records([record.replace({"p": record["p"] + noise})], path)
    page = tmp_path / "page.html"
    options = ["verify", "rate_first_order", str(path), "--value", "Lp=-4", "--residual-tests"]
    run([*options, "--html", str(page)])
    shown = capsys.readouterr().out
    assert "Verification(" in shown
    assert "ResidualTests(1 output, 1 input" in shown
    assert "no loop seen: " in shown
    assert "Residual tests" in page.read_text()
    run([*options, "--json"])
    plain = json.loads(capsys.readouterr().out)
    assert plain["residual_tests"]["horizon"] == "free run"


def test_rivals_of_one_name_are_told_apart_by_their_files(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = fid.load_model("rate_first_order")
    for name, damping in (("monday", -4.0), ("friday", -9.0)):
        fid.write_model(model.with_values({"Lp": damping}), tmp_path / f"{name}.toml")
    first, second = (str(tmp_path / f"{name}.toml") for name in ("monday", "friday"))
    assert run(["verify", first, str(flown), "--against", second]) == 0
    shown = capsys.readouterr().out
    assert "monday" in shown
    assert "friday" in shown
    assert "(1)" not in shown
