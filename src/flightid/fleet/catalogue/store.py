"""Where a catalogue lies: a folder, or a bucket behind fsspec; names appear whole or not at all."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import unquote, urlsplit

from flightid.errors import DataError
from flightid.extras import extra_module
from flightid.files import sha256_of_file, write_atomically
from flightid.fleet.addresses import LOCAL

MOST_BYTES = 1 << 30
"""Of one file that is read whole: parts hold a million rows at most."""


class Store(Protocol):
    """Bytes by name below one place."""

    root: str

    def names(self, prefix: str) -> Iterator[str]:
        """Names of the files directly below a prefix; temporary ones are left out."""
        ...

    def folders(self, prefix: str) -> Iterator[str]:
        """Names of the folders directly below a prefix."""
        ...

    def read(self, name: str) -> bytes:
        """All bytes of a file; FileNotFoundError where there is none."""
        ...

    def write(self, name: str, content: bytes) -> None:
        """Write a file whole or not at all."""
        ...

    def create(self, name: str, content: bytes) -> bool | None:
        """Write a small file where there is none, one of several alone; False where there is one.

        None where the store cannot tell: it has no such writing.
        """
        ...

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""
        ...

    def n_bytes(self, name: str) -> int | None:
        """Size of a file; None where there is none."""
        ...

    def digest(self, name: str) -> str | None:
        """SHA-256 of a file; None where the store itself keeps its bytes whole."""
        ...

    def remove(self, name: str) -> None:
        """Remove a file or a folder, there or not."""
        ...

    def path(self, name: str) -> str:
        """A file's path or address."""
        ...


class FolderStore:
    """A folder of this machine, or of a file system that several share.

    Example
    -------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = FolderStore(folder)
    ...     store.write("loose/a.json", b"{}")
    ...     list(store.names("loose")), store.read("loose/a.json")
    (['a.json'], b'{}')
    """

    def __init__(self, root: str | Path) -> None:
        self.root = str(Path(root).absolute())

    def names(self, prefix: str) -> Iterator[str]:
        """Names of the files directly below a prefix; temporary ones are left out."""
        yield from (entry.name for entry in self._entries(prefix) if entry.is_file())

    def folders(self, prefix: str) -> Iterator[str]:
        """Names of the folders directly below a prefix."""
        yield from (entry.name for entry in self._entries(prefix) if entry.is_dir())

    def _entries(self, prefix: str) -> Iterator[os.DirEntry[str]]:
        try:
            with os.scandir(Path(self.root, prefix)) as entries:
                # Names that begin with a point are being written.
                yield from (entry for entry in entries if not entry.name.startswith("."))
        except FileNotFoundError:
            return

    def read(self, name: str) -> bytes:
        """All bytes of a file; FileNotFoundError where there is none."""
        path = Path(self.root, name)
        if path.stat().st_size > MOST_BYTES:
            raise OSError(errno.EFBIG, f"longer than {MOST_BYTES} B", str(path))
        return path.read_bytes()

    def write(self, name: str, content: bytes) -> None:
        """Write a file whole or not at all: temporary name, fsync, rename."""
        path = self._own(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, content)

    def create(self, name: str, content: bytes) -> bool | None:
        """Write a small file where there is none, one of several alone; False: there is one."""
        path = self._own(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with path.open("xb") as file:
                file.write(content)
        except FileExistsError:
            return False
        return True

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""
        return Path(self.root, name).is_file()

    def n_bytes(self, name: str) -> int | None:
        """Size of a file; None where there is none."""
        try:
            return Path(self.root, name).stat().st_size
        except FileNotFoundError:
            return None

    def digest(self, name: str) -> str | None:
        """SHA-256 of a file, taken once as long as size and time of change stay."""
        path = Path(self.root, name)
        seen = path.stat()
        return _digest(str(path), seen.st_size, seen.st_mtime_ns, seen.st_ino)

    def remove(self, name: str) -> None:
        """Remove a file or a folder, there or not."""
        path = self._own(name)
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)

    def path(self, name: str) -> str:
        """A file's path."""
        return str(Path(self.root, name))

    def _own(self, name: str) -> Path:
        """Where a file is written or removed: through no link that was laid below the root."""
        path = Path(self.root, name)
        if path.parent.resolve() != (Path(self.root).resolve() / name).parent:
            raise DataError(
                "a link in a catalogue leads elsewhere: nothing is written through it",
                found=str(path.parent),
                action="remove the link",
            )
        return path


class ObjectStore:
    """A bucket behind fsspec: one PUT of whole bytes, for such stores have no rename."""

    def __init__(self, root: str) -> None:
        fsspec = extra_module("fsspec", "a catalogue at an address")
        self.root = root.rstrip("/")
        self.fs: Any
        self.fs, self._base = fsspec.core.url_to_fs(self.root)

    def names(self, prefix: str) -> Iterator[str]:
        """Names of the files directly below a prefix."""
        yield from self._below(prefix, "file")

    def folders(self, prefix: str) -> Iterator[str]:
        """Names of the folders directly below a prefix."""
        yield from self._below(prefix, "directory")

    def _below(self, prefix: str, kind: str) -> Iterator[str]:
        place = f"{self._base}/{prefix}".rstrip("/")
        try:
            found = self.fs.ls(place, detail=True, refresh=True)
        except FileNotFoundError:
            return
        for info in found:
            name = str(info["name"]).rstrip("/")
            if info["type"] == kind and name != place:
                yield name.rpartition("/")[2]

    def read(self, name: str) -> bytes:
        """All bytes of a file; FileNotFoundError where there is none."""
        return bytes(self.fs.cat_file(f"{self._base}/{name}"))

    def write(self, name: str, content: bytes) -> None:
        """Write a file by one PUT."""
        self.fs.pipe_file(f"{self._base}/{name}", content)

    def create(self, name: str, content: bytes) -> bool | None:
        """Write a small file where there is none, by a conditional PUT; None where there is none.

        Of stores and of versions of their libraries some refuse a condition; others pass it over,
        which `flightid.fleet.engine.claims.can_claim` finds out.
        """
        try:
            self.fs.pipe_file(f"{self._base}/{name}", content, mode="create")
        except FileExistsError:
            return False
        except (TypeError, ValueError, RuntimeError, OSError):  # the third: not implemented
            return None
        return True

    def exists(self, name: str) -> bool:
        """Whether there is such a file."""
        return self.n_bytes(name) is not None

    def n_bytes(self, name: str) -> int | None:
        """Size of a file; None where there is none."""
        self.fs.invalidate_cache()
        try:
            return int(self.fs.info(f"{self._base}/{name}")["size"])
        except FileNotFoundError:
            return None

    def digest(self, name: str) -> str | None:
        """None: such stores check what they hold, and reading all of it costs."""
        del name
        return None

    def remove(self, name: str) -> None:
        """Remove a file or a folder, there or not."""
        self.fs.invalidate_cache()
        try:
            self.fs.rm(f"{self._base}/{name}", recursive=True)
        except FileNotFoundError:
            return

    def path(self, name: str) -> str:
        """A file's address."""
        return f"{self.root}/{name}"


@lru_cache(maxsize=100_000)
def _digest(path: str, size: int, changed_ns: int, number: int) -> str:
    del size, changed_ns, number  # Where one of them is another, so is the file.
    return sha256_of_file(path)


def store_at(place: str) -> Store:
    """The store of a catalogue's place: a folder, or an address with a protocol."""
    if place.startswith(LOCAL):
        return FolderStore(unquote(urlsplit(place).path))
    return ObjectStore(place) if "://" in place else FolderStore(place)
