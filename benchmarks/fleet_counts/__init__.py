"""What `flightid fleet report` finds and misses, counted on fleets drawn by NumPy.

Run: python -m benchmarks.fleet_counts [section ...] [--fleets 100] [--page docs/fleet_counts.md]

The page holds each table between two marks; sections that are not named keep theirs.
"""

from __future__ import annotations

import os

from benchmarks.fleet_counts.changes import alarms, events, kinds, shared, steps
from benchmarks.fleet_counts.types import least, odd_flights, relative, shapes, unlike
from flightid.table import Column, Table

SECTIONS = {
    "alarms": alarms, "steps": steps, "shared": shared, "kinds": kinds, "events": events,
    "least": least, "unlike": unlike, "shapes": shapes, "relative": relative,
    "odd-flights": odd_flights,
}  # fmt: skip


def run() -> Table:
    """Every section, printed as it is counted; FLIGHTID_FLEET_DRAWS fleets of each row."""
    fleets, rows = int(os.environ.get("FLIGHTID_FLEET_DRAWS", "100")), []
    for name, section in SECTIONS.items():
        table = section(fleets).table(lambda line: print(line, flush=True))
        rows.append((name, table.count("\n") - 1))
    return Table("Counts of fleets", (Column("section"), Column("rows")), tuple(rows))
