"""Run every benchmark of this folder, or those that are named, and print their tables.

Run: python -m benchmarks [topic ...]      for example: python -m benchmarks output_error narx

A topic is a module here with `run()`, which returns a table; others are programs of their own.
Peers that are not installed are left out with a word; `pip install .[bench]` brings them.
"""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from pathlib import Path

from flightid.errors import FlightidError


def topics() -> list[str]:
    """Names of the modules in this folder that return a table."""
    return sorted(path.stem for path in Path(__file__).parent.glob("*.py") if _returns_one(path))


def _returns_one(path: Path) -> bool:
    """Read and not imported: a program of its own may need what is not installed."""
    found = ast.parse(path.read_bytes()).body
    return any(isinstance(each, ast.FunctionDef) and each.name == "run" for each in found)


def main(wanted: list[str]) -> int:
    """Print the tables; 2 for an unknown topic, 1 where one could not run."""
    known = topics()
    stray = [name for name in wanted if name not in known]
    if stray:
        print(f"no such benchmark: {', '.join(stray)}; there are {', '.join(known)}")
        return 2
    failed = 0
    for name in wanted or known:
        print(f"\n{name} …", flush=True)
        try:
            print(import_module(f"benchmarks.{name}").run(), flush=True)
        except (ModuleNotFoundError, FileNotFoundError, FlightidError) as error:
            # One peer or one record that is not here must not take the others' tables with it.
            print(f"  not run: {error}")
            failed += 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
