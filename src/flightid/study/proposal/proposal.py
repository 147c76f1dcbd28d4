"""The noun: a study file that was written for data, and what was left out of it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from flightid.errors import StudyError
from flightid.files import write_atomically
from flightid.findings import CAUSES, FIRST, Finding, in_order
from flightid.frozen import dataclass
from flightid.inspection import Inspection
from flightid.inspection.carried import carried_sentence
from flightid.surface import spoken
from flightid.wrapping import wrapped

WIDTH = 100
LOGGED = ("rate-too-low", "rate-limited", "gaps", "jitter", "no-command-logged")
"""Codes of what is set before a flight: sweeps of a log that is too slow are flown in vain."""
STAMP = "# Written by flightid, which replaces this file as long as nobody changes it: "
"""Begins the last line, with the hash of the lines above it."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A study file for data that have none.

    Attributes
    ----------
    lines : tuple of str
        The study file; paths in it are relative to the folder that it was written for.
    models : tuple of str
        Names of the models that it identifies; empty where the data carry none.
    findings : tuple of Finding
        What cannot be identified from these data, why, and what to do.
    inspection : Inspection or None
        Of the log; None where records come from files.
    said : tuple of str
        What the columns of records were taken for.
    """

    lines: tuple[str, ...]
    models: tuple[str, ...]
    findings: tuple[Finding, ...] = ()
    inspection: Inspection | None = None
    said: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The study file, with a stamp that tells whether anyone changed it."""
        body = "\n".join(self.lines) + "\n"
        return f"{body}{STAMP}{_hash(body)}\n"

    def refusal(self) -> str:
        """What the data show, what to do, and last that there is no model, and why."""
        answer = ["No model can be identified from these data."]
        sentence, grounded = "", False
        if self.inspection is not None:
            sentence = carried_sentence(self.inspection)
            answer = _wrapped(sentence)
            grounded = self.inspection.phases.is_known and not self.inspection.phases.airborne
        for why, parts in self._reasons().items():
            if why not in sentence and not grounded:
                answer += _wrapped(f"- {', '.join(parts)}: {why}")
        actions = self._actions()
        said = [] if self.inspection is None else [self.inspection.in_short(), ""]
        said += ["What to do, the first first"] if actions else []
        said += [line for each in actions for line in _wrapped(f"- {each}")]
        return "\n".join([*said, *([""] if actions else []), *answer])

    def _reasons(self) -> dict[str, list[str]]:
        """Why there is no model, with the axes or parts of which it is so."""
        reasons: dict[str, list[str]] = {}
        for finding in self.findings:
            what, _, why = finding.message.partition(": no model, ")
            reasons.setdefault(why, []).append(what)
        return reasons

    def _actions(self) -> list[str]:
        """What to do where there is no model, the first first, each once."""
        actions = [finding.action for finding in self.findings if finding.action]
        if self.inspection is not None:
            noted = self.inspection.findings
            ranked = [f for f in in_order(noted) if f.action]
            first = [f.action for f in ranked if f.code in FIRST]
            mended = [f.action for f in ranked if f.code.startswith(CAUSES)]
            settings = [f.action for f in ranked if f.code in LOGGED]
            found = [*actions, *(each.action for each in noted if each.action)]
            planned = [each for each in found if "flightid plan" in each]
            looked = [*self._next(planned=bool(planned))]
            # What made a vehicle fall is mended before anything; what is logged, before it flies.
            early = [*mended, *looked] if self.inspection.phases.fall else [*looked, *mended]
            actions = [*first, *early, *settings, *planned, *found]
        return [a for a in dict.fromkeys(actions) if not any(_goes_on(b, a) for b in actions)]

    def _next(self, *, planned: bool) -> Iterator[str]:
        """Commands that go on from a log of a flight without a model."""
        if self.inspection is not None and self.inspection.phases.airborne:
            log = self.inspection.name
            flight = f"flightid flight {log}: what this flight tells without a model"
            yield spoken(f"{flight}: steps, motors, noise")
            if not planned:
                yield spoken(f"flightid plan {log}: the sweep to fly, as this vehicle's parameters")

    def write(self, path: str | Path) -> Path:
        """Write the study file; one that was changed by hand is never replaced.

        Raises
        ------
        StudyError
            The data carry no model, or the file there was changed by hand.
        OSError
            The file cannot be written.
        """
        file = Path(path)
        if not self.models:
            reasons = (": ".join(filter(None, (", ".join(parts), why)))
                       for why, parts in self._reasons().items())  # fmt: skip
            raise StudyError(
                "these data carry no model, so no study is written",
                found="; ".join(reasons) or "nothing to identify",
                action="; ".join(self._actions()[:1]),
            )
        file.parent.mkdir(parents=True, exist_ok=True)
        if file.exists() and not _is_untouched(file):
            raise StudyError(
                "a study of that name is there, and it is not as flightid wrote it",
                found=str(file),
                needed="a name that is free",
                action=f"run that study (flightid run {file.name}), or move it away",
            )
        return write_atomically(file, self.text)


def _goes_on(longer: str, action: str) -> bool:
    """Whether another advice begins with all of one, and says more."""
    return longer != action and longer.startswith(action)


def _wrapped(text: str) -> list[str]:
    return wrapped(text, WIDTH, later="  ")


def _hash(body: str) -> str:
    return hashlib.sha256(body.encode()).hexdigest()[:16]


def _is_untouched(file: Path) -> bool:
    """Whether a file is as some proposal wrote it."""
    try:
        body, stamp, told = file.read_text(encoding="utf-8").rpartition(STAMP)
    except UnicodeDecodeError:
        return False
    return bool(stamp) and told.strip() == _hash(body)
