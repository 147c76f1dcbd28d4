"""Records that a study reads from files of samples: their settings, and how they are loaded."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from glob import glob, has_magic
from itertools import takewhile
from pathlib import Path
from typing import Any

from flightid.conventions import Role
from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.logs.joinable import joinable
from flightid.option_forms import NOTHING, SPAN
from flightid.options import option
from flightid.record import InputShape, Record, read_records
from flightid.record.derived import sources_of
from flightid.record.formats.columns import channel_name
from flightid.record.options import RECORD_COLUMN, TableOptions
from flightid.record.time_columns import is_time_unit, unit_in_name
from flightid.study.reading import TableReader, read_table
from flightid.study.shape_options import ShapeOptions

UNKNOWN = InputShape()
_COMMAND = re.compile(r"`(python [^`]+)`")
ALL = "*"
"""Manoeuvre that stands for all of a file."""


@dataclass(frozen=True)
class RecordFile(ShapeOptions, TableOptions):
    """One manoeuvre in files: a table ``[[record]]``, and the paths that it stands for."""

    name: str = option(doc="Name by which models refer to it.")
    path: tuple[str, ...] = option(
        doc="Table or ROS bag, by name or pattern; the name stands for all pieces."
    )
    manoeuvre: str | None = option(
        None, doc="Name of the manoeuvre where the file holds several; '*': all, as one group."
    )
    span_s: tuple[float, float] | None = option(
        None, unit="s", forms=(SPAN, NOTHING), doc="Start and stop on the file's clock."
    )
    experiment: str = option(RECORD_COLUMN, doc="Column that tells manoeuvres of one file apart.")
    columns: Mapping[str, str] = option(
        default_factory=dict, doc="Column of a channel, where it has another name."
    )
    paths: tuple[Path, ...] = ()


def read_record_file(reader: TableReader, folder: Path) -> RecordFile:
    """Check one table ``[[record]]``.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    made = read_table(RecordFile, reader)
    joined = tuple(str(folder / name) for name in made.join)
    return replace(made, paths=_paths(reader, folder, made.path), join=joined)


def _paths(reader: TableReader, folder: Path, names: Iterable[str]) -> tuple[Path, ...]:
    """Files by name, or by a pattern with ``*``, ``?`` or ``[``, in the order of their names."""
    found: list[Path] = []
    for text in names:
        place = folder / text
        is_pattern = has_magic(text) and not place.exists()
        matches = sorted(map(Path, glob(str(place), recursive=True))) if is_pattern else [place]
        if not matches:
            raise reader.error("path", "matches no file", found=text, needed=f"files in {folder}")
        found += matches
    return tuple(dict.fromkeys(found))


def require_files(files: Iterable[RecordFile], source: Path) -> None:
    """See before any work that every file is there.

    Parameters
    ----------
    files : iterable of RecordFile
    source : Path
        The study.

    Raises
    ------
    StudyError
        Some are not; the message names all of them, and what the study says that makes them.
    """
    missing: dict[Path, str] = {}
    for file in files:
        for path in (*file.paths, *map(Path, file.join)):
            if not path.exists():
                missing.setdefault(path, file.name)
    if not missing:
        return
    one = len(missing) == 1
    raise StudyError(
        f"the file of record {next(iter(missing.values()))!r} is not there"
        if one
        else f"{len(missing)} files of records are not there",
        found=", ".join(map(str, missing)),
        needed="a file" if one else "files",
        action=f"{made_by(source)}correct path of its [[record]]",
    )


def made_by(source: Path) -> str:
    """What the comment at the top of a study names for making its files, in words; or nothing.

    Parameters
    ----------
    source : Path
        The study, on whose first lines a command stands as ```python fly.py```.
    """
    lines = takewhile(lambda line: line.startswith("#"), source.read_text("utf-8").splitlines())
    opening = " ".join(line.removeprefix("#").strip() for line in lines)
    command = _COMMAND.search(opening)
    if command is None:
        return ""
    folder = "" if source.parent == Path() else f"cd {shlex.quote(str(source.parent))} && "
    return f"run what the study's first lines name for making them ({folder}{command[1]}), or "


def declared(record: Record, shape: InputShape) -> Record:
    """The record with what the study knows of its inputs; what is left out stays."""
    if shape == UNKNOWN:
        return record
    return record.declare(hold=shape.hold, period_s=shape.period_s, loop=shape.loop)


def load_records(
    file: RecordFile,
    roles: Mapping[str, Role],
    outliers: Sequence[Mapping[str, Any]] | None = None,
) -> list[Record]:
    """Read the channels that models need, of one manoeuvre or of all that the files hold.

    Parameters
    ----------
    file : RecordFile
    roles : mapping of str to Role
        Channels to take.
    outliers : sequence of mapping of str to object, optional
        Options of the outliers that are bridged before anything is resampled.

    Returns
    -------
    list of Record

    Raises
    ------
    StudyError
        A file holds several manoeuvres and none is named.
    FlightidError
        The file cannot be read as a record; the message says why.
    """
    pieces = [_load(file, path, roles, outliers) for path in file.paths]
    if len(pieces) == 1:
        return pieces[0]
    return [
        record.replace(name=f"{file.name}: {path.stem}" if len(piece) == 1 else record.name)
        for path, piece in zip(file.paths, pieces, strict=True)
        for record in piece
    ]


def _load(
    file: RecordFile,
    path: Path,
    roles: Mapping[str, Role],
    outliers: Sequence[Mapping[str, Any]] | None,
) -> list[Record]:
    """Records of one file."""

    def named(role: Role) -> dict[str, str] | None:
        chosen = {key: file.columns.get(key, key) for key, value in roles.items() if value is role}
        return chosen or None

    found = read_records(
        path,
        inputs=named(Role.INPUT),
        outputs=named(Role.OUTPUT),
        excitations=named(Role.EXCITATION),
        others=named(Role.OTHER),
        **_reading(file, roles),
        outliers=outliers,
        record_column=file.experiment,
        hold=file.shape.hold,
    )
    if file.manoeuvre == ALL:
        return [_named(file, record, f"{file.name}: {record.name}") for record in found]
    if file.manoeuvre is not None:
        chosen = [record for record in found if record.name == file.manoeuvre]
    else:
        chosen = found
    if len(chosen) != 1:
        raise StudyError(
            f"it is not clear which manoeuvre record {file.name!r} is",
            found=f"{len(chosen)} of that name" if file.manoeuvre else f"{len(found)} in the file",
            needed="one",
            action=f'name it with manoeuvre ({_names(found)}), take all with "*", or mend gaps '
            "with resample_to_s",
        )
    return [_named(file, chosen[0], file.name)]


def _names(records: list[Record]) -> str:
    shown = [record.name for record in records[:6]]
    return ", ".join([*shown, *(["…"] if len(records) > len(shown) else [])])


def _reading(file: RecordFile, roles: Mapping[str, Role]) -> dict[str, Any]:
    """How the file is read: one study may use it in several ways, of other channels each."""
    asked = {each.name: getattr(file, each.name) for each in fields(TableOptions)}
    asked["join"] = joinable(file.join)
    times = (file.time_column,) if file.time_column else ()
    read = (file.columns.get(role, role) for role in roles)
    known = {*map(channel_name, (*roles, *read, *times, *sources_of(file.derive)))}
    asked["units"] = {
        key: unit
        for key, unit in file.units.items()
        if channel_name(key) in known or (unit_in_name(key) is not None and is_time_unit(unit))
    }
    if isinstance(file.interpolation, Mapping):
        asked["interpolation"] = {k: way for k, way in file.interpolation.items() if k in roles}
    return asked


def _named(file: RecordFile, record: Record, name: str) -> Record:
    known = declared(record, replace(file.shape, hold=None))
    return (
        known.replace(name=name) if file.span_s is None else known.segment(*file.span_s, name=name)
    )
