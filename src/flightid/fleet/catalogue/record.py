"""The record of one log: all its rows in one small JSON document, checked when it is read."""

from __future__ import annotations

import datetime
import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeGuard

from flightid.errors import DataError, FlightidError
from flightid.fleet.catalogue.parts import BROKEN_JSON
from flightid.fleet.catalogue.schema import (
    INSTANT,
    NUMBER,
    NUMBERS,
    SCHEMA,
    TABLES,
    TEXT,
    TEXTS,
    WHOLE,
    FleetTable,
)
from flightid.fleet.catalogue.soundness import flaw_of
from flightid.frozen import dataclass

KEY_LENGTH = 64
MOST_EXACT = 1 << 53
"""Greatest whole number that a float64 of Arrow takes."""
MOST_WHOLE = 1 << 63
STAMP = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}(T[0-9]{2}:[0-9]{2}:[0-9]{2}(\.[0-9]{6})?)?")
"""Instants as they are written: UTC without zone, to the microsecond."""
SURROGATE = re.compile("[\ud800-\udfff]")
Rows = Mapping[str, Sequence[Mapping[str, Any]]]


@dataclass(frozen=True)
class LogRecord:
    """All rows of one log.

    Attributes
    ----------
    log : str
        SHA-256 of the log's bytes; of address and stamp, where nobody could read them.
    rows : mapping of str to sequence of mapping
        By table, each row by column.

    Example
    -------
    >>> record = LogRecord("0" * 64, {"logs": [{"log": "0" * 64, "outcome": "fitted"}]})
    >>> LogRecord.from_bytes(record.to_bytes()).outcome
    'fitted'
    """

    log: str
    rows: Rows

    @property
    def outcome(self) -> str:
        """What became of the log: fitted, refused or failed."""
        return str(self.rows["logs"][0]["outcome"])

    @property
    def reason(self) -> str | None:
        """Code or class of what refused it."""
        found = self.rows["logs"][0].get("reason")
        return None if found is None else str(found)

    def stamped(self, recipe: str) -> LogRecord:
        """The record as it is kept: which recipe made it, and that it was now."""
        now = datetime.datetime.now(datetime.UTC).replace(tzinfo=None)
        own = {"recorded_at": now.isoformat(timespec="microseconds"), "recipe": recipe}
        return LogRecord(self.log, {**self.rows, "logs": [{**self.rows["logs"][0], **own}]})

    def to_bytes(self) -> bytes:
        """The document: columns by name once a table, then bare rows; the same for equal rows."""
        tables = {
            name: [table.row(row) for row in self.rows.get(name, ())]
            for name, table in TABLES.items()
        }
        columns = {name: list(TABLES[name].names) for name in tables}
        values = {"schema": SCHEMA, "log": self.log, "columns": columns, "tables": tables}
        text = json.dumps(values, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
        # A lone surrogate, of a name that was no text, becomes a question mark.
        return text.encode(errors="replace")

    @classmethod
    def from_bytes(cls, content: bytes) -> LogRecord:
        """A record from its document, every value of the type that its column has.

        Raises
        ------
        DataError
            It is cut short, of another version, holds what a column cannot, or numbers that
            nothing can be computed with.
        """
        try:
            values = json.loads(content)
            if values["schema"] != SCHEMA:
                raise DataError("a record of another version", found=values["schema"])
            if values["columns"] != {name: list(t.names) for name, t in TABLES.items()}:
                raise DataError("a record with other columns")
            rows = {name: _rows(table, values["tables"][name]) for name, table in TABLES.items()}
            log = values["log"]
            if len(rows["logs"]) != 1 or len(log) != KEY_LENGTH:
                raise DataError("a record of no log")
            if any(row["log"] != log for part in rows.values() for row in part):
                raise DataError("a record of several logs")
            if flaw := flaw_of(rows):
                raise DataError("numbers of this record are not as they were written", found=flaw)
        except FlightidError:
            raise
        except BROKEN_JSON as error:
            raise DataError(
                "these bytes are no record of a log",
                found=f"{type(error).__name__}: {error}"[:200],
                needed=f"a document of {SCHEMA}",
            ) from error
        return cls(log, rows)


def legible(content: bytes, table: str, column: str) -> str | None:
    """A text of a record's first row in a table, of one that is broken elsewhere; None: it is too.

    Parameters
    ----------
    content : bytes
    table, column : str
    """
    try:
        values = json.loads(content)
        value = values["tables"][table][0][values["columns"][table].index(column)]
    except (*BROKEN_JSON, LookupError):
        return None
    return value if isinstance(value, str) and _fits(value, TEXT) else None


def _rows(table: FleetTable, given: list[list[Any]]) -> list[dict[str, Any]]:
    kinds = [column.kind for column in table.columns]
    made = []
    for row in given:
        if len(row) != len(kinds):
            raise ValueError(f"a row of {table.name} has {len(row)} values, not {len(kinds)}")
        for value, kind in zip(row, kinds, strict=True):
            if value is not None and not _fits(value, kind):
                raise ValueError(f"{table.name}: {value!r} is no {kind}")
        made.append(dict(zip(table.names, row, strict=True)))
    return made


def _is_whole(value: object) -> TypeGuard[int]:
    return isinstance(value, int) and not isinstance(value, bool)


def _fits(value: object, kind: str) -> bool:
    if kind == TEXT:
        return isinstance(value, str) and not SURROGATE.search(value)
    if kind == NUMBER:
        is_number = isinstance(value, float) and math.isfinite(value)
        return is_number or (_is_whole(value) and abs(value) <= MOST_EXACT)
    if kind == WHOLE:
        return _is_whole(value) and -MOST_WHOLE <= value < MOST_WHOLE
    if kind == INSTANT:
        return (
            isinstance(value, str)
            and STAMP.fullmatch(value) is not None
            and bool(datetime.datetime.fromisoformat(value))
        )
    assert kind in (TEXTS, NUMBERS)
    inner = TEXT if kind == TEXTS else NUMBER
    return isinstance(value, list) and all(_fits(item, inner) for item in value)
