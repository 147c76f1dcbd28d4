"""Say what a bare machine lacks before anything is installed; needs Python alone."""

import shutil
import sys

MINIMUM_PYTHON = (3, 11)


def missing() -> list[str]:
    """List what is lacking, each with what to do."""
    found: list[str] = []
    if sys.version_info < MINIMUM_PYTHON:
        found.append(
            f"Python {sys.version_info.major}.{sys.version_info.minor} found, 3.11 needed: "
            "name another with `make PYTHON=python3.12 …`"
        )
    if shutil.which("cargo") is None:
        found.append("no Rust toolchain (cargo) on the path: install Rust 1.89 or newer")
    if not any(shutil.which(name) for name in ("cc", "gcc", "clang")):
        found.append("no C compiler (cc) on the path: Rust needs one to link")
    return found


if __name__ == "__main__":
    for line in missing():
        print(f"flightid: {line}", file=sys.stderr)
    sys.exit(1 if missing() else 0)
