"""Counts that last: a file with one line of JSON a flight, so that runs of a case add up."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from tests.strangers.counting import Case, Reading, Tally, Trial


def as_line(case: str, seed: int, trial: Trial) -> str:
    """One flight as JSON."""
    return json.dumps({"case": case, "seed": seed, **asdict(trial)})


def read(path: Path) -> dict[str, dict[int, Trial]]:
    """Trials of a file by case and seed; a last line that was cut off is left out."""
    found: dict[str, dict[int, Trial]] = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            item = json.loads(line)
        except json.JSONDecodeError:
            continue
        case, seed = item.pop("case"), item.pop("seed")
        readings = tuple(
            Reading(**{**each, "interval95": each["interval95"] and tuple(each["interval95"])})
            for each in item.pop("readings")
        )
        found.setdefault(case, {})[seed] = Trial(readings, **item)
    return found


def collected(case: Case, seeds: Sequence[int], path: Path) -> Tally:
    """A case over those seeds, flown where the file has them not, and all that it had besides."""
    known = read(path).get(case.name, {})
    # A line that was cut off must not swallow the next one.
    cut = path.exists() and not path.read_bytes().endswith(b"\n") and path.stat().st_size > 0
    with path.open("a") as file:
        file.write("\n" if cut else "")
        for seed in seeds:
            if seed not in known:
                known[seed] = case.fly(seed)
                file.write(as_line(case.name, seed, known[seed]) + "\n")
                file.flush()
    return Tally(case.name, tuple(known[seed] for seed in sorted(known)))
