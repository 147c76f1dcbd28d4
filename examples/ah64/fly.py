"""Simulated flights that stand in for the records of the AH-64 study.

Run: python examples/ah64/fly.py [records] [seed] [short|full]
"""

import sys
from pathlib import Path

from flights import fly_manoeuvres, fly_sweeps

import flightid as fid


def write(folder: Path, seed: int, *, full: bool) -> None:
    """Write the sweeps, and the manoeuvres that no fit sees."""
    folder.mkdir(parents=True, exist_ok=True)
    flown = fly_sweeps(seed) if full else fly_sweeps(seed, repeats=1, duration_s=120.0)
    fid.write_records(flown, folder / "sweeps.nc")
    fid.write_records(fly_manoeuvres(seed), folder / "manoeuvres.nc")


if __name__ == "__main__":
    target, number, form = [*sys.argv[1:], *("records", "1", "short")[len(sys.argv) - 1 :]]
    write(Path(target), int(number), full=form == "full")
