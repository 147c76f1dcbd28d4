"""Parts: tables of many logs in Parquet, each under a manifest that is written last."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.fleet.catalogue.schema import SCHEMA, TABLES
from flightid.fleet.catalogue.store import Store
from flightid.frozen import dataclass

PARTS = "parts"
MANIFEST = "manifest.json"
KEYS = "logs.keys"
KEY_BYTES = 32
BROKEN_JSON = (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError)
"""What a document that somebody has broken may raise."""
Keys = NDArray[np.void]
"""Digests of logs, sorted, 32 bytes each."""


@dataclass(frozen=True)
class TablePart:
    """The manifest of one part.

    Attributes
    ----------
    name : str
        Folder below ``parts``.
    rows : mapping of str to int
        Number of rows by table; a table without rows has no file.
    sizes : mapping of str to int
        Size of each file, B.
    digests : mapping of str to str
        SHA-256 of each file.
    outcomes : mapping of str to int
        Logs by outcome.
    replaces : tuple of str
        Parts whose logs this one holds too: they count no more.
    """

    name: str
    rows: Mapping[str, int]
    sizes: Mapping[str, int]
    digests: Mapping[str, str]
    outcomes: Mapping[str, int] = field(default_factory=dict)
    replaces: tuple[str, ...] = ()

    @property
    def n_logs(self) -> int:
        """Number of logs."""
        return self.rows.get("logs", 0)

    def file(self, table: str) -> str:
        """Name of a table's file in the store."""
        return f"{PARTS}/{self.name}/{table}.parquet"

    def to_bytes(self) -> bytes:
        """The manifest."""
        values = {
            "schema": SCHEMA,
            "name": self.name,
            "rows": dict(self.rows),
            "sizes": dict(self.sizes),
            "digests": dict(self.digests),
            "outcomes": dict(self.outcomes),
            "replaces": list(self.replaces),
        }
        return json.dumps(values, indent=1).encode()

    @classmethod
    def from_bytes(cls, content: bytes) -> TablePart:
        """A part from its manifest.

        Raises
        ------
        DataError
            These bytes are none, or of another version.
        """
        try:
            values = json.loads(content)
            if values["schema"] != SCHEMA:
                raise DataError("a part of another version", found=values["schema"])
            rows = {str(k): int(v) for k, v in values["rows"].items() if k in TABLES}
            sizes = {str(k): int(v) for k, v in values["sizes"].items()}
            digests = {str(k): str(v) for k, v in values["digests"].items()}
            outcomes = {str(k): int(v) for k, v in values["outcomes"].items()}
            replaces = tuple(map(str, values["replaces"]))
            return cls(str(values["name"]), rows, sizes, digests, outcomes, replaces)
        except BROKEN_JSON as error:
            if isinstance(error, DataError):
                raise
            raise DataError("these bytes are no manifest", found=str(error)[:200]) from error


def read_parts(store: Store) -> tuple[list[TablePart], list[str]]:
    """Parts that count, in the order of their names, and folders that cannot be used.

    A folder without a manifest is being written, or its writer died: it counts nowhere. One whose
    files are missing or of other bytes than it states cannot be used.
    """
    found: dict[str, TablePart] = {}
    broken = []
    for name in sorted(store.folders(PARTS)):
        try:
            part = TablePart.from_bytes(store.read(f"{PARTS}/{name}/{MANIFEST}"))
            _require_whole(store, part, name)
        except FileNotFoundError:
            continue
        except DataError:
            broken.append(name)
            continue
        found[name] = part
    gone = {name for own, part in found.items() for name in part.replaces if name != own}
    return [part for name, part in found.items() if name not in gone], broken


def _require_whole(store: Store, part: TablePart, name: str) -> None:
    if part.name != name:
        raise DataError("a manifest of another part", found=part.name, needed=name)
    tables = (f"{table}.parquet" for table, rows in part.rows.items() if rows)
    needed = {KEYS, *tables}
    if needed != set(part.sizes) or needed != set(part.digests):
        raise DataError("a manifest of other files", found=sorted(part.sizes), needed=needed)
    if part.sizes[KEYS] != KEY_BYTES * part.n_logs:
        raise DataError("keys of other logs", found=part.sizes[KEYS])
    for file, size in part.sizes.items():
        place = f"{PARTS}/{name}/{file}"
        if store.n_bytes(place) != size or store.digest(place) not in (None, part.digests[file]):
            raise DataError("a file of a part is not whole", found=file)


def read_keys(store: Store, part: TablePart) -> Keys:
    """Digests of a part's logs, sorted."""
    content = store.read(f"{PARTS}/{part.name}/{KEYS}")
    return np.frombuffer(content, dtype=f"V{KEY_BYTES}")


def key_bytes(logs: Sequence[str]) -> bytes:
    """Digests as `logs.keys` holds them."""
    return b"".join(sorted(map(bytes.fromhex, logs)))


class KnownLogs:
    """Which logs a catalogue holds: digests of its parts, and loose files.

    Parameters
    ----------
    store : Store
    parts : sequence of TablePart
    """

    def __init__(self, store: Store, parts: Sequence[TablePart]) -> None:
        self._store = store
        keys = [read_keys(store, part) for part in parts]
        joined = np.concatenate(keys) if keys else np.empty(0, dtype=f"V{KEY_BYTES}")
        self._sorted = np.sort(joined.view(f"S{KEY_BYTES}")) if joined.size else None

    def in_parts(self, log: str) -> bool:
        """Whether a part holds the log."""
        if self._sorted is None:
            return False
        key = np.frombuffer(bytes.fromhex(log), dtype=f"S{KEY_BYTES}")
        at = int(np.searchsorted(self._sorted, key)[0])
        return at < self._sorted.size and bool(self._sorted[at] == key[0])

    def __call__(self, log: str) -> bool:
        """Whether the catalogue holds the log."""
        return self.in_parts(log) or self._store.exists(f"loose/{log}.json")


class LiveLogs:
    """The same while others compact: parts are read again where there are other ones.

    Parameters
    ----------
    store : Store
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._read()

    def _read(self) -> None:
        self._names = sorted(self._store.folders(PARTS))
        self._known = KnownLogs(self._store, read_parts(self._store)[0])
        # One that is being written has no manifest yet, and is looked at again.
        manifests = {each: f"{PARTS}/{each}/{MANIFEST}" for each in self._names}
        self._names = [each for each, name in manifests.items() if self._store.exists(name)]

    def __call__(self, log: str) -> bool:
        """Whether the catalogue holds the log."""
        if self._known(log):
            return True
        if sorted(self._store.folders(PARTS)) == self._names:
            return False
        self._read()
        return self._known(log)


def new_name(logs: Sequence[str]) -> str:
    """Name of a new part: what it holds, and a number that nobody else has."""
    content = hashlib.sha256(key_bytes(logs)).hexdigest()[:12]
    return f"{content}-{secrets.token_hex(4)}"


def outcomes_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, int]:
    """Numbers of logs by outcome."""
    return dict(Counter(str(row["outcome"]) for row in rows))
