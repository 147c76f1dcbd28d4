"""A table of the logs in a workspace: what is in the files themselves, for a quick look.

It can be deleted at any time: `Workspace.scan` writes it again.
"""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from flightid.frozen import dataclass

SCHEMA = """
create table if not exists log (
    path text primary key, id text, size integer not null, mtime_ns integer not null
)
"""
WAIT_MS = 10_000


@dataclass(frozen=True)
class IndexedLog:
    """A log of the workspace.

    Attributes
    ----------
    path : str
        Below the workspace.
    id : str
        First 16 digits of the SHA-256 of its bytes.
    size : int
        Bytes.
    mtime_ns : int
        When the file was changed last, ns since 1970.
    """

    path: str
    id: str
    size: int
    mtime_ns: int


class LogIndex:
    """The table, in one file that one process writes.

    Parameters
    ----------
    path : Path
        File; one that is no database is begun anew.
    """

    def __init__(self, path: Path) -> None:
        self._lock = threading.Lock()
        try:
            self._table = _opened(path)
        except sqlite3.DatabaseError:
            for each in path.parent.glob(f"{path.name}*"):
                each.unlink()
            self._table = _opened(path)

    def is_current(self, path: str, size: int, mtime_ns: int) -> bool:
        """Whether a file is as it was when it was written down."""
        query = "select 1 from log where path = ? and size = ? and mtime_ns = ?"
        return bool(self._rows(query, path, size, mtime_ns))

    def put(self, path: str, log: str | None, size: int, mtime_ns: int) -> None:
        """Write a file down; `log` is None where it is no log."""
        self._rows("insert or replace into log values (?, ?, ?, ?)", path, log, size, mtime_ns)

    def keep(self, paths: Iterable[str]) -> None:
        """Forget files that are not among these."""
        known = {path for (path,) in self._rows("select path from log")}
        for path in sorted(known - set(paths)):
            self._rows("delete from log where path = ?", path)

    def paths(self, log: str) -> list[str]:
        """Where a log lies."""
        return [path for (path,) in self._rows("select path from log where id = ?", log)]

    def entries(self) -> list[IndexedLog]:
        """All logs, each once, the youngest first."""
        query = (
            "select min(path), id, size, max(mtime_ns) from log where id is not null "
            "group by id order by 4 desc"
        )
        return [IndexedLog(*row) for row in self._rows(query)]

    def close(self) -> None:
        """Let the file go."""
        self._table.close()

    def _rows(self, query: str, *values: object) -> list[tuple[Any, ...]]:
        with self._lock, self._table:
            return self._table.execute(query, values).fetchall()


def _opened(path: Path) -> sqlite3.Connection:
    table = sqlite3.connect(path, timeout=WAIT_MS / 1000.0, check_same_thread=False)
    table.execute("pragma journal_mode = wal")
    table.execute(f"pragma busy_timeout = {WAIT_MS}")
    table.execute(SCHEMA)
    table.commit()
    return table
