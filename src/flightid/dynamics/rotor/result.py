"""Rotor physics as a result: identified numbers beside what they should be."""

from __future__ import annotations

from flightid.errors import ModelError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import interval_words, shown

THEORY, GIVEN, FULL = "theory", "given", "full model's mode"
"""Where an expected number comes from."""


@dataclass(frozen=True)
class RotorFact:
    """One identified number beside what it should be.

    Attributes
    ----------
    identified : Estimate
    formula : str
    expected : Estimate
        Theory, a measurement on the vehicle, or the full model's mode; None without one.
    expected_from : str
    ratio : Estimate
        Identified over expected.

    Example
    -------
    >>> import flightid as fid
    >>> fid.rotor_physics(fid.load_model("r50_hover"), 89.0)["roll flapping frequency"].identified
    Estimate(roll flapping frequency = 12.88 rad/s)
    """

    identified: Reading
    formula: str
    expected: Reading
    expected_from: str
    ratio: Reading

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "identified": self.identified.to_dict(),
            "formula": self.formula,
            "expected": self.expected.to_dict(),
            "expected_from": self.expected_from,
            "ratio": self.ratio.to_dict(),
        }


@dataclass(frozen=True, repr=False, eq=False)
class RotorPhysics(Result, schema="flightid.rotor_physics/1"):
    """Result of `flightid.rotor_physics`.

    Attributes
    ----------
    name : str
        The model's.
    rotor_speed_rad_s : float
    facts : tuple of RotorFact
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> fid.rotor_physics(fid.load_model("r50_hover"), 89.0, expected={"bar time constant": 0.36})
    RotorPhysics('Yamaha R-50, hover': 10 numbers, farthest from theory 5 %)
    """

    name: str
    rotor_speed_rad_s: float
    facts: tuple[RotorFact, ...]
    findings: tuple[Finding, ...] = ()

    def __getitem__(self, name: str) -> RotorFact:
        for fact in self.facts:
            if fact.identified.name == name:
                return fact
        raise ModelError(
            "there is no such number",
            found=repr(name),
            needed=", ".join(fact.identified.name for fact in self.facts),
        )

    def summary(self, *, level: float | None = None) -> Table:
        """Table of identified and expected numbers with their ratios."""
        level = shown(level)
        columns = (
            Column("quantity"),
            Column("formula"),
            Column("identified"),
            Column(f"{interval_words(level)} low"),
            Column(f"{interval_words(level)} high"),
            Column("unit"),
            Column("expected"),
            Column("from"),
            Column("ratio", digits=3),
            Column(f"{interval_words(level)} low", digits=3),
            Column(f"{interval_words(level)} high", digits=3),
        )
        rows = tuple(_row(fact, level) for fact in self.facts)
        reasons = dict.fromkeys(f.identified.reason for f in self.facts if f.identified.reason)
        notes = (
            f"Rotor speed {self.rotor_speed_rad_s:.4g} rad/s.",
            *(f"No interval: {reason}." for reason in reasons),
            *map(str, self.findings),
        )
        title = f"Rotor physics of {self.name}"
        return Table(title, columns, rows, notes).without_empty_columns()

    def __repr__(self) -> str:
        """Count, and the farthest from theory or measurement, on one line."""
        apart = [
            abs(f.ratio.value - 1.0)
            for f in self.facts
            if f.ratio.value is not None and f.expected_from in (THEORY, GIVEN)
        ]
        far = f", farthest from theory {100.0 * max(apart):.0f} %" if apart else ""
        return f"RotorPhysics({self.name!r}: {len(self.facts)} numbers{far})"

    def _computed(self) -> dict[str, object]:
        return {"facts": {fact.identified.name: fact for fact in self.facts}}


def _row(fact: RotorFact, level: float) -> tuple[Cell, ...]:
    mine = fact.identified
    unit = "" if mine.unit == "1" else mine.unit
    low, high = mine.interval(level) or (None, None)
    ends = fact.ratio.interval(level) or (None, None)
    return (
        mine.name, fact.formula, mine.value, low, high, unit,
        fact.expected.value, fact.expected_from, fact.ratio.value, *ends,
    )  # fmt: skip
