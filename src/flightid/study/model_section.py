"""The part of a study's report about one model: response, fit, rival estimates, verification."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from flightid.dynamics.derivatives.derivatives import derivatives
from flightid.dynamics.modes.approximate_modes import approximate_modes
from flightid.dynamics.modes.modes import modes
from flightid.errors import ModelError
from flightid.models import StateSpaceModel
from flightid.plot import look
from flightid.plot.frequency_response import Curve, bode
from flightid.plot.modes import pole_map
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Figure, Lights, Paragraph, Section, TableBlock
from flightid.report.evidence import evidence_blocks
from flightid.report.figures import figure_block
from flightid.report.fitted_record import record_figures
from flightid.report.modes import modes_blocks, physics_blocks
from flightid.report.reduction import reduction_blocks
from flightid.report.verification import verification_blocks
from flightid.table import Cell, Column, Table

if TYPE_CHECKING:
    from flightid.identification import Fit
    from flightid.study.stages import Identified
    from flightid.study.truth import Truth
    from flightid.uncertainty.estimate import Estimate

ESTIMATORS = {
    "composite": "direct estimate",
    "local_polynomial": "local polynomial estimate",
    "instrument": "instrument estimate",
    "output_error": "output error on the records",
    "equation_error": "equation error on the records",
    "fourier_regression": "regression on Fourier integrals",
    "fourier_output_error": "output error at the harmonics",
    "filter_error": "filter error on the records",
}
"""Estimators in words, as legends and tables name them."""


def model_section(item: Identified, truth: Truth | None) -> Section:
    """Say what was found of one model.

    Parameters
    ----------
    item : Identified
        Responses, fits and verifications.
    truth : Truth or None
        What should have been found, where the flight was simulated.

    Returns
    -------
    Section
    """
    figures = _bode_figures(item, truth) if item.responses else record_figures(item.fit)
    shown = result_blocks(item.fit, title="Parameters")
    blocks: list[Block] = [*figures, *shown, *evidence_blocks(item.fit.evidence)]
    if len(item.fits) > 1:
        blocks.append(TableBlock(_comparison(item, truth)))
    if item.response is not None and item.response.findings:
        blocks.append(Lights(item.response.findings, "Frequency response"))
    parts = [
        Section(f"Prediction of “{name}”", verification_blocks(verification))
        for name, verification in item.verifications.items()
    ]
    if isinstance(item.fit.model, StateSpaceModel):
        parts.insert(0, Section("Modes and derivatives", (*_physics(item.fit), *_beside(item))))
    if item.tests is not None:
        parts.insert(0, Section("Residual tests", result_blocks(item.tests)))
    if item.reduction is not None:
        parts.insert(0, Section("Reduction of the structure", reduction_blocks(item.reduction)))
    if item.coherent is not None:
        parts.insert(0, Section("Choice of responses", result_blocks(item.coherent)))
    return Section(item.settings.name, tuple(blocks), tuple(parts))


def _physics(fit: Fit) -> tuple[Block, ...]:
    """Modes of any model; approximations and derivatives of those that have them."""
    approximations, table = None, None
    # A rig's or a filter's states fit no textbook formula, and coefficients are no derivatives.
    with suppress(ModelError):
        approximations = approximate_modes(fit)
    with suppress(ModelError):
        table = derivatives(fit)
    try:
        shown = modes_blocks(modes(fit))
    except ModelError as reason:
        shown = (Paragraph(f"No modes: {reason}."),)
    return (*shown, *physics_blocks(approximations, table))


def _beside(item: Identified) -> tuple[Block, ...]:
    """Eigenvalues of the reference, in a table and beside those of the fit."""
    if item.reference is None:
        return ()
    try:
        theirs, ours = modes(item.reference), modes(item.fit)
    except ModelError:
        return ()
    both = {"identified": ours, "reference": theirs}
    picture = figure_block(pole_map(both), "Eigenvalues with 95 % regions, beside the reference's.")
    return (picture, TableBlock(theirs.table(), folded=True))


def _bode_figures(item: Identified, truth: Truth | None) -> list[Figure]:
    """One picture for each response that was fitted."""
    return [_bode_figure(item, each.name, truth) for each in item.fit.responses]


def _bode_figure(item: Identified, name: str, truth: Truth | None) -> Figure:
    output, source = name.split("/")
    curves = []
    for number, (method, response) in enumerate(item.responses.items()):
        pair = response.pair(output, source)
        curves.append(
            Curve(
                ESTIMATORS[method],
                pair.omega_rad_s,
                pair.response,
                colour=look.MEASURED if number == 0 else look.SERIES[number],
                dash="solid" if number == 0 else "dash",
                coherence=pair.coherence,
                random_error=pair.random_error if number == 0 else None,
            )
        )
    omega, model = curves[0].omega_rad_s, item.fit.model
    place = model.outputs.index(output), model.inputs.index(source)
    fitted = model.frequency_response(omega)[place]
    curves.append(Curve("model", omega, fitted, colour=look.MODEL))
    exact = None if truth is None else truth.response(model, omega)
    if exact is not None and len(item.fit.responses) == 1:
        curves.append(Curve("truth", omega, exact, colour=look.TRUTH, dash="dot"))
    shown = f"{output} to {source}: {curves[0].name} with its 95 % band of random error, and model"
    return figure_block(
        bode(curves, unit=pair.unit), shown + ("; truth dotted." if exact is not None else ".")
    )


def _comparison(item: Identified, truth: Truth | None) -> Table:
    known = {} if truth is None else truth.parameters(item.fit.model)
    columns = [Column("parameter"), Column("unit")]
    columns += [Column(ESTIMATORS[method]) for method in item.fits]
    columns += [Column("truth")] if known else []
    rows: list[tuple[Cell, ...]] = []
    for name, parameter in item.fit.parameters.items():
        cells: list[Cell] = [name, parameter.unit]
        cells += [_with_interval(other.parameters[name]) for other in item.fits.values()]
        cells += [known[name]] if known else []
        rows.append(tuple(cells))
    return Table(
        "The same model fitted to each estimate, with 95 % intervals", tuple(columns), tuple(rows)
    )


def _with_interval(parameter: Estimate) -> str:
    if parameter.interval95 is None:
        return f"{parameter.value:.4g}"
    low, high = parameter.interval95
    return f"{parameter.value:.4g} ({low:.4g} … {high:.4g})"
