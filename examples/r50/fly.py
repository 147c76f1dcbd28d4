"""Simulated flights that stand in for the records of the R-50 study.

Run: python examples/r50/fly.py [records] [seed] [short|full]
"""

import sys
from pathlib import Path

import flights

import flightid as fid

UNSEEN_S = 6.0
"""Doublets are cut to their length: what follows is the pilot alone."""


def write(folder: Path, seed: int, *, full: bool) -> None:
    """Write sweeps and doublets of both conditions, as the sticks were moved."""
    folder.mkdir(parents=True, exist_ok=True)
    for condition in flights.LIBRARY:
        plan = flights.plan(condition, full=full)
        doublets = [record.segment(0.0, UNSEEN_S) for record in plan.fly_doublets(seed)]
        fid.write_records(plan.fly_sweeps(seed), folder / f"{condition}_sweeps.nc")
        fid.write_records(doublets, folder / f"{condition}_doublets.nc")


if __name__ == "__main__":
    target, number, form = [*sys.argv[1:], *("records", "0", "short")[len(sys.argv) - 1 :]]
    write(Path(target), int(number), full=form == "full")
