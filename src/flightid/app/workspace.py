"""The workspace: a folder with logs, study files and results, of which nothing half is ever seen.

``logs/<id>/<name>`` what was dropped, by the hash of its bytes; ``studies/<id>.toml``;
``.flightid/results/<id>/`` what was computed. Logs that lie elsewhere in the folder stay there.
Files are written whole, flushed and renamed; what a killed server leaves behind is a temporary
file that the next start removes. The folder may be a stranger's: `own_folders` follows no link of
it, and a file that cannot be listed is told with its reason.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import time
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from flightid.app.index import LogIndex
from flightid.app.own_folders import (
    clear_left,
    is_link,
    made_name,
    new_file,
    own_folder,
    read_plain,
    shown_name,
)
from flightid.errors import FlightidError, OptionError
from flightid.files import flush, sha256_of_file, write_atomically
from flightid.logs import is_log
from flightid.version import VERSION

HIDDEN = ".flightid"
ID = re.compile(r"[0-9a-f]{16}")
UNDATED_NS = 0
"""Time of the last change of a file of which nobody knows it, ns since 1970."""
NAME_BYTES = 120
"""Of a log's name; file systems end at 255."""
DEEPEST = 6
"""Folders below the workspace that are looked into for logs."""
SUFFIXES = frozenset(
    {".bin", ".log", ".ulg", ".bbl", ".bfl", ".tlog", ".px4log", ".mcap", ".db3", ".bag"}
)


class Workspace:
    """A folder that the page works in.

    Parameters
    ----------
    folder : path-like
        It must exist; what the page makes is written below it and nowhere else.

    Raises
    ------
    OptionError
        There is no such folder, or one that the page needs for itself in it is a link.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).resolve()
        if not self.folder.is_dir():
            raise OptionError(
                "the workspace is no folder",
                found=str(folder),
                needed="a folder with logs, or an empty one",
                action="make it first, or name another",
            )
        self._own("logs")
        for part in ("results", "jobs"):
            self._own(HIDDEN, part)
        clear_left(self._own("studies"))
        clear_left(self._own(HIDDEN, "uploads"))
        for planted in self._own(HIDDEN).glob("index.sqlite*"):
            if is_link(planted):
                planted.unlink()
        self.index = LogIndex(self._hidden("index.sqlite"))
        self.left_out: dict[str, str] = {}

    def scan(self) -> None:
        """Look for logs in the folder; what has kept its size and time is not read again.

        What cannot be listed stands in `left_out`, with its reason.
        """
        seen: list[str] = []
        left: dict[Path, str] = {}
        for path in _files(self.folder, DEEPEST, left, everything=False):
            try:
                seen += self._seen(path)
            except (OSError, FlightidError, UnicodeError) as error:
                left[path] = _reason(error)
        self.index.keep(seen)
        named = {shown_name(path.relative_to(self.folder)): why for path, why in left.items()}
        self.left_out = dict(sorted(named.items()))

    def _seen(self, path: Path) -> list[str]:
        """Name of a file in the index, brought up to date; none where it lies elsewhere."""
        if not self._inside(path):
            return []
        status = path.stat()
        name = path.relative_to(self.folder).as_posix()
        name.encode()
        if not self.index.is_current(name, status.st_size, status.st_mtime_ns):
            known = sha256_of_file(path)[:16] if is_log(path) else None
            self.index.put(name, known, status.st_size, status.st_mtime_ns)
        return [name]

    def log_path(self, log: str) -> Path | None:
        """Path of a log by its hash; None where the workspace holds no such log."""
        if not ID.fullmatch(log):
            return None
        for name in self.index.paths(log):
            path = self.folder / name
            with suppress(OSError):
                if path.is_file() and self._inside(path):
                    return path
        return None

    async def take(self, name: str, chunks: AsyncIterator[bytes], modified_ms: int = 0) -> str:
        """Write a log that comes in pieces, and return its hash.

        Parameters
        ----------
        name : str
            As the page calls it; of a path the last part alone is taken.
        chunks : async iterator of bytes
        modified_ms : int
            When the file that is sent was changed last, ms since 1970, so that it keeps its date;
            0 where nobody knows, and a date to come, are kept as `UNDATED_NS`: the hour of a drop
            is no date of a flight.

        Raises
        ------
        OptionError
            The name is none, or the file is no log that flightid reads.
        """
        plain = plain_name(name)
        digest = hashlib.sha256()
        folder = self._own(HIDDEN, "uploads")
        with new_file(folder, f"{made_name('part')}{Path(plain).suffix}") as (stream, temporary):
            async for chunk in chunks:
                digest.update(chunk)
                stream.write(chunk)
            stream.close()
            if not is_log(temporary):
                raise OptionError(
                    "this file is no log that flightid reads",
                    found=plain,
                    needed="a log of ArduPilot, PX4, Betaflight or INAV",
                )
            known = 0 < modified_ms < 1000 * time.time()
            os.utime(temporary, ns=(modified_ms * 1_000_000 if known else UNDATED_NS,) * 2)
            flush(temporary)
            return self._keep(temporary, digest.hexdigest()[:16], plain)

    def _keep(self, temporary: Path, log: str, name: str) -> str:
        if self.log_path(log) is None:
            folder = self._own("logs", log)
            final = temporary.replace(folder / name)
            flush(folder)
            status = final.stat()
            path = final.relative_to(self.folder).as_posix()
            self.index.put(path, log, status.st_size, status.st_mtime_ns)
        return log

    def study_path(self, log: str) -> Path:
        """Where the study of a log is, or would be.

        Raises
        ------
        OptionError
            That is a link: what it leads to is not ours to show or to change.
        """
        path = self._own("studies") / f"{_checked(log)}.toml"
        if is_link(path):
            raise OptionError(
                "a study file is a link",
                found=f"studies/{path.name}",
                needed="a file",
                action="copy what it leads to in its place",
            )
        return path

    def result_path(self, log: str, name: str) -> Path:
        """Where a result of this version is, or would be; its folder is made, links are removed."""
        folder = self._own(HIDDEN, "results") / _checked(log)
        if is_link(folder) or (folder.exists() and not folder.is_dir()):
            folder.unlink()
        path = self._own(HIDDEN, "results", log) / f"{name}-{VERSION}"
        if is_link(path):
            path.unlink()
        return path

    def result(self, log: str, name: str) -> dict[str, Any] | None:
        """A result that was written; None where there is none, and where it is broken."""
        path = self.result_path(log, f"{name}.json")
        if not path.exists():
            return None
        try:
            found = json.loads(read_plain(path))
        except (OSError, ValueError, RecursionError):
            found = None
        if not isinstance(found, dict):
            self.drop_result(log, name)
            return None
        return found

    def drop_result(self, log: str, name: str) -> None:
        """Remove a result that cannot be what was written; it is made again when asked for."""
        path = self.result_path(log, f"{name}.json")
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)

    def keep_result(self, log: str, name: str, values: Mapping[str, Any]) -> None:
        """Write a result whole."""
        text = json.dumps(values, allow_nan=False, ensure_ascii=False)
        write_atomically(self.result_path(log, f"{name}.json"), text)

    def forget(self, log: str) -> None:
        """Remove what was computed of a log; the log and its study stay."""
        shutil.rmtree(self._hidden("results") / _checked(log), ignore_errors=True)

    def _own(self, *parts: str) -> Path:
        return own_folder(self.folder, *parts)

    def _hidden(self, name: str) -> Path:
        return self.folder / HIDDEN / name

    def _inside(self, path: Path) -> bool:
        """Whether a file lies in the workspace, links followed."""
        return path.resolve().is_relative_to(self.folder)


def plain_name(name: str) -> str:
    """The last part of a file's name, without what a shell or a file system might misread.

    Raises
    ------
    OptionError
        Nothing is left.

    Example
    -------
    >>> plain_name("../../etc/flight 7.BIN")
    'flight 7.BIN'
    """
    last = re.split(r"[/\\]", name)[-1]
    plain = re.sub(r"[^\w .()+-]", "_", last).strip(" .")
    kept = plain.encode()[-NAME_BYTES:].decode("utf-8", "ignore").strip(" .")
    if not kept:
        raise OptionError("a log needs a name", found=repr(name), needed="such as flight.BIN")
    return kept


def _checked(log: str) -> str:
    if not ID.fullmatch(log):
        raise OptionError("this is no log of the workspace", found=log, needed="16 hex digits")
    return log


def _reason(error: Exception) -> str:
    if isinstance(error, UnicodeError):
        return "its name is not UTF-8"
    if isinstance(error, OSError):
        return error.strerror or str(error)
    return str(error)


def _files(folder: Path, deep: int, left: dict[Path, str], *, everything: bool) -> Iterator[Path]:
    """Files that may be logs, hidden folders left out; all of those that the page has taken."""
    root = deep == DEEPEST
    try:
        listed = sorted(folder.iterdir())
    except OSError as error:
        left[folder] = _reason(error)
        return
    for path in listed:
        if path.name.startswith("."):
            continue
        try:
            goes_on = path.is_dir() and not path.is_symlink()
            is_file = path.is_file()
        except OSError as error:
            left[path] = _reason(error)
            continue
        if goes_on and deep:
            taken = everything or (root and path.name == "logs")
            yield from _files(path, deep - 1, left, everything=taken)
        elif is_file and (everything or path.suffix.lower() in SUFFIXES):
            yield path
