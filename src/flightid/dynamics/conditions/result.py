"""A comparison of flight conditions as a result: numbers and modes side by side."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from flightid.conventions import Light
from flightid.dynamics.modes.result import Mode
from flightid.errors import UnknownNameError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import interval_words, shown

LEAST_CHANCE = 1e-15
"""Smaller probabilities are told as less than this: no error is normal so far out."""


@dataclass(frozen=True)
class ComparedNumber:
    """One number in several conditions.

    Attributes
    ----------
    name : str
    values : mapping of str to Estimate
        By condition, those that have it.
    ratios : mapping of str to Estimate
        To the first of them, by condition, with Fieller's interval.
    chances : mapping of str to float
        Probability of so large a difference between equal truths.

    Example
    -------
    >>> from flightid.uncertainty.estimate import Estimate
    >>> one = Estimate("Zw", -0.6, "1/s")
    >>> ComparedNumber("Zw", {"hover": one}, {}, {}).name
    'Zw'
    """

    name: str
    values: Mapping[str, Reading]
    ratios: Mapping[str, Reading]
    chances: Mapping[str, float]

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "values": {name: value.to_dict() for name, value in self.values.items()},
            "ratios": {name: value.to_dict() for name, value in self.ratios.items()},
            "chances": dict(self.chances),
        }


@dataclass(frozen=True)
class ComparedMode:
    """Modes of several conditions that answer to each other.

    Attributes
    ----------
    name : str
        In the first condition.
    modes : mapping of str to Mode
        By condition.
    numbers : tuple of ComparedNumber
        Natural frequency and damping ratio, or the real eigenvalue.

    Example
    -------
    >>> import flightid as fid
    >>> both = {n: fid.load_model(f"r50_{n}") for n in ("hover", "cruise")}
    >>> fid.compare_conditions(both).modes[0].name
    'heave'
    """

    name: str
    modes: Mapping[str, Mode]
    numbers: tuple[ComparedNumber, ...]

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "modes": {name: mode.to_dict() for name, mode in self.modes.items()},
            "numbers": {number.name: number.to_dict() for number in self.numbers},
        }


@dataclass(frozen=True, repr=False, eq=False)
class ConditionComparison(Result, schema="flightid.condition_comparison/1"):
    """Result of `flightid.compare_conditions`.

    Attributes
    ----------
    conditions : tuple of str
    parameters : tuple of ComparedNumber
        Those that two or more conditions share.
    modes : tuple of ComparedMode
    only_parameters, only_modes : mapping of str to tuple of str
        What one condition has alone.
    findings : tuple of Finding
        Significant changes, turned signs, stability.

    Example
    -------
    >>> import flightid as fid
    >>> both = {n: fid.load_model(f"r50_{n}") for n in ("hover", "cruise")}
    >>> fid.compare_conditions(both).only_parameters["cruise"]
    ('Lw', 'Mw', 'Mcol', 'Yped', 'U0', 'V0')
    """

    conditions: tuple[str, ...]
    parameters: tuple[ComparedNumber, ...]
    modes: tuple[ComparedMode, ...]
    only_parameters: Mapping[str, tuple[str, ...]]
    only_modes: Mapping[str, tuple[str, ...]]
    findings: tuple[Finding, ...]

    def __getitem__(self, name: str) -> ComparedNumber:
        for number in self.parameters:
            if number.name == name:
                return number
        raise UnknownNameError(
            "there is no such common parameter",
            found=repr(name),
            needed=", ".join(number.name for number in self.parameters),
        )

    def summary(self, *, level: float | None = None) -> Table:
        """Table of the common parameters, ratios to the first condition and findings.

        Of black boxes, whose parameters have no names, that of the modes.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        level = shown(level)
        notes = [
            f"Only in {name}: {', '.join(alone)}."
            for name, alone in self.only_parameters.items()
            if alone
        ]
        if not self._is_named:
            modes = self.modes_table(level=level)
            return replace(modes, notes=(*modes.notes, *self.verdicts))
        title = "Parameters, " + " and ".join(self.conditions)
        return self._table(title, self.parameters, (*notes, *self.verdicts), level)

    @property
    def verdicts(self) -> tuple[str, ...]:
        """What changed beyond noise in one sentence, and each finding that asks for something."""
        changed = [f.message.split(":")[0] for f in self.findings if f.code == "changed"]
        said = [f"Changed beyond noise: {'; '.join(changed)}."] if changed else []
        return (*said, *(str(f) for f in self.findings if f.light is not Light.GREEN))

    def modes_table(self, *, level: float | None = None) -> Table:
        """Table of the modes that answer to each other.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        level = shown(level)
        numbers = [number for mode in self.modes for number in mode.numbers]
        notes = tuple(
            f"Only in {name}: {', '.join(alone)}."
            for name, alone in self.only_modes.items()
            if alone
        )
        return self._table("Modes, " + " and ".join(self.conditions), numbers, notes, level)

    def _table(
        self,
        title: str,
        numbers: tuple[ComparedNumber, ...] | list[ComparedNumber],
        notes: tuple[str, ...],
        level: float,
    ) -> Table:
        columns = [Column("quantity"), Column("unit")]
        for name in self.conditions:
            columns += [Column(name), Column("±", digits=2)]
        for name in self.conditions[1:]:
            columns += [Column(f"{name} / {self.conditions[0]}", digits=3)]
            columns += [Column(interval_words(level))]
            columns += [Column("chance", digits=2)]
        rows: list[tuple[Cell, ...]] = []
        for number in numbers:
            unit = next(iter(number.values.values())).unit
            cells: list[Cell] = [number.name, "" if unit == "1" else unit]
            for name in self.conditions:
                cells += _value(number.values.get(name), level)
            for name in self.conditions[1:]:
                cells += [*_ratio(number.ratios.get(name), level)]
                cells.append(_chance(number.chances.get(name)))
            rows.append(tuple(cells))
        said: tuple[str, ...] = (
            "chance: of so large a difference between equal truths, of this row alone.",
        )
        if not any(number.chances for number in numbers):
            said = ()
        said = (*said, *_withheld(numbers))
        return Table(title, tuple(columns), tuple(rows), (*said, *notes)).without_empty_columns()

    def __repr__(self) -> str:
        """Sizes and number of significant changes on one line."""
        changed = sum(f.code in ("changed", "sign-changed") for f in self.findings)
        return (
            f"ConditionComparison({', '.join(self.conditions)}: {len(self.parameters)} common "
            f"parameters, {len(self.modes)} common modes, {changed} significant changes)"
        )

    def _computed(self) -> dict[str, object]:
        return {"parameters": {number.name: number for number in self.parameters}}

    def _tables(self) -> tuple[Table, ...]:
        return (self.summary(), self.modes_table()) if self._is_named else (self.summary(),)

    @property
    def _is_named(self) -> bool:
        return bool(self.parameters or any(self.only_parameters.values()))


def _chance(chance: float | None) -> Cell:
    """A probability; of one that no normal tail tells, that it is less than such."""
    return f"< {LEAST_CHANCE:g}" if chance is not None and chance < LEAST_CHANCE else chance


def _value(quantity: Reading | None, level: float) -> list[Cell]:
    if quantity is None:
        return [None, None]
    return [quantity.value, quantity.half(level)]


def _ratio(ratio: Reading | None, level: float) -> list[Cell]:
    if ratio is None or ratio.value is None:
        return [None, ""]
    return [ratio.value, ratio.range_words(level, 3)]


def _withheld(numbers: Iterable[ComparedNumber]) -> Iterator[str]:
    """Why ratios have no interval, each reason once."""
    reasons: dict[str, dict[str, None]] = {}
    for number in numbers:
        for ratio in number.ratios.values():
            if ratio.reason not in ("", "fixed") and ratio.interval95 is None:
                reasons.setdefault(ratio.reason, {})[number.name] = None
    for reason, names in reasons.items():
        yield f"No interval of the ratio of {', '.join(names)}: {reason}."
