"""What a reader came for: a study in one sentence, the numbers to use, and what is next."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from shlex import quote
from statistics import median
from typing import TYPE_CHECKING

from flightid.control.autopilots.angle_law import angle_law
from flightid.control.autopilots.parameter_files import parameter_suffix
from flightid.control.autopilots.pid_loop import PidLoop
from flightid.control.tuning.limits import ANGLE
from flightid.conventions import Light
from flightid.findings import Finding, counted, said_once, worst
from flightid.frozen import dataclass
from flightid.models import NarxModel
from flightid.report.content import Document, Lights, Section, TableBlock
from flightid.study.elsewhere import red_elsewhere
from flightid.study.estimate_tables import short_modes_table, structure_words
from flightid.study.faults import CODE, other_faults, tuning_fault
from flightid.table import Cell, Column, Table

if TYPE_CHECKING:
    from flightid.control.tuning.pid_design import PidDesign
    from flightid.control.tuning.result import Tuning
    from flightid.control.tuning.tuned_filters import TunedFilters
    from flightid.study.identified import ModelResults
    from flightid.study.results import StudyResults
    from flightid.vehicles import GainFlight

MARGINS = {"phase margin": "deg", "gain margin": "dB"}


@dataclass(frozen=True)
class StudyAnswer:
    """The answer of a study.

    Attributes
    ----------
    findings : tuple of Finding
        One for the models, one for gains where any were asked for; each says what to do next.
    tables : tuple of Table
        Gains and their margins, where there are any.
    """

    findings: tuple[Finding, ...]
    tables: tuple[Table, ...] = ()


def answer_of(
    study: StudyResults,
    *,
    source: str | None = None,
    written: Sequence[str] = (),
    results: str = "",
) -> StudyAnswer:
    """Say in a sentence each what the models are worth, and the gains.

    Parameters
    ----------
    study : StudyResults
    source : str, optional
        Study file as the reader has to write it; default: its name, which holds in any folder.
    written : sequence of str
        Files of the gains, the first to fly first, where they have been written.
    results : str
        Folder of the results as the reader has to write it.
    """
    if source is None:
        source = next((name for name in study.files if name.endswith(".toml")), "STUDY")
    findings = [_models(study, source)]
    tuning = study.tuning
    if tuning is None:
        fault = tuning_fault(study.faults)
        told = [] if fault is None else [_without_verdicts(fault, study.identified)]
        return StudyAnswer(tuple(said_once([*findings, *told])))
    findings.append(_gains(tuning, source, written, results))
    if study.gain_flight is not None:
        findings.append(_flown(study.gain_flight))
    made = tuning.sound or tuple(design for design in tuning.designs if design.exists)
    tables = (_gain_table(made, tuning.filters), _margin_table(made)) if made else ()
    return StudyAnswer(tuple(findings), tables)


def _without_verdicts(fault: Finding, items: Iterable[ModelResults]) -> Finding:
    """Why there are no gains, without the verdict on a model, which its own line tells."""
    said = fault.message
    for item in items:
        if item.fit is not None:
            said = said.replace(f": found {item.fit.evidence.verdict.message}", "")
    return replace(fault, message=said)


def in_short(item: ModelResults) -> Finding:
    """One line about a model: the light of its evidence, and the first reason for it."""
    if item.fit is None:
        why = item.left_out[0]
        return Finding("model", worst(item.findings), f"{item.name}: {why.message}", why.action)
    verdict = item.fit.evidence.verdict
    first = f"{item.name}: average cost {item.fit.average_cost:.3g}"
    if item.settings.structure is not None:
        first = f"{item.name}: {structure_words(item.fit)}"
    return Finding("model", verdict.light, f"{first}; {verdict.message}", verdict.action)


def models_in_short(items: Sequence[ModelResults]) -> Lights:
    """One line about each model; a last reason that several share, and its action, is said once."""
    lines = [in_short(item) for item in items]
    groups: dict[tuple[str, str, str], list[int]] = {}
    for place, line in enumerate(lines):
        _, found, reason = line.message.rpartition("; ")
        if found:
            groups.setdefault((line.light, reason, line.action), []).append(place)
    for (light, reason, action), places in groups.items():
        if len(places) > 1:
            for place in places:
                said = lines[place].message.removesuffix(f"; {reason}")
                lines[place] = replace(lines[place], message=said, action="")
            names = ", ".join(items[place].name for place in places)
            lines.append(Finding("model", Light(light), f"{names}: {reason}", action))
    return Lights(tuple(lines), repeats=True)


def short_document(
    study: StudyResults, document: Document, written: Sequence[str] = (), results: str = ""
) -> Document:
    """A report of one screen: models, gains and, last, the answer with what is next.

    Parameters
    ----------
    study : StudyResults
    document : Document
        The whole report, whose verdicts count.
    written, results
        See `answer_of`.
    """
    source = None if study.source is None else quote(str(study.source))
    answer = answer_of(study, source=source, written=written, results=results)
    models = _without_actions(models_in_short(study.identified), answer.findings)
    others = other_faults(study.faults)
    faults = (Lights(others),) if others else ()
    tables = tuple(map(TableBlock, answer.tables))
    roots = short_modes_table(study.identified)
    moving = (TableBlock(roots),) if roots.rows else ()
    red = red_elsewhere(answer.findings, document.sections[1:])
    sections = (
        Section("Models", (models, *moving, *faults)),
        *((Section("Gains", tables),) if tables else ()),
        Section(
            f"Answer: {document.verdict} ({document.tally})",
            (Lights((*answer.findings, *red), repeats=True),),
        ),
    )
    return Document(document.title, document.subtitle, sections)


def _without_actions(lights: Lights, others: Iterable[Finding]) -> Lights:
    """Lights whose actions the answer does not give as well: it stands where eyes are."""
    given = {each.action for each in others}
    kept = (replace(e, action="") if e.action in given else e for e in lights.findings)
    return replace(lights, findings=tuple(kept))


def _models(study: StudyResults, source: str) -> Finding:
    """What the models are worth together: first what serves, then what does not."""
    lights = [in_short(item) for item in study.identified]
    if not lights:
        return Finding("answer", Light.UNKNOWN, "no model was asked for")
    if all(item.fit is None for item in study.identified):
        said = "no model was made, for the reasons named above: there is nothing to use"
        if Light.RED in {each.light for each in lights}:
            return Finding("answer", Light.RED, said, "mend first what is red there")
        action = "move the inputs more, over a decade of frequencies: flightid design plans it"
        return Finding("answer", Light.UNKNOWN, said, action)
    light = worst(lights)
    pairs = list(zip(lights, study.identified, strict=True))
    none = [item.name for each, item in pairs if item.fit is None and each.light is not Light.RED]
    good = [item for each, item in pairs if each.light is not Light.RED and item.fit is not None]
    bad = [(each, item) for each, item in pairs if each.light is Light.RED]
    several = f"{len(good)} of {counted(len(pairs), 'model')}"
    said = f"{several if bad or none else counted(len(good), 'model')} to use" if good else ""
    said += _promise(good)
    if any(each.light is Light.AMBER for each in lights):
        said += "; each says what is to be doubted" if good else ""
    if none:
        said += f"{'; ' if said else ''}none of {', '.join(none)}, for the reason that is named"
    if bad:
        why = f"not to be used, for what is said of {'it' if len(bad) == 1 else 'each'}"
        said += f"{'; ' if said else ''}{why}: {', '.join(item.name for _, item in bad)}"
    action = _next(study, source, good) if good else bad[0][0].action
    return Finding("answer", light, said, action)


def _promise(items: Sequence[ModelResults]) -> str:
    """How much of what no fit has seen the models predict, channel by channel."""
    fits = {
        f"{name} of “{record}”": value
        for item in items
        for record, run in item.on_unseen.items()
        for name, value in run.fit_percent.items()
    }
    if not fits:
        return ""
    they = "it predicts" if len(items) == 1 else "they predict"
    values = sorted(fits.values())
    unseen = "of motion that no fit has seen"
    missed = sum(value <= 0.0 for value in values)
    if not missed:
        ends = dict.fromkeys(f"{value:.3g}" for value in (values[0], values[-1]))
        return f": {they} {' to '.join(ends)} % {unseen}"
    if missed == len(values):
        return f": {they} nothing {unseen}"
    middle = f"{median(values):.3g} % at the median of {len(values)} channels"
    worse = f"{missed} no better than a constant would, {min(fits, key=fits.__getitem__)} least"
    return f": {they} up to {values[-1]:.3g} % {unseen}, {middle}; {worse}"


def _next(study: StudyResults, source: str, good: Sequence[ModelResults]) -> str:
    """What to do with models that serve."""
    if study.tuning is not None or any(each.code == CODE for each in study.faults):
        return ""
    if study.inspection is not None:
        return f"for gains: flightid tune {source}"
    if all(item.fit is not None and isinstance(item.fit.model, NarxModel) for item in good):
        return "gains of a PID need a linear model: record small steps about one operating point"
    if all(item.fit is None or item.fit.covariance is None for item in good):
        return "gains of a PID need a model whose errors are known: mend first what is named above"
    models = [item.fit.model for item in good if item.fit is not None]
    loop = ""
    if all(len(each.inputs) + len(each.outputs) > 2 for each in models):
        loop = f" --loops {_loop_of(good)}"
    return f"for gains of a PID: flightid tune {source} --controller pi_d{loop}"


def _loop_of(items: Sequence[ModelResults]) -> str:
    """A loop worth closing: output and input whose response held over the widest band."""
    fit = next(item.fit for item in items if item.fit is not None)
    widths = {
        each.name: each.omega_rad_s[-1] / each.omega_rad_s[0]
        for each in fit.responses
        if len(each.omega_rad_s)
    }
    if widths:
        return max(widths, key=widths.__getitem__)
    return f"{fit.model.outputs[0]}/{fit.model.inputs[0]}"


def _gains(tuning: Tuning, source: str, written: Sequence[str] = (), results: str = "") -> Finding:
    """Whether there are gains, and what they promise or what is in the way."""
    designs, findings = tuning.sound, tuning.findings
    left = "; ".join(f"{axis}: {why}" for axis, why in tuning.left_out.items())
    red = next((each for each in findings if each.light is Light.RED), None)
    if not designs:
        action = red.action if red else "relax what cannot be met, or identify better"
        return Finding("gains", Light.RED, f"no gains to fly: {left}", action)
    least = [
        each.worst
        for design in designs
        for each in design.worst_cases
        if each.name == "phase margin" and each.worst is not None
    ]
    promise = f" keep at least {min(least):.0f}° of phase margin" if least else " keep their limits"
    steps = max(len(design.stages) for design in designs)
    axes = ", ".join(design.axis for design in designs)
    plain = any(isinstance(design.loop, PidLoop) for design in designs)
    if plain:
        coded = all(design.plain and design.plain.sampled for design in designs)
        files = "controller.toml and controller.c" if coded else "controller.toml"
        where = f"stand in {written[0]}" if written else f"lie beside the report as {files}"
        way = f"they {where}: close the loop with them, and log"
    elif written:
        step = f", step 1 of {steps}" if steps > 1 else ""
        way = f"fly {written[0]}{step}, log, then flightid compare {results} LOG: kept or not"
    else:
        file = f"gains{parameter_suffix(designs[0].flown.autopilot)}"
        way = f"flightid tune {source} --write {file} writes them; " + (
            f"fly step 1 of {steps}, log, and look again" if steps > 1 else "fly them, and log"
        )
    what = "rig" if plain else "vehicle"
    message = f"gains of {axes}{promise} at the worst {what} that the data allow"
    asked = designs[0].requirements.phase_margin_deg
    if least and min(least) < asked:
        share = min(design.share_met for design in designs)
        message += f" ({100.0 * share:.1f} % of them or more keep {asked:g}° and all else asked)"
    if left:
        message += f"; none to fly, they stay as flown: {left}"
    return Finding("gains", worst(findings) if findings else Light.GREEN, message, way)


def _flown(flight: GainFlight) -> Finding:
    """Whether the simulated vehicle keeps what the gains promise."""
    first = next((each for each in flight.findings if each.light is Light.RED), None)
    said = f"{flight.meeting} of {len(flight.judged)} pairs of 95 % intervals meet"
    least = [
        each.measured.value
        for each in flight.margins
        if each.name == "phase margin" and each.measured.value is not None
    ]
    said += f", least phase margin {min(least):.0f}°" if least else ""
    told = f"flown again in the simulated vehicle: {first.message if first else said}"
    return Finding("flown-again", worst(flight.findings), told, first.action if first else "")


def _gain_table(designs: tuple[PidDesign, ...], filters: TunedFilters | None) -> Table:
    columns = (
        Column("axis"), Column("parameter"), Column("flown"), Column("new"),
        Column("ratio", digits=3), Column("first step"),
    )  # fmt: skip
    named = {each.name: each for design in designs for each in design.filters}
    rows: list[tuple[Cell, ...]] = [
        ("filter", each.name, each.old, each.value, each.value / each.old if each.old else None,
         each.value)
        for each in named.values()
    ]  # fmt: skip
    rows += [
        (
            design.axis, change.name, change.flown, change.new, change.ratio,
            design.stages[0].gains.get(change.name) if len(design.stages) > 1 else None,
        )
        for design in designs
        for change in design.changes
    ]  # fmt: skip
    notes = (*(() if filters is None else filters.words), *small_angles(designs))
    return Table("Gains to fly", columns, tuple(rows), notes).without_empty_columns()


def small_angles(designs: Iterable[PidDesign]) -> Iterator[str]:
    """Up to which error angle controllers do what is promised, where parameters end it."""
    said: list[str] = []
    bounds: dict[str, None] = {}
    for design in designs:
        flown, new = (
            angle_law(each.autopilot, each.gains, design.axis)
            for each in (design.flown, design.loop)
        )
        if flown is None or new is None or not math.isfinite(new.proportional_to_rad):
            continue
        before, after = (math.degrees(each.proportional_to_rad) for each in (flown, new))
        said.append(f"{after:.2g} deg in {design.axis} ({before:.2g} as flown)")
        bounds[new.bound] = None
    if said:
        yield (
            f"Angle steps are promised for errors up to {', '.join(said)}: larger ones are "
            f"answered more slowly ({', '.join(bounds)})."
        )


def _margin_table(designs: tuple[PidDesign, ...]) -> Table:
    columns = [Column("axis"), Column("loop")]
    for name, unit in MARGINS.items():
        columns += [Column(name, unit, 3), Column(f"{name} as flown", unit, 3)]
    rows: list[tuple[Cell, ...]] = []
    for design in designs:
        for loop in dict.fromkeys(each.loop for each in design.worst_cases):
            cells: list[Cell] = []
            for name in MARGINS:
                found = [e for e in design.worst_cases if (e.loop, e.name) == (loop, name)]
                cells += [found[0].worst, found[0].flown_worst] if found else [None, None]
            if any(cell is not None for cell in cells):
                rows.append((design.axis, loop, *cells))
    asked = designs[0].requirements
    angled = any(each.loop == ANGLE for design in designs for each in design.worst_cases)
    angle = f" ({asked.angle_phase_margin_deg:g} deg of the angle loop)" if angled else ""
    note = f"Required: {asked.phase_margin_deg:g} deg{angle} and {asked.gain_margin_db:g} dB."
    notes = [note]
    if any(f.code == "margin-beyond-band" for each in designs for f in each.findings):
        shown = [[row[2 + 2 * place] for row in rows] for place in range(len(MARGINS))]
        gone = [name for name, cells in zip(MARGINS, shown, strict=True) if {*cells} == {None}]
        dashed = any(None in cells and {*cells} != {None} for cells in shown)
        what = " and ".join(["–"] * (dashed or not gone) + gone)
        notes.append(
            f"{what}: not promised, for what lies above the band to which the model was shown."
        )
    what = "rig" if any(isinstance(each.loop, PidLoop) for each in designs) else "vehicle"
    title = f"Margins of the worst {what} that the data allow"
    return Table(title, tuple(columns), tuple(rows), tuple(notes)).without_empty_columns()
