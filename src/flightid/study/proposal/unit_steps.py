"""The step of a study that takes columns to the units of its equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from flightid.models import load_structure
from flightid.models.save import toml_value
from flightid.record import Record
from flightid.record.unit_changes import unit_changes
from flightid.study.model_settings import placed
from flightid.study.proposal.columns import Columns
from flightid.study.task import source_of


def unit_steps(
    model: str,
    records: Sequence[Record],
    columns: Columns,
    folder: Path,
    renamed: Mapping[str, str],
) -> tuple[list[str], list[str]]:
    """Lines of a ``[[conditioning]]``, none where all units are those of the model; word of them.

    Parameters
    ----------
    model : str
        Library model, or file of equations.
    records : sequence of Record
    columns : Columns
    folder : Path
        Of the study, to which the file is relative.
    renamed : mapping of str to str
        Columns by the channels of the equations, where they have another name.

    Raises
    ------
    FlightidError
        There is no such model, or it has no equations.
    """
    known = load_structure(source_of(placed(folder, model))).units
    channels = {column: name for name, column in renamed.items()}
    wanted = {each: channels.get(each, each) for each in (*columns.inputs, *columns.outputs)}
    units = {column: known[name] for column, name in wanted.items() if name in known}
    found: dict[str, str] = {}
    said: dict[str, None] = {}
    for record in records:
        changes = unit_changes(record, units)
        found |= {wanted[column]: unit for column, unit in changes.items()}
        for name, unit in changes.items():
            said[f"{name} converted from {record.unit(name)} to {unit}, its unit in {model}"] = None
    if not found:
        return [], []
    return ["", "[[conditioning]]", f"units = {toml_value(found)}"], [*said]
