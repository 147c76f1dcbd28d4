"""Print the table: `python -m tests.strangers [PART OF A NAME ...] --runs 500 --jobs 2`.

`--keep FILE` adds every flight to a file and flies only those that it has not, so that runs add up,
the cheapest case first; several numbers after `--runs` bring all cases to each of them in turn;
`--runs 0 --keep FILE` prints what it holds; with `--page docs/coverage.md` it becomes that page,
with `--before FILE` beside what the flights of an earlier tree held.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from tests.strangers.cases import CASES, LIGHTS
from tests.strangers.counting import HEADING, Case, Tally, count
from tests.strangers.coverage_page import write
from tests.strangers.kept import KeptFlights, read


def main() -> None:
    """Count the named cases, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="parts of names of cases; all where none is given")
    parser.add_argument("--runs", type=int, nargs="+", default=[100])
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="file that flights are added to, and read from")
    parser.add_argument("--each", action="store_true", help="coverage of every quantity too")
    parser.add_argument("--page", type=Path, help="Markdown to make of the file of flights")
    parser.add_argument("--before", type=Path, help="flights of an earlier tree, for the page")
    parser.add_argument("--note", default="", help="where the flights come from, for the page")
    asked = parser.parse_args()
    if asked.page and not asked.keep:
        parser.error("--page is made of the file of --keep")
    print(HEADING, flush=True)
    cases = [
        case
        for case in (*CASES, *LIGHTS)
        if not asked.names or any(part in case.name for part in asked.names)
    ]
    for tally in _tallies(cases, asked):
        if not tally.trials:
            continue
        print(tally.row(), flush=True)
        for name in tally.quantities() if asked.each else ():
            share, n = tally.coverage(name)
            print(f"    {name:40s} {100 * share:6.1f} {n:7d}", flush=True)
    if asked.page:
        before = asked.before and read(asked.before)
        write(asked.page, read(asked.keep), before, asked.note)


def _tallies(cases: Sequence[Case], asked: argparse.Namespace) -> Iterator[Tally]:
    if asked.keep:
        yield from KeptFlights(asked.keep).flown(cases, asked.first_seed, asked.runs)
        return
    for case in cases:
        yield count(case, asked.runs[-1], first_seed=asked.first_seed, jobs=asked.jobs)


if __name__ == "__main__":
    main()
