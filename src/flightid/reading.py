"""Bytes of strangers: one memory budget for all readers, bounded text, TOML and JSON.

What a file declares is compared with the budget before anything is allocated for it. The budget is
`DEFAULT_MIB`, far below what machines have; the environment variable ``FLIGHTID_MEMORY_MIB`` or
``flightid --memory`` sets another.
"""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flightid.errors import FileFormatError, FlightidError, OptionError

VARIABLE = "FLIGHTID_MEMORY_MIB"
DEFAULT_MIB = 2048
DOCUMENT_BYTES = 1 << 20
"""Longest file that a person writes: studies, models, charts, channel maps."""
DEEPEST = 64
LONGEST_NUMBER = 300
"""Digits of an integer; what has more is no double."""
_PART = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+"""
_DEEP_KEY = re.compile(rf"(?<![A-Za-z0-9_-]){_PART}(?:\.[ \t]*+{_PART}){{{DEEPEST}}}")
"""More parts than a table may be deep: Python's reader takes time and memory by their square."""


def memory_budget() -> int:
    """Bytes that one file may take in memory.

    Raises
    ------
    OptionError
        The environment variable holds no positive whole number.

    Example
    -------
    >>> memory_budget() >> 20
    2048
    """
    text = os.environ.get(VARIABLE, str(DEFAULT_MIB))
    if not (text.isascii() and text.isdigit() and len(text) < 9 and int(text)):
        raise OptionError(
            f"the environment variable {VARIABLE} is no amount of memory",
            found=text[:40],
            needed="MiB, a whole number from 1",
        )
    return int(text) << 20


def require_memory(name: str, n_bytes: float) -> None:
    """Refuse what would take more memory than the budget; call it before allocating.

    Parameters
    ----------
    name : str
        Of the file.
    n_bytes : float
        What its content takes, as the file declares it.

    Raises
    ------
    FileFormatError
        It is more than the budget.
    """
    budget = memory_budget()
    if n_bytes > budget:
        raise FileFormatError(
            f"{name} declares more than is read into memory",
            found=f"{n_bytes / (1 << 20):,.0f} MiB",
            needed=f"at most {budget >> 20:,} MiB",
            action=f"check that it is whole, split it, or allow more by --memory or {VARIABLE}",
        )


def require_file(path: Path) -> None:
    """Refuse devices, pipes and sockets: to open or read one may wait without end.

    Parameters
    ----------
    path : Path
        A file, a folder, or nothing yet.

    Raises
    ------
    FileFormatError
        It is another thing.
    """
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise FileFormatError(
            f"{path.name} is no file",
            found="a pipe, a socket or a device",
            needed="a file, or the folder of a bag",
            action="write what comes from it to a file first",
        )


@contextmanager
def within_memory(name: str) -> Iterator[None]:
    """Turn a native reader's MemoryError, which holds bytes, into the refusal of `require_memory`.

    Parameters
    ----------
    name : str
        Of the file.

    Raises
    ------
    FileFormatError
        What the file holds takes more than the budget.
    """
    try:
        yield
    except MemoryError as fault:
        require_memory(name, *fault.args)
        raise


@contextmanager
def decoding(name: str, whole: str, action: str = "write or copy it again") -> Iterator[None]:
    """Turn whatever a library's decoder raises at a damaged file into `FileFormatError`.

    Parameters
    ----------
    name : str
        Of the file.
    whole : str
        What it should be, such as "a whole netCDF file".
    action : str
        What to do next.

    Raises
    ------
    FileFormatError
        For every error but those of flightid and a file that is not there.
    """
    try:
        yield
    except (FlightidError, FileNotFoundError, IsADirectoryError, PermissionError):
        raise
    # Decoders have no error of their own: what they met is what they raise.
    except Exception as error:
        raise FileFormatError(
            f"{name} is not {whole}",
            found=f"{type(error).__name__}: {str(error).strip()[:200]}",
            action=action,
        ) from error


@contextmanager
def of_file(name: str) -> Iterator[None]:
    """Name the file in errors on what it holds: one of many may be at fault.

    Parameters
    ----------
    name : str
        Of the file.

    Raises
    ------
    FlightidError
        What was raised, its problem after the name.
    """
    try:
        yield
    except FlightidError as error:
        if name in str(error):
            raise
        raise type(error)(
            f"{name}: {error.problem}",
            found=error.found,
            needed=error.needed,
            action=error.action,
        ) from error


def bounded_bytes(path: Path, most: int, error: type[FlightidError] = FileFormatError) -> bytes:
    """Content of a file, never more than a number of bytes.

    Raises
    ------
    FlightidError
        Of class `error`: the file is longer.
    OSError
        It cannot be read.
    """
    with path.open("rb") as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise error(
            f"{path.name} is longer than such a file can be",
            found=f"more than {most} bytes",
            needed=f"at most {most}",
        )
    return content


def read_toml(
    path: Path, what: str, error: type[FlightidError] = FileFormatError
) -> dict[str, Any]:
    """Table of a TOML file of at most `DOCUMENT_BYTES`.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What it should hold, for the error: "a study file".
    error : type
        Class of the error.

    Raises
    ------
    FlightidError
        Of class `error`: it is longer, or as `parse_toml`.
    OSError
        It cannot be read.
    """
    return parse_toml(bounded_bytes(path, DOCUMENT_BYTES, error), what, path.name, error)


def parse_toml(
    content: bytes | str, what: str, name: str, error: type[FlightidError] = FileFormatError
) -> dict[str, Any]:
    """Table of TOML text.

    Raises
    ------
    FlightidError
        Of class `error`: it is no TOML, is nested deeper than `DEEPEST`, or has an integer beyond
        64 bits, which TOML does not know.

    Example
    -------
    >>> parse_toml("a = 1", "a model", "a.toml")
    {'a': 1}
    """
    try:
        text = content if isinstance(content, str) else content.decode("utf-8")
        if _DEEP_KEY.search(text):
            raise ValueError(f"a key of more than {DEEPEST} parts")
        table = tomllib.loads(text)
        _require_plain(table)
    except RecursionError as fault:
        raise error(
            f"{what} is nested too deep", found=name, needed=f"at most {DEEPEST}"
        ) from fault
    # Integers of thousands of digits are a plain ValueError in Python.
    except ValueError as fault:
        raise error(f"{what} is no TOML in UTF-8", found=f"{name}: {fault}") from fault
    return table


def parse_json(content: bytes | str, what: str, name: str) -> Any:  # noqa: ANN401 - JSON has any
    """Value of JSON text.

    Raises
    ------
    FileFormatError
        It is no JSON, nested too deeply, or has an integer of more than `LONGEST_NUMBER` digits.

    Example
    -------
    >>> parse_json("[1]", "a fit", "fit.json")
    [1]
    """
    try:
        text = content if isinstance(content, str) else content.decode("utf-8")
        return json.loads(text, parse_int=_integer)
    except (ValueError, RecursionError) as fault:
        raise FileFormatError(
            f"{what} is no JSON in UTF-8", found=f"{name}: {str(fault) or 'deep nesting'}"
        ) from fault


def _integer(digits: str) -> int:
    if len(digits) > LONGEST_NUMBER:
        raise ValueError(f"an integer of {len(digits)} digits")
    return int(digits)


def _require_plain(table: dict[str, Any]) -> None:
    """Refuse depth and integers that no reader expects, without recursion."""
    waiting: list[tuple[Any, int]] = [(table, 0)]
    while waiting:
        value, depth = waiting.pop()
        if isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
            raise ValueError(f"an integer of {value.bit_length()} bits")
        if isinstance(value, dict | list):
            if depth > DEEPEST:
                raise ValueError(f"nested deeper than {DEEPEST}")
            inner = value.values() if isinstance(value, dict) else value
            waiting.extend((each, depth + 1) for each in inner)
