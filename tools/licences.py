"""Licences of everything that runs with flightid: crates inside the wheel, packages beside it.

``python tools/licences.py --write`` makes THIRD_PARTY.md from what is installed; without the flag
the tables are printed.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import tomllib
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "THIRD_PARTY.md"
HEAD = """# Software of others

Made by `python tools/licences.py --write`. The crates are inside the wheel, whose
`dist-info/sboms` lists them with versions and checksums, and what the page and reports are made
of (`tools/sbom.py`); the packages are installed beside it.
Reports draw with plotly.js 4.1.1 (MIT, Copyright 2012-2026, Plotly, Inc.), which the wheel holds.
The page of `flightid app` is made of Svelte 5.57.3 (MIT, Copyright 2016-2025, Svelte
Contributors), uPlot 1.6.32 (MIT, Copyright 2022, Leon Sorokin) and three.js 0.187.0 (MIT, Copyright
2010-2026, three.js authors); reports unpack themselves by fflate 0.8.3 (MIT, Copyright 2026, Arjun
Barrett). The wheel holds these too.
"""


def crates() -> Iterator[tuple[str, str, str]]:
    """Name, version and licence of the crates that the wheel is linked from."""
    command = ["cargo", "tree", "--workspace", "-e", "normal,no-proc-macro", "--prefix", "none"]
    command += ["--format", "{p}|{l}"]
    text = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for line in sorted({line.removesuffix(" (*)") for line in text.splitlines()}):
        name, _, licence = line.partition("|")
        words = name.split()
        if words and not words[0].startswith("flightid"):
            yield words[0], words[1].removeprefix("v"), licence


def packages() -> Iterator[tuple[str, str, str]]:
    """Name, version and licence of the packages that `pip install flightid` brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    waiting, seen = [*project["dependencies"]], set[str]()
    found = []
    while waiting:
        line = waiting.pop()
        name = re.split(r"[^\w.-]", line)[0].lower().replace("_", "-")
        if name in seen or "extra ==" in line:
            continue
        seen.add(name)
        try:
            made = distribution(name)
        except PackageNotFoundError:
            continue  # for another system
        about: Any = made.metadata
        classified = [
            each.rpartition(" :: ")[2]
            for each in about.get_all("Classifier") or []
            if each.startswith("License ::")
        ]
        text = (about.get("License") or "").strip()
        short = text if len(text) < 40 else ""
        licence = about.get("License-Expression") or " / ".join(classified) or short
        found.append((name, made.version, licence or "see its files"))
        waiting += made.requires or []
    yield from sorted(found)


def page() -> str:
    """Both tables as Markdown."""
    lines = [HEAD]
    for title, rows in (("Crates", crates()), ("Packages", packages())):
        lines += [f"## {title}\n", "| name | version | licence |", "| --- | --- | --- |"]
        lines += [f"| {name} | {version} | {licence} |" for name, version, licence in rows]
        lines.append("")
    return "\n".join(lines)


def main() -> None:
    """Print the tables or write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help=f"write {PAGE.name}")
    if parser.parse_args().write:
        PAGE.write_text(page(), encoding="utf-8")
    else:
        print(page())


if __name__ == "__main__":
    main()
