"""Records of a rig in the workspace: files of columns that belong together, and their study.

``records/<id>/`` holds the files of one set; its id is the hash of the first, by which its study
and its results are known as those of a log are.
"""

from __future__ import annotations

import asyncio
import hashlib
import os
import stat
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path

from flightid.app.own_folders import (
    BINARY,
    NO_LINK,
    NO_WAIT,
    is_link,
    made_name,
    new_file,
    own_folder,
)
from flightid.app.removed import RemovedList
from flightid.app.workspace import HIDDEN, ID, Workspace, plain_name
from flightid.errors import FileFormatError, OptionError
from flightid.files import flush
from flightid.frozen import dataclass
from flightid.record.formats.sniff import FileFormat, file_format

FOLDER = "records"
SUFFIXES = frozenset({".csv", ".tsv", ".txt", ".dat", ".mat", ".nc", ".parquet", ".h5"})
MOST_FILES = 64
"""In one set."""


@dataclass(frozen=True)
class Rigs:
    """The sets of record files of a workspace.

    Attributes
    ----------
    workspace : Workspace
    """

    workspace: Workspace

    def ids(self) -> list[str]:
        """All sets that hold a file, the youngest first."""
        root = own_folder(self.workspace.folder, FOLDER)
        known = [each for each in root.iterdir() if ID.fullmatch(each.name) and not is_link(each)]
        found = [each for each in known if each.is_dir() and self.files(each.name)]
        found.sort(key=lambda each: -each.stat().st_mtime_ns)
        return [each.name for each in found]

    def files(self, rig: str) -> list[Path]:
        """Files of a set by name, those taken out left out; none where there is no such set."""
        left = RemovedList(self.workspace).files(rig)
        return [each for each in self.all_files(rig) if each.name not in left]

    def all_files(self, rig: str) -> list[Path]:
        """Every file of a set, those that were taken out too."""
        folder = self.workspace.folder / FOLDER / rig
        if not ID.fullmatch(rig) or is_link(folder.parent) or is_link(folder):
            return []
        if not folder.is_dir():
            return []
        listed = (each for each in folder.iterdir() if each.suffix.lower() in SUFFIXES)
        return sorted(each for each in listed if each.is_file() and not is_link(each))

    def name_of(self, rig: str) -> str:
        """A set by the name of its first file, and how many more there are."""
        first, *more = self.files(rig) or self.all_files(rig)
        return f"{first.name} and {len(more)} more" if more else first.name

    async def take(
        self,
        name: str,
        chunks: AsyncIterator[bytes],
        rig: str = "",
        *,
        check: Callable[[Path], Awaitable[str]],
    ) -> str:
        """Write a file that comes in pieces, and return the id of its set.

        Parameters
        ----------
        name : str
            As the page calls it; of a path the last part alone is taken.
        chunks : async iterator of bytes
        rig : str
            Set to which it is added; empty: its own.
        check : callable
            Reads the file as records are read, and tells why it cannot be; empty: it can.

        Raises
        ------
        OptionError
            The name is none, there is no such set, or it is full.
        FileFormatError
            The file is of no format that holds records, or holds no table of numbers.
        """
        plain = plain_name(name)
        if rig and not 0 < len(self.files(rig)) < MOST_FILES:
            raise OptionError(
                "no file can be added to these records",
                found=f"{len(self.files(rig))} files",
                needed=f"a set of 1 to {MOST_FILES - 1} files",
            )
        digest = hashlib.sha256()
        uploads = own_folder(self.workspace.folder, HIDDEN, "uploads")
        with new_file(uploads, f"{made_name('part')}{Path(plain).suffix}") as (stream, temporary):
            async for chunk in chunks:
                digest.update(chunk)
                stream.write(chunk)
            stream.close()
            if file_format(temporary) is FileFormat.BAG or not _is_named(plain):
                raise OptionError(
                    "this file is no table that the page reads",
                    found=plain,
                    needed=f"one of {', '.join(sorted(SUFFIXES))}",
                    action="a bag of ROS is a log: drop it among the logs",
                )
            if refusal := await check(temporary):
                raise FileFormatError(refusal.replace(temporary.name, plain))
            flush(temporary)
            made = rig or digest.hexdigest()[:16]
            folder = own_folder(self.workspace.folder, FOLDER, made)
            final = await asyncio.to_thread(_free, folder, plain, digest.hexdigest())
            temporary.replace(final)
            flush(folder)
        # Dropped again: it is meant to be there.
        removed = RemovedList(self.workspace)
        if final.name in removed.files(made):
            await asyncio.to_thread(removed.leave_out, made, final.name, out=False)
        return made


def _is_named(plain: str) -> bool:
    return Path(plain).suffix.lower() in SUFFIXES


def _free(folder: Path, plain: str, digest: str) -> Path:
    """The name itself, or one with part of the hash where another file has it."""
    path = folder / plain
    if not os.path.lexists(path) or _holds(path, digest):
        return path
    return folder / f"{path.stem} {digest[:6]}{path.suffix}"


def _holds(path: Path, digest: str) -> bool:
    """Whether a plain file has that hash; a pipe or device that was planted is not waited for."""
    try:
        handle = os.open(path, os.O_RDONLY | NO_LINK | NO_WAIT | BINARY)
    except OSError:
        return False
    with os.fdopen(handle, "rb") as stream:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            return False
        return hashlib.file_digest(stream, "sha256").hexdigest() == digest
