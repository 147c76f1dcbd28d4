"""What a worker does for the screen Fleet: a run, answers of a catalogue, one question to it."""

from __future__ import annotations

import datetime
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightid.app.fleet_schemas import (
    FleetFlight,
    FleetHistory,
    FleetPart,
    FleetRunPart,
    FleetSheet,
    FleetType,
    FleetVehicle,
    FleetVehiclePart,
)
from flightid.app.overview import light_of
from flightid.app.schemas import ShownFinding
from flightid.errors import OptionError
from flightid.files import write_atomically
from flightid.findings import Finding
from flightid.fleet import ask_fleet, propose_fleet, read_fleet, run_fleet
from flightid.fleet import open as open_fleet
from flightid.fleet.drift_lights import estimate_lights, shared_lights
from flightid.fleet.engine.address_space import bounded_memory
from flightid.fleet.normality import least_words
from flightid.fleet.opening import names_fleet_file
from flightid.fleet.page import (
    copies_words,
    events_table,
    fleet_vehicles,
    fleet_words,
    least_steps_table,
    lights_counted,
    odd_words,
    red_words,
    refused_table,
    slopes_table,
)
from flightid.fleet.statistics.answers import FleetAnswers, TypeAnswers
from flightid.fleet.statistics.parameter_history import ParameterHistory
from flightid.fleet.vehicle_lights import change_words, event_words, going_on_words
from flightid.table import Table
from flightid.uncertainty.quantiles import half_width, showing, shown

SHOWN = 9
"""Histories that the whole fleet shows; those of a vehicle are all there."""
MOST_CHARACTERS = 16 << 20
"""Of the text in an answer: more is no page."""
EXACT = 1 << 53
"""Whole numbers beyond are not those of a browser."""
NOTHING_HELD: tuple[str, FleetAnswers | None] = ("", None)
_held: list[tuple[str, FleetAnswers | None]] = [NOTHING_HELD]


def make_fleet(path: Path, result: Path) -> None:
    """Run a fleet file as `flightid fleet run` does, and write what became of it."""
    done = run_fleet(path)
    part = FleetRunPart(lines=[*done.lines], said=[_finding(each) for each in done.findings])
    write_atomically(result, part.model_dump_json())


def propose(folder: Path) -> tuple[str, list[str]]:
    """Write the fleet file of a folder of logs: its name, and what was chosen."""
    made = propose_fleet(folder)
    return made.write().name, list(made.said)


def answer_fleet(place: Path) -> dict[str, Any]:
    """The answers of a fleet's catalogue."""
    answers, level = _answers(place), _level(place)
    with showing(level):
        every = [(t.drift, t, h) for t in answers.types if t.drift for h in t.drift.drawn]
        every.sort(key=lambda each: each[0].place_drawn(each[2]))
        return FleetPart(
            title=_title(place),
            words=fleet_words(answers),
            verdict=lights_counted(answers),
            level=shown(),
            vehicles=[
                _vehicle(name, found, answers) for name, found in fleet_vehicles(answers).items()
            ],
            types=[_type(each) for each in answers.types],
            histories=[_history(t, h) for _, t, h in every[:SHOWN]],
            refused=_table(_refused(answers)),
            undated=answers.undated,
        ).model_dump()


def answer_vehicle(place: Path, name: str) -> dict[str, Any]:
    """Flights and histories of one vehicle."""
    answers = _answers(place)
    with showing(_level(place)):
        mine = [(t, h) for t in answers.types if t.drift for h in t.drift.histories]
        found = [_history(t, h) for t, h in mine if h.vehicle == name]
    flights = [_flight(row) for row in answers.logs if row["vehicle"] == name]
    flights.sort(key=lambda each: each.flown_at, reverse=True)
    return FleetVehiclePart(name=name, flights=flights, histories=found).model_dump()


def query_fleet(place: Path, sql: str) -> dict[str, Any]:
    """Answer of one SELECT, with the limits of `flightid fleet query`."""
    with open_fleet(place) as catalogue, bounded_memory():
        table = catalogue.answer(sql)
        rows = [[_plain(each) for each in row] for row in table.rows]
    long = sum(len(each) for row in rows for each in row if isinstance(each, str))
    if long > MOST_CHARACTERS:
        raise OptionError(
            "the answer is too long for the page",
            found=f"{long / 1e6:.0f} MB of text",
            needed=f"{MOST_CHARACTERS / 1e6:.0f} MB or less",
            action="ask for fewer columns, or use flightid fleet query",
        )
    return {"columns": [each.name for each in table.columns], "rows": rows}


def _answers(place: Path) -> FleetAnswers:
    """Answers of a catalogue as it stands, held while it stands so."""
    stamp = _stamp(place)
    if _held[0][0] != stamp:
        _held[0] = NOTHING_HELD
        _held[0] = (stamp, ask_fleet(place))
    found = _held[0][1]
    assert found is not None
    return found


def _stamp(place: Path) -> str:
    """What changes where a fleet file or its catalogue does."""
    is_file = names_fleet_file(place)
    catalogue = Path(read_fleet(place).catalogue) if is_file else place
    listed = (
        (path.as_posix(), path.stat().st_size, path.stat().st_mtime_ns)
        for path in sorted(catalogue.rglob("*"))
        if path.is_file()
    )
    return json.dumps([str(place), place.read_text("utf-8") if is_file else "", *listed])


def _level(place: Path) -> float | None:
    return read_fleet(place).questions.level if names_fleet_file(place) else None


def _title(place: Path) -> str:
    return read_fleet(place).words.title if names_fleet_file(place) else place.name


def _vehicle(name: str, found: Finding, answers: FleetAnswers) -> FleetVehicle:
    mine = [each for each in answers.types if name in each.data.members]
    flown = {
        flight
        for each in mine
        for flight, vehicle in zip(each.data.flights, each.data.vehicles, strict=True)
        if vehicle == name
    }
    return FleetVehicle(
        name=name,
        types=list(dict.fromkeys(each.type_name for each in mine)),
        flights=len(flown),
        finding=_finding(found),
    )


def _finding(found: Finding) -> ShownFinding:
    return ShownFinding(
        code=found.code, light=light_of(found.light), message=found.message, action=found.action,
        spans_s=[],
    )  # fmt: skip


def _type(each: TypeAnswers) -> FleetType:
    tables, reasons, found = list[Table](), list(each.reasons), tuple[Finding, ...]()
    if each.population is not None:
        tables.append(each.population.summary(labels=each.labels))
        tables.append(each.population.spread_table(labels=each.labels))
    if each.outliers is not None:
        tables.append(each.outliers.summary(each.labels))
    if each.drift is not None:
        found = (*estimate_lights(each.drift, each.labels), *shared_lights(each.drift, each.labels))
        tables.append(slopes_table(each.drift, each.labels))
        tables.append(each.drift.summary(labels=each.labels))
        tables.append(events_table(each.drift, each.labels))
        tables.append(least_steps_table(each.drift, each.labels))
        reasons += [each.drift.reason] if each.drift.reason else []
    return FleetType(
        name=each.type_name, model=each.model, reasons=reasons,
        labels=dict(each.labels), tables=[_table(table) for table in tables],
        notes=list(filter(None, [odd_words(each)])), findings=[_finding(one) for one in found],
    )  # fmt: skip


def _refused(answers: FleetAnswers) -> Table:
    table = refused_table(answers.logs)
    outdated = (f"{each.message}: {each.action}" for each in answers.outdated)
    copies = filter(None, [copies_words(answers)])
    return replace(table, notes=(*table.notes, *red_words(answers), *copies, *outdated))


def _table(table: Table) -> FleetSheet:
    return FleetSheet(
        title=table.title,
        columns=[each.name for each in table.columns],
        units=[each.unit or "" for each in table.columns],
        digits=[each.digits for each in table.columns],
        rows=[[_plain(cell) for cell in row] for row in table.rows],
        notes=list(table.notes),
    )


def _history(of: TypeAnswers, each: ParameterHistory) -> FleetHistory:
    ends = each.track.ends(shown())
    data = of.data
    logs = {
        (vehicle, at): flight
        for vehicle, at, flight in zip(
            data.vehicles, data.time_s.tolist(), data.flights, strict=True
        )
    }
    half = half_width(shown())
    return FleetHistory(
        vehicle=each.vehicle, type=of.type_name, model=of.model, name=each.name,
        unit="" if each.unit == "1" else each.unit, label=of.labels.get(each.name, ""),
        time_s=each.time_s.tolist(), values=each.values.tolist(),
        half=[half * math.sqrt(v) for v in each.variances.tolist()],
        level=each.track.level.tolist(), low=ends[:, 0].tolist(), high=ends[:, 1].tolist(),
        changed=each.is_alarm, kind=each.kind,
        words=_words(of, each),
        changed_s=each.changed_s if each.is_alarm else None,
        events=list(dict.fromkeys((one.time_s, one.what) for one in each.happened)),
        logs=[logs.get((each.vehicle, at), "")[:16] for at in each.time_s.tolist()],
    )  # fmt: skip


def _words(of: TypeAnswers, each: ParameterHistory) -> str:
    """What changed or may have, else what would have been found; empty where nothing was asked."""
    if each.is_alarm:
        return change_words(each, of.labels)
    if each.goes_on:
        return going_on_words(each, of.labels)
    return "; ".join(_doubts(of, each)) or least_words(each)


def _doubts(of: TypeAnswers, each: ParameterHistory) -> Iterator[str]:
    """What events did to it, and whether its newest flight is off, as its light says."""
    if of.drift is None:
        return
    yield from (event_words(h, e, of.labels) for h, e in of.drift.by_event if h is each)
    for newest in of.drift.newest_off:
        if (newest.vehicle, newest.name) == (each.vehicle, each.name):
            yield newest.words(of.labels)


def _flight(row: Mapping[str, Any]) -> FleetFlight:
    at = row["flown_at"]
    text = at.isoformat(" ", "minutes") if isinstance(at, datetime.datetime) else str(at or "")
    return FleetFlight(
        log=str(row["log"]), flown_at=text, light=str(row["light"] or "unknown"),
        address=str(row["address"] or ""), outcome=str(row["outcome"]), here=None,
    )  # fmt: skip


def _plain(value: object) -> str | int | float | bool | None:
    """A value that JSON and a browser hold as it is; others as their words."""
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int):
        return value if abs(value) < EXACT else str(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    return str(value)
