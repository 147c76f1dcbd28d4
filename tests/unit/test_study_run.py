"""A whole study on a short simulated flight: every stage, every face, every ending."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.conventions import Light
from flightid.errors import StudyError
from flightid.findings import Finding
from flightid.report.content import Figure
from flightid.report.html import to_html
from flightid.report.text import to_text
from flightid.study import answer
from flightid.study import run as running

STUDY = """
[study]
title = "Short flight <b>"
[flight]
simulate = "quadrotor"
seed = 1
log_every = 4
[[flight.sweep]]
axis = 10
start_s = 2.0
magnitude = 0.15
start_hz = 0.4
stop_hz = 8.0
fade_in_s = 1.0
record_s = 40.0
fade_out_s = 1.0
[[flight.doublet]]
axis = "roll"
start_s = 52.0
amplitude = 0.3
[[segment]]
name = "sweep"
sid_axis = 10
[[segment]]
name = "doublet"
span_s = [61.0, 66.0]
[response]
estimator = "instrument"
compare = ["composite"]
[reduce]
[[model]]
name = "Roll rate"
template = "rate_motor_lag"
axis = "roll"
identify = "sweep"
verify = "doublet"
rivals = "rate_integrator"
band_rad_s = [4.0, 40.0]
parameters.T_m = { maximum = 0.15 }
"""

SHORT = """
[study]
title = "Short record"
[[record]]
name = "r"
path = "short.csv"
[[model]]
name = "Black"
structure = "arx"
inputs = "u"
outputs = "y"
identify = "r"
na = 1
nb = 1
nk = 1
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> fid.Study:
    folder = tmp_path_factory.mktemp("study")
    (folder / "study.toml").write_text(STUDY)
    return fid.run_study(folder / "study.toml")


def test_output_is_whole(study: fid.Study) -> None:
    names = sorted(item.name for item in study.output.iterdir())
    reports = ["report.html", "report.txt", "results.json"]
    assert names == [".written.json", "flight.bin", "models", *reports]
    assert study.output.name == "study-output"
    assert list(study.output.parent.glob(".*")) == []


def test_every_stage_left_its_result(study: fid.Study) -> None:
    (item,) = study.identified
    assert list(item.fits) == ["instrument", "composite"]
    assert list(item.verifications) == ["doublet"]
    assert item.reduction is not None
    (step,) = item.reduction.path
    assert (step.name, step.accepted) == ("tau", False)
    assert item.fit.model is item.reduction.start.model
    assert {f.code for f in item.reduction.path_findings} <= {f.code for f in item.findings}
    beside = item.verifications["doublet"]
    assert isinstance(beside, fid.Comparison)
    assert beside.names == ("Roll rate", "rate_integrator")
    assert study.truth is not None
    assert set(study.truth.parameters(item.fit.model)) == {"Ltphi", "Lp", "T_m", "tau"}
    assert set(study.records) == {"sweep", "doublet"}
    assert re.fullmatch(r"Study\('Short flight <b>', 1 model, .*green.*\)", repr(study))


def test_the_report_shows_the_time_history_that_was_used(study: fid.Study) -> None:
    """Instrument, input and output over the time of the log, and nothing else of the record."""
    figures = [block for block in study.document.walk() if isinstance(block, Figure)]
    (drawn,) = (each for each in figures if each.caption.startswith("What the responses were"))
    assert "sweep; injected signals, inputs and" in drawn.caption
    traces = [(each["name"], each["yaxis"]) for each in drawn.spec["data"]]
    assert traces == [("excitation", "y"), ("input", "y2"), ("output", "y3")]
    assert study.identified[0].training == (study.records["sweep"],)


def test_text_html_and_json_agree_on_the_numbers(study: fid.Study) -> None:
    values = json.loads((study.output / "results.json").read_text())
    text = (study.output / "report.txt").read_text()
    page = (study.output / "report.html").read_text()
    fitted = values["models"][0]["fits"]["instrument"]["parameters"]
    for name, parameter in fitted.items():
        shown = f"{parameter['value']:.5g}"
        assert shown in text, name
        assert f">{shown}<" in page, name
    assert text == to_text(study.document)
    assert page == to_html(study.document)
    assert values["report"]["tally"] in text
    path = values["models"][0]["reduction"]["path"]
    assert [step["name"] for step in path] == ["tau"]
    assert "Reduction of the structure" in page
    assert "Step 1, tau: the average cost would rise to" in text


def test_provenance_names_every_file_by_its_hash(study: fid.Study) -> None:
    text = (study.output / "report.txt").read_text()
    assert set(study.files) == {"study.toml", "flight.bin"}
    for digest in study.files.values():
        assert digest in text


@pytest.mark.usefixtures("no_report")
def test_a_second_run_on_the_written_log_finds_the_same(
    study: fid.Study, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = study.output.parent / "study.toml"
    output = tmp_path / "again"
    arguments = ["run", str(source), "--log", str(study.output / "flight.bin")]
    code = run([*arguments, "--output", str(output), "--json"])
    values = json.loads(capsys.readouterr().out)
    first = study.to_dict()
    assert code in {0, 1}
    assert values["truth"] is None
    assert values["models"] == json.loads(json.dumps(first["models"]))


@pytest.mark.parametrize(
    "failure", [pytest.param(RuntimeError, marks=pytest.mark.nightly), KeyboardInterrupt]
)
def test_a_run_that_breaks_off_leaves_nothing(
    study: fid.Study,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    failure: type[BaseException],
) -> None:
    def broken(*_: object) -> str:
        raise failure

    monkeypatch.setattr(running, "to_html", broken)
    (study.output.parent / "short.toml").write_text(SHORT)
    rows = (f"{0.1 * k},{np.sin(k)},{np.cos(k)}" for k in range(100))
    (study.output.parent / "short.csv").write_text("\n".join(["t,u,y", *rows]))
    with pytest.raises(failure):
        fid.run_study(study.output.parent / "short.toml", output=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("sid_axis = 10", "sid_axis = 11", "no such system-identification run: found runs of"),
        ('template = "rate_motor_lag"', 'template = "rate_motor"', "no such library model"),
        ("parameters.T_m", "parameters.T_x", "there is no such parameter"),
    ],
)
def test_what_the_log_or_library_lacks_is_named(
    study: fid.Study, tmp_path: Path, old: str, new: str, said: str
) -> None:
    (tmp_path / "study.toml").write_text(STUDY.replace(old, new))
    with pytest.raises(fid.FlightidError, match=said):
        fid.run_study(tmp_path / "study.toml", log=study.output / "flight.bin")
    assert [item.name for item in tmp_path.iterdir()] == ["study.toml"]


TWO_RESPONSES = (
    'kind = "transfer"\nname = "two"\nsource = "none"\n'
    '[inputs]\ntau_phi = "1"\n[outputs]\np = "rad/s"\nq = "rad/s"\n'
    '[parameters]\nT_m = { value = 0.1, min = 0.001, max = 1.0, unit = "s" }\n'
    'K = { value = 200.0, unit = "rad/s^2" }\n'
    '[responses."p/tau_phi"]\ngain = "K"\ndenominator = ["s", "T_m*s + 1"]\n'
    '[responses."q/tau_phi"]\ngain = "K"\ndenominator = ["s"]\n'
)


@pytest.mark.parametrize(
    "wanted", ['"coherent"', pytest.param('["p/tau_phi"]', marks=pytest.mark.nightly)]
)
@pytest.mark.usefixtures("no_report")
def test_of_several_responses_those_asked_for_are_fitted(
    study: fid.Study, tmp_path: Path, wanted: str
) -> None:
    (tmp_path / "two.toml").write_text(TWO_RESPONSES)
    text = STUDY.replace('"rate_motor_lag"\naxis = "roll"', f'"two.toml"\nresponses = {wanted}')
    text = text.replace('compare = ["composite"]\n[reduce]\n', "")
    (tmp_path / "study.toml").write_text(text)
    item = fid.run_study(tmp_path / "study.toml", log=study.output / "flight.bin").identified[0]
    # A roll sweep on a rig moves no pitch: that response has no coherence.
    assert [each.name for each in item.fit.responses] == ["p/tau_phi"]
    assert (item.coherent is not None) == (wanted == '"coherent"')


def test_a_log_that_is_not_there_is_named(tmp_path: Path) -> None:
    text = re.sub(r"\[flight\].*?\[\[segment\]\]", "[[segment]]", STUDY, count=1, flags=re.DOTALL)
    (tmp_path / "study.toml").write_text('[log]\npath = "lost.bin"\n' + text)
    with pytest.raises(StudyError, match="the log of the study is not there"):
        fid.run_study(tmp_path / "study.toml")


def test_a_folder_of_other_content_is_refused_before_the_work(
    study: fid.Study, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.txt").touch()
    assert run(["run", str(study.output.parent / "study.toml"), "--output", str(tmp_path)]) == 2
    assert "holds something else" in capsys.readouterr().err


def test_the_next_step_names_the_study_as_it_was_given(
    study: fid.Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(answer, "_models", lambda _, source: Finding("answer", Light.GREEN, source))
    asked = str(study.output.with_name("study.toml"))
    assert asked in re.sub(r"\s", "", to_text(answer.short_document(study, study.document)))
    assert answer.answer_of(study).findings[0].message == "study.toml"
    # The page keeps studies in one folder and results in another: a bare name lay in neither.
    held = study.output.parent / "studies" / "0123.toml"
    apart = replace(study, source=held, files={"0123.toml": ""})
    assert answer.answer_of(apart).findings[0].message == "studies/0123.toml"


def test_the_next_step_of_a_model_with_two_inputs_can_be_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    random = np.random.default_rng(3)
    u, w = np.repeat(random.choice([-1.0, 1.0], (2, 160)), 5, axis=1)
    y = np.zeros(800)
    for k in range(1, 800):
        y[k] = 0.9 * y[k - 1] + 0.2 * u[k - 1] + 0.1 * w[k - 1] + 0.01 * random.standard_normal()
    rows = [f"{0.05 * k:.2f},{u[k]},{w[k]},{y[k]:.6f}" for k in range(800)]
    (tmp_path / "short.csv").write_text("\n".join(["time,u,w,y", *rows]))
    study = tmp_path / "two.toml"
    told = 'path = "short.csv"\nhold = "zero"\nloop = "open"'
    text = SHORT.replace('path = "short.csv"', told).replace('inputs = "u"', 'inputs = ["u", "w"]')
    study.write_text(text)
    assert run(["run", str(study)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    said = re.search(r"flightid (tune \S+ --controller pi_d --loops y/u)", shown)
    assert said is not None
    assert run([*said[1].split(), "--loop-rate-hz", "20", "--draws", "6"]) == 0
    assert "gains of y" in capsys.readouterr().out
    assert run([*said[1].split()[:-1], "y/v"]) == 1
    told = capsys.readouterr()
    assert "name one: --loops y/u" in told.out
    assert "report.html" in told.err


@pytest.mark.parametrize(("rate", "told"), [(-0.2, "--loops w/col"), (0.2, "--loops OUTPUT/INPUT")])
def test_no_loop_is_picked_around_a_vehicle_that_grows(rate: float, told: str) -> None:
    """An unstable helicopter was sent to a PID of heave, which holds nothing of it."""
    a, b = np.diag([-0.5, rate]), np.eye(2)
    model = fid.LinearSystem(a, b, np.eye(2), np.zeros((2, 2)), ("col", "lon"), ("w", "u"))
    fit = SimpleNamespace(
        model=model, covariance=np.eye(1), responses=(), linear_system=lambda: model
    )
    study = SimpleNamespace(tuning=None, faults=(), inspection=None)
    assert told in answer._next(study, "h.toml", [SimpleNamespace(fit=fit)])


def test_the_answer_tells_what_all_models_predict_of_one_channel() -> None:
    """Two models of one output, seen on one record: the later one's figure stood for both."""
    of_one, of_other = (
        SimpleNamespace(
            name=name, on_unseen={"doublet": SimpleNamespace(fit_percent={"y1": percent})}
        )
        for name, percent in (("noise", 91.3), ("centres", 49.9))
    )
    assert "they predict 49.9 to 91.3 %" in answer._promise([of_one, of_other])
    of_other.on_unseen["doublet"].fit_percent["y1"] = -3.0
    assert "1 no better than a constant would, y1 of “doublet” by centres least" in (
        answer._promise([of_one, of_other])
    )
