"""Count what is asked for, and write it on the page."""

from __future__ import annotations

import argparse
from pathlib import Path

from benchmarks.fleet_counts import SECTIONS
from benchmarks.fleet_counts.sections import placed


def main() -> None:
    """Tables on the screen, and between the marks of the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fleet_counts")
    parser.add_argument("section", nargs="*", choices=[[], *SECTIONS], default=[])
    parser.add_argument("--fleets", type=int, default=100, help="drawn for each row")
    parser.add_argument("--page", type=Path, help="Markdown with the marks of the sections")
    asked = parser.parse_args()
    for name in asked.section or SECTIONS:
        table = SECTIONS[name](asked.fleets).table(lambda line: print(line, flush=True))
        if asked.page is not None:
            page = asked.page.read_text(encoding="utf-8")
            asked.page.write_text(placed(page, name, table), encoding="utf-8")


if __name__ == "__main__":
    main()
