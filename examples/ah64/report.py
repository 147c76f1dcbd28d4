"""The report of the AH-64 study."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from augmentation import tables_of
from flights import truth

import flightid as fid
from flightid.files import write_atomically
from flightid.plot import look
from flightid.plot.fit import estimates_of, fit_figure, parameter_intervals
from flightid.plot.frequency_response import Curve, bode
from flightid.plot.modes import pole_map
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Document, Figure, Paragraph, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.report.html import to_html
from flightid.report.modes import modes_blocks, physics_blocks
from flightid.report.reduction import reduction_blocks
from flightid.report.verification import verification_blocks

if TYPE_CHECKING:
    from identify import Results

SHOWN = ("q/lon", "p/lat", "r/ped", "ax/lon", "q/lat", "p/ped")
"""On-axis angular responses, and some that are harder."""
COLOURS = {"before inflow": look.RIVAL, "after inflow": look.MODEL}


def write(found: Results, folder: Path) -> Path:
    """Write ``report.html`` into a folder.

    Parameters
    ----------
    found : Results
        What the study found.
    folder : Path
        Made if it is not there.

    Returns
    -------
    Path
    """
    folder.mkdir(parents=True, exist_ok=True)
    document = Document(
        "Identification of an unstable helicopter in hover",
        "simulated AH-64, augmentation off; sweeps, doublets and 3-2-1-1s under a crude pilot",
        (
            Section("Responses that are fitted", _coherence(found)),
            Section("Heave before and after dynamic inflow", _heave(found)),
            Section("Reduction of the structure", reduction_blocks(found.reduction)),
            Section("Six degrees of freedom with inflow", _fit(found.fit)),
            Section(
                "Verification beside a linearised full-envelope model",
                verification_blocks(found.comparison),
            ),
            Section("Augmented", tuple(TableBlock(each) for each in tables_of(found.augmented))),
        ),
    )
    return write_atomically(folder / "report.html", to_html(document))


def _coherence(found: Results) -> tuple[Block, ...]:
    text = (
        "Four sticks and eight sensors make 32 responses. Those without enough coherence over "
        "enough of the band are left out; most of them belong to couplings that hardly exist."
    )
    return (Paragraph(text), TableBlock(found.coherent.summary()))


def _heave(found: Results) -> tuple[Block, ...]:
    pictures = [_heave_picture(found, output) for output in ("az", "w")]
    tables = [
        block
        for name, fit in found.heave.items()
        for block in result_blocks(fit, title=f"Heave {name}: average cost {fit.average_cost:.1f}")
    ]
    return (*pictures, *tables)


def _heave_picture(found: Results, output: str) -> Figure:
    measured = found.response.pair(output, "col")
    curves = [
        Curve("measured", measured.omega_rad_s, measured.response, coherence=measured.coherence)
    ]
    for name, fit in found.heave.items():
        model = fit.model
        row = model.outputs.index(output)
        drawn = model.frequency_response(measured.omega_rad_s)[row, 0]
        curves.append(Curve(name, measured.omega_rad_s, drawn, COLOURS[name], "dash"))
    shown = f"{output} to collective, with the heave model fitted to az before and after inflow."
    return figure_block(bode(curves, unit=measured.unit), shown)


def _fit(fit: fid.Fit) -> tuple[Block, ...]:
    known: Mapping[str, float] = {
        name: parameter.value
        for name, parameter in truth().parameters.items()
        if parameter.value is not None
    }
    estimates = estimates_of(fit, known)
    # Intervals of derivatives whose truth is zero have no percentage.
    drawn = [each for each in estimates if each.truth not in (None, 0.0)]
    fitted = {each.name for each in fit.responses}
    pictures = [
        figure_block(fit_figure(fit, name), f"{name}: measured with its 95 % band, and the model.")
        for name in SHOWN
        if name in fitted
    ]
    picture = figure_block(
        parameter_intervals(drawn), "Estimates with 95 % intervals, in percent of the truth."
    )
    return (*result_blocks(fit), *_modes(fit), picture, *pictures)


def _modes(fit: fid.Fit) -> tuple[Block, ...]:
    """Modes, the hovering cubics beside them, derivatives; and the map with the truth."""
    caption = "Eigenvalues of the identified and of the flown vehicle, with 95 % regions."
    both = {"identified": fid.modes(fit), "truth": fid.modes(truth())}
    return (
        *modes_blocks(both["identified"]),
        figure_block(pole_map(both), caption),
        *physics_blocks(fid.approximate_modes(fit), fid.derivatives(fit)),
    )
