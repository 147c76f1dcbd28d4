"""The same fit shows the same light with the same reason wherever it is shown."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.conventions import Light
from flightid.errors import DataError
from flightid.report.html import to_html
from flightid.report.text import to_text

STUDY = """
[study]
title = "One light"
[[record]]
name = "flown"
path = "flown.parquet"
[[model]]
name = "Roll rate"
template = "rate_first_order"
axis = "roll"
identify = "flown"
band_rad_s = [2.0, 20.0]
[[model]]
name = "Recursion"
structure = "arx"
inputs = ["tau_phi"]
outputs = "p"
identify = "flown"
band_rad_s = [2.0, 20.0]
na = 1
nb = 1
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    truth = fid.load_model("rate_first_order", axis="roll").with_values({"Lp": -6.0})
    time_s = np.arange(3000) * 0.02
    rng = np.random.default_rng(2)
    sweep = 0.1 * np.sin(0.25 * time_s**2) + 0.02 * rng.standard_normal(time_s.size)
    driven = fid.Record.from_arrays(time_s, inputs={"tau_phi": sweep}, units={"tau_phi": "1"})
    record = fid.simulate(truth, driven, units={"p": "rad/s"})
    noisy = record.replace({"p": record["p"] + 0.1 * rng.standard_normal(time_s.size)})
    return fid.write_records(noisy, tmp_path_factory.mktemp("light") / "flown.parquet")


@pytest.fixture(scope="module")
def study(flown: Path) -> fid.Study:
    path = flown.with_name("study.toml")
    path.write_text(STUDY)
    return fid.run_study(path)


def test_a_study_shows_the_light_of_its_fits_on_every_page(study: fid.Study) -> None:
    verdicts = [item.fit.evidence.verdict for item in study.identified if item.fit is not None]
    assert len(verdicts) == 2
    unbroken, page = " ".join(to_text(study.document).split()), to_html(study.document)
    stored = json.loads((study.output / "results.json").read_text(encoding="utf-8"))
    for verdict in verdicts:
        assert unbroken.count(verdict.message) >= 2, "the line in short, and the block of the model"
        assert verdict.message in page
    plain = next(iter(stored["models"][0]["fits"].values()))["evidence"]
    assert plain["light"] == verdicts[0].light
    assert plain["missing"] == []


def test_the_command_line_shows_the_light_of_the_same_fit(
    flown: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["identify", str(flown), "--model", "rate_first_order", "--axis", "roll"]
    words += ["--band", "2", "20"]
    assert run(words) == 0
    shown = capsys.readouterr().out
    assert run([*words, "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)["evidence"]
    records = fid.read_records(flown, inputs=["tau_phi"], outputs=["p"])
    response = fid.estimate_response(records, band_rad_s=(2.0, 20.0))
    fit = fid.identify(fid.load_model("rate_first_order", axis="roll"), response)
    assert plain == fit.evidence.to_dict()
    for line in fit.evidence.lines:
        assert line in shown


def test_gains_show_the_light_of_their_fit_and_are_refused_on_red(study: fid.Study) -> None:
    fit = study.identified[0].fit
    gains = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0).with_gains(
        ATC_RAT_RLL_P=0.08, ATC_RAT_RLL_I=0.08, ATC_RAT_RLL_D=0.002
    )
    verdict = fit.evidence.verdict
    design = fid.tune_pid(fit, gains=gains, draws=3, angle_loop=False)
    told = next(finding for finding in design.findings if finding.code == "fit-evidence")
    assert told.light is verdict.light
    assert verdict.message in told.message
    bad = fit.evidence.with_checks([fid.Check("residuals", Light.RED, "nothing explained")])
    with pytest.raises(DataError, match=r"the fit of .* is red"):
        fid.tune_pid(dataclasses.replace(fit, evidence=bad), gains=gains, draws=20)


def test_every_kind_of_fit_has_evidence_that_is_never_green_for_what_is_missing(
    flown: Path,
) -> None:
    record = fid.read_records(flown)[0]
    model = fid.load_model("rate_first_order", axis="roll")
    response = fid.estimate_response(record, omega_rad_s=np.geomspace(2.0, 20.0, 40))
    fits = [
        fid.identify(model, response),
        fid.identify(model, record),
        fid.identify(fid.PolynomialModel.arx(("tau_phi",), "p", na=2, nb=2), record),
        fid.identify(fid.InnovationsModel.subspace(("tau_phi",), ("p",), order=1), record),
        fid.identify(fid.NarxStructure(("tau_phi",), "p", 2, 2), record),
    ]
    for fit in fits:
        evidence = fit.evidence
        compared = fit.agreement is not None
        assert evidence.missing == (() if compared else ("agreement of parts",)), fit
        assert compared or evidence.light in (Light.AMBER, Light.RED)
        assert fit.to_dict()["evidence"] == evidence.to_dict()
        assert str(evidence.lines[0]) in fit.summary().to_text()
