"""What a hand has taken off the list of logs and records: files stay where they are.

``.flightid/removed.json`` names them by their ids, and files of a set of records by their names.
Without it everything is listed again.
"""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from flightid.app.own_folders import NO_LINK, own_folder, read_plain
from flightid.app.workspace import HIDDEN, ID, Workspace
from flightid.files import write_atomically

FILE, LOCK = "removed.json", "removed.lock"
MOST_BYTES = 1 << 20


class RemovedList:
    """Ids of logs and records that are not listed, in the order in which they were taken off.

    Parameters
    ----------
    workspace : Workspace
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._lock = threading.Lock()

    def ids(self) -> list[str]:
        """All that were taken off; none where the file is not there or not as it was written."""
        return [each for each in _words(self._read().get("removed")) if ID.fullmatch(each)]

    def files(self, rig: str) -> list[str]:
        """Names of files that were taken out of a set of records."""
        known = self._read().get("files")
        return _words(known.get(rig)) if isinstance(known, dict) else []

    def take_off(self, item: str) -> None:
        """Leave a log or records out of the list."""
        with self._alone():
            self._write(removed=[*(each for each in self.ids() if each != item), item])

    def put_back(self, item: str) -> None:
        """List it again; nothing happens where it is listed."""
        with self._alone():
            known = self.ids()
            if item in known:
                self._write(removed=[each for each in known if each != item])

    def leave_out(self, rig: str, name: str, *, out: bool) -> None:
        """Take a file out of a set of records, or put it back."""
        with self._alone():
            left = [each for each in self.files(rig) if each != name] + ([name] if out else [])
            known = self._read().get("files")
            files = {**(known if isinstance(known, dict) else {}), rig: left}
            self._write(files={key: each for key, each in files.items() if each})

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Nobody else changes the file meanwhile, another server on the folder included.

        Where the system has no such locks the threads of this server alone are kept apart.
        """
        with self._lock, ExitStack() as stack:
            try:
                locks = import_module("fcntl")
            except ModuleNotFoundError:
                yield
                return
            handle = os.open(self._path().with_name(LOCK), os.O_RDWR | os.O_CREAT | NO_LINK, 0o600)
            stack.callback(os.close, handle)  # The lock goes with it, however this ends.
            locks.flock(handle, locks.LOCK_EX)
            yield

    def _read(self) -> dict[str, Any]:
        try:
            told = json.loads(read_plain(self._path(), MOST_BYTES))
        except (OSError, ValueError, RecursionError):
            return {}
        return told if isinstance(told, dict) else {}

    def _write(self, **changed: object) -> None:
        whole = {"removed": self.ids(), "files": self._read().get("files", {})}
        write_atomically(self._path(), json.dumps(whole | changed))

    def _path(self) -> Path:
        return own_folder(self._workspace.folder, HIDDEN) / FILE


def _words(known: object) -> list[str]:
    return [each for each in known if isinstance(each, str)] if isinstance(known, list) else []
