"""Folders and files that the page makes for itself: never reached through a link that was planted.

A workspace may come out of a stranger's archive. Its own folders are opened one below the other
without following links; what is made in them has a name that nobody can guess and is made anew.
On Windows, which has no such opening, links are looked for before.
"""

from __future__ import annotations

import os
import re
import secrets
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from flightid.errors import FlightidError, OptionError
from flightid.files import STALE_S, process_lives

NO_LINK: int = getattr(os, "O_NOFOLLOW", 0)
BINARY: int = getattr(os, "O_BINARY", 0)
NO_WAIT: int = getattr(os, "O_NONBLOCK", 0)
REPARSED = 0x400
"""File attribute of links and junctions on Windows."""
BY_HANDLE = os.open in os.supports_dir_fd and bool(NO_LINK)
NEW = os.O_CREAT | os.O_EXCL | NO_LINK | BINARY
MADE = re.compile(r"(?:\.draft-)?(\d{1,10})-[0-9a-f]{16}\..*", re.DOTALL)
MOST_BYTES = 64 << 20
"""Of a cached file of words."""


def own_folder(root: Path, *parts: str) -> Path:
    """A folder of the workspace, made where it is missing, not reached through any link.

    Parameters
    ----------
    root : Path
        The workspace; it may itself be reached through links.
    *parts : str
        Plain names, each a folder in the one before.

    Raises
    ------
    OptionError
        One of them is a link, or no folder.
    """
    path = root
    handle = os.open(root, os.O_RDONLY) if BY_HANDLE else -1
    try:
        for part in parts:
            path = path / part
            handle = _entered(path, handle)
    finally:
        if handle >= 0:
            os.close(handle)
    return path


def _entered(path: Path, above: int) -> int:
    """Make a folder where it is missing and open it; `above` is closed."""
    with suppress(FileExistsError):
        os.mkdir(path.name, dir_fd=above) if above >= 0 else path.mkdir()
    try:
        if above < 0:
            if is_link(path) or not path.is_dir():
                raise NotADirectoryError(path)
            return -1
        handle = os.open(path.name, os.O_RDONLY | os.O_DIRECTORY | NO_LINK, dir_fd=above)
        os.close(above)
    except OSError as error:
        raise OptionError(
            "a folder that the page keeps for itself is a link, or no folder",
            found=shown_name(path),
            needed="a folder of its own, or nothing there",
            action="move it away; flightid app makes its own",
        ) from error
    return handle


def is_link(path: Path) -> bool:
    """Whether a path is a link or, on Windows, a junction; False where there is nothing."""
    try:
        status = path.lstat()
    except OSError:
        return False
    reparsed = getattr(status, "st_file_attributes", 0) & REPARSED
    return stat.S_ISLNK(status.st_mode) or bool(reparsed)


def read_plain(path: Path, most: int = MOST_BYTES) -> bytes:
    """Bytes of a regular file that is no link.

    Raises
    ------
    OSError
        It is a link, no regular file, longer than `most` bytes, or cannot be read.
    """
    if is_link(path):
        raise OSError(f"{shown_name(path)} is a link")
    handle = os.open(path, os.O_RDONLY | NO_LINK | NO_WAIT | BINARY)
    with os.fdopen(handle, "rb") as stream:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(f"{shown_name(path)} is no plain file")
        if status.st_size > most:
            raise OSError(f"{shown_name(path)} is longer than {most} bytes")
        return stream.read(most)


def made_name(ending: str) -> str:
    """A name that nobody can guess and that tells which process made it."""
    return f"{os.getpid()}-{secrets.token_hex(8)}.{ending}"


@contextmanager
def new_file(folder: Path, name: str) -> Iterator[tuple[IO[bytes], Path]]:
    """A file that was not there before, open for writing; it is removed at the end.

    Raises
    ------
    OSError
        There is something of that name, a link too, or the folder is one.
    """
    path = folder / name
    if is_link(folder):
        raise OSError(f"{shown_name(folder)} is a link")
    with os.fdopen(os.open(path, NEW | os.O_WRONLY, 0o600), "wb") as stream:
        try:
            yield stream, path
        finally:
            stream.close()
            path.unlink(missing_ok=True)


@contextmanager
def draft_of(study: Path, text: str) -> Iterator[Path]:
    """A text as a file beside a study, for as long as it is looked at.

    What is raised meanwhile names the study: a reader has never seen the other file.

    Raises
    ------
    OSError
        The folder is a link, or cannot be written.
    """
    with new_file(study.parent, f".draft-{made_name('toml')}") as (stream, path):
        stream.write(text.encode())
        stream.close()
        try:
            yield path
        except FlightidError as error:
            call_file(error, path.name, study.name)
            raise


def call_file(error: FlightidError, path: str, name: str) -> None:
    """Call a file by another name in an error, where a copy was read in its place.

    Example
    -------
    >>> error = OptionError("no table", found="copy.toml: line 2")
    >>> call_file(error, "copy.toml", "mine.toml")
    >>> print(error, error.found, sep="; ")
    no table: found mine.toml: line 2; mine.toml: line 2
    """
    for key, told in vars(error).items():
        if isinstance(told, str):
            setattr(error, key, told.replace(path, name))
    error.args = tuple(str(each).replace(path, name) for each in error.args)


def clear_left(folder: Path) -> None:
    """Remove what killed makers left: plain files with names of ours alone, links not followed.

    A file stays while the process that made it lives, unless nothing was written to it for an hour.
    """
    for entry in os.scandir(folder):
        made = MADE.fullmatch(entry.name)
        if made is None or not entry.is_file(follow_symlinks=False):
            continue
        with suppress(OSError):
            aged = time.time() - entry.stat(follow_symlinks=False).st_mtime > STALE_S
            if aged or not process_lives(int(made[1])):
                Path(entry.path).unlink()


def shown_name(path: Path | str) -> str:
    r"""A name in letters that every answer can carry.

    Example
    -------
    >>> shown_name("a\udcff.bin").endswith(".bin")
    True
    """
    return os.fsencode(path).decode("utf-8", "replace")
