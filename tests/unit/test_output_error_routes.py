"""Output error from a study, from the command line, and on any number of threads."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from tests.unit.test_study_run import STUDY

FIT = """
import numpy as np
import flightid as fid

model = fid.load_model("short_period").with_fixed(Malphadot=-0.9)
time_s = np.arange(200) * 0.02
flown = []
for seed in range(3):
    random = np.random.default_rng(seed)
    elevator = 0.05 * np.sign(np.sin((1.0 + 0.2 * seed) * time_s))
    units = {"elevator": "rad"}
    record = fid.Record.from_arrays(time_s, inputs={"elevator": elevator}, units=units)
    flight = fid.simulate(model, record, units={"alpha": "rad", "q": "rad/s", "nz": "1"})
    noisy = {n: flight[n] + 0.005 * random.standard_normal(200) for n in ("alpha", "q", "nz")}
    flown.append(flight.replace(noisy))
fit = fid.identify(model, flown, starts=5, seed=4)
for parameter in fit.parameters.values():
    print(parameter.name, parameter.value.hex(), (parameter.stderr or 0.0).hex())
"""


def _on_threads(count: int) -> str:
    found = subprocess.run(
        [sys.executable, "-c", FIT],
        env=os.environ | {"RAYON_NUM_THREADS": str(count)},
        capture_output=True,
        text=True,
        check=True,
    )
    return found.stdout


def test_one_thread_and_many_give_the_same_bits(capsys: pytest.CaptureFixture[str]) -> None:
    exec(compile(FIT, "fit", "exec"), {"__name__": "fit"})
    here = capsys.readouterr().out
    assert "Malpha" in here
    # The threads of this process are those of the machine, unless somebody has said one.
    alone = os.environ.get("RAYON_NUM_THREADS", str(os.cpu_count())) == "1"
    assert _on_threads(3 if alone else 1) == here


def test_a_study_fits_the_records_themselves(tmp_path: Path) -> None:
    head, tail = STUDY.split("[response]")
    models = tail[tail.index("[[model]]") :].replace("band_rad_s = [4.0, 40.0]\n", "")
    path = tmp_path / "study.toml"
    path.write_text(head + '[fit]\nmethod = "output_error"\n' + models)
    study = fid.run_study(path)
    (item,) = study.identified
    # The simulated air is not still, and output error gives no intervals in turbulence.
    assert item.fit.intervals_from == "nothing"
    assert "process-noise" in {finding.code for finding in item.fit.findings}
    assert len(item.fit.records) == 1
    assert "doublet" in item.verifications
    values = json.loads((study.output / "results.json").read_text())
    (fitted,) = values["models"][0]["fits"].values()
    assert fitted["parameters"]["Lp"]["value"] == item.fit.parameters["Lp"].value
    assert "filter_error" in (study.output / "report.html").read_text()


def test_the_command_line_fits_records(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time_s = np.arange(600) * 0.02
    elevator = 0.05 * np.sign(np.sin(1.3 * time_s))
    driven = fid.Record.from_arrays(
        time_s, inputs={"elevator": elevator}, units={"elevator": "rad"}, name="doublets"
    )
    truth = fid.load_model("short_period").with_fixed(Malphadot=-0.9)
    flown = fid.simulate(truth, driven, units={"alpha": "rad", "q": "rad/s", "nz": "1"})
    fid.write_model(truth, tmp_path / "model.toml")
    file = tmp_path / "flown.nc"
    fid.write_records([flown], file)
    arguments = ["identify", str(file), "--model", str(tmp_path / "model.toml")]
    code = run([*arguments, "--method", "output_error", "--json"])
    values = json.loads(capsys.readouterr().out)
    assert code == 0
    found = values["parameters"]["Malpha"]["value"]
    assert abs(found / truth.parameters["Malpha"].value - 1.0) < 1e-4
