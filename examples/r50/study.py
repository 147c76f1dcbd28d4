"""The Yamaha R-50 study: sweeps of the published models, identified from their records alone.

Run: python examples/r50/study.py [short|full] [seed] [folder]

Prints the paper's tables 2 to 7 with what these flights give beside the published figures, and
writes them with plots to report.html. The short form takes seconds, the full study minutes.
"""

import sys
from pathlib import Path

import flights
import identification
import tables

import flightid as fid
from flightid.plot.fit import fit_figure
from flightid.plot.modes import pole_map
from flightid.report.content import Document, Paragraph, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.report.html import to_html
from flightid.report.modes import physics_blocks
from flightid.report.verification import verification_blocks

SHOWN = ("p/lat", "p/lon", "q/lat", "q/lon", "r/ped", "az/col")
"""Responses whose comparison is drawn, those of figures 6 and 7 of the paper."""


def study(condition: str, *, full: bool, seed: int) -> identification.Identified:
    """Fly one condition, and find its model from the records."""
    plan = flights.plan(condition, full=full)
    response = identification.estimate(plan, plan.sweeps(seed))
    return identification.identify(plan, response, reduced=full)


def section(condition: str, found: identification.Identified, *, full: bool, seed: int) -> Section:
    """Report of one condition."""
    records = [
        flight.segment(0.0, 6.0) for flight in flights.plan(condition, full=full).doublets(seed)
    ]
    verification = fid.verify(found.fit, records, initial_state="estimate")
    shown = [name for name in SHOWN if name in found.fit.costs]
    return Section(
        condition.capitalize(),
        (
            Paragraph(f"{found.fit!r}; {verification!r}"),
            *(TableBlock(table) for table in tables.of_condition(condition, found)),
            *(
                figure_block(fit_figure(found.fit, name), f"{name}: flights and identified model.")
                for name in shown
            ),
            figure_block(
                pole_map(
                    {
                        "identified": fid.modes(found.fit),
                        "published": fid.modes(fid.load_model(flights.LIBRARY[condition])),
                    }
                ),
                "Eigenvalues with 95 % regions, beside the published model's.",
            ),
            *physics_blocks(None, fid.derivatives(found.fit)),
            *verification_blocks(verification),
        ),
    )


def main(form: str = "short", seed: str = "0", folder: str = "r50-output") -> None:
    """Both conditions, then their ratios and the physics."""
    if form not in ("short", "full"):
        sys.exit(__doc__)
    full, number = form == "full", int(seed)
    both = {name: study(name, full=full, seed=number) for name in flights.LIBRARY}
    ends = tables.of_both(both)
    for name, found in both.items():
        for table in tables.of_condition(name, found):
            print(table, end="\n\n")
    for table in ends:
        print(table, end="\n\n")
    sections = [section(name, found, full=full, seed=number) for name, found in both.items()]
    sections.append(Section("Hover and cruise", tuple(TableBlock(table) for table in ends)))
    document = Document(
        "Yamaha R-50, identified from simulated flights",
        f"{form} form, seed {number}; beside the figures of Mettler, Tischler and Kanade (2002)",
        tuple(sections),
    )
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    (target / "report.html").write_text(to_html(document), encoding="utf-8")
    print(f"{document.verdict}: {target / 'report.html'}")


if __name__ == "__main__":
    main(*sys.argv[1:])
