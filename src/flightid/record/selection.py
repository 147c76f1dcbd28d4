"""Channels that are named by role, and what they take of a file that `write_records` made."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path

from flightid.conventions import Role
from flightid.errors import OptionError, UnitError
from flightid.record.channel import Channel
from flightid.record.formats import FileFormat, netcdf, parquet
from flightid.record.formats.columns import channel_name
from flightid.record.history import Step
from flightid.record.record import Record
from flightid.record.store import stored_records
from flightid.units import canonical

Names = Iterable[str] | Mapping[str, str]


def selected_records(
    path: Path, kind: FileFormat, roles: Mapping[Role, Names | None], units: Mapping[str, str]
) -> list[Record] | None:
    """Records of a file that flightid wrote, of their named channels; None of another writer's.

    Raises
    ------
    UnitError
        A declared unit contradicts the file.
    """
    text = _labels(path, kind)
    if text is None:
        return None
    stored = stored_records(path, text, is_parquet=kind is FileFormat.PARQUET)
    return [_selected(item, roles, units) for item in stored]


def pairs_of(names: Names | None, columns: Container[str] = ()) -> list[tuple[str, str]]:
    """Names of channels with the columns that they come from."""
    if names is None:
        return []
    if isinstance(names, Mapping):
        return list(names.items())
    return [(channel_name(name, columns), name) for name in names]


def channel_units(
    units: Mapping[str, str], pairs: Iterable[tuple[str, str]], columns: Container[str] = ()
) -> dict[str, str]:
    """Units by channel, of units that were declared by channel or by column.

    Example
    -------
    >>> channel_units({"u": "1", "time": "ms"}, [("tau_phi", "u"), ("phi", "y")])
    {'tau_phi': '1', 'time': 'ms'}
    """
    known = list(pairs)
    channels = {channel_name(column, columns): name for name, column in known}
    own = {name for name, _ in known}
    by_column = {channels[k]: unit for k, unit in units.items() if k in channels and k not in own}
    return by_column | {k: unit for k, unit in units.items() if k in own or k not in channels}


def refuse_columns(path: Path, names: Sequence[str], derive: Mapping[str, str]) -> None:
    """Refuse options of columns for a file that flightid wrote.

    Raises
    ------
    OptionError
        There are some.
    """
    if names or derive:
        raise OptionError(
            f"{path.name} was written by flightid, and its channels have names",
            found="column_names" if names else f"derive {', '.join(derive)}",
            needed="neither",
            action="derive channels where the table is read, and write the record after it",
        )


def _labels(path: Path, kind: FileFormat) -> str | None:
    if kind is FileFormat.PARQUET:
        return parquet.read_labels(path)
    return netcdf.read_labels(path) if kind is FileFormat.NETCDF else None


def _selected(
    stored: Record, roles: Mapping[Role, Names | None], units: Mapping[str, str]
) -> Record:
    """A stored record with only the named channels, in the roles they are named under."""
    pairs = [(role, *pair) for role, names in roles.items() for pair in pairs_of(names)]
    named = stored if not pairs else _renamed(stored, pairs)
    renamed = [pair[1:] for pair in pairs]
    for name, unit in channel_units(units, renamed).items():
        if canonical(unit) != named.unit(name):
            raise UnitError(
                f"the declared unit of {name!r} contradicts the file",
                found=named.unit(name),
                needed=canonical(unit),
                action="leave the declaration out and convert the record",
            )
    return named


def _renamed(stored: Record, pairs: list[tuple[Role, str, str]]) -> Record:
    channels = [
        Channel(name, stored.unit(column), role, stored.channels[column].note)
        for role, name, column in pairs
    ]
    samples = {name: stored[column] for _, name, column in pairs}
    step = Step("read_records", {name: column for _, name, column in pairs})
    return stored.replace(samples, channels=channels, step=step)
