"""The part of a study's report about one model, whatever its kind and however it was fitted."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING

from flightid.conventions import Light
from flightid.dynamics.derivatives.derivatives import derivatives
from flightid.dynamics.modes.approximate_modes import approximate_modes
from flightid.dynamics.modes.modes import modes
from flightid.errors import DataError, ModelError
from flightid.findings import Finding
from flightid.identification import PolynomialDetails
from flightid.models import StateSpaceModel
from flightid.models.model import model_of
from flightid.plot.inputs import input_figure
from flightid.plot.modes import pole_map
from flightid.plot.pictures import record_history
from flightid.plot.polynomial import pole_zero
from flightid.plot.residuals import correlations, spectrum_comparison
from flightid.plot.training import training_history
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Lights, Paragraph, Section, TableBlock
from flightid.report.evidence import evidence_blocks
from flightid.report.figures import figure_block
from flightid.report.fitted_record import record_figures
from flightid.report.modes import modes_blocks, physics_blocks
from flightid.report.reduction import reduction_blocks
from flightid.report.verification import verification_blocks
from flightid.study.choice_section import choice_blocks
from flightid.study.estimate_tables import correlation_table, estimates_table, minima_table
from flightid.study.faults import blocks_until, section_of
from flightid.study.identified import LEFT_OUT
from flightid.study.published import published_tables
from flightid.study.response_figures import response_figures
from flightid.study.structures import goal_findings
from flightid.uncertainty.quantiles import interval_words, shown

if TYPE_CHECKING:
    from flightid.dynamics import Modes
    from flightid.identification import Fit
    from flightid.study.identified import ModelResults
    from flightid.study.truth import Truth
    from flightid.validation import ResidualTests, SpectrumComparison


def model_section(item: ModelResults, truth: Truth | None) -> Section:
    """Say what was found of one model.

    Parameters
    ----------
    item : ModelResults
        Every stage.
    truth : Truth or None
        What should have been found, where the flight was simulated.
    """
    first = blocks_until(item.name, _first, item, truth)
    return Section(item.name, first, tuple(_parts(item, truth)))


def _first(item: ModelResults, truth: Truth | None) -> Iterator[Block]:
    """The fit that counts, with what it was fitted to."""
    fit = item.fit
    if fit is None:
        yield Lights(item.left_out)
        return
    if isinstance(fit.details, PolynomialDetails):
        yield figure_block(
            pole_zero(fit),
            f"Poles and zeros in the z plane; {interval_words(shown())} ellipses may be smaller "
            "than a mark.",
        )
    elif fit.responses:
        yield from response_figures(item, truth)
        yield from _training(item, fit)
        yield from record_figures(fit)
    elif item.settings.structure is None:
        yield from record_figures(fit)
    for record in () if fit.responses else item.training:
        yield figure_block(record_history(record), f"{record.name}: what the model was fitted to.")
        yield figure_block(
            input_figure(record, fit.model.inputs),
            f"{record.name}: spectrum of each input, and how often it has each size.",
        )
    goal = goal_findings(fit)
    if goal:
        yield Lights(goal)
    title = "Parameters" if item.settings.structure is None else "Coefficients"
    yield from result_blocks(fit, title=title)
    if fit.details is not None:
        yield from (TableBlock(table, folded=True) for table in fit.details.tables())
    if sum(each.count for each in fit.minima) > 1:
        yield TableBlock(minima_table(fit), folded=True)
    if item.settings.structure is None and fit.covariance is not None and len(fit.names) > 1:
        yield TableBlock(correlation_table(fit), folded=True)
    if item.settings.figures is not None:
        yield from map(TableBlock, published_tables(item.settings.figures, fit, item.on_unseen))
    yield from evidence_blocks(fit.evidence)
    if len(item.fits) > 1:
        yield TableBlock(estimates_table(item, truth), folded=True)
    if item.settings.structure is None and item.response is not None and item.response.findings:
        yield Lights(item.response.findings, "Frequency response")


def _training(item: ModelResults, fit: Fit) -> Iterator[Block]:
    """The time history behind responses that were fitted."""
    assert item.response is not None
    if not item.training:
        return
    pairs = [each.name.split("/") for each in fit.responses]
    outputs, inputs = (list(dict.fromkeys(side)) for side in zip(*pairs, strict=True))
    used: tuple[str, ...] = ()
    if item.response.estimator == "instrument":
        used = item.settings.response.excitations or item.training[0].excitations
    names = ", ".join(item.settings.flown)
    several = len(item.training)
    after = "" if several == 1 else f", {several} manoeuvres one after the other"
    yield figure_block(
        training_history(item.training, inputs, outputs, used),
        f"What the responses were made of: {names}{after}; {'injected signals, ' if used else ''}"
        "inputs and the outputs that were used, of each short stretch its extremes.",
    )


def _parts(item: ModelResults, truth: Truth | None) -> Iterator[Section]:
    """The stages before and after the fit."""
    structure, fit = item.settings.structure, item.fit
    if item.coherent is not None:
        title = "Choice of responses" if structure is None else "Coherence"
        yield section_of(title, _coherence, item, truth)
    if item.choice is not None or item.settings.tried:
        yield section_of("Choice of the structure", choice_blocks, item)
    if item.reduction is not None:
        yield section_of("Reduction of the structure", _reduction, item)
    if item.tests is not None:
        yield section_of("Residual tests", _tests, item.tests)
    if fit is not None and isinstance(fit.model, StateSpaceModel):
        yield section_of("Modes and derivatives", _physics, item, fit)
    elif fit is not None and (found := _modes_of(fit)) is not None:
        yield section_of("Modes", _plain_modes, item, fit, found)
    for name, verification in item.verifications.items():
        yield section_of(f"Prediction of “{name}”", verification_blocks, verification)
    if item.spectra is not None:
        yield section_of("Spectra", _spectra, item.spectra)


def _coherence(item: ModelResults, truth: Truth | None) -> Iterator[Block]:
    """Which responses or inputs were taken, and why."""
    assert item.coherent is not None
    pairs = tuple(finding for finding in item.left_out if finding.code == LEFT_OUT)
    if pairs:
        yield Lights(pairs)
    limits = f"{item.coherent.minimum_coherence:g} over {item.coherent.minimum_decades:g}"
    yield from result_blocks(item.coherent, title=f"Coherence, at least {limits} decades needed")
    if item.settings.structure is not None:
        yield from response_figures(item, truth)


def _reduction(item: ModelResults) -> Iterator[Block]:
    """The path, and what unseen records say of it."""
    assert item.reduction is not None
    if item.reduction_judged:
        yield Lights(item.reduction_judged)
    yield from reduction_blocks(item.reduction)


def _spectra(spectra: SpectrumComparison) -> Iterator[Block]:
    shown = "Spectrum as measured with its 95 % band, and of the model in free run."
    yield figure_block(spectrum_comparison(spectra), shown)
    yield from result_blocks(spectra, title="Peaks")


def _physics(item: ModelResults, fit: Fit) -> Iterator[Block]:
    """Modes of any model; approximations and derivatives of those that have them."""
    lacking = _without_point(fit)
    if lacking is not None:
        yield Lights((lacking,))
        return
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
    yield from (*shown, *physics_blocks(approximations, table))
    yield from _beside(item, fit)


def _modes_of(fit: Fit) -> Modes | None:
    """Modes of a model without equations; None where it has none: no linear system, or delays."""
    try:
        found = modes(fit)
    except ModelError:
        return None
    return found if len(found) else None


def _plain_modes(item: ModelResults, fit: Fit, found: Modes) -> Iterator[Block]:
    yield from modes_blocks(found)
    yield from _beside(item, fit)


def _without_point(source: object) -> Finding | None:
    """What to do where equations have no finite linearisation at the model's trim."""
    try:
        modes(source)
    except DataError as error:
        trim = getattr(model_of(source), "trim", {})
        zero = [name for name in getattr(model_of(source), "states", ()) if not trim.get(name)]
        words = f"no modes and derivatives: at the trim, with {', '.join(zero)} zero, {error}"
        action = "give [trim] in the model file, such as the speed at which it was flown"
        return Finding("no-point", Light.AMBER, words, action)
    except ModelError:
        return None
    return None


def _beside(item: ModelResults, fit: Fit) -> tuple[Block, ...]:
    """Eigenvalues of the reference, in a table and beside those of the fit."""
    if item.reference is None:
        return ()
    try:
        theirs, ours = modes(item.reference), modes(fit)
    except ModelError:
        return ()
    both = {"identified": ours, "reference": theirs}
    caption = f"Eigenvalues with {interval_words(shown())} regions, beside the reference's."
    picture = figure_block(pole_map(both), caption)
    return (picture, TableBlock(theirs.table(), folded=True))


def _tests(tests: ResidualTests) -> Iterator[Block]:
    yield from result_blocks(tests, title="Correlation functions")
    for output in tests.outputs:
        for name in tests.inputs:
            shown = f"Correlation functions of {output} and {name} with their bands."
            yield figure_block(correlations(tests, output, name), shown)
