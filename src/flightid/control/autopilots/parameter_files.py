"""Parameter files that ground stations load, and the file that takes every change back."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path

import numpy as np

from flightid.errors import FileFormatError, OptionError
from flightid.files import as_path, write_atomically
from flightid.frozen import dataclass

NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}")
"""ArduPilot and PX4 keep names in 16 characters."""
CLI_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
"""Betaflight's settings, by the line."""
CLI_WORDS = {"simplified_pids_mode": ("OFF", "RP", "RPY")}
"""Settings of which Betaflight's command line takes words: those of the numbers."""
PX4_INTEGERS = ("IMU_GYRO_DNF_EN",)
REAL32, INT32 = 9, 6
"""MAVLink's numbers for the types of a parameter."""
LARGEST_FILE_BYTES = 10_000_000
ROLLBACK = ".rollback"


@dataclass(frozen=True)
class GainChange:
    """A parameter's new value beside the one it replaces.

    Attributes
    ----------
    name : str
        The autopilot's name.
    value : float
        New value.
    old : float or None
        Value that the vehicle flew with; None: not known.
    reason : str
        Goes into the file as a comment.

    Raises
    ------
    OptionError
        A name or a value that no autopilot would take.

    Example
    -------
    >>> GainChange("ATC_RAT_RLL_P", 0.12, old=0.135, reason="phase margin")
    GainChange(name='ATC_RAT_RLL_P', value=0.12, old=0.135, reason='phase margin')
    """

    name: str
    value: float
    old: float | None = None
    reason: str = ""

    def __post_init__(self) -> None:
        if not (NAME.fullmatch(self.name) or CLI_NAME.fullmatch(self.name)):
            raise OptionError(
                "not a parameter's name",
                found=self.name,
                needed="up to 16 capitals, digits and underscores; Betaflight: small letters",
            )
        for value in (self.value, 0.0 if self.old is None else self.old):
            if not math.isfinite(value):
                raise OptionError(f"{self.name} would not be a finite number", found=value)


@dataclass(frozen=True)
class WrittenParameters:
    """Files that were written.

    Attributes
    ----------
    path : Path
        The new values.
    rollback : Path or None
        The old ones; None where none was known.
    """

    path: Path
    rollback: Path | None


Changes = Iterable[GainChange] | Mapping[str, float]


def _listed(changes: Changes) -> list[GainChange]:
    if isinstance(changes, Mapping):
        found = [GainChange(name, float(value)) for name, value in changes.items()]
    elif isinstance(changes, str | PathLike):
        raise OptionError(
            "changes were expected here",
            found=changes,
            needed="GainChanges, or values by name",
            action="give what is to be written first, then the path",
        )
    else:
        found = list(changes)
    if not found:
        raise OptionError("no parameter is to be written", needed="one change or more")
    return found


def _number(value: float) -> str:
    """Shortest decimal that single precision reads back as the same number."""
    return np.format_float_positional(np.float32(value), trim="-")


def _write(path: str | Path, text: str, rollback: str | None, overwrite: bool) -> WrittenParameters:
    final = as_path(path)
    back = final.with_name(final.stem + ROLLBACK + final.suffix) if rollback else None
    for target in (final, back):
        if target is not None and target.exists() and not overwrite:
            raise OptionError(
                "a parameter file is already there",
                found=target,
                action="name another file, or pass overwrite=True; a rollback file may be the only "
                "record of the values a vehicle flew with",
            )
    # The way back first: a vehicle must never get new values without it.
    if back is not None and rollback is not None:
        write_atomically(back, rollback)
    write_atomically(final, text)
    return WrittenParameters(final, back)


def write_ardupilot_parameters(
    changes: Changes, path: str | Path, *, notes: Iterable[str] = (), overwrite: bool = False
) -> WrittenParameters:
    """Write an ArduPilot parameter file: one ``NAME,value`` a line, reasons as comments.

    Ground stations and the Methodic Configurator read it. Beside it a rollback file with the old
    values is written, where they are known.

    Parameters
    ----------
    changes : iterable of GainChange, or mapping of str to float
        What to set.
    path : str or Path
        File, usually ``*.param``.
    notes : iterable of str
        Comment lines at the top.
    overwrite : bool
        Whether files that exist may be replaced.

    Raises
    ------
    OptionError
        Nothing to write, a name or value that no autopilot takes, or a file that exists.
    OSError
        The folder is missing or cannot be written.

    Reference
    ---------
    ArduPilot, Tools/Frame_params; Methodic Configurator, ``NAME,value # comment``.

    Example
    -------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = write_ardupilot_parameters(
    ...         [GainChange("ATC_RAT_RLL_P", 0.12, 0.135, "phase margin")],
    ...         f"{folder}/roll.param")
    ...     print(written.path.read_text(), written.rollback.read_text(), sep="")
    ATC_RAT_RLL_P,0.12 # phase margin; was 0.135
    ATC_RAT_RLL_P,0.135
    <BLANKLINE>
    """
    found = _listed(changes)
    lines = [f"# {_comment(note)}" for note in notes]
    lines += [f"{c.name},{_number(c.value)}{_remark(c)}" for c in found]
    old = [f"{c.name},{_number(c.old)}" for c in found if c.old is not None]
    return _write(path, "\n".join(lines) + "\n", "\n".join(old) + "\n" if old else None, overwrite)


def write_px4_parameters(
    changes: Changes,
    path: str | Path,
    *,
    notes: Iterable[str] = (),
    integers: Iterable[str] = PX4_INTEGERS,
    overwrite: bool = False,
) -> WrittenParameters:
    """Write a QGroundControl parameter file, as PX4 users load it.

    Parameters
    ----------
    changes : iterable of GainChange, or mapping of str to float
        What to set.
    path : str or Path
        File, usually ``*.params``.
    notes : iterable of str
        Comment lines at the top.
    integers : iterable of str
        Parameters that PX4 keeps as integers.
    overwrite : bool
        Whether files that exist may be replaced.

    Raises
    ------
    OptionError
        Nothing to write, a name or value that no autopilot takes, or a file that exists.
    OSError
        The folder is missing or cannot be written.

    Reference
    ---------
    QGroundControl, parameter file format: vehicle, component, name, value, MAVLink type.

    Example
    -------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = write_px4_parameters({"MC_ROLLRATE_P": 0.15}, f"{folder}/roll.params")
    ...     read_parameters(written.path)
    {'MC_ROLLRATE_P': 0.15}
    """
    found, whole = _listed(changes), set(integers)
    head = [f"# {_comment(note)}" for note in notes]
    head += [f"# {c.name}:{_remark(c).removeprefix(' #')}" for c in found if _remark(c)]
    head += ["#", "# Vehicle-Id Component-Id Name Value Type"]

    def line(name: str, value: float) -> str:
        text = str(round(value)) if name in whole else _number(value)
        return f"1\t1\t{name}\t{text}\t{INT32 if name in whole else REAL32}"

    new = [line(c.name, c.value) for c in found]
    old = [line(c.name, c.old) for c in found if c.old is not None]
    back = "\n".join([*head[-2:], *old]) + "\n" if old else None
    return _write(path, "\n".join(head + new) + "\n", back, overwrite)


def write_betaflight_settings(
    changes: Changes, path: str | Path, *, notes: Iterable[str] = (), overwrite: bool = False
) -> WrittenParameters:
    """Write lines for the command line of Betaflight or INAV, as ``diff`` prints, and ``save``.

    Parameters
    ----------
    changes : iterable of GainChange, or mapping of str to float
        What to set: whole numbers.
    path : str or Path
        File, usually ``*.txt``.
    notes : iterable of str
        Comment lines at the top.
    overwrite : bool
        Whether files that exist may be replaced.

    Raises
    ------
    OptionError
        Nothing to write, a name or value that Betaflight does not take, or a file that exists.
    OSError
        The folder is missing or cannot be written.

    Reference
    ---------
    Betaflight and INAV, cli.c: comments have lines of their own; `save` restarts.

    Example
    -------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = write_betaflight_settings([GainChange("p_roll", 52, 45)], f"{folder}/a.txt")
    ...     print(written.path.read_text(), end="")
    ...     read_parameters(written.rollback)
    # p_roll: was 45
    set p_roll = 52
    save
    {'p_roll': 45.0}
    """
    found = _listed(changes)
    lines = [f"# {_comment(note)}" for note in notes]
    for each in found:
        if remark := _remark(each).removeprefix(" # "):
            lines.append(f"# {each.name}: {remark}")
        lines.append(_cli_line(each.name, each.value))
    old = [_cli_line(each.name, each.old) for each in found if each.old is not None]
    back = "\n".join([*old, "save"]) + "\n" if old else None
    return _write(path, "\n".join([*lines, "save"]) + "\n", back, overwrite)


def _cli_line(name: str, value: float) -> str:
    words = CLI_WORDS.get(name)
    if not CLI_NAME.fullmatch(name) or value != round(value):
        raise OptionError(
            "the command line takes no such setting",
            found=f"{name} = {value:g}",
            needed="a name in small letters, and a whole number",
        )
    kept = round(value)
    return f"set {name} = {words[kept] if words and 0 <= kept < len(words) else kept}"


WRITERS = {
    "px4": (".params", write_px4_parameters),
    "betaflight": (".txt", write_betaflight_settings),
    "inav": (".txt", write_betaflight_settings),
    "ardu": (".param", write_ardupilot_parameters),
}
"""Usual suffix and writer of parameter files by what the name of an autopilot begins with."""


def parameter_suffix(autopilot: str) -> str:
    """Suffix of an autopilot's parameter files, by its name."""
    return next(suffix for start, (suffix, _) in WRITERS.items() if autopilot.startswith(start))


def write_parameters(
    autopilot: str,
    changes: Changes,
    path: str | Path,
    *,
    notes: Iterable[str] = (),
    overwrite: bool = False,
) -> WrittenParameters:
    """Write the parameter file of an autopilot, by its name; see the writers of `WRITERS`."""
    write = next(each for start, (_, each) in WRITERS.items() if autopilot.startswith(start))
    return write(changes, path, notes=notes, overwrite=overwrite)


def read_parameters(path: str | Path) -> dict[str, float]:
    r"""Read a parameter file of any of these forms.

    Parameters
    ----------
    path : str or Path
        ``NAME,value`` (or with a blank, a tab or ``=`` between), QGroundControl's five columns, or
        Betaflight's ``set name = value``.

    Returns
    -------
    dict of str to float

    Raises
    ------
    FileFormatError
        A line that is neither, a value that is no number, or a file too large to be one.
    OSError
        The file cannot be read.

    Reference
    ---------
    As `write_ardupilot_parameters`, `write_px4_parameters` and `write_betaflight_settings`.

    Example
    -------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "old.parm").write_text("ATC_RAT_RLL_P 0.1\n# a note\n")
    ...     read_parameters(f"{folder}/old.parm")
    {'ATC_RAT_RLL_P': 0.1}
    """
    source = Path(path)
    if source.stat().st_size > LARGEST_FILE_BYTES:
        raise FileFormatError("too large for a parameter file", found=source.stat().st_size)
    found = {}
    text = source.read_text(encoding="utf-8", errors="replace")
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.split("#", 1)[0].strip()
        if line and line != "save":
            name, value = _parsed(line, f"line {number} of {source.name}")
            found[name] = value
    return found


def _parsed(line: str, where: str) -> tuple[str, float]:
    parts = re.split(r"[,\s=]+", line)
    pair = parts[2:4] if len(parts) == 5 else parts
    names = NAME
    if parts[0] == "set":
        pair, names = parts[1:], CLI_NAME
    if len(pair) != 2 or not names.fullmatch(pair[0]):
        raise FileFormatError(f"{where} is not a parameter", found=line[:80])
    words = CLI_WORDS.get(pair[0], ())
    try:
        value = float(words.index(pair[1]) if pair[1] in words else pair[1])
    except ValueError:
        raise FileFormatError(f"{where} has no number", found=line[:80]) from None
    if not math.isfinite(value):
        raise FileFormatError(f"{where} has no finite number", found=line[:80])
    return pair[0], value


def _comment(text: str) -> str:
    return " ".join(text.split())


def _remark(change: GainChange) -> str:
    was = "" if change.old is None else f"was {_number(change.old)}"
    parts = [part for part in (_comment(change.reason), was) if part]
    return f" # {'; '.join(parts)}" if parts else ""
