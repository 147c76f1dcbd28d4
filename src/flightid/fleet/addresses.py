"""Where logs lie: folders, globs and addresses of object stores, found without reading them."""

from __future__ import annotations

import datetime
import glob
import hashlib
import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO
from urllib.parse import unquote, urlsplit

from flightid.conventions import Light
from flightid.errors import StudyError
from flightid.extras import extra_module
from flightid.findings import Finding
from flightid.frozen import dataclass

SUFFIXES = (".bin", ".ulg", ".bbl", ".bfl", ".tlog", ".log")
"""What a folder is searched for; a glob or a file's own name takes any."""
WILD = "*?["
LOCAL = "file://"
GONE = "gone"
"""Stamp of a file that cannot be reached: a dangling link, or one removed meanwhile."""
NO_LOGS = Finding(
    "no-logs",
    Light.RED,
    "there is no log at the places of the fleet file",
    "name folders, globs or addresses in [fleet] logs",
)


@dataclass(frozen=True)
class LogAddress:
    """One log before it is read.

    Attributes
    ----------
    address : str
        Path, or address with its protocol.
    n_bytes : int
    stamp : str
        Changes where the log does: time of change, or ETag.
    changed_s : float or None
        Time of the last change, s since 1970.
    problem : str
        Why it cannot be read as it lies there; empty where nothing is known against it.
    """

    address: str
    n_bytes: int
    stamp: str
    changed_s: float | None = None
    problem: str = ""

    @property
    def name(self) -> str:
        """File name."""
        return PurePosixPath(self.address).name

    @property
    def local(self) -> Path | None:
        """Path, where it lies on this machine."""
        return None if "://" in self.address else Path(self.address)

    @property
    def digest(self) -> str:
        """Name of its record where its bytes cannot be read."""
        return hashlib.sha256(f"{self.address}\n{self.stamp}".encode()).hexdigest()


def find_logs(places: Sequence[str]) -> list[LogAddress]:
    """Logs at the places that a fleet file names, each once, by address.

    Parameters
    ----------
    places : sequence of str
        Files, folders (searched to the bottom), globs, or addresses with a protocol.

    Raises
    ------
    StudyError
        A place does not exist.
    OptionError
        An address needs a library that is not installed.
    """
    found: dict[str, LogAddress] = {}
    for place in places:
        is_remote = "://" in place and not place.startswith(LOCAL)
        for each in _remote(place) if is_remote else _local(_path_of(place)):
            found.setdefault(each.address, each)
    return [found[address] for address in sorted(found)]


def open_address(address: str) -> BinaryIO:
    """A log of an object store as a stream of its bytes."""
    fsspec = extra_module("fsspec", "the address of a log")
    opened: BinaryIO = fsspec.open(address, "rb").open()
    return opened


def _path_of(place: str) -> str:
    return unquote(urlsplit(place).path) if place.startswith(LOCAL) else place


def _local(place: str) -> Iterator[LogAddress]:
    path = Path(place)
    if path.is_file():
        yield _of_file(path)
    elif path.is_dir():
        for folder, _, names in os.walk(path):
            for name in names:
                if name.lower().endswith(SUFFIXES):
                    yield _of_file(Path(folder) / name)
    elif any(letter in place for letter in WILD):
        for name in glob.iglob(place, recursive=True):
            if not Path(name).is_dir():
                yield _of_file(Path(name))
    else:
        raise _missing(place)


def _of_file(path: Path) -> LogAddress:
    """A file of this machine; what cannot be read is a log with a problem, and costs no other."""
    place = os.fsencode(path.absolute())
    address = place.decode(errors="backslashreplace")
    try:
        seen = path.stat()
    except OSError as error:
        return LogAddress(address, 0, GONE, None, f"it cannot be reached: {error.strerror}")
    problem = "" if stat.S_ISREG(seen.st_mode) else "it is no regular file"
    if address.encode() != place:
        problem = "its path is not UTF-8: rename it"
    return LogAddress(address, seen.st_size, str(seen.st_mtime_ns), seen.st_mtime, problem)


def _remote(place: str) -> Iterator[LogAddress]:
    fsspec = extra_module("fsspec", "the address of logs")
    try:
        fs, path = fsspec.core.url_to_fs(place)
    except (ValueError, ImportError) as error:
        raise StudyError(
            "no way to this address is known", found=f"{place}: {error}", needed="as s3://bucket/"
        ) from error
    if any(letter in path for letter in WILD):
        infos: list[dict[str, Any]] = list(fs.glob(path, detail=True).values())
    elif fs.isfile(path):
        infos = [fs.info(path)]
    else:
        every = fs.find(path, detail=True).values()
        infos = [info for info in every if str(info["name"]).lower().endswith(SUFFIXES)]
        if not infos and not fs.exists(path):
            raise _missing(place)
    for info in infos:
        if info.get("type") == "file":
            yield _of_info(fs.unstrip_protocol(info["name"]), info)


def _of_info(address: str, info: dict[str, Any]) -> LogAddress:
    changed = info.get("LastModified") or info.get("mtime") or info.get("created")
    changed_s = changed.timestamp() if isinstance(changed, datetime.datetime) else changed
    stamp = str(info.get("ETag") or changed_s or "")
    at = float(changed_s) if isinstance(changed_s, int | float) else None
    return LogAddress(address, int(info.get("size") or 0), stamp, at)


def _missing(place: str) -> StudyError:
    return StudyError(
        "fleet file, [fleet] logs: a place does not exist",
        found=place,
        needed="a file, a folder, a glob or an address",
    )
