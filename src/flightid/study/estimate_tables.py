"""Estimates of a study as tables: one model by several estimators, and all models together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from flightid.dynamics.modes.delays import EACH_ONE_SAMPLE, delays_apart
from flightid.dynamics.modes.modes import modes
from flightid.errors import ModelError
from flightid.identification import PolynomialDetails
from flightid.models import NarxStructure, PolynomialStructure
from flightid.table import Cell, Column, Table
from flightid.uncertainty.quantiles import interval_words, shown
from flightid.validation import Verdict

if TYPE_CHECKING:
    from flightid.dynamics.modes.result import Mode
    from flightid.identification import Fit
    from flightid.study.identified import ModelResults
    from flightid.study.truth import Truth
    from flightid.uncertainty.estimate import Estimate

HZ = 1 / (2 * math.pi)
WORDS = {
    "composite": "direct estimate",
    "local_polynomial": "local polynomial estimate",
    "periodic": "estimate at harmonics",
    "instrument": "instrument estimate",
    "prewhitened": "estimate with a noise model",
}
"""Estimators in words, as legends and tables name them."""


def estimates_table(item: ModelResults, truth: Truth | None) -> Table:
    """The same model fitted to each estimate of the response.

    Parameters
    ----------
    item : ModelResults
        With several fits.
    truth : Truth or None
        What should have been found, where the flight was simulated.
    """
    (first, *_) = item.fits.values()
    known = {} if truth is None else truth.parameters(first.model)
    columns = [Column("parameter"), Column("unit")]
    columns += [Column(WORDS[estimator]) for estimator in item.fits]
    columns += [Column("truth")] if known else []
    rows: list[tuple[Cell, ...]] = []
    for name, parameter in first.parameters.items():
        cells: list[Cell] = [name, parameter.unit]
        cells += [_with_interval(other.parameters[name]) for other in item.fits.values()]
        cells += [known[name]] if known else []
        rows.append(tuple(cells))
    title = f"The same model fitted to each estimate, with {interval_words(shown())} intervals"
    return Table(title, tuple(columns), tuple(rows))


def _with_interval(parameter: Estimate) -> str:
    ends = parameter.interval(shown())
    if ends is None:
        return f"{parameter.value:.4g}"
    return f"{parameter.value:.4g} ({ends[0]:.4g} … {ends[1]:.4g})"


def minima_table(fit: Fit) -> Table:
    """Where the starts of a search ended, and what each end loses.

    Parameters
    ----------
    fit : Fit
    """
    best = fit.minima[0]
    columns = (
        *(Column("minimum"), Column("starts"), Column("objective over the best", digits=3)),
        *(Column(name) for name in best.values),
        Column("ended by"),
    )
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (k, each.count, each.objective - best.objective, *each.values.values(), each.termination)
        for k, each in enumerate(fit.minima, 1)
    )
    return Table("Starts inside the bounds, and the minima that they found", columns, rows)


def correlation_table(fit: Fit) -> Table:
    """Correlations of the free parameters' estimates.

    Parameters
    ----------
    fit : Fit
        With a covariance.
    """
    rows = tuple(
        (name, *(round(float(r), 3) for r in row[: k + 1]), *[None] * (len(row) - k - 1))
        for k, (name, row) in enumerate(zip(fit.names, fit.correlation, strict=True))
    )
    heads = tuple(Column(name, digits=3) for name in fit.names)
    return Table("Correlations of the estimates", (Column("parameter"), *heads), rows)


def model_table(items: Iterable[ModelResults]) -> Table:
    """All models: structure, modes, residual tests and free runs.

    Parameters
    ----------
    items : iterable of ModelResults
        Of one study.
    """
    columns = (
        Column("model"),
        Column("structure"),
        Column("average cost", digits=3),
        Column("modes"),
        Column("residual tests passed"),
        Column("worst free-run fit", "%", 3),
        Column("worst TIC", digits=2),
        Column("note"),
    )
    rows = tuple(map(_row, items))
    made = Table("Models", columns, rows).without_empty_columns()
    # A note explains a column that is there.
    words = {
        "modes": "modes: natural frequency in Hz with the half-width of its "
        f"{interval_words(shown())} interval, and damping ratio; 1 is a real pole",
        "worst free-run fit": "free runs: on the records of the verification",
    }
    there = {column.name for column in made.columns}
    notes = tuple(f"{text}." for title, text in words.items() if title in there)
    return replace(made, notes=notes)


def _row(item: ModelResults) -> tuple[Cell, ...]:
    if item.fit is None:
        pairs = () if item.coherent is None else item.coherent.pairs
        reasons = "; ".join(pair.reason for pair in pairs)
        if item.fitted.refused is not None:
            reasons = item.fitted.refused.message
        return (item.name, "left out", None, None, None, None, None, reasons)
    fit = item.fit
    free = item.on_unseen.values()
    return (
        item.name,
        structure_words(fit),
        fit.average_cost if fit.responses else None,
        modes_words(fit.details) if isinstance(fit.details, PolynomialDetails) else None,
        _passed(item),
        min((value for run in free for value in run.fit_percent.values()), default=None),
        max((value for run in free for value in run.theil.values()), default=None),
        "; ".join(finding.message for finding in item.left_out) or None,
    )


def _passed(item: ModelResults) -> str | None:
    if item.tests is None:
        return None
    passed = len(item.tests.counted(Verdict.PASS))
    counted = passed + len(item.tests.counted(Verdict.FAIL))
    # Tests that the records do not allow are no tests passed.
    return f"{passed} of {counted}" if counted else "none possible"


def structure_words(fit: Fit) -> str:
    """Structure of a fit in a few words."""
    structure = fit.structure
    if isinstance(structure, PolynomialStructure):
        return f"{structure.kind}, {structure.orders_text}"
    if isinstance(structure, NarxStructure):
        lags = f"{structure.output_lags} + {structure.input_lags} lags"
        return f"NARX {lags}, {structure.kernel or 'polynomial'}, {len(fit.parameters)} terms"
    if isinstance(fit.details, PolynomialDetails):
        return f"innovations form, {fit.model.order} states"
    free = sum(parameter.status == "free" for parameter in fit.parameters.values())
    return f"{fit.model.name}, {free} free parameters"


def short_modes_table(items: Iterable[ModelResults]) -> Table:
    """Modes of models without equations: frequency, damping or time constant, each with its ±.

    Parameters
    ----------
    items : iterable of ModelResults
        Of one study; those whose modes are not known are left out.
    """
    columns = (
        Column("model"), Column("mode"),
        Column("f_n", "Hz", 4), Column("±", "Hz", 2), Column("ω_n", "rad/s", 4),
        Column("ζ", digits=3), Column("±", digits=2),
        Column("time constant", "s", 4), Column("±", "s", 2),
    )  # fmt: skip
    rows: list[tuple[Cell, ...]] = []
    untold: dict[str, list[str]] = {}
    for item in items:
        if item.fit is None or not isinstance(item.fit.details, PolynomialDetails):
            continue
        with suppress(ModelError):
            found = modes(item.fit)
            rows += [(item.name, *cells) for cells in modes_cells(found)]
            for mode in delays_apart(found)[0]:
                number = mode.natural_frequency if mode.is_pair else mode.time_constant
                if number.half(shown()) is None and mode.eigenvalue is not None:
                    why = found.reason or mode.reason or number.reason
                    untold.setdefault(why, []).append(f"{item.name}, {mode.named.character}")
    made = Table("Modes", columns, tuple(rows)).without_empty_columns()
    told = any(column.name == "±" for column in made.columns)
    note = (f"±: half of the {interval_words(shown())} interval.",) if told else ()
    gaps = [
        f"No interval of {'; '.join(dict.fromkeys(names))}: {reason}."
        for reason, names in untold.items()
    ]
    return replace(made, notes=(*note, *gaps))


def modes_cells(found: Iterable[Mode]) -> Iterator[tuple[Cell, ...]]:
    """A row a mode; poles at the origin, which differ in nothing, in one."""
    moving, delays = delays_apart(found)
    yield from map(_mode_cells, moving)
    if delays:
        words = f"{len(delays)} {EACH_ONE_SAMPLE}" if len(delays) > 1 else delays[0].named.character
        yield (words, *[None] * 7)


def _mode_cells(mode: Mode) -> tuple[Cell, ...]:
    """A pair by frequency and damping, a real root by its time constant."""
    if mode.eigenvalue is None:
        return (mode.named.character, *[None] * 7)
    if not mode.is_pair:
        slow = mode.time_constant
        return (mode.named.character, *[None] * 5, slow.value, slow.half(shown()))
    omega, zeta = mode.natural_frequency, mode.damping_ratio
    half = omega.half(shown())
    wide = None if half is None else half * HZ
    value = omega.value
    hertz = None if value is None else value * HZ
    return (mode.named.character, hertz, wide, value, zeta.value, zeta.half(shown()), None, None)


def modes_words(details: PolynomialDetails) -> str:
    """Natural frequencies in Hz with half-widths, and dampings, in words."""
    said = []
    for root in details.modes:
        frequency, damping = root.natural_frequency, root.damping
        if frequency is None or damping is None:
            continue
        wide = ""
        if (half := frequency.half(shown())) is not None:
            wide = f" ± {half * HZ:.2g}"
        said.append(f"{frequency.value * HZ:.3g}{wide} Hz (ζ {damping.value:.2g})")
    return "; ".join(said) or "none"
