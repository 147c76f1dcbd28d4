"""The workspace: a folder with logs, study files and results, of which nothing half is ever seen.

``logs/<id>/<name>`` what was dropped, by the hash of its bytes; ``studies/<id>.toml``;
``.flightid/results/<id>/`` what was computed. Logs that lie elsewhere in the folder stay there.
Files are written whole, flushed and renamed; what a killed server leaves behind is a temporary
file that the next start removes.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import AsyncIterator, Iterator, Mapping
from pathlib import Path
from typing import Any

from flightid.app.index import LogIndex
from flightid.errors import OptionError
from flightid.files import flush, sha256_of_file, write_atomically
from flightid.logs import is_log
from flightid.version import VERSION

HIDDEN = ".flightid"
ID = re.compile(r"[0-9a-f]{16}")
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
        There is no such folder.
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
        for part in ("logs", "studies", f"{HIDDEN}/results", f"{HIDDEN}/uploads"):
            self.folder.joinpath(part).mkdir(parents=True, exist_ok=True)
        for left in self._hidden("uploads").iterdir():
            left.unlink()
        self.index = LogIndex(self._hidden("index.sqlite"))

    def scan(self) -> None:
        """Look for logs in the folder; what has kept its size and time is not read again."""
        seen = []
        for path in _files(self.folder, DEEPEST):
            if not self._inside(path):
                continue
            status = path.stat()
            name = path.relative_to(self.folder).as_posix()
            seen.append(name)
            if self.index.is_current(name, status.st_size, status.st_mtime_ns):
                continue
            known = sha256_of_file(path)[:16] if is_log(path) else None
            self.index.put(name, known, status.st_size, status.st_mtime_ns)
        self.index.keep(seen)

    def log_path(self, log: str) -> Path | None:
        """Path of a log by its hash; None where the workspace holds no such log."""
        if not ID.fullmatch(log):
            return None
        for name in self.index.paths(log):
            path = self.folder / name
            if path.is_file() and self._inside(path):
                return path
        return None

    async def take(self, name: str, chunks: AsyncIterator[bytes]) -> str:
        """Write a log that comes in pieces, and return its hash.

        Parameters
        ----------
        name : str
            As the page calls it; of a path the last part alone is taken.
        chunks : async iterator of bytes

        Raises
        ------
        OptionError
            The name is none, or the file is no log that flightid reads.
        """
        plain = plain_name(name)
        digest = hashlib.sha256()
        folder = self._hidden("uploads")
        temporary = folder / f"{hashlib.sha256(plain.encode()).hexdigest()[:8]}-{id(chunks)}.part"
        try:
            with temporary.open("wb") as stream:
                async for chunk in chunks:
                    digest.update(chunk)
                    stream.write(chunk)
            named = temporary.with_name(f"{temporary.stem}{Path(plain).suffix}")
            temporary = temporary.replace(named)
            if not is_log(temporary):
                raise OptionError(
                    "this file is no log that flightid reads",
                    found=plain,
                    needed="a log of ArduPilot, PX4, Betaflight or INAV",
                )
            flush(temporary)
            found = digest.hexdigest()[:16]
            return self._keep(temporary, found, plain)
        finally:
            temporary.unlink(missing_ok=True)

    def _keep(self, temporary: Path, log: str, name: str) -> str:
        if self.log_path(log) is None:
            folder = self.folder / "logs" / log
            folder.mkdir(exist_ok=True)
            final = temporary.replace(folder / name)
            flush(folder)
            status = final.stat()
            path = final.relative_to(self.folder).as_posix()
            self.index.put(path, log, status.st_size, status.st_mtime_ns)
        return log

    def study_path(self, log: str) -> Path:
        """Where the study of a log is, or would be."""
        return self.folder / "studies" / f"{_checked(log)}.toml"

    def result_path(self, log: str, name: str) -> Path:
        """Where a result of this version is, or would be; its folder is made."""
        folder = self._hidden("results") / _checked(log)
        folder.mkdir(exist_ok=True)
        return folder / f"{name}-{VERSION}"

    def result(self, log: str, name: str) -> dict[str, Any] | None:
        """A result that was written; None where there is none."""
        path = self.result_path(log, f"{name}.json")
        if not path.is_file():
            return None
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return found

    def keep_result(self, log: str, name: str, values: Mapping[str, Any]) -> None:
        """Write a result whole."""
        text = json.dumps(values, allow_nan=False, ensure_ascii=False)
        write_atomically(self.result_path(log, f"{name}.json"), text)

    def forget(self, log: str) -> None:
        """Remove what was computed of a log; the log and its study stay."""
        shutil.rmtree(self._hidden("results") / _checked(log), ignore_errors=True)

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
    kept = re.sub(r"[^\w .()+-]", "_", last).strip(" .")[-120:]
    if not kept:
        raise OptionError("a log needs a name", found=repr(name), needed="such as flight.BIN")
    return kept


def _checked(log: str) -> str:
    if not ID.fullmatch(log):
        raise OptionError("this is no log of the workspace", found=log, needed="16 hex digits")
    return log


def _files(folder: Path, deep: int) -> Iterator[Path]:
    """Files that may be logs, hidden folders left out."""
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir() and deep and not path.is_symlink():
            yield from _files(path, deep - 1)
        elif path.suffix.lower() in SUFFIXES and path.is_file():
            yield path
