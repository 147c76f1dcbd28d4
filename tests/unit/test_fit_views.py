"""Views of a fit: the picture, the estimates as drawn, the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import flightid as fid
from flightid.cli.identify import command
from flightid.errors import UnknownNameError
from flightid.plot.fit import fit_figure
from tests.closeness import assert_close

OMEGA = np.geomspace(1.0, 30.0, 60)


@pytest.fixture(scope="module")
def fit() -> fid.Fit:
    model = fid.load_model("rate_first_order")
    data = fid.FrequencyResponse.from_values(
        OMEGA,
        model.with_values({"Lp": -6.0}).frequency_response(OMEGA),
        inputs=["tau_phi"],
        outputs=["p"],
        units={"p": "rad/s"},
        random_error=np.full(60, 0.05),
    )
    return fid.identify(model, data, band_rad_s=(2.0, 20.0))


def test_figure_shows_data_and_model(fit: fid.Fit) -> None:
    made = fit_figure(fit)
    drawn = {trace.name: trace for trace in made.data if trace.name in ("measured", "model")}
    assert set(drawn) == {"measured", "model"}
    gain = next(trace for trace in made.data if trace.name == "model")
    assert 2.0 <= min(gain.x) < 2.2
    assert max(gain.x) <= 20.0
    each = fit.responses[0]
    low, high = each.band_rad_s
    inside = (low <= OMEGA) & (high >= OMEGA)
    assert_close(gain.y, 20 * np.log10(np.abs(each.model[inside])), rtol=1e-12, why="gain in dB")
    with pytest.raises(UnknownNameError, match="the fit has no such response"):
        fit_figure(fit, "q/u")


def test_command_identifies_a_record(tmp_path: Path) -> None:
    truth = fid.load_model("rate_first_order").with_values({"Lp": -6.0, "Ltphi": 180.0})
    sweep = np.random.default_rng(0).standard_normal(1500).cumsum() * 0.02
    time_s = np.arange(1500) * 0.02
    record = fid.Record.from_arrays(time_s, inputs={"tau_phi": sweep - sweep.mean()})
    flown = fid.simulate(truth, record)
    noise = 0.02 * np.random.default_rng(1).standard_normal(1500)
    path = tmp_path / "flight.csv"
    lines = [
        f"{t:.2f},{u!r},{p!r}"
        for t, u, p in zip(
            time_s.tolist(), record["tau_phi"].tolist(), (flown["p"] + noise).tolist(), strict=True
        )
    ]
    path.write_text("time [s],tau_phi [1],p [rad/s]\n" + "\n".join(lines) + "\n")
    options = ["--model", "rate_first_order", "--axis", "roll", "--band", "2", "15"]
    run = CliRunner().invoke(command, [str(path), *options, "--json"])
    assert run.exit_code == 0, run.output
    plain = json.loads(run.stdout)
    assert_close(plain["parameters"]["Lp"]["value"], -6.0, rtol=0.1, why="half a noisy minute")
    shown = CliRunner().invoke(command, [str(path), *options])
    assert "Cramér–Rao" in shown.stdout
    wrong = CliRunner().invoke(command, [str(path), *options, "--run", "0"])
    assert wrong.exit_code == 2
    assert "belongs to logs" in wrong.output
