"""Evidence: what was examined of a result, what that says, and the one light that follows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from typing import Any

from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import Finding, said_once
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.surface import spoken
from flightid.table import Column, Table

INSPECTION = "inspection"
SWEEP = "sweep"
TIME = "time base"
SAMPLES = "samples"
BAND = "excitation band"
COHERENCE = "coherence"
LOOP = "loop"
HOLD = "input hold"
SETTLED = "estimator settled"
AGREEMENT = "agreement of parts"
SIGNS = "declared signs"
RESIDUALS = "residuals"
PREDICTION = "prediction"
GUIDELINES = "guidelines"
NAMES = (
    INSPECTION, SWEEP, TIME, SAMPLES, BAND, COHERENCE, LOOP, HOLD, SETTLED, AGREEMENT, SIGNS,
    RESIDUALS, PREDICTION, GUIDELINES,
)  # fmt: skip
ALWAYS = (BAND, COHERENCE, LOOP, SETTLED, AGREEMENT)
"""What every result needs before it may be green."""
LONGEST = 200
"""Letters of a reason why values are no evidence."""

_ABSENT: Mapping[str, tuple[str, str]] = {
    INSPECTION: ("the log was not inspected", "run inspect_log, or `flightid inspect`"),
    SWEEP: ("whether a sweep was flown was not examined", "run inspect_log, or `flightid inspect`"),
    TIME: ("the time base was not examined", ""),
    SAMPLES: ("the samples were not examined", ""),
    BAND: ("the band that the inputs excite was not examined", "fit records or their responses"),
    COHERENCE: ("coherence was not examined", "fit records or a response estimated from them"),
    LOOP: ("whether a loop was closed was not examined", "declare loop='open' or 'closed'"),
    HOLD: ("how inputs move between samples was not examined", "declare hold=…"),
    SETTLED: ("whether the estimator settled was not examined", ""),
    AGREEMENT: (
        "whether parts of the data agree was not examined",
        "fit halves of the record, or records, by themselves and compare their intervals",
    ),
    SIGNS: ("declared signs were not examined", ""),
    RESIDUALS: ("residuals were not tested", "run residual_tests"),
    PREDICTION: ("no record that the fit has not seen was predicted", "verify it on one"),
    GUIDELINES: ("guidelines were not examined", ""),
}
_ORDER = (Light.RED, Light.AMBER, Light.UNKNOWN, Light.GREEN)


@dataclass(frozen=True)
class Check:
    """One thing that was examined.

    Attributes
    ----------
    name : str
        One of `NAMES`.
    light : Light
    what : str
        What was found, with numbers and units.
    action : str
        What to do about it; empty where nothing is to be done.
    band_rad_s : tuple of float or None
        Frequencies that it is about, rad/s.
    limit : str
        What these data cannot tell, however green: said beside the light.
    by_response_rad_s : mapping of str to (float, float)
        By response, rad/s, where it is about several.

    Example
    -------
    >>> print(Check("loop", Light.GREEN, "loop open, as declared").finding)
    [green] loop open, as declared
    """

    name: str
    light: Light
    what: str
    action: str = ""
    band_rad_s: tuple[float, float] | None = None
    limit: str = ""
    by_response_rad_s: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.name not in NAMES:
            raise OptionError("no such check", found=self.name, needed=", ".join(NAMES))
        object.__setattr__(self, "what", spoken(self.what))
        object.__setattr__(self, "action", spoken(self.action))

    @property
    def finding(self) -> Finding:
        """The check as a finding; its code is ``evidence-`` and the name."""
        code = "evidence-" + self.name.replace(" ", "-")
        return Finding(code, self.light, self.what, self.action)

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "name": self.name,
            "light": str(self.light),
            "what": self.what,
            "action": self.action,
            "band_rad_s": None if self.band_rad_s is None else list(self.band_rad_s),
            "limit": self.limit,
            "by_response_rad_s": {
                name: list(band) for name, band in self.by_response_rad_s.items()
            },
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Check:
        """A check from its plain values."""
        band = values.get("band_rad_s")
        return cls(
            values["name"],
            Light(values["light"]),
            values["what"],
            values.get("action", ""),
            None if band is None else (float(band[0]), float(band[1])),
            values.get("limit", ""),
            {
                name: (float(a), float(b))
                for name, (a, b) in values.get("by_response_rad_s", {}).items()
            },
        )


@dataclass(frozen=True)
class Evidence(Result, schema="flightid.evidence/1"):
    """Checks of a result, and its light.

    Red where a check is red. Green where every required check is there and green, and no other is
    worse. Amber otherwise: what was not examined is never green.

    Attributes
    ----------
    checks : tuple of Check
        One of a name at most.
    required : tuple of str
        Names that must be there for green.

    Example
    -------
    >>> evidence = Evidence((Check("loop", Light.GREEN, "loop open, as declared"),), ("loop",))
    >>> evidence.light.value, Evidence(evidence.checks).light.value
    ('green', 'amber')
    """

    checks: tuple[Check, ...] = ()
    required: tuple[str, ...] = ALWAYS

    def __post_init__(self) -> None:
        for name in self.required:
            if name not in NAMES:
                raise OptionError("no such check", found=name, needed=", ".join(NAMES))

    @property
    def missing(self) -> tuple[str, ...]:
        """Required checks that are not there."""
        present = {check.name for check in self.checks}
        return tuple(name for name in self.required if name not in present)

    @property
    def light(self) -> Light:
        """The light of the result: everything that shows one shows this."""
        found = self._worst(self.findings)
        return Light.AMBER if found is Light.UNKNOWN else found

    @property
    def band_rad_s(self) -> tuple[float, float] | None:
        """Frequencies that the inputs excited with coherence, rad/s: where a model is known."""
        check = self.check(BAND)
        return None if check is None else check.band_rad_s

    @property
    def by_response_rad_s(self) -> Mapping[str, tuple[float, float]]:
        """The same by response, ``"output/input"`` or the output of all inputs, rad/s."""
        check = self.check(BAND)
        return {} if check is None else check.by_response_rad_s

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Every check, and what is missing, in the order of `NAMES`."""
        present = {check.name: check.finding for check in self.checks}
        absent = {
            name: Finding("evidence-" + name.replace(" ", "-"), Light.AMBER, *_ABSENT[name])
            for name in self.missing
        }
        both = present | absent
        return tuple(both[name] for name in NAMES if name in both)

    @property
    def reason(self) -> Finding | None:
        """The finding that gives the light; one that was examined goes before one that was not.

        Where a loop was closed, that comes before the residual tests which it spoils.
        """
        absent = {"evidence-" + name.replace(" ", "-") for name in self.missing}
        ranked = sorted(self.findings, key=lambda f: (_ORDER.index(f.light), f.code in absent))
        if not ranked:
            return None
        loop, tests = self.check(LOOP), self.check(RESIDUALS)
        if loop is None or tests is None or ranked[0] != tests.finding:
            return ranked[0]
        if loop.light is not Light.AMBER:
            return ranked[0]
        # Feedback leaves inputs in residuals whatever the order: it is what to mend first.
        what = f"{loop.what}; {tests.what}"
        return Finding(loop.finding.code, tests.light, what, loop.action)

    @property
    def lines(self) -> tuple[str, ...]:
        """The light, each reason for which it is not green with what to do, and limits."""
        reasons = said_once(f for f in self.findings if f.light is not Light.GREEN)
        return (f"Light: {self.light}.", *map(str, reasons), *(f"{each}." for each in self.limits))

    @property
    def limits(self) -> tuple[str, ...]:
        """What the data cannot tell, however green."""
        return tuple(check.limit for check in self.checks if check.limit)

    @property
    def verdict(self) -> Finding:
        """What the model predicts of unseen data, then the first reason for the light."""
        reason, predicted = self.reason, self.check(PREDICTION)
        first = "" if predicted is None else f"{predicted.what}; "
        if self.light is Light.GREEN or reason is None:
            what = f"{first}every check that is needed was made and holds"
            what = "; ".join((what, *(limit[:1].lower() + limit[1:] for limit in self.limits)))
            return Finding("evidence", self.light, what)
        if predicted is not None and reason == predicted.finding:
            return Finding("evidence", self.light, reason.message, reason.action)
        return Finding("evidence", self.light, first + reason.message, reason.action)

    def check(self, name: str) -> Check | None:
        """The check of a name; None where it was not made."""
        return next((check for check in self.checks if check.name == name), None)

    def with_checks(self, checks: Iterable[Check], *, required: Iterable[str] = ()) -> Evidence:
        """Copy with more checks, in place of those of their names, and more required names."""
        given = {check.name: check for check in checks}
        kept = tuple(check for check in self.checks if check.name not in given)
        names = dict.fromkeys((*self.required, *required))
        return replace(self, checks=(*kept, *given.values()), required=tuple(names))

    def summary(self) -> Table:
        """Table of the checks, and of what was not examined."""
        columns = (Column("examined"), Column("light"), Column("found"), Column("do"))
        rows = []
        for name in NAMES:
            check = self.check(name)
            if check is not None:
                rows.append((name, str(check.light), check.what, check.action or None))
            elif name in self.missing:
                rows.append((name, "not examined", *_ABSENT[name]))
        return Table(f"What was examined: {self.light}", columns, tuple(rows))

    def _computed(self) -> dict[str, object]:
        return {
            "light": self.light,
            "missing": self.missing,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Evidence:
        """Evidence from its plain values.

        Raises
        ------
        DataError
            They are none, as in a file that was changed by hand.
        """
        try:
            checks = tuple(map(Check.from_dict, values["checks"]))
            return cls(checks, tuple(values["required"]))
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
            raise DataError(
                "these values are no evidence",
                found=f"{type(error).__name__}: {error}"[:LONGEST],
                needed=f"what {cls.schema!r} holds",
            ) from error

    def __repr__(self) -> str:
        """Light and numbers of checks on one line."""
        absent = f", not examined: {', '.join(self.missing)}" if self.missing else ""
        return f"Evidence({self.light}, {len(self.checks)} checks{absent})"

    @staticmethod
    def _worst(findings: Iterable[Finding]) -> Light:
        lights = {finding.light for finding in findings}
        return next((light for light in _ORDER if light in lights), Light.AMBER)
