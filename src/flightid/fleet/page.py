"""One page about a fleet: lights by vehicle, types, what changed, logs that could not be used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.catalogue.schema import FITTED
from flightid.fleet.drift_lights import (
    errors_lights,
    estimate_lights,
    shared_lights,
)
from flightid.fleet.normality import INSIDE, MORE, normal_light
from flightid.fleet.pictures import history_picture, type_picture
from flightid.fleet.reasons import grouped_reasons, reasons_table
from flightid.fleet.statistics.answers import RED, FleetAnswers, Row, TypeAnswers, fitted_share
from flightid.fleet.statistics.drift import FleetDrift
from flightid.fleet.statistics.event_shares import event_shares
from flightid.fleet.statistics.least_step import POWER
from flightid.fleet.statistics.multiple_testing import chance_cell
from flightid.fleet.taken import copies_named
from flightid.fleet.unnamed import unnamed_light, unnamed_logs
from flightid.fleet.vehicle_lights import shares_words, vehicle_light
from flightid.report.content import Block, Document, Lights, Paragraph, Section, TableBlock
from flightid.report.figures import figure_block
from flightid.table import Cell, Column, Table
from flightid.uncertainty.quantiles import interval_words, shown
from flightid.version import VERSION

SHOWN = 9
"""Histories drawn at most; those that changed come first."""
ORDER = (Light.RED, Light.AMBER, Light.UNKNOWN, Light.GREEN)
EVERY = "Every log gave a model."
NAMED = 40
"""Vehicles with a light of their own; of more, those that are green are counted."""


def fleet_document(answers: FleetAnswers, title: str = "Fleet") -> Document:
    """Say what a fleet's catalogue tells.

    Parameters
    ----------
    answers : FleetAnswers
    title : str
    """
    damaged = damaged_light(answers.damaged)
    lost = (*([damaged] if damaged else []), *answers.outdated)
    sections = [
        *([Section("The catalogue", (Lights(lost),))] if lost else []),
        Section("Vehicles", tuple(_vehicles(answers))),
        *(Section(_type_title(each), tuple(_type_blocks(each))) for each in answers.types),
        Section("Logs that could not be used", tuple(_refused(answers))),
    ]
    footer, lights = f"Made by flightid {VERSION}.", lights_counted(answers)
    return Document(title, fleet_words(answers), tuple(sections), footer, lights)


def damaged_light(parts: int) -> Finding | None:
    """What damaged parts of a catalogue mean for an answer; None where all can be read."""
    if not parts:
        return None
    said = f"{counted(parts, 'part')} of the catalogue damaged: the logs in it are in no answer"
    return Finding("damaged-parts", Light.RED, said, "flightid fleet run takes them again")


def lights_counted(answers: FleetAnswers) -> str:
    """Vehicles by light, in words, behind `fleet_words`; other verdicts are on estimates."""
    found = Counter(each.light for each in fleet_vehicles(answers).values())
    said = ", ".join(f"{found[light]} {light.words}" for light in ORDER if found[light])
    if len(found) == 1:
        said = said.removeprefix("1 ") if found.total() == 1 else f"all {said}"
    errors = Counter(
        finding.light
        for each in answers.types
        if each.drift is not None
        for finding in errors_lights(each.drift, each.labels)
    )
    rest = "".join(
        f"; standard errors of {counted(errors[light], 'parameter')} {words}"
        for light, words in (
            (Light.AMBER, "not borne out by flights"),
            (Light.UNKNOWN, "taken as stated, for no vehicle flew twice a day"),
        )
        if errors[light]
    )
    return f"{said}{rest}" if said else ""


def fleet_words(answers: FleetAnswers) -> str:
    """How large a fleet is, in one line."""
    fitted, every = fitted_share(answers.logs)
    vehicles = len(fleet_vehicles(answers))
    whose = counted(vehicles, "vehicle") if vehicles else "vehicles that nothing names"
    n = len(answers.copies)
    copies = f" and {n} cop{'y' if n == 1 else 'ies'} of them" if n else ""
    return f"{counted(every, 'log')}{copies}, {fitted} with a model, of {whose}"


def fleet_vehicles(answers: FleetAnswers) -> dict[str, Finding]:
    """Light of every vehicle, those without a model too, the worst first."""
    flown: dict[str, list[Row]] = {}
    for each in answers.logs:
        if each["vehicle"] is not None:
            flown.setdefault(str(each["vehicle"]), []).append(each)
    members = {name for each in answers.types for name in each.data.members}
    found = [
        (name, vehicle_light(name, answers.types) if name in members else _bare(name, flown[name]))
        for name in sorted(members | set(flown))
    ]
    chances = _least_chances(answers.types)
    found.sort(key=lambda pair: (ORDER.index(pair[1].light), chances.get(pair[0], 1.0)))
    return dict(found)


def _least_chances(types: Sequence[TypeAnswers]) -> dict[str, float]:
    """Of each vehicle, the chance of its least likely history: of two lights the worse."""
    found: dict[str, float] = {}
    for each in types:
        for history in each.drift.judged if each.drift is not None else ():
            chance = 1.0 if history.chance is None else history.chance
            found[history.vehicle] = min(chance, found.get(history.vehicle, 1.0))
    return found


def _bare(vehicle: str, flown: Sequence[Row]) -> Finding:
    """Of a vehicle without a model that counts."""
    logs, red = len(flown), sum(e["outcome"] == FITTED and e["light"] == RED for e in flown)
    words = f"none of its {logs} logs gave" if logs > 1 else "its log did not give"
    said = f"{vehicle}: {words} a model that counts"
    if red:
        said += f", {'all' if red == logs > 1 else red} of them red" if logs > 1 else ": it is red"
    why = "see below why they are red" if red == logs else "see below what to change, by reason"
    act = f"{why}, and fly sweeps"
    return Finding("vehicle", Light.UNKNOWN, said, act)


def _type_title(each: TypeAnswers) -> str:
    return f"Type “{each.type_name}”, model “{each.model}”"


def _vehicles(answers: FleetAnswers) -> Iterator[Block]:
    """One light a vehicle: changed is red, unlike its type amber."""
    found = fleet_vehicles(answers)
    if not any(each.data.members for each in answers.types):
        none = "counts: see below why" if answers.red else "intervals: see below what to change"
        yield Paragraph(f"No vehicle has a model {'that' if answers.red else 'with'} {none}.")
    if unnamed := unnamed_light(unnamed_logs(answers.logs)):
        yield Lights((unnamed,))
    if not found:
        return
    if len(found) <= NAMED:
        shown_lights = tuple(found.values())
    else:
        worrying = [e for e in found.values() if e.light in (Light.RED, Light.AMBER)]
        shown_lights = (*worrying, *_counts(found, answers.types))
    yield Lights(shown_lights, "The worst first")
    if answers.undated:
        yield Paragraph(
            f"{counted(answers.undated, 'flight')} without a date: part of their type, but of no "
            "history."
        )


def _counts(found: Mapping[str, Finding], types: Iterable[TypeAnswers]) -> Iterator[Finding]:
    """How many of a large fleet are normal, and of how many that cannot be told."""
    green = {name for name, each in found.items() if each.light is Light.GREEN}
    unjudged = sum(each.light is Light.UNKNOWN for each in found.values())
    if green:
        yield normal_light(green, types)
    if unjudged:
        words = f"{counted(unjudged, 'vehicle')} not judged: too few flights or vehicles to tell"
        yield Finding("vehicles-unknown", Light.UNKNOWN, words, MORE)


def _type_blocks(each: TypeAnswers) -> Iterator[Block]:
    for reason in each.reasons:
        yield Paragraph(f"Not answered: {reason}.")
    if each.population is not None:
        yield TableBlock(each.population.summary(labels=each.labels))
        yield TableBlock(each.population.spread_table(labels=each.labels))
        if odd := odd_words(each):
            yield Paragraph(odd)
        caption = f"Every vehicle's own estimate with its interval of {interval_words(shown())}"
        ends = (e.next_vehicle.interval(shown()) for e in each.population.parameters.values())
        shaded = ", and, shaded, where the next vehicle lies" if any(ends) else ""
        caption += f"{shaded}, by name from left to right."
        yield figure_block(type_picture(each.population, each.labels), caption)
    if each.outliers is not None:
        many = len(each.outliers.vehicles) > SHOWN
        if each.outliers.vehicles:
            table = each.outliers.summary(each.labels)
            yield TableBlock(
                table, folded=many and not (each.outliers.odd or each.outliers.minorities)
            )
        else:
            yield Paragraph(f"No vehicle was held beside its type: {each.outliers.reason}.")
    if each.drift is not None:
        yield from _drift_blocks(each.drift, each.labels)


def odd_words(each: TypeAnswers) -> str:
    """Flights that the tables of a type lack; empty where there are none."""
    told = "; ".join(
        f"{len(logs)} of {each.labels.get(k, k)} ({_few(logs)})"
        for k, logs in each.odd_flights.items()
    )
    said = "Flights far off those beside them are left out of these tables"
    return f"{said}: {told}." if told else ""


def _few(logs: Sequence[str]) -> str:
    """The first few names of logs, and how many there are more."""
    left = len(logs) - SHOWN
    return ", ".join(logs[:SHOWN]) + (f" and {left} more" if left > 0 else "")


def _drift_blocks(drift: FleetDrift, labels: Mapping[str, str]) -> Iterator[Block]:
    yield Lights(estimate_lights(drift, labels), "Errors of the estimates")
    if drift.shared or drift.alike:
        yield Lights(shared_lights(drift, labels), "What all vehicles did together")
    slopes = slopes_table(drift, labels)
    if slopes.rows:
        yield TableBlock(slopes)
    if drift.reason:
        yield Paragraph(f"Not answered: {drift.reason}.")
    else:
        changes = drift.summary(labels=labels)
        yield TableBlock(changes) if changes.rows else Paragraph(_unchanged(drift, changes))
    events = events_table(drift, labels)
    if events.rows:
        yield TableBlock(events)
    least = least_steps_table(drift, labels)
    if least.rows:
        yield TableBlock(least, folded=True)
    if drift.judged:
        caption = (
            "Estimates of flights with their intervals, what covariates explain taken out; the "
            "level behind them; orange where it changed, and when. What a light speaks of is drawn "
            "first, then the least likely ones."
        )
        yield figure_block(history_picture(drift.drawn[:SHOWN], labels), caption)


def _unchanged(drift: FleetDrift, changes: Table) -> str:
    together = drift.shared or drift.alike
    said = "No vehicle changed beside the others:" if together else "Nothing changed:"
    return " ".join((said, *changes.notes))


def slopes_table(drift: FleetDrift, labels: Mapping[str, str]) -> Table:
    """What covariates do to each parameter; no rows without any."""
    rows: list[tuple[Cell, ...]] = []
    units = {each.name: each.unit for each in drift.histories if each.unit != "1"}
    for name, effects in drift.slopes.items():
        for each in effects:
            low, high = each.interval(shown()) or (None, None)
            told = (labels.get(name, name), each.name, units.get(name), each.value)
            rows.append((*told, low, high, each.reason or None))
    words = interval_words(shown())
    columns = (
        *(Column("parameter"), Column("covariate"), Column("unit"), Column("change", digits=3)),
        *(Column(f"{words} low", digits=3), Column(f"{words} high", digits=3), Column("note")),
    )
    notes = (
        "Change of the parameter for one unit of a number, or for that word instead of the "
        "commonest.",
        *(f"{n} flights do not tell {k}." for k, n in drift.covariates_missing.items()),
    )
    return Table("What covariates explain", columns, tuple(rows), notes).without_empty_columns()


def events_table(drift: FleetDrift, labels: Mapping[str, str]) -> Table:
    """What was done, and by how much each parameter stepped then, the least likely first."""
    rows: list[tuple[Cell, ...]] = []
    happened = [(e, history) for history in drift.histories for e in history.events]
    happened.sort(key=lambda pair: 2.0 if pair[0].chance is None else pair[0].chance)
    for each, history in happened[:NAMED]:
        low, high = each.percent.interval(shown()) or (None, None)
        event = ", ".join(each.names)
        value, reason = each.percent.value, each.percent.reason or each.together or None
        if shares := event_shares(history, each, drift.histories):
            reason = f"{reason}: {shares_words(shares)}"
        name = labels.get(history.name, history.name)
        rows.append(
            (event, history.vehicle, name, value, low, high, chance_cell(each.chance), reason)
        )
    words = interval_words(shown())
    columns = (
        *(Column("event"), Column("vehicle"), Column("parameter")),
        *(
            Column("change", "%", 3),
            Column(f"{words} low", "%", 3),
            Column(f"{words} high", "%", 3),
        ),
        *(Column("chance without", digits=2), Column("note")),
    )
    left = len(happened) - len(rows)
    notes = (f"The least likely first; {left} more are not shown.",) if left else ()
    return Table("Events", columns, tuple(rows), notes).without_empty_columns()


def least_steps_table(drift: FleetDrift, labels: Mapping[str, str]) -> Table:
    """What "no change" was able to see, the largest first; no rows where nothing was judged."""
    told = [(e, e.least_step) for e in drift.judged if e.least_step and not e.is_alarm]
    told.sort(key=lambda pair: pair[1].value or 0.0, reverse=True)
    rows: list[tuple[Cell, ...]] = [
        *(
            (e.vehicle, labels.get(e.name, e.name), len(e.values), least.value, least.unit)
            for e, least in told[:NAMED]
        )
    ]
    columns = (
        *(Column("vehicle"), Column("parameter"), Column("flights")),
        *(Column("least step", digits=2), Column("unit")),
    )
    note = (
        f"Of lasting steps of this size{INSIDE} {100.0 * POWER:.0f} % would be found, at the level "
        "of the whole fleet; smaller ones, and such behind the first or before the last flights, "
        "may be there."
    )
    left = len(told) - len(rows)
    notes = (note, *((f"The largest first; {left} more are not shown.",) if left else ()))
    return Table("What would have been seen", columns, tuple(rows), notes)


def _refused(answers: FleetAnswers) -> Iterator[Block]:
    table = refused_table(answers.logs)
    every = "Every log gave a model; red ones count nowhere." if answers.red else EVERY
    yield TableBlock(table) if table.rows else Paragraph(every)
    yield from map(Paragraph, red_words(answers))
    if copies := copies_words(answers):
        yield Paragraph(copies)


def copies_words(answers: FleetAnswers) -> str:
    """Copies with what they are of; empty where there are none."""
    if not answers.copies:
        return ""
    return f"Copies, each the log of which it is one: {copies_named(answers.copies)}."


def red_words(answers: FleetAnswers) -> list[str]:
    """A line for each model that is red in logs of which another one counts."""
    return [
        f"Model “{model}” is red in {counted(len(places), 'log')} more, and is left out there: "
        f"flightid run STUDY --log {places[0].rpartition('/')[2]} says why."
        for model, places in answers.red.items()
    ]


def refused_table(logs: Sequence[Row]) -> Table:
    """Logs without a model by reason, with what to change; no rows where every one has a model."""
    return reasons_table(grouped_reasons(logs))
