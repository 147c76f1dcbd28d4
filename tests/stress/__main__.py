"""Run seeds and list what broke: `python -m tests.stress --runs 100000 --keep FILE`."""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

from tests.stress.runs import run


def main() -> None:
    """Count ends by kind; faults go to the file with their seeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="file to which faults are added")
    asked = parser.parse_args()
    ends: Counter[str] = Counter()
    begun = time.process_time()
    for seed in range(asked.first_seed, asked.first_seed + asked.runs):
        try:
            ends[run(seed)] += 1
        except Exception as error:
            ends["FAULT"] += 1
            line = f"{seed} {type(error).__name__}: {error}"[:400]
            print(line, flush=True)
            if asked.keep:
                with asked.keep.open("a") as file:
                    file.write(line + "\n")
    each = 1e3 * (time.process_time() - begun) / max(asked.runs, 1)
    print(f"seeds {asked.first_seed} to {seed}: {dict(ends.most_common())}, {each:.1f} ms a run")


if __name__ == "__main__":
    main()
