"""Bandwidth and phase delay of the R-50: published model, identified model, measured responses.

Run: python examples/r50/qualities.py [hover|cruise] [seed] [folder]

Flies the short sweeps, identifies the model as the study does, and reads the handling qualities of
all three. Levels are those of ADS-33E for piloted helicopters of full size; a 3 m helicopter is far
quicker than they ask for, and its stabilizer bar sets the gain bandwidth.
"""

import sys
from pathlib import Path

import flights
import identification

import flightid as fid
from flightid.dynamics import HandlingQualities
from flightid.report.content import Document, Section, TableBlock
from flightid.report.handling_qualities import handling_qualities_blocks
from flightid.report.html import to_html
from flightid.table import Column, Table

BAND_RAD_S = (1.0, 60.0)
AXES = {"roll": ("p", "lat"), "pitch": ("q", "lon"), "yaw": ("r", "ped")}
SIGNS = {"pitch": -1}
"""A positive longitudinal stick pushes the nose down."""
SPEEDS = {"hover": "hover", "cruise": "forward"}


def qualities(source: object, condition: str) -> HandlingQualities:
    """Handling qualities of a model, a fit or a measured response."""
    return fid.handling_qualities(
        source, axes=AXES, signs=SIGNS, band_rad_s=BAND_RAD_S, speed=SPEEDS[condition]
    )


def compared(found: dict[str, HandlingQualities]) -> Table:
    """Bandwidth, ω_180 and phase delay of each source, with half of each 95 % interval."""
    columns = (
        Column("axis"),
        Column("from"),
        Column("bandwidth", "rad/s"),
        Column("±", digits=2),
        Column("ω_180", "rad/s"),
        Column("±", digits=2),
        Column("phase delay by slope", "ms", 3),
        Column("±", digits=2),
        Column("level"),
    )
    rows = []
    for axis in AXES:
        for name, each in found.items():
            if axis not in each.bandwidths:
                continue
            read = each.bandwidths[axis]
            numbers = (read.quantities[0], read.quantities[1], read.quantities[5])
            cells = []
            for quantity, factor in zip(numbers, (1.0, 1.0, 1000.0), strict=True):
                low, high = quantity.interval95 or (None, None)
                value = quantity.value
                cells.append(None if value is None else factor * value)
                cells.append(None if low is None or high is None else factor * (high - low) / 2.0)
            levels = [rating.text for rating in each.ratings if rating.subject == read.name]
            rows.append((axis, name, *cells, levels[0] if levels else None))
    return Table("Bandwidth and phase delay", columns, tuple(rows))


def main(condition: str = "hover", seed: str = "0", folder: str = "r50-qualities") -> None:
    """One condition from flights to levels."""
    if condition not in SPEEDS:
        sys.exit(__doc__)
    plan = flights.plan(condition, full=False)
    response = identification.estimate(plan, plan.sweeps(int(seed)))
    fit = identification.identify(plan, response, reduced=False).fit
    sources = {"published": fid.load_model(flights.LIBRARY[condition])}
    found = {
        name: qualities(source, condition)
        for name, source in {**sources, "identified": fit, "measured": response}.items()
    }
    table = compared(found)
    print(table, end="\n\n")
    for finding in found["identified"].findings:
        print(finding)
    sections = [Section("Compared", (TableBlock(table),))]
    sections += [
        Section(name.capitalize(), handling_qualities_blocks(each)) for name, each in found.items()
    ]
    document = Document(
        "Handling qualities of the R-50", f"{condition}, seed {seed}", tuple(sections)
    )
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    (target / "report.html").write_text(to_html(document), encoding="utf-8")
    print(f"{document.verdict}: {target / 'report.html'}")


if __name__ == "__main__":
    main(*sys.argv[1:])
