"""The Python blocks of docs/*.md run, in order, one namespace for each file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from flightid.cli.program import run

PAGES = sorted((Path(__file__).parent.parent.parent / "docs").glob("*.md"))
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


LONG = {
    *("tuning", "verification", "responses", "margins", "evidence", "regression", "inspection"),
    *("identify", "black_box", "flight", "fleet"),
}
"""Pages whose examples take half a second or more; the verbs they call have tests of their own."""
RUN = [
    pytest.param(page, id=page.name, marks=pytest.mark.nightly if page.stem in LONG else ())
    for page in PAGES
]


@pytest.mark.parametrize("page", RUN)
def test_python_blocks_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.chdir(tmp_path)
    text = page.read_text(encoding="utf-8")
    if "demo-output/" in text:
        (tmp_path / "demo-output").symlink_to(request.getfixturevalue("demo_output"))
    namespace: dict[str, object] = {"__name__": page.stem}
    for block in BLOCK.findall(text):
        exec(compile(block, str(page), "exec"), namespace)


def test_the_law_of_blocks_of_the_export_page_flies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`flightid fly MODEL --blocks law.toml` with the page's own law."""
    (page,) = (each for each in PAGES if each.stem == "export")
    (law,) = re.findall(
        r"^```toml\n(\[\[block\]\].*?)^```", page.read_text(), re.MULTILINE | re.DOTALL
    )
    (tmp_path / "law.toml").write_text(law, encoding="utf-8")
    words = ["fly", "fixed_wing_longitudinal", "--blocks", str(tmp_path / "law.toml")]
    assert run([*words, "--duration", "0.2"]) == 0, capsys.readouterr().err
