"""Studies on record files, and black-box models in studies: every stage, every refusal."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import flightid as fid
from flightid.cli.program import run as command
from flightid.conventions import Light
from flightid.errors import StudyError
from flightid.identification.innovation_tests import INPUTS_IN_ERRORS
from flightid.identification.prediction_error.findings import CANCELLATION
from flightid.report.content import Figure
from flightid.report.html import to_html
from flightid.report.text import to_text
from flightid.study.settings import read_settings
from flightid.validation.order_scan.trials import fit_of

TRUTH = fid.PolynomialModel(("drive",), "angle", 0.1, a=[1, -1.6, 0.8], b=[[0.4]], nk=(2,))

LINEAR = """
[study]
title = "Rig"
[[record]]
name = "fitted"
path = "rig.csv"
span_s = [0.0, 40.0]
[[record]]
name = "choice"
path = "rig.csv"
span_s = [40.0, 80.0]
[[record]]
name = "unseen"
path = "rig.mat"
time_column = "t"
columns = { drive = "V" }
units = { drive = "V" }
[[model]]
name = "Angle"
structure = "armax"
inputs = ["drive", "idle"]
outputs = "angle"
identify = "fitted"
select = "choice"
verify = "unseen"
band_rad_s = [0.6, 10.0]
na = [1, 2, 3]
nb = [1, 2]
nc = [1, 2]
nk = [1, 2]
"""


def rig(seed: int) -> dict[str, np.ndarray]:
    """Two drives of which one moves nothing, and noise at the output."""
    rng = np.random.default_rng(seed)
    drive, idle = np.repeat(np.sign(rng.standard_normal((2, 400))), 2, axis=1)
    record = fid.Record.from_arrays(
        np.arange(800) / 10, inputs={"drive": drive}, outputs={"angle": np.zeros(800)}
    )
    angle = TRUTH.simulate(record) + 0.05 * rng.standard_normal(800)
    return {"t": np.arange(800) / 10, "drive": drive, "idle": idle, "angle": angle}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("rig")
    data = rig(0)
    rows = ["time [s],drive [V],idle [V],angle [rad]"]
    rows += [",".join(map(repr, map(float, row))) for row in zip(*data.values(), strict=True)]
    (place / "rig.csv").write_text("\n".join(rows), encoding="utf-8")
    other = rig(1)
    named = {"t": other["t"], "V": other["drive"], "idle": other["idle"], "angle": other["angle"]}
    savemat(place / "rig.mat", named)
    return place


def written(folder: Path, text: str) -> Path:
    path = folder / "study.toml"
    path.write_text(text, encoding="utf-8")
    return path


def units_in_mat(text: str) -> str:
    return text.replace(
        'units = { drive = "V" }', 'units = { drive = "V", idle = "V", angle = "rad" }'
    )


@pytest.fixture(scope="module")
def study(folder: Path) -> fid.Study:
    return fid.run_study(written(folder, units_in_mat(LINEAR)), output=folder / "out")


def test_the_input_without_coherence_is_left_out_and_the_rest_is_found(study: fid.Study) -> None:
    item = study.identified[0]
    assert [finding.code for finding in item.left_out] == ["left-out"]
    assert "angle/idle is left out: coherence reaches" in item.left_out[0].message
    assert isinstance(item.fit.model, fid.PolynomialModel)
    assert item.fit.model.inputs == ("drive",)
    frequency = item.fit.details.modes[0].natural_frequency
    assert frequency is not None
    assert frequency.stderr is not None
    truth = TRUTH.modes()["angle/drive"][0].natural_frequency_rad_s or 0.0
    assert frequency.stderr < 0.01 * truth
    assert abs(frequency.value - truth) < 3.5 * frequency.stderr


def test_every_stage_stands_in_results_and_report(study: fid.Study) -> None:
    item = study.identified[0]
    assert item.tests is not None
    assert list(item.verifications) == ["unseen", "unseen, 1 ahead"]
    assert item.spectra is not None
    results = json.loads((study.output / "results.json").read_text(encoding="utf-8"))
    box = results["models"][0]
    for stage in ("coherent", "choice", "residual_tests", "spectra"):
        assert box[stage]["schema"].startswith("flightid.")
    for group in ("fits", "responses", "verifications"):
        for value in box[group].values():
            assert value["schema"].startswith("flightid.")
    assert results["inspection"] is None
    text = to_text(study.document)
    for title in ("Coherence", "Choice of the structure", "Residual tests", "Spectra", "Records"):
        assert f"\n{title}\n" in text
    assert to_html(study.document).startswith("<!")
    figures = [block for block in study.document.walk() if isinstance(block, Figure)]
    series = [name for figure in figures for name in figure.series]
    assert any(name.startswith("taken: na 2, ") for name in series)
    assert "1 model" in repr(study)
    assert study.summary().title == "Models"
    assert set(study.files) == {"study.toml", "rig.csv", "rig.mat"}


def test_a_balanced_choice_takes_the_noise_model_that_whitens(study: fid.Study) -> None:
    item = study.identified[0]
    assert isinstance(item.choice, fid.OrderScan)
    assert item.tests is not None
    assert item.tests.test("εε", "angle").verdict == "pass"
    assert isinstance(item.fit.model, fid.PolynomialModel)
    assert (item.fit.structure.na, item.fit.structure.nk) == (2, (2,))


def _first_without_doubt(scan: fid.OrderScan, fit: fid.Fit) -> fid.OrderTrial:
    """By free run, of those whose own fit does not doubt its structure."""
    doubts = {CANCELLATION, INPUTS_IN_ERRORS, "local-minima"}
    records = [each.measured for each in fit.records]
    for trial in scan.trials:
        alone = scan.best if trial is scan.trials[0] else fit_of(trial, records)
        if not doubts & {each.code for each in alone.findings if each.light is not Light.GREEN}:
            return trial
    return scan.trials[0]


@pytest.mark.parametrize("choose", ["free_run", "simplest", "bic"])
@pytest.mark.usefixtures("no_report")
def test_the_other_rules_choose_as_they_say(choose: str, folder: Path) -> None:
    text = units_in_mat(LINEAR).replace("na = ", f'choose = "{choose}"\nna = ')
    found = fid.run_study(written(folder, text), output=folder / "rules")
    item = found.identified[0]
    scan, fit = item.choice, item.fit
    assert isinstance(scan, fid.OrderScan)
    assert isinstance(fit.model, fid.PolynomialModel)
    expected = {
        "free_run": _first_without_doubt(scan, fit),
        "simplest": scan.simplest,
        "bic": scan.smallest("bic"),
    }[choose]
    assert str(fit.structure) == str(expected.structure)
    assert bool(item.choice_findings) is (choose == "free_run" and bool(scan.findings))


NARX = """
structure = "narx"
inputs = "drive"
outputs = "angle"
identify = "fitted"
select = "choice"
verify = "unseen"
band_rad_s = [0.6, 10.0]
output_lags = [2, 3]
input_lags = 2
width = [4.0, 8.0]
stop = "bic"
"""


@pytest.mark.usefixtures("no_report")
def test_a_narx_model_is_searched_and_tested(folder: Path) -> None:
    head = units_in_mat(LINEAR).split("structure")[0]
    found = fid.run_study(written(folder, head + NARX), output=folder / "narx")
    item = found.identified[0]
    assert isinstance(item.choice, fid.validation.NarxSearch)
    assert len(item.choice.trials) == 4
    assert isinstance(item.fit.model, fid.NarxModel)
    beside = item.verifications["unseen"]
    assert isinstance(beside, fid.Comparison)
    assert beside.names == ("Angle", "linear, same lags")
    assert item.tests is not None
    assert str(item.tests.horizon) == "one step ahead"
    text = to_text(found.document)
    assert "NARX" in text


@pytest.mark.usefixtures("no_report")
def test_lags_of_a_narx_model_follow_from_the_spectrum(folder: Path) -> None:
    head = units_in_mat(LINEAR).split("structure")[0]
    head = head.replace("[0.0, 40.0]", "[0.0, 80.0]")
    text = NARX.replace("[2, 3]", '"spectrum"').replace("[4.0, 8.0]", "8.0")
    fit = fid.run_study(written(folder, head + text), output=folder / "lags").identified[0].fit
    (said,) = (each for each in fit.findings if each.code == "lags-of-spectrum")
    assert f"{fit.structure.output_lags} lags" in said.message
    assert abs(fit.structure.output_lags - 14) <= 2, "2 pi over the angle of the truth's poles"
    with pytest.raises(StudyError, match=r"whole numbers from 0 on or 'spectrum'"):
        fid.run_study(written(folder, head + text.replace("spectrum", "spectral")))


@pytest.mark.usefixtures("no_report")
def test_one_structure_needs_no_choice(folder: Path) -> None:
    text = units_in_mat(LINEAR).replace('select = "choice"\n', "")
    text = re.sub(r"na = .*\nnb = .*\nnc = .*\nnk = .*", "na = 2\nnb = 1\nnc = 2\nnk = 2", text)
    item = fid.run_study(written(folder, text), output=folder / "one").identified[0]
    assert item.choice is None
    assert item.fit is not None


@pytest.mark.usefixtures("no_report")
def test_nothing_coherent_leaves_the_model_out_without_a_fault(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = units_in_mat(LINEAR).replace('["drive", "idle"]', '"idle"')
    code = command(["--quiet", "run", str(written(folder, text)), "--output", str(folder / "none")])
    assert code == 0
    said = capsys.readouterr().out
    assert "left out" in said


@pytest.mark.usefixtures("no_report")
def test_models_with_equations_may_use_record_files(folder: Path) -> None:
    head = units_in_mat(LINEAR).split("structure")[0]
    text = (
        head.replace("[[model]]", '[fit]\nmethod = "output_error"\n[[model]]')
        + 'template = "own.toml"\nidentify = "fitted"\nverify = "unseen"\n'
    )
    (folder / "own.toml").write_text(OWN, encoding="utf-8")
    found = fid.run_study(written(folder, text), output=folder / "grey")
    assert found.identified[0].fit.records
    assert found.inspection is None
    assert "The records" in to_text(found.document)


OWN = """
kind = "transfer"
name = "angle"
source = "a second-order lag"
[inputs]
drive = "V"
[outputs]
angle = "rad"
[parameters]
k = { value = 3.0, min = 0.1, max = 100.0, unit = "rad/V", note = "steady gain" }
zeta = { value = 0.3, min = 0.01, max = 2.0, unit = "1", note = "damping ratio" }
omega = { value = 4.5, min = 0.5, max = 20.0, unit = "rad/s", note = "natural frequency" }
tau = { value = 0.1, min = 0.0, max = 0.3, unit = "s", note = "delay" }
[responses."angle/drive"]
gain = "k*omega^2"
denominator = ["s^2 + 2*zeta*omega*s + omega^2"]
delay = "tau"
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('select = "choice"\n', "", "select is missing: several structures are tried"),
        ("[0.6, 10.0]", "[-1.0, 10.0]", "above 0 [rad/s]"),
        ('"armax"', '"arma"', "structure is not known"),
        ("nc = [1, 2]", "nc = [1, 1]", "nc is tried twice"),
        ("nc = [1, 2]", "nc = -1", "nc is too small"),
        ("nc = [1, 2]", "", "nc is missing"),
        ('verify = "unseen"', 'verify = "nowhere"', "there is no such record"),
        ('verify = "unseen"', 'verify = "fitted"', "verified on data it has seen"),
        ('name = "choice"', 'name = "fitted"', "two [[record]]s have one name"),
        ("[[model]]", "[[segment]]\nname='s'\nspan_s=[0,1]\n[[model]]", "cuts a log"),
        ("[[model]]", "[log]\npath = 'x'\n[[model]]", "the source of the data is not clear"),
        ('time_column = "t"', 'tme = "t"', "there is no key 'tme'"),
    ],
)
def test_a_study_that_does_not_fit_is_refused(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    assert old in LINEAR
    with pytest.raises(StudyError, match=re.escape(said)):
        read_settings(written(tmp_path, LINEAR.replace(old, new, 1)))


def test_a_narx_model_is_chosen_by_free_run_alone(tmp_path: Path) -> None:
    text = LINEAR.split("structure", maxsplit=1)[0] + NARX + 'choose = "bic"\n'
    with pytest.raises(StudyError, match="'free_run' for NARX"):
        read_settings(written(tmp_path, text))


def test_a_missing_file_is_named(folder: Path) -> None:
    text = units_in_mat(LINEAR).replace("rig.mat", "gone.mat")
    with pytest.raises(StudyError, match="the file of record 'unseen' is not there"):
        fid.run_study(written(folder, text), output=folder / "gone")
    # What makes records is named where the study's own first lines name it, all files in one error.
    opened = "# A rig.\n# `python fly.py records` writes\n# them.\n" + text.replace(
        "rig.csv", "lost.csv"
    )
    said = re.escape(f"making them (cd {folder} && python fly.py records), or correct path")
    with pytest.raises(StudyError, match=said) as raised:
        fid.run_study(written(folder, opened), output=folder / "gone")
    assert str(raised.value).count("python fly.py") == 1


@pytest.mark.usefixtures("no_report")
def test_a_file_with_a_gap_needs_a_decision(folder: Path) -> None:
    lines = (folder / "rig.csv").read_text(encoding="utf-8").split("\n")
    (folder / "gap.csv").write_text("\n".join(lines[:300] + lines[330:]), encoding="utf-8")
    text = units_in_mat(LINEAR).replace('"rig.csv"', '"gap.csv"', 1)
    with pytest.raises(StudyError, match="not clear which manoeuvre record 'fitted' is"):
        fid.run_study(written(folder, text), output=folder / "gap")
    named = text.replace('"gap.csv"', '"gap.csv"\nmanoeuvre = "gap[1]"', 1).replace(
        "[0.0, 40.0]", "[35.0, 80.0]", 1
    )
    found = fid.run_study(written(folder, named), output=folder / "gap")
    assert found.records["fitted"].time_s[0] == pytest.approx(35.0)


def test_a_log_has_no_place_in_a_study_of_records(folder: Path) -> None:
    with pytest.raises(StudyError, match="reads records, not a log"):
        fid.run_study(
            written(folder, units_in_mat(LINEAR)), output=folder / "out", log=folder / "rig.csv"
        )
