"""`flightid report`: an earlier run's report, again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flightid.cli.program import run
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.report.content import Document, Lights, Section
from flightid.report.json import to_dict
from flightid.report.text import to_text
from flightid.study.output import SCHEMA


def _results(folder: Path, light: Light) -> Document:
    lights = Lights((Finding("cost", light, "average cost is 34", "nothing"),))
    document = Document("Roll", "aircraft", (Section("Verdicts", (lights,)),))
    values = {"schema": SCHEMA, "report": to_dict(document)}
    (folder / "results.json").write_text(json.dumps(values))
    return document


@pytest.mark.parametrize(("light", "code"), [(Light.GREEN, 0), (Light.RED, 1)])
def test_text_json_and_html_of_an_earlier_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], light: Light, code: int
) -> None:
    document = _results(tmp_path, light)
    assert run(["report", str(tmp_path)]) == code
    assert capsys.readouterr().out == to_text(document)
    assert run(["report", str(tmp_path / "results.json"), "--json"]) == code
    assert json.loads(capsys.readouterr().out) == to_dict(document)
    assert run(["report", str(tmp_path), "--html", str(tmp_path / "page.html")]) == code
    assert "average cost is 34" in (tmp_path / "page.html").read_text()
    assert "Wrote" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "a results file is no JSON"),
        ("[]", "needed schema"),
        (json.dumps({"schema": SCHEMA}), "not a report"),
        (json.dumps({"schema": SCHEMA, "report": {"schema": "flightid.document/1"}}), "KeyError"),
        ("[" * 100_000, "a results file is no JSON"),
    ],
)
def test_a_file_that_is_no_result_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, said: str
) -> None:
    (tmp_path / "results.json").write_text(content)
    assert run(["report", str(tmp_path)]) == 2
    assert said in capsys.readouterr().err
