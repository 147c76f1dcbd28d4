"""What the workers do with records of a rig: columns, manoeuvres, faults, levels, a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flightid.app.overview import light_of, shown_finding
from flightid.app.own_folders import is_link
from flightid.app.pyramid import Pyramid
from flightid.app.rig_schemas import ProposedStudy, RigColumn, RigFault, RigFile, RigManoeuvre
from flightid.app.rig_words import as_laid
from flightid.app.work import KEPT
from flightid.conventions import Light
from flightid.errors import FlightidError, UnknownNameError
from flightid.record import Record, read_records
from flightid.record.checks import BRIDGED, CHECK, checked_history, places_of
from flightid.record.contents import table_contents
from flightid.record.formats.sniff import file_format
from flightid.record.grid_proposal import GridProposal, propose_grid
from flightid.record.shared_ways import shared_ways
from flightid.record.tables import read_table
from flightid.study.proposal import propose_study
from flightid.study.proposal.columns import columns_of
from flightid.study.stage_runner import StageRunner
from flightid.surface import speaking

SHOWN = 200
"""Faults of a manoeuvre that are told."""


def require_table(path: Path) -> None:
    """Refuse a file in which nobody would find a column of numbers.

    Raises
    ------
    FileFormatError
        It is of no format that holds records, damaged, or prose.
    """
    read_table(path, file_format(path), ())


def make_rig(paths: Sequence[Path], reading: Mapping[str, Any]) -> dict[str, Any]:
    """Files with columns, manoeuvres and what was found in them; roles that their names tell."""
    files = [_file(path, reading) for path in paths]
    records = [r for path in paths for r in _quietly(path, reading)]
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    untold = ""
    if records:
        try:
            told = columns_of(records, (), ())
            inputs, outputs = told.inputs, told.outputs
        except FlightidError as error:
            # What to do is the page's to say: it has no flags.
            untold = error.reason
    return {
        "files": [each.model_dump() for each in files],
        "inputs": list(inputs),
        "outputs": list(outputs),
        "untold": untold,
        "time": _told_of(records, "time") or next((f.grid_column for f in files), ""),
        "time_unit": _told_of(records, "time_unit")
        or next((f.grid_unit for f in files if f.grid_unit and not f.manoeuvres), ""),
    }


def _told_of(records: Sequence[Record], what: str) -> str:
    """Column of the time, or its unit, as the reader of tables took it."""
    told = (step.options.get(what) for each in records for step in each.history)
    return next((each for each in told if isinstance(each, str)), "")


def propose(
    paths: Sequence[Path], folder: Path, asked: Mapping[str, Any], reading: Mapping[str, Any]
) -> dict[str, Any]:
    """The study that `flightid new` writes for these files."""
    made = propose_study(paths, folder=folder, cache=KEPT, **asked, **reading)
    missed = [each.message for each in made.findings]
    text = made.text if made.models else ""
    return ProposedStudy(
        text=text,
        models=list(made.models),
        said=[*made.said, *missed],
        findings=[shown_finding(each) for each in made.findings],
    ).model_dump()


def make_rig_pyramid(
    path: Path, manoeuvre: str, channel: str, reading: Mapping[str, Any], result: Path
) -> None:
    """Write a channel of a manoeuvre with its levels."""
    found = [each for each in _records(path, reading) if each.name == manoeuvre]
    if not found or channel not in found[0]:
        raise UnknownNameError("the records hold no such channel", found=f"{manoeuvre}: {channel}")
    if not is_link(result):
        Pyramid.of(found[0].time_s, found[0][channel]).write(result)


def input_ways(paths: Sequence[Path], reading: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Inputs that other files of the set bring to the grid in another way, by name of the file."""
    ways = shared_ways({path.name: _quietly(path, reading) for path in paths})
    return {name: {each: str(way) for each, way in own.items()} for name, own in ways.items()}


def _records(path: Path, reading: Mapping[str, Any]) -> list[Record]:
    return StageRunner(KEPT).stage("records", _read, path, dict(reading)).value


def _read(path: Path, reading: Mapping[str, Any]) -> list[Record]:
    return read_records(path, **reading)


def _quietly(path: Path, reading: Mapping[str, Any]) -> list[Record]:
    try:
        return _records(path, reading)
    except FlightidError:
        return []


def _file(path: Path, reading: Mapping[str, Any]) -> RigFile:
    columns: list[RigColumn] = []
    notes: list[str] = []
    manoeuvres: list[RigManoeuvre] = []
    said = ""
    try:
        table = table_contents(path)
        columns = [_column(row) for row in table.rows]
        # What is said of columns holds for tables; a file of records has none.
        notes = [each for each in table.notes if columns and not each.startswith("Next:")]
        with speaking(as_laid):
            records = _records(path, reading)
        manoeuvres = [_manoeuvre(each) for each in records]
        columns += _unlisted(records, {each.name for each in columns})
    except FlightidError as error:
        said = str(error)
    grid = _grid(path, reading) if said or "resample_to_s" in reading else None
    return RigFile(
        name=path.name, columns=columns, notes=notes, manoeuvres=manoeuvres, error=said,
        grid_s=None if grid is None else grid.step_s,
        grid_column="" if grid is None else grid.time_column,
        grid_unit="" if grid is None else grid.time_unit,
    )  # fmt: skip


def _grid(path: Path, reading: Mapping[str, Any]) -> GridProposal | None:
    """A new grid, where stamps call for one."""
    if "sample_time_s" in reading:
        return None
    try:
        return propose_grid(path, time_column=reading.get("time_column"))
    except FlightidError:
        return None


def _column(row: tuple[Any, ...]) -> RigColumn:
    name, unit, samples, _, least, most = row
    return RigColumn(name=name, unit=unit or "", samples=samples, least=least, most=most)


def _unlisted(records: Sequence[Record], told: set[str]) -> list[RigColumn]:
    """Channels that a table of contents leaves out: what never moves, or all of a file of records.

    Their ends are unknown where a file holds no number of them.
    """
    found: dict[str, list[np.ndarray]] = {}
    units: dict[str, str] = {}
    for record in records:
        for name in (each for each in record.channels if each not in told):
            found.setdefault(name, []).append(record[name])
            units.setdefault(name, record.unit(name))
    return [_of_samples(name, units[name], np.concatenate(parts)) for name, parts in found.items()]


def _of_samples(name: str, unit: str, samples: np.ndarray) -> RigColumn:
    held = samples[np.isfinite(samples)]
    least, most = (float(held.min()), float(held.max())) if held.size else (None, None)
    return RigColumn(name=name, unit=unit, samples=samples.size, least=least, most=most)


def _manoeuvre(record: Record) -> RigManoeuvre:
    steps = [step.options for step in checked_history(record) if step.operation == CHECK]
    return RigManoeuvre(
        name=str(record.name),
        start_s=float(record.time_s[0]),
        stop_s=float(record.time_s[-1]),
        rate_hz=record.sample_rate_hz,
        channels={name: record.unit(name) for name in record.channels},
        faults=[_fault(each) for each in steps[:SHOWN]],
    )


def _fault(options: Mapping[str, Any]) -> RigFault:
    return RigFault(
        channel=str(options["channel"]),
        code=str(options["code"]),
        light=light_of(Light(str(options["light"]))),
        message=str(options["found"]),
        action=str(options["action"] or ""),
        spans_s=list(places_of(options)),
        deviations=options.get(BRIDGED),
    )
