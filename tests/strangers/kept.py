"""Counts that last: a file with one line of JSON a flight, so that runs of a case add up."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

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


class KeptFlights:
    """Flights of a file, which is read once, and to which every further one is added."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.trials = read(path)

    def tally(self, case: Case) -> Tally:
        """All that is known of a case."""
        known = self.trials.get(case.name, {})
        return Tally(case.name, tuple(known[seed] for seed in sorted(known)))

    def seconds(self, case: Case) -> float:
        """Median of a flight; none for a case that was never flown, which comes first."""
        taken = [trial.seconds for trial in self.trials.get(case.name, {}).values()]
        return float(np.median(taken)) if taken else 0.0

    def fly(self, case: Case, seeds: Sequence[int]) -> None:
        """Fly those seeds that the file has not."""
        known = self.trials.setdefault(case.name, {})
        # A line that was cut off must not swallow the next one.
        with self.path.open("a+b") as file:
            file.seek(max(file.tell() - 1, 0))
            file.write(b"\n" if file.read(1) not in (b"", b"\n") else b"")
            for seed in seeds:
                if seed not in known:
                    known[seed] = case.fly(seed)
                    file.write(f"{as_line(case.name, seed, known[seed])}\n".encode())
                    file.flush()

    def flown(self, cases: Sequence[Case], first: int, counts: Sequence[int]) -> Iterator[Tally]:
        """Cases brought to one count after the other, the cheapest first, and their tallies."""
        for place, count in enumerate(counts, 1):
            for case in sorted(cases, key=self.seconds):
                self.fly(case, range(first, first + count))
                if place == len(counts):
                    yield self.tally(case)
