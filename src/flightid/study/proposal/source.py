"""Records that a study is proposed of: read, with what their columns are to its equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flightid.frozen import dataclass
from flightid.logs.joinable import joinable
from flightid.record import Record, read_records
from flightid.record.formats.columns import channel_name
from flightid.record.shared_ways import Ways, read_alike
from flightid.study.proposal.columns import Columns, columns_of, columns_of_model, units_of_channels
from flightid.study.proposal.options import DataOptions
from flightid.study.proposal.stretches import Stretch


@dataclass(frozen=True)
class Source:
    """Manoeuvres of files.

    Attributes
    ----------
    reading : DataOptions
        How they were read; units by column.
    parts : tuple of Stretch
    columns : Columns
    injected : tuple of str
        Columns that were injected ahead of a controller.
    renamed : mapping of str to str
        Columns by the channels of the equations, where they have another name.
    """

    reading: DataOptions
    parts: tuple[Stretch, ...]
    columns: Columns
    injected: tuple[str, ...]
    renamed: Mapping[str, str]


def read_source(
    paths: Sequence[Path],
    reading: DataOptions,
    model: str | None,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    excitations: tuple[str, ...],
) -> Source:
    """Read files, and tell what their columns are.

    Raises
    ------
    StudyError
        No column can be told for an input or output.
    FlightidError
        A file cannot be read, or there is no such model.
    """
    # What is named alone is read, so that no other column's gaps part its manoeuvres.
    named = {"inputs": inputs, "outputs": outputs} if inputs and outputs else {}
    named |= {"excitations": excitations} if excitations and named else {}
    # Which columns the channels of equations are is known once the columns have been read.
    of_channels = {} if model is None else units_of_channels(model, reading.units)
    by_column = {k: unit for k, unit in reading.units.items() if k not in of_channels}
    read = _read(paths, {**vars(reading), **named, "units": by_column})
    known = read[0].record.channels
    inputs, outputs, injected = (
        tuple(channel_name(name, known) for name in names)
        for names in (inputs, outputs, excitations)
    )
    columns = columns_of([part.record for part in read], inputs, outputs, injected)
    renamed = {} if model is None else columns_of_model(model, columns)
    if of_channels:
        by_column |= {renamed.get(name, name): unit for name, unit in of_channels.items()}
        reading = replace(reading, units=by_column)
        read = _read(paths, {**vars(reading), **named})
    return Source(reading, tuple(read), columns, injected, renamed)


def _read(paths: Sequence[Path], reading: Mapping[str, Any]) -> list[Stretch]:
    """Manoeuvres of all files."""

    def read(path: Path, interpolation: Ways) -> list[Record]:
        joined = {"join": joinable(reading["join"]), "interpolation": interpolation}
        return read_records(path, **{**reading, **joined})

    found = read_alike(paths, reading.get("interpolation"), read)
    return [part for path, made in zip(paths, found, strict=True) for part in _parts(path, made)]


def _parts(path: Path, found: Sequence[Record]) -> list[Stretch]:
    """Manoeuvres of a file."""
    if len(found) == 1:
        return [Stretch(found[0], path)]
    return [Stretch(record, path, str(record.name)) for record in found]
