"""Records that a study reads from files of samples: their settings, and how they are loaded."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from flightid.conventions import Role
from flightid.errors import StudyError
from flightid.record import InputShape, Interpolation, Record, read_records
from flightid.record.hold import HOLDS, LOOPS
from flightid.record.store import RECORD_COLUMN
from flightid.study.error_list import ErrorList
from flightid.study.reading import TableReader

UNKNOWN = InputShape()
ALL = "*"
"""Manoeuvre that stands for all of a file."""


@dataclass(frozen=True)
class RecordFile:
    """One manoeuvre in a file.

    Attributes
    ----------
    name : str
        Name by which models refer to it.
    paths : tuple of Path
        CSV, Parquet, MATLAB or netCDF; the name stands for the pieces of all, where they are
        several.
    manoeuvre : str or None
        Name of the manoeuvre, where the file holds several; ``"*"`` takes all of them, and the
        name then stands for the whole group.
    span_s : tuple of float or None
        Start and stop on the file's clock, s; None: all of it.
    time : str
        Column of the time stamps.
    sample_time_s : float or None
        Sample time of a file without time column, s.
    resample_to_s : float or None
        Sample time of a new uniform grid, s.
    time_unit : str or None
        Unit of the time stamps, where the file does not say.
    experiment : str
        Column that tells manoeuvres of one file apart.
    interpolation : str, mapping of str to str, or None
        How samples of the new grid arise, for all channels or by name.
    columns : mapping of str to str
        Column of a channel, where it has another name.
    units : mapping of str to str
        Unit of a channel or of the time column, where the file does not say.
    shape : InputShape
        What is known of the inputs beyond their samples.
    """

    name: str
    paths: tuple[Path, ...]
    manoeuvre: str | None = None
    span_s: tuple[float, float] | None = None
    time: str = "time"
    sample_time_s: float | None = None
    resample_to_s: float | None = None
    time_unit: str | None = None
    experiment: str = RECORD_COLUMN
    interpolation: str | Mapping[str, str] | None = None
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    shape: InputShape = UNKNOWN


def read_record_file(reader: TableReader, folder: Path) -> RecordFile:
    """Check one table ``[[record]]``.

    Raises
    ------
    StudyError
        A key is unknown or a value does not fit.
    """
    made = RecordFile(
        reader.text("name"),
        _paths(reader, folder),
        reader.maybe(reader.text, "manoeuvre"),
        reader.maybe(reader.interval, "span_s"),
        reader.text("time_column", "time"),
        reader.maybe(reader.positive, "sample_time_s"),
        reader.maybe(reader.positive, "resample_to_s"),
        reader.maybe(reader.text, "time_unit"),
        reader.text("experiment", RECORD_COLUMN),
        reader.maybe(lambda key: _interpolation(reader, key), "interpolation"),
        _texts(reader.table("columns"), reader.values("columns")),
        _texts(reader.table("units"), reader.values("units")),
        read_shape(reader),
    )
    reader.finish()
    return made


def _paths(reader: TableReader, folder: Path) -> tuple[Path, ...]:
    """Files by name, or by a pattern with ``*``, in the order of their names."""
    found: list[Path] = []
    for text in reader.names("path"):
        place = folder / text
        matches = sorted(place.parent.glob(place.name)) if "*" in place.name else [place]
        if not matches:
            raise reader.error("path", "matches no file", found=text, needed=f"files in {folder}")
        found += matches
    return tuple(dict.fromkeys(found))


def require_files(files: Iterable[RecordFile]) -> None:
    """See before any work that every file is there.

    Raises
    ------
    StudyError
        Some are not; the message names all of them.
    """
    collected = ErrorList()
    for file in files:
        for path in file.paths:
            collected.read(_require_file, None, file.name, path)
    collected.finish()


def _require_file(name: str, path: Path) -> None:
    if not path.is_file():
        raise StudyError(
            f"the file of record {name!r} is not there",
            found=str(path),
            needed="a file",
            action="correct path of its [[record]]",
        )


def _interpolation(reader: TableReader, key: str) -> str | dict[str, str]:
    """One word for all channels, or one for each that is named."""
    words = tuple(map(str, Interpolation))
    given = reader.peek(key)
    if not isinstance(given, Mapping):
        return reader.choice(key, words)
    inner = reader.table(key)
    return {str(name): inner.choice(str(name), words) for name in given}


def read_shape(reader: TableReader) -> InputShape:
    """Take what a table says of the inputs between samples, their repetition and the loop."""
    given: dict[str, Any] = {
        "hold": reader.maybe(lambda key: reader.choice(key, HOLDS), "hold"),
        "period_s": reader.maybe(reader.positive, "period_s"),
        "loop": reader.maybe(lambda key: reader.choice(key, LOOPS), "loop"),
    }
    return InputShape(**given)


def declared(record: Record, shape: InputShape) -> Record:
    """The record with what the study knows of its inputs; what is left out stays."""
    if shape == UNKNOWN:
        return record
    return record.declare(hold=shape.hold, period_s=shape.period_s, loop=shape.loop)


def _texts(reader: TableReader, values: Mapping[str, object]) -> dict[str, str]:
    return {key: reader.text(key) for key in values}


def load_records(
    file: RecordFile,
    roles: Mapping[str, Role],
    outliers: Mapping[str, Any] | None = None,
) -> list[Record]:
    """Read the channels that models need, of one manoeuvre or of all that the files hold.

    Parameters
    ----------
    file : RecordFile
    roles : mapping of str to Role
        Channels to take.
    outliers : mapping of str to object, optional
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
    file: RecordFile, path: Path, roles: Mapping[str, Role], outliers: Mapping[str, Any] | None
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
        time_column=file.time,
        units=_declared_units(file, roles),
        sample_time_s=file.sample_time_s,
        resample_to_s=file.resample_to_s,
        interpolation=_named_in(file.interpolation, roles),
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


def _declared_units(file: RecordFile, roles: Mapping[str, Role]) -> dict[str, str]:
    """Units of the channels that are taken and of the time column.

    Raises
    ------
    StudyError
        The unit of the time is declared twice, and differently.
    """
    units = {key: unit for key, unit in file.units.items() if key in roles or key == file.time}
    if file.time_unit is not None and units.setdefault(file.time, file.time_unit) != file.time_unit:
        raise StudyError(
            f"study file, record {file.name!r}: the unit of the time is declared twice",
            found=f"time_unit = {file.time_unit!r}, units {file.time} = {units[file.time]!r}",
            needed="one of them",
        )
    return units


def _named_in(
    interpolation: str | Mapping[str, str] | None, roles: Mapping[str, Role]
) -> str | dict[str, str] | None:
    """Interpolation of the channels that are taken: one study may use a file in several ways."""
    if isinstance(interpolation, Mapping):
        return {key: word for key, word in interpolation.items() if key in roles}
    return interpolation


def _named(file: RecordFile, record: Record, name: str) -> Record:
    known = declared(record, replace(file.shape, hold=None))
    return (
        known.replace(name=name) if file.span_s is None else known.segment(*file.span_s, name=name)
    )
