"""The commit-msg hook, as git calls it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


def _check(repository: Path, folder: Path, message: str) -> subprocess.CompletedProcess[str]:
    file = folder / "COMMIT_EDITMSG"
    file.write_text(message, encoding="utf-8")
    command = [sys.executable, str(repository / "tools" / "commit_subject.py"), str(file)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "message",
    [
        "Hold the version in one place\n\nTwo files stated it.\n",
        "x" * 60,
        "\n# a comment above\nShort\n",
        f"Merge branch '{'x' * 80}'\n",
        f"Short\n# ------------------------ >8 ------------------------\n{'d' * 200}\n",
    ],
)
def test_a_good_message_passes(repository: Path, tmp_path: Path, message: str) -> None:
    run = _check(repository, tmp_path, message)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ("x" * 61, "The subject has 61 letters, at most 60 are wanted"),
        ("ä" * 61, "The subject has 61 letters"),
        ("Subject\nbody at once\n", "leave a line between subject and body"),
        ("\n# only a comment\n", "The message is empty"),
    ],
)
def test_a_bad_message_is_stopped(
    repository: Path, tmp_path: Path, message: str, said: str
) -> None:
    run = _check(repository, tmp_path, message)
    assert run.returncode == 1
    assert said in run.stderr


def test_without_a_file_it_says_how_it_is_called(repository: Path) -> None:
    command = [sys.executable, str(repository / "tools" / "commit_subject.py")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "commit_subject.py .git/COMMIT_EDITMSG" in run.stderr
