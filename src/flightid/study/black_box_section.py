"""The part of a study's report about one black-box model, and all of them in one table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from flightid.findings import Finding, worst
from flightid.identification import Fit
from flightid.identification.prediction_error.details import PolynomialDetails
from flightid.models import PolynomialStructure
from flightid.plot import look
from flightid.plot.cross_validation import cross_runs
from flightid.plot.frequency_response import Curve, bode
from flightid.plot.polynomial import order_scan, pole_zero
from flightid.plot.residuals import correlations, spectrum_comparison
from flightid.report.blocks import result_blocks
from flightid.report.content import Block, Figure, Lights, Paragraph, Section, TableBlock
from flightid.report.evidence import evidence_blocks
from flightid.report.figures import figure_block
from flightid.table import Cell, Column, Table
from flightid.validation import CrossRun, OrderScan, Verdict

if TYPE_CHECKING:
    from flightid.study.black_box import BlackBox

HZ = 1 / (2 * math.pi)


def black_box_table(items: Iterable[BlackBox]) -> Table:
    """All black-box models: structure, modes, tests and free runs.

    Parameters
    ----------
    items : iterable of BlackBox
        Of one study.

    Returns
    -------
    Table
    """
    columns = (
        Column("model"),
        Column("structure"),
        Column("modes"),
        Column("residual tests passed"),
        Column("worst free-run fit", "%", 3),
        Column("worst TIC", digits=2),
        Column("note"),
    )
    notes = (
        "modes: natural frequency in Hz with the half-width of its 95 % interval, and damping "
        "ratio; 1 is a real pole. Free runs: on the records of the verification.",
    )
    return Table("Black-box models", columns, tuple(map(_row, items)), notes)


def _row(item: BlackBox) -> tuple[Cell, ...]:
    name = item.settings.name
    if item.fit is None:
        reasons = "; ".join(pair.reason for pair in item.coherent.pairs)
        return (name, "left out", None, None, None, None, reasons)
    structure = structure_words(item.fit)
    modes = modes_words(item.fit) if isinstance(item.fit.details, PolynomialDetails) else None
    free = [] if item.cross is None else _free_runs(item.cross.runs)
    lost = [finding.message for finding in item.left_out]
    return (
        name,
        structure,
        modes,
        _passed(item),
        min((run.fit_percent for run in free), default=None),
        max((run.theil for run in free), default=None),
        "; ".join(lost),
    )


def _free_runs(runs: Sequence[CrossRun]) -> list[CrossRun]:
    return [run for run in runs if run.horizon == "free run" and run.model == "model"]


def _passed(item: BlackBox) -> str | None:
    if item.tests is None:
        return None
    passed = len(item.tests.counted(Verdict.PASS))
    return f"{passed} of {passed + len(item.tests.counted(Verdict.FAIL))}"


def structure_words(fit: Fit) -> str:
    """Structure of a fit in a few words."""
    structure = fit.structure
    if isinstance(structure, PolynomialStructure):
        return f"{structure.kind}, {structure.orders_text}"
    lags = f"{structure.output_lags} + {structure.input_lags} lags"
    return f"NARX {lags}, {structure.kernel or 'polynomial'}, {len(fit.parameters)} terms"


def _is_linear(fit: Fit) -> bool:
    return isinstance(fit.details, PolynomialDetails)


def modes_words(fit: Fit) -> str:
    """Natural frequencies in Hz with half-widths, and dampings, in words."""
    said = []
    for root in fit.details.modes:
        frequency, damping = root.natural_frequency, root.damping
        if frequency is None or damping is None:
            continue
        wide = ""
        if frequency.interval95 is not None:
            half = 0.5 * (frequency.interval95[1] - frequency.interval95[0])
            wide = f" ± {half * HZ:.2g}"
        said.append(f"{frequency.value * HZ:.3g}{wide} Hz (ζ {damping.value:.2g})")
    return "; ".join(said) or "none"


def black_box_in_short(item: BlackBox) -> Finding:
    """One line about a model: the light of its evidence, and the first reason for it."""
    name = item.settings.name
    if item.fit is None:
        return Finding("model", worst(item.findings), f"{name}: {item.left_out[0].message}")
    verdict = item.fit.evidence.verdict
    first = f"{name}: {structure_words(item.fit)}"
    return Finding("model", verdict.light, f"{first}; {verdict.message}", verdict.action)


def black_box_section(item: BlackBox) -> Section:
    """Say what was found of one black-box model.

    Parameters
    ----------
    item : BlackBox
        Every stage.

    Returns
    -------
    Section
    """
    parts = [Section("Coherence", tuple(_coherence(item)))]
    if item.choice is not None:
        parts.append(Section("Choice of the structure", _choice(item)))
    if item.fit is not None:
        goal = (Lights(item.goal_findings),) if item.goal_findings else ()
        evidence = evidence_blocks(item.fit.evidence)
        parts.append(Section("Model", (*goal, *_model(item.fit), *evidence)))
    if item.tests is not None:
        parts.append(Section("Residual tests", tuple(_tests(item))))
    if item.cross is not None:
        parts.append(Section("Verification on unseen records", tuple(_cross(item))))
    if item.spectra is not None:
        shown = "Spectrum as measured with its 95 % band, and of the model in free run."
        picture = figure_block(spectrum_comparison(item.spectra), shown)
        parts.append(Section("Spectra", (picture, *result_blocks(item.spectra, title="Peaks"))))
    return Section(item.settings.name, (), tuple(parts))


def _coherence(item: BlackBox) -> Iterable[Block]:
    if item.left_out:
        yield Lights(item.left_out)
    needed = f"at least {item.coherent.minimum_coherence:g} over {item.coherent.minimum_decades:g}"
    yield from result_blocks(item.coherent, title=f"Coherence, {needed} decades needed")
    for name in item.settings.inputs:
        yield _bode_figure(item, name)


def _bode_figure(item: BlackBox, name: str) -> Figure:
    output, fit = item.settings.output, item.fit
    pair = item.response.pair(output, name)
    curves = [
        Curve(
            "estimate",
            pair.omega_rad_s,
            pair.response,
            coherence=pair.coherence,
            random_error=pair.random_error,
        )
    ]
    shown = f"{output} to {name}: estimate with its 95 % band of random error, and coherence"
    if fit is not None and name in fit.model.inputs and _is_linear(fit):
        place = fit.model.inputs.index(name)
        response = fit.model.frequency_response(pair.omega_rad_s)[0, place]
        curves.append(Curve("model", pair.omega_rad_s, response, colour=look.MODEL))
        shown += "; model fitted in time"
    made = bode(curves, unit=pair.unit, minimum_coherence=item.settings.minimum_coherence)
    return figure_block(made, f"{shown}.")


def _choice(item: BlackBox) -> tuple[Block, ...]:
    choice = item.choice
    if not isinstance(choice, OrderScan):
        return () if choice is None else result_blocks(choice)
    shown = "Every structure tried: error in free run on the selection records, and BIC of the fit."
    words = f"Chosen by “{item.settings.choose}”"
    taken = item.fit.structure if item.fit is not None and _is_linear(item.fit) else None
    if taken is not None:
        words += f": {taken.orders_text}"
    if item.settings.choose == "balanced":
        words += (
            ". Free runs do not see the noise model; so of all structures whose free-run error "
            "lies within 10 % of the smallest the one with the smallest BIC is taken"
        )
    lights = (Lights(item.choice_findings),) if item.choice_findings else ()
    table = choice.summary()
    # Verdicts of the scan are about its first structure, which need not be the one taken.
    notes = tuple(note for note in table.notes if note not in set(map(str, choice.findings)))
    shorter = Table("Structures by free run", table.columns, table.rows, notes)
    return (
        Paragraph(f"{words}."),
        *lights,
        figure_block(order_scan(choice, taken), shown),
        TableBlock(shorter, folded=True),
    )


def _model(fit: Fit) -> tuple[Block, ...]:
    if not _is_linear(fit):
        beside = (TableBlock(table) for table in fit.details.tables())
        return (*result_blocks(fit), *beside)
    picture = figure_block(pole_zero(fit), "Poles and zeros with 95 % ellipses.")
    return (
        *result_blocks(fit, title="Coefficients"),
        TableBlock(fit.details.roots_table()),
        picture,
    )


def _tests(item: BlackBox) -> Iterable[Block]:
    tests = item.tests
    if tests is None:
        return
    yield from result_blocks(tests, title="Correlation functions")
    for name in tests.inputs:
        shown = f"Correlation functions of {item.settings.output} and {name} with their bands."
        yield figure_block(correlations(tests, item.settings.output, name), shown)


def _cross(item: BlackBox) -> Iterable[Block]:
    if item.cross is None:
        return
    yield from result_blocks(item.cross, title="Errors of the predictions")
    free = [run for run in item.cross.runs if run.horizon == "free run"]
    for record in dict.fromkeys(run.record.name for run in free):
        runs = [run for run in free if run.record.name == record]
        shown = f"{record}: measured, and predicted from the inputs alone."
        yield figure_block(cross_runs(runs), shown)
