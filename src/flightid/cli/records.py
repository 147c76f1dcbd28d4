"""Records that a command reads from tables and logs, with the options that say how."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from glob import glob
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from flightid.cli.option_fields import flags_of
from flightid.cli.output import note

if TYPE_CHECKING:
    from flightid.cli.log_parts import Take
    from flightid.options import Options
    from flightid.record import Record


WILD = re.compile(r"[*?[]")


def expanded(text: str) -> list[str]:
    """Files that a pattern names, sorted, where no file has that very name and no shell saw it.

    Example
    -------
    >>> expanded("no such file *.csv"), expanded("plain.csv")
    (['no such file *.csv'], ['plain.csv'])
    """
    if not WILD.search(text) or Path(text).exists():
        return [text]
    return sorted(glob(text)) or [text]


class FilesArgument(click.Argument):
    """An argument of several files, which quoted patterns may name."""

    def type_cast_value(self, ctx: click.Context, value: Any) -> Any:  # noqa: ANN401 — as click has it
        """Put the files of each pattern in its place, then look at each."""
        listed = isinstance(value, list | tuple)
        texts = [each for text in value for each in expanded(str(text))] if listed else value
        return super().type_cast_value(ctx, texts)


class _DataPath(click.Path):
    """A file, or the folder of a ROS 2 bag."""

    def convert(
        self,
        value: Any,  # noqa: ANN401 - as click has it
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401
        """A path that is there; a folder has to hold files of a bag."""
        found = expanded(str(value))
        if len(found) > 1:
            self.fail(f"{value} names {len(found)} files, and one is taken here", param, ctx)
        value = found[0]
        path = Path(str(super().convert(value, param, ctx)))
        if path.is_dir() and not any(path.glob("*.mcap")) and not any(path.glob("*.db3*")):
            self.fail(f"{path} is a folder, and no ROS 2 bag: it holds no .mcap and no .db3")
        return path


FILES = _DataPath(exists=True, path_type=Path)


def reading() -> dict[str, type[Options]]:
    """Options of reading: of tables, and of a part of a log or record."""
    from flightid.logs.options import PartOptions
    from flightid.record.options import ReadOptions

    return {"tables": ReadOptions, "logs": PartOptions}


def read_files(
    files: Iterable[Path],
    of_tables: Mapping[str, Any],
    of_logs: Mapping[str, Any],
    *,
    inputs: Sequence[str] | Mapping[str, str] | None = None,
    outputs: Sequence[str] | Mapping[str, str] | None = None,
    excitations: Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
    take: Take | None = None,
) -> list[Record]:
    """Records of files, in the units that a model has.

    A unit of the same dimension is converted, and a note says so.

    Parameters
    ----------
    files : iterable of Path
        Tables or logs.
    of_tables, of_logs : mapping of str to object
        What was given of `reading`.
    inputs, outputs, excitations : sequence of str, optional
        Channels by role; without them all of a log, and those with a role of a table. A mapping
        gives columns of tables other names.
    units : mapping of str to str, optional
        Unit of the model by channel.
    take : {"flown", "unseen"}, optional
        Of a log, where no part is named: its sweeps, or what they leave to verify on.

    Raises
    ------
    click.UsageError
        An option of tables for a log, or the other way round.
    """
    from flightid.logs import is_log, is_table_too
    from flightid.progress import track

    found: list[Record] = []
    for file in track(list(files), "Reading"):
        if is_log(file) and not (_names_columns(of_tables, inputs, outputs) and is_table_too(file)):
            _refuse(of_tables, f"tables, and {file.name} is a log")
            named = [*(inputs or ()), *(outputs or ()), *(excitations or ())]
            _refuse_renaming(file, inputs, outputs)
            asked = None if of_logs or not inputs else take
            found += _from_log(file, of_logs, list(dict.fromkeys(named)), list(inputs or ()), asked)
            continue
        _refuse({"sid_run": None} if "sid_run" in of_logs else {}, "logs")
        found += _from_table(file, of_tables, of_logs, inputs, outputs, excitations)
    return [in_units(record, units or {}) for record in found]


def as_channels(record: Record, names: Iterable[str]) -> tuple[str, ...]:
    """Channels by the names of the columns that they were, such as ``/imu/rate.x`` of a bag."""
    from flightid.record.formats.columns import channel_name

    own = {name: channel_name(name) for name in names}
    return tuple(own[name] if name not in record and own[name] in record else name for name in own)


def _refuse_renaming(file: Path, *roles: Sequence[str] | Mapping[str, str] | None) -> None:
    """Refuse columns of other names for a log, whose channels have names of their own."""
    given = [name for role in roles if isinstance(role, dict) for name in role.items()]
    other = [f"{column} for {name}" for name, column in given if column != name]
    if other:
        raise click.UsageError(
            f"{file.name} is a log, whose channels have names of their own: found "
            f"{', '.join(other)}; leave --inputs and --outputs out"
        )


def _names_columns(
    of_tables: Mapping[str, Any],
    inputs: Sequence[str] | Mapping[str, str] | None,
    outputs: Sequence[str] | Mapping[str, str] | None,
) -> bool:
    """Whether columns of a table are meant: topics of a bag, fields of a decoded blackbox."""
    roles = (role.values() if isinstance(role, dict) else role or () for role in (inputs, outputs))
    named = [name for role in roles for name in role]
    return bool(of_tables) or any(name.startswith("/") or "[" in name for name in named)


def _refuse(given: Mapping[str, Any], owner: str) -> None:
    for name in given:
        raise click.UsageError(f"{flags_of(name)[-1]} belongs to {owner}")


def _from_log(
    file: Path,
    of_logs: Mapping[str, Any],
    names: list[str],
    inputs: Sequence[str],
    take: Take | None,
) -> list[Record]:
    from flightid import read_log
    from flightid.cli.log_parts import log_records

    log = read_log(file)
    parts = None if take is None else log_records(log, names, inputs, take)
    return parts or [log.record(names=names or None, **of_logs)]


def _from_table(
    file: Path,
    of_tables: Mapping[str, Any],
    of_logs: Mapping[str, Any],
    inputs: Sequence[str] | Mapping[str, str] | None,
    outputs: Sequence[str] | Mapping[str, str] | None,
    excitations: Sequence[str] | None,
) -> list[Record]:
    from flightid import read_records
    from flightid.logs.joinable import joinable
    from flightid.record.time_question import time_said

    if "join" in of_tables:
        of_tables = {**of_tables, "join": joinable(of_tables["join"])}
    records = read_records(
        file, inputs or None, outputs or None, excitations=excitations or None, **of_tables
    )
    for said in filter(None, dict.fromkeys(map(time_said, records))):
        note(said)
    for record in records:
        for channel in record.channels.values():
            if channel.is_declared:
                note(f"{record.name}: {channel.name} {channel.note}")
    span = of_logs.get("span_s")
    return records if span is None else [record.segment(*span) for record in records]


def in_units(record: Record, units: Mapping[str, str]) -> Record:
    """The record with channels in the units that are wanted, where they convert; each is told."""
    from flightid.record.unit_changes import unit_changes

    wanted = unit_changes(record, units)
    for name, unit in wanted.items():
        note(f"{record.name or 'Record'}: {name} converted from {record.unit(name)} to {unit}")
    return record.to_units(**wanted) if wanted else record


def write_out(records: Sequence[Record], path: Path) -> Path:
    """Write records in the format that the file's name says.

    Raises
    ------
    click.UsageError
        Several records for one sheet.
    """
    from flightid import write_records
    from flightid.record.sheet import write_sheet

    if path.suffix.lower() != ".csv":
        return write_records(records, path)
    if len(records) > 1:
        raise click.UsageError("a .csv holds one record: write .parquet or .nc")
    return write_sheet(records[0], path)
