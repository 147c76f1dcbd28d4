"""The committed `_native.pyi` is what the native module says of itself."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_stub_is_current(repository: Path) -> None:
    run = subprocess.run(
        [sys.executable, str(repository / "tools" / "stubs.py")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
