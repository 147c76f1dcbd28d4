"""What a reader came for: a study in one sentence, the numbers to use, and what is next."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from shlex import quote
from statistics import median
from typing import TYPE_CHECKING

from flightid.conventions import Light
from flightid.errors import FlightidError
from flightid.evidence.evidence import LOOP, Check
from flightid.findings import Finding, counted, said_once, worst
from flightid.frozen import dataclass
from flightid.models import NarxModel
from flightid.report.content import Document, Lights, Section, TableBlock
from flightid.study.elsewhere import red_elsewhere
from flightid.study.estimate_tables import short_modes_table, structure_words
from flightid.study.faults import CODE, other_faults, tuning_fault
from flightid.study.gain_answer import flown_again, gain_tables, gains_finding
from flightid.table import Table

if TYPE_CHECKING:
    from flightid.identification.fit import Fit
    from flightid.study.identified import ModelResults
    from flightid.study.results import StudyResults


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
        Study file as the reader has to write it; default: its name, or where results lie beside
        its folder that and the name.
    written : sequence of str
        Files of the gains, the first to fly first, where they have been written.
    results : str
        Folder of the results as the reader has to write it; default: its name.
    """
    if source is None:
        source = _place(study)
    findings = [_models(study, source)]
    tuning = study.tuning
    if tuning is None:
        fault = tuning_fault(study.faults)
        told = [] if fault is None else [_without_verdicts(fault, study.identified)]
        return StudyAnswer(tuple(said_once([*findings, *told])))
    findings.append(
        gains_finding(tuning, source, written, results or study.output.name, study.gains_file)
    )
    if study.gain_flight is not None:
        findings.append(flown_again(study.gain_flight))
    made = tuning.sound or tuple(design for design in tuning.designs if design.exists)
    tables = gain_tables(made, tuning.filters) if made else ()
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
    """One line about each model; a last reason that several share, and its action, is said once.

    What is left of a line keeps the light of its model, and says where the reason stands.
    """
    lines = [in_short(item) for item in items]
    groups: dict[tuple[Light, str, str], list[int]] = {}
    for place, line in enumerate(lines):
        _, found, reason = line.message.rpartition("; ")
        if found:
            groups.setdefault((line.light, reason, line.action), []).append(place)
    for (light, reason, action), places in groups.items():
        if len(places) > 1:
            whose = "both" if len(places) == 2 else f"all {len(places)}"
            where = f"; {light.words} for what is said of {whose} below"
            for place in places:
                said = lines[place].message.removesuffix(f"; {reason}")
                told = "" if light is Light.GREEN else where
                lines[place] = replace(lines[place], message=said + told, action="")
            names = ", ".join(items[place].name for place in places)
            lines.append(Finding("model", light, f"{names}: {reason}", action))
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


def _place(study: StudyResults) -> str:
    """A study as seen from the folder that holds it and its results: the page has one for each."""
    name = next((name for name in study.files if name.endswith(".toml")), "STUDY")
    if study.source is None:
        return name
    folder, output = study.source.absolute().parent, study.output.absolute()
    apart = output.is_relative_to(folder.parent) and not output.is_relative_to(folder)
    return quote(f"{folder.name}/{name}") if apart and folder.parent.name else name


def _models(study: StudyResults, source: str) -> Finding:
    """What the models are worth together: first what serves, then what does not."""
    lights = [in_short(item) for item in study.identified]
    if not lights:
        return Finding("answer", Light.UNKNOWN, "no model was asked for")
    if all(item.fit is None for item in study.identified):
        said = "no model was made, for the reasons told of each: there is nothing to use"
        if Light.RED in {each.light for each in lights}:
            return Finding("answer", Light.RED, said, "mend first what is red there")
        action = "move the inputs more, over a decade of frequencies: flightid design plans it"
        return Finding("answer", Light.UNKNOWN, said, action)
    light = worst(lights)
    pairs = list(zip(lights, study.identified, strict=True))
    none = [item.name for each, item in pairs if item.fit is None and each.light is not Light.RED]
    sound = [item for each, item in pairs if each.light is not Light.RED and item.fit is not None]
    looped = [(check, item) for item in sound if (check := _doubted_loop(item.fit)) is not None]
    held = [item for _, item in looped]
    good = [item for item in sound if item not in held]
    bad = [(each, item) for each, item in pairs if each.light is Light.RED]
    several = f"{len(good)} of {counted(len(pairs), 'model')}"
    whole = not (bad or none or held)
    said = f"{counted(len(good), 'model') if whole else several} to use" if good else ""
    said += _promise(good)
    if any(each.light is Light.AMBER for each in lights):
        said += "; what is to be doubted is said of each" if good else ""
    if none:
        said += f"{'; ' if said else ''}none of {', '.join(none)}, for the reason that is named"
    for what in dict.fromkeys(check.what for check, _ in looped):
        names = ", ".join(item.name for check, item in looped if check.what == what)
        said += f"{'; ' if said else ''}not to be used, for the loop: {names}: {what}"
    if bad:
        why = f"not to be used, for what is said of {'it' if len(bad) == 1 else 'each'}"
        said += f"{'; ' if said else ''}{why}: {', '.join(item.name for _, item in bad)}"
    if good:
        action = _next(study, source, good)
    else:
        action = looped[0][0].action if looped else bad[0][0].action
    return Finding("answer", light, said, action)


def _doubted_loop(fit: Fit | None) -> Check | None:
    """What evidence says of a loop that no kind of model is to be used in; None elsewhere.

    Along a loop a model may be the controller turned round, and predicts unseen records of the same
    loop all the same. That a loop is closed alone leaves a model whose bars hold what it biases.
    """
    loop = None if fit is None else fit.evidence.check(LOOP)
    if fit is None or loop is None:
        return None
    if loop.light is Light.UNKNOWN:
        return loop
    return loop if loop.light is Light.AMBER and fit.covariance is None else None


def _promise(items: Sequence[ModelResults]) -> str:
    """How much of what no fit has seen the models predict, channel by channel of each."""
    alone = len(items) == 1
    fits = {
        f"{name} of “{record}”{'' if alone else f' by {item.name}'}": value
        for item in items
        for record, run in item.on_unseen.items()
        for name, value in run.fit_percent.items()
    }
    if not fits:
        return ""
    they = "it predicts" if alone else "they predict"
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
        return "gains of a PID need a model whose errors are known: mend first what is told of each"
    fits = [item.fit for item in good if item.fit is not None]
    if any(len(fit.model.inputs) > 1 and _grows(fit) for fit in fits):
        return (
            "for gains of a PID name the loops that hold its growing modes, attitudes and rates by "
            f"their own controls first: flightid tune {source} --controller pi_d "
            "--loops OUTPUT/INPUT ..."
        )
    models = [fit.model for fit in fits]
    loop = ""
    if all(len(each.inputs) + len(each.outputs) > 2 for each in models):
        loop = f" --loops {_loop_of(good)}"
    return f"for gains of a PID: flightid tune {source} --controller pi_d{loop}"


def _grows(fit: Fit) -> bool:
    """Whether a model moves away by itself, so that a loop elsewhere holds nothing of it."""
    try:
        return not fit.linear_system().is_stable
    except FlightidError:
        return False


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
