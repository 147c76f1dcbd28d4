"""Logs without a model by reason: how many, in words, what to do, and one of them as example."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from typing import Any

from flightid.fleet.catalogue.schema import FITTED, OUTCOMES
from flightid.frozen import dataclass
from flightid.table import Cell, Column, Table
from flightid.wrapping import wrapped

WIDTH = 100
STOPPED = "The study stopped at this: "
"""After what an inspection found, before where the study ended."""
NUMBERS = re.compile(r"[0-9.]+")
IN_WORDS = {
    "record": "damaged record",
    "time": "out of time",
    "memory": "out of memory",
    "killed": "its process was killed",
    "fault": "a fault of flightid",
    "pattern": "pattern without an end",
}
"""Codes that say too little by themselves."""


@dataclass(frozen=True)
class RefusalReason:
    """Logs that one reason kept from a model.

    Attributes
    ----------
    outcome : str
        refused or failed.
    reason : str
        Code of it, as in the table of logs.
    logs : int
    message, action : str
        Of the first of them: what was found, and what to do.
    example : str
        Its address.

    Example
    -------
    >>> RefusalReason("refused", "not-a-log", 3, "it is a text").words
    'not a log'
    """

    outcome: str
    reason: str
    logs: int = 1
    message: str = ""
    action: str = ""
    example: str = ""

    @property
    def words(self) -> str:
        """The code as people read it."""
        plain = self.reason.replace("-", " ") or "no reason is known"
        return IN_WORDS.get(self.reason, plain)

    @property
    def name(self) -> str:
        """Last part of the address of the example."""
        return self.example.rpartition("/")[2]

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def grouped_reasons(rows: Iterable[Mapping[str, Any]]) -> tuple[RefusalReason, ...]:
    """Reasons of the logs without a model, by what to do, the commonest first.

    Parameters
    ----------
    rows : iterable of mapping
        ``outcome``, ``reason``, ``message``, ``action`` and ``address`` of each log.
    """
    found: dict[tuple[str, str, str], RefusalReason] = {}
    for row in rows:
        outcome, reason = str(row["outcome"]), str(row["reason"] or "")
        # Only what became of a log is a reason: what is known already, say, is none.
        if outcome not in OUTCOMES or outcome == FITTED:
            continue
        key = outcome, reason, _advice(row)
        told = found.get(key)
        if told is not None:
            found[key] = replace(told, logs=told.logs + 1)
            continue
        words = (str(row.get(name) or "") for name in ("message", "action", "address"))
        found[key] = RefusalReason(outcome, reason, 1, *words)
    return _stops_once(sorted(found.values(), key=lambda each: -each.logs))


def _stops_once(reasons: Iterable[RefusalReason]) -> tuple[RefusalReason, ...]:
    """The same; where studies stopped alike, but for numbers, the commonest reason says it."""
    said, found = set[str](), list[RefusalReason]()
    for each in reasons:
        why, mark, where = each.message.partition(STOPPED)
        alike = NUMBERS.sub("0", where)
        found.append(replace(each, message=why.rstrip()) if mark and alike in said else each)
        said.add(alike)
    return tuple(found)


def _advice(row: Mapping[str, Any]) -> str:
    """What to do, whichever log it names: one that names its own is that of all others, too."""
    name = str(row.get("address") or "").rpartition("/")[2]
    action = str(row.get("action") or "")
    return action.replace(name, "LOG") if name else action


def reason_lines(reasons: Iterable[RefusalReason]) -> list[str]:
    """Lines of a terminal, at most 100 characters each: count, reason, example, what to do."""
    lines = []
    for each in reasons:
        example = f" (such as {_said(each)})" if each.name else ""
        said = f"{each.logs} {each.outcome}: {each.words}{example}"
        lines += wrapped(said, WIDTH, first="  ", later="      ")
        if each.action:
            lines += wrapped(f"do: {each.action}", WIDTH, first="      ", later="          ")
    return lines


def _said(reason: RefusalReason) -> str:
    """The example with its message, in which neither its name nor the reason comes twice."""
    name, told = reason.name, reason.message
    if not told.startswith(f"{name} "):
        return f"{name}: {told}"
    rest = told.removeprefix(f"{name} ")
    clause = f"is {reason.words}: ", f"is a {reason.words}: ", f"is an {reason.words}: "
    again = next((each for each in clause if rest.startswith(each)), None)
    return f"{name}, which {rest}" if again is None else f"{name}: {rest.removeprefix(again)}"


def reasons_table(reasons: Iterable[RefusalReason]) -> Table:
    """One row a reason; no rows where every log has a model."""
    rows: list[tuple[Cell, ...]] = [
        (e.logs, e.outcome, e.words, e.action, e.message, e.name) for e in reasons
    ]
    columns = (
        *(Column("logs"), Column("outcome"), Column("reason"), Column("what to change")),
        *(Column("in words"), Column("for example")),
    )
    return Table("By reason", columns, tuple(rows)).without_empty_columns()
