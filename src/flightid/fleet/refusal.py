"""Why a log gives no model, in words, and what to do: its reason is a code, never a class."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from flightid.conventions import Light
from flightid.errors import (
    DataError,
    FileFormatError,
    FitError,
    FlightidError,
    LogFormatError,
    SingularError,
    UnknownNameError,
)
from flightid.findings import FIRST, Finding, in_order
from flightid.fleet.catalogue.schema import FAILED, REFUSED
from flightid.fleet.reasons import STOPPED
from flightid.inspection import Inspection, inspect_log
from flightid.inspection.log_end import is_aside
from flightid.logs import Log
from flightid.study.proposal import Proposal

MESSAGE_LENGTH = 2000
MOST_ACTIONS = 3
MEMORY, FAULT, PATTERN = "memory", "fault", "pattern"
"""More memory than the fleet allows one log; an error that no log should raise; a pattern of the
fleet file that does not come to an end."""
SHORT = "too-short"
"""Code of an inspection's verdict on a log that ends too early."""
SETTING = re.compile(r"\b[A-Z][A-Z0-9]+_[A-Z0-9_]+\b|\blog(ged|ging)?\b")
"""An action that speaks of the logging, or of a parameter of the autopilot."""
EMPTY = "an empty file"
"""What a reader of logs says that it found where there is no byte."""
CODES: tuple[tuple[type[Exception], str], ...] = (
    (LogFormatError, "not-a-log"),
    (FileFormatError, "not-a-log"),
    (UnknownNameError, "not-in-the-log"),
    (FitError, "no-fit"),
    (SingularError, "no-fit"),
    (DataError, "data-unusable"),
)
UNSUITED = "study-unsuited"
"""Of all other errors of flightid's own: the study asks for what this log has not."""
ACTIONS = {
    "not-a-log": "take it out of the places of the fleet file, or copy the log again",
    "not-in-the-log": "log what the study takes: flightid inspect shows what is in a log",
    "no-fit": "flightid run STUDY --log LOG shows how far the fit came",
    "data-unusable": "flightid inspect shows what is in a log; one that is shorter than the others "
    "may be cut off: copy it again",
    UNSUITED: "change the study, or give logs of this kind a fleet file of their own",
    "time": "raise time_s in [limits] of the fleet file, then flightid fleet run --retry",
    MEMORY: "raise memory_mib in [limits] of the fleet file, then flightid fleet run --retry",
    "killed": "see whether the machine ran out of memory, then flightid fleet run --retry",
    PATTERN: "write the pattern of [vehicles] so that it comes to an end, without repeats inside "
    "repeats, then flightid fleet run",
    FAULT: "a fault of flightid and not of the log: report it with these words",
}
"""What to do where an error does not say it."""


class LogRefusalError(FlightidError):
    """Why a log gives no model, by the code of the verdict that decided it."""

    code = "no-model"


class UnreadableFileError(LogRefusalError):
    """What lies there cannot be opened as a file, whatever it holds."""

    code = "not-readable"


def kind_of(error: Exception) -> str:
    """Class of an error as the table of failures names it."""
    if isinstance(error, LogRefusalError):
        return error.code
    return MEMORY if isinstance(error, MemoryError) else type(error).__name__


def refusal(error: Exception, log: Log | None) -> dict[str, Any]:
    """What a log's own row says of an error: flightid's own refuse it, others fail.

    Parameters
    ----------
    error : Exception
    log : Log or None
        The log where it could be read: what its inspection finds red comes first, for a study that
        stops says where, and seldom why.
    """
    known = isinstance(error, FlightidError)
    code = _code(error)
    words, actions = str(error), []
    if isinstance(error, FlightidError):
        words = error.reason if error.needed is None else f"{error.reason}; needed {error.needed}"
        actions = [error.action or ""]
    elif code == FAULT:
        words = f"{type(error).__name__}: {error}"
    if known and log is not None and not isinstance(error, LogRefusalError):
        seen = _inspected(log)
        worst = decisive(seen)
        if worst is not None:
            code, words = worst.code, f"{worst.message}. {STOPPED}{words}"
            actions = _against_it(worst, seen) or actions
    return {
        "outcome": REFUSED if known else FAILED,
        "reason": code,
        "message": words[:MESSAGE_LENGTH],
        "action": joined(actions) or ACTIONS.get(code, ACTIONS[UNSUITED]),
        "models": 0,
    }


def _code(error: Exception) -> str:
    if isinstance(error, LogRefusalError):
        return error.code
    if not isinstance(error, FlightidError):
        return MEMORY if isinstance(error, MemoryError) else FAULT
    if isinstance(error, LogFormatError) and error.found == EMPTY:
        return "empty-file"
    return next((code for kind, code in CODES if isinstance(error, kind)), UNSUITED)


def _inspected(log: Log) -> tuple[Finding, ...]:
    """What an inspection says against a log; nothing where it cannot be made."""
    try:
        return against(inspect_log(log))
    except (FlightidError, ArithmeticError, ValueError, np.linalg.LinAlgError):
        return ()


def against(inspection: Inspection | None) -> tuple[Finding, ...]:
    """Findings that are not green, a fall first, for it comes before all that follows from it."""
    seen = () if inspection is None else inspection.findings
    return in_order(f for f in seen if f.light is not Light.GREEN and not is_aside(f))


def decisive(seen: Sequence[Finding]) -> Finding | None:
    """What decides against a log whose study stopped: a fall, what is red, or no sweep."""
    first = next((each for each in seen if each.code in FIRST), None)
    red = next((each for each in seen if each.light is Light.RED), None)
    return first or red or next((each for each in seen if each.code == "no-model"), None)


def unidentified(made: Proposal) -> LogRefusalError:
    """The verdict that decided, and what to change: settings of the logging come first."""
    bad = [*against(made.inspection)]
    bad += [each for each in made.findings if each.light is not Light.GREEN]
    # A fall comes first, then the worst; of several the inspection's, which looks at the logging.
    worst = next(iter(in_order(bad)), None)
    refused = LogRefusalError(
        "no model can be identified from this log",
        found=None if worst is None else worst.message,
        action=joined(_against_it(worst, bad)) or None,
    )
    if worst is not None:
        refused.code = worst.code
    return refused


def _against_it(worst: Finding | None, seen: Sequence[Finding]) -> list[str]:
    """What to do about what decided, and about what weighs as much; else about anything.

    Where it fell, or where a log is too short, all else follows from that: one thing is to be done.
    """
    if worst is not None and worst.code in FIRST and worst.action:
        return [worst.action]
    if worst is not None and worst.code == SHORT and worst.action:
        return [f"copy the log again where it is cut off, else {worst.action}"]
    light = None if worst is None else worst.light
    grave = [each.action for each in seen if each.light is light and each.action]
    return grave or [each.action for each in seen if each.action]


def joined(actions: Iterable[str]) -> str:
    """What to do, settings of the logging first, three at most; none that another begins with."""
    told = sorted(filter(None, actions), key=lambda action: SETTING.search(action) is None)
    once = [a for a in dict.fromkeys(told) if not any(b != a and b.startswith(a) for b in told)]
    return "; ".join(once[:MOST_ACTIONS])
