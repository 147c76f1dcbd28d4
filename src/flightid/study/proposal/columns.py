"""Which columns of rig records drive and which answer: by role, by name, by unit."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence

from flightid.conventions import Role
from flightid.errors import StudyError, UnknownNameError
from flightid.frozen import dataclass
from flightid.models import load_model
from flightid.record import Record

MOST = 6
"""Columns that a refusal names; of more it tells how many there are."""
DRIVES = re.compile(
    r"u\d*|inputs?\d*|in\d*|.*_in|d_(lat|lon|ped|col)|.*(command|cmd|voltage|volt|current|throttle|pwm|duty|stick|torque|force"
    r"|aileron|elevator|rudder|collective|tau_).*",
    re.IGNORECASE,
)
ANSWERS = re.compile(
    r"y\d*|outputs?\d*|out\d*|.*_out|[pqr]|phi|theta|psi|.*(angle|rate|speed|velocity|position|height"
    r"|altitude|pitch|roll|yaw|temperature|accel).*",
    re.IGNORECASE,
)
DRIVING_UNITS = frozenset({"V", "A", "%", "us", "N", "N*m", "W"})
ANSWERING_UNITS = frozenset(
    {"rad", "deg", "rad/s", "deg/s", "rad/s^2", "m", "m/s", "m/s^2", "g", "K", "degC", "1/min"}
)


@dataclass(frozen=True)
class Columns:
    """Inputs and outputs of records.

    Attributes
    ----------
    inputs, outputs : tuple of str
    said : tuple of str
        How they were told, in words.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    said: tuple[str, ...]


def columns_of_model(model: str, columns: Columns) -> dict[str, str]:
    """Columns by the channels that equations name, those of another name alone.

    Names that both have stay; as many others are taken in their order, inputs and outputs apart.

    Raises
    ------
    FlightidError
        The model cannot be loaded.
    """
    found = load_model(model)
    taken = columns_by_channel(found.inputs, columns.inputs)
    return {**(taken or {}), **(columns_by_channel(found.outputs, columns.outputs) or {})}


def columns_by_channel(channels: Sequence[str], columns: Sequence[str]) -> dict[str, str] | None:
    """Columns of another name by the channels of equations, in their order; None: not as many.

    Example
    -------
    >>> columns_by_channel(("tau_phi",), ("u",)), columns_by_channel(("p",), ("p", "q"))
    ({'tau_phi': 'u'}, None)
    """
    free = [name for name in columns if name not in channels]
    waiting = [name for name in channels if name not in columns]
    return dict(zip(waiting, free, strict=True)) if len(free) == len(waiting) else None


def units_of_channels(model: str, units: Mapping[str, str]) -> dict[str, str]:
    """Units that are declared by the names of channels of equations, not of columns.

    Raises
    ------
    FlightidError
        The model cannot be loaded.
    """
    if not units:
        return {}
    found = load_model(model)
    channels = {*found.inputs, *found.outputs}
    return {name: unit for name, unit in units.items() if name in channels}


def columns_of(
    records: Sequence[Record],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    injected: tuple[str, ...] = (),
) -> Columns:
    """Tell the inputs and outputs that all records have.

    What is named goes first; then roles that a file holds, words in the names of columns, units.

    Raises
    ------
    UnknownNameError
        A column that was named is not there.
    StudyError
        Nothing tells which column drives or which answers.
    """
    first = records[0]
    shared = [name for name in first.channels if all(name in record for record in records)]
    for name in (*inputs, *outputs, *injected):
        if name not in shared:
            raise UnknownNameError(
                "the records have no such column", found=name, needed=", ".join(shared)
            )
    shared = [name for name in shared if name not in injected]
    drives, how_in = _told(first, shared, Role.INPUT, inputs, outputs)
    answers, how_out = _told(first, shared, Role.OUTPUT, outputs, drives)
    if answers and not drives:
        drives, how_in = _told(first, shared, Role.INPUT, inputs, answers)
    for role, found in (("inputs", drives), ("outputs", answers)):
        if not found:
            columns = ", ".join(f"{name} [{first.unit(name) or '?'}]" for name in shared[:MOST])
            if len(shared) > MOST:
                columns = f"{len(shared)} columns: {columns} and so on"
            raise StudyError(
                f"the columns do not tell which are {role}",
                found=columns or "no column that all records have",
                needed=f"{role} by name",
                action=_name_them(role, [c for c in shared if c not in (*drives, *answers)]),
            )
    left = [name for name in shared if name not in (*drives, *answers)]
    said = [f"Inputs {', '.join(drives)} ({how_in}), outputs {', '.join(answers)} ({how_out})"]
    said += [f"Injected: {', '.join(injected)} (as named)"] if injected else []
    said += [f"Not used: {', '.join(left)}"] if left else []
    return Columns(drives, answers, tuple(said))


def _name_them(role: str, free: Sequence[str]) -> str:
    """What to do where nothing tells a role: of columns that no role has taken."""
    if free:
        return f"name them: --{role} {shlex.quote(free[0])}"
    other = "inputs" if role == "outputs" else "outputs"
    return f"no column is left for them: name fewer --{other}"


def _told(
    record: Record, names: Sequence[str], role: Role, given: tuple[str, ...], taken: tuple[str, ...]
) -> tuple[tuple[str, ...], str]:
    """Columns of a role, and what told them."""
    if given:
        return given, "as named"
    free = [name for name in names if name not in taken]
    words, units = (DRIVES, DRIVING_UNITS) if role is Role.INPUT else (ANSWERS, ANSWERING_UNITS)
    ways = {
        "by their roles in the file": [n for n in free if record.channels[n].role is role],
        "by their names": [n for n in free if words.fullmatch(n)],
        "by their units": [n for n in free if record.unit(n) in units],
        "as what is left": free if taken and len(free) == 1 else [],
    }
    for how, found in ways.items():
        if found:
            return tuple(found), how
    return (), ""
