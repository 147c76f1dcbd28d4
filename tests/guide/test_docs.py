"""The Python blocks of docs/*.md run, in order, one namespace for each file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

PAGES = sorted((Path(__file__).parent.parent.parent / "docs").glob("*.md"))
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


LONG = {
    *("tuning", "verification", "responses", "margins", "evidence", "regression", "inspection"),
    *("identify", "black_box", "flight"),
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
