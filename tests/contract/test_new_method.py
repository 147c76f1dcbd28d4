"""A method of `identify` that nobody knows works everywhere once it stands in the table.

One line in `identification/methods.py`: commands, studies, provenance, the model's file and the
page of options follow. Run in a process of its own, since they read the table as they are loaded.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flightid as fid

ADDED = """
import sys
from dataclasses import dataclass, replace

from flightid.identification import methods
from flightid.identification.frequency_domain.fit import fit_responses
from flightid.identification.frequency_domain.options import FrequencyDomainOptions
from flightid.identification.output_error.fit import fit_output_error
from flightid.identification.records.options import RecordOptions
from flightid.options import option


def pull():
    return option(0.0, minimum=0.0, unit="1", doc="How far estimates go to zero.")


@dataclass(frozen=True)
class RecordToy(RecordOptions):
    pull: float = pull()


@dataclass(frozen=True)
class ResponseToy(FrequencyDomainOptions):
    pull: float = pull()


def pulled(fit, options):
    small = {name: each.value / (1.0 + options.pull) for name, each in fit.parameters.items()}
    return replace(fit, model=fit.model.with_values(small))


def on_records(model, data, options):
    return pulled(fit_output_error(model, data, options), options)


def on_responses(model, data, options):
    return pulled(fit_responses(model, data, options), options)


methods.METHODS += [
    methods.Method("toy", methods.GREY, methods.RECORDS, on_records, RecordToy),
    methods.Method("toy_curve", methods.GREY, methods.RESPONSES, on_responses, ResponseToy),
]
"""
USED = """
import json

from tools.options_page import page

from flightid.cli.program import run

outputs, folder = [], sys.argv[1]
for method, band in {"toy": [], "toy_curve": ["--band", "1.0", "20.0"]}.items():
    asked = ["identify", f"{folder}/sweep.nc", "--model", f"{folder}/roll.toml",
             "--method", method, "--write", f"{folder}/{method}.toml"]
    outputs.append([
        run([*asked, *band, "--pull", "0.25"]),
        run(["run", f"{folder}/{method}-study.toml", "--output", f"{folder}/{method}"]),
        run([*asked, "--pull", "-1"]),
    ])
with open(f"{folder}/told.json", "w") as file:
    json.dump({"ends": outputs, "page": page()}, file)
"""
MODEL = """
kind = "state-space"
name = "Roll"

[states]
p = "rad/s"

[inputs]
aileron = "rad"

[outputs]
p = "p"

[parameters]
Lp = { value = -2.0, min = -20.0, max = 0.0, unit = "1/s" }
Lda = { value = 5.0, min = 0.0, max = 50.0, unit = "1/s^2" }

[equations]
"p'" = "Lp*p + Lda*aileron"
"""
STUDY = """
[study]
title = "A toy"

[[record]]
name = "sweep"
path = "sweep.nc"

[response]
band_rad_s = [1.0, 20.0]

[[model]]
name = "roll"
template = "roll.toml"
identify = ["sweep"]
fit = {{ method = "{method}", pull = 0.25 }}
"""


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any], str]:
    """Folder of what commands and studies wrote, what they returned, and what they printed."""
    folder = tmp_path_factory.mktemp("toy")
    time_s = np.arange(1000) * 0.02
    record = fid.Record.from_arrays(
        time_s, inputs={"aileron": 0.1 * np.sin(0.45 * time_s**2 + time_s)},
        units={"aileron": "rad"}, hold="zero",
    )  # fmt: skip
    (folder / "roll.toml").write_text(MODEL)
    truth = fid.load_model(folder / "roll.toml").with_values({"Lp": -4.0, "Lda": 10.0})
    flown = fid.simulate(truth, record)
    noise = np.random.default_rng(3).standard_normal(time_s.size) * 1e-3
    fid.write_records([flown.replace({"p": flown["p"] + noise})], folder / "sweep.nc")
    for method in ("toy", "toy_curve"):
        (folder / f"{method}-study.toml").write_text(STUDY.format(method=method))
    done = subprocess.run(
        [sys.executable, "-c", ADDED + USED, str(folder)],
        cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (folder / "told.json").is_file(), done.stderr
    return folder, json.loads((folder / "told.json").read_text()), done.stdout + done.stderr


@pytest.mark.parametrize("method", ["toy", "toy_curve"])
def test_a_new_method_needs_its_folder_and_its_line(
    used: tuple[Path, dict[str, Any], str], method: str
) -> None:
    folder, told, printed = used
    identified, studied, refused = told["ends"][method != "toy"]
    assert identified == studied == 0, printed
    assert refused == 2
    for file in (folder / f"{method}.toml", folder / method / "models" / "roll.toml"):
        written = fid.load_model(file)
        # A fifth off, as the option says.
        assert written.parameters["Lda"].value == pytest.approx(8.0, rel=0.02)
        assert written.estimated.method == method
        assert written.estimated.provenance["told"]["pull"] == 0.25


def test_commands_and_pages_tell_options_of_a_new_method(
    used: tuple[Path, dict[str, Any], str],
) -> None:
    _, told, printed = used
    assert "identify, toy (on records)" in told["page"]
    assert (
        "| `pull` | `0.0` | a number from 0 on [1] | How far estimates go to zero. |"
        in told["page"]
    )
    assert "Invalid value for '--pull'" in printed
