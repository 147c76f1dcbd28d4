"""One number with its unit, its standard error and its interval, or why it has none."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar, cast

from flightid.frozen import dataclass
from flightid.table import Cell, Column, Table
from flightid.uncertainty.quantiles import LEVEL, half_width, interval_words, shown

if TYPE_CHECKING:
    from typing_extensions import TypeVar as DefaultTypeVar

    Number_co = DefaultTypeVar("Number_co", bound=float | None, default=float, covariant=True)
else:
    Number_co = TypeVar("Number_co", bound=float | None, covariant=True)

Interval = tuple[float, float]
UNHEARD = "to first order its error is below what numbers hold"


class Ends(Protocol):
    """Ends of an interval that is not even about its value, at any level.

    None where they are not determined. See `flightid.uncertainty.uneven`.
    """

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        ...


@dataclass(frozen=True)
class Estimate(Generic[Number_co]):
    """An estimated number: a fitted parameter, a margin, a mode's damping, a clock's skew.

    ``Estimate`` in an annotation has a value; ``Estimate[float | None]`` may lack it.

    Attributes
    ----------
    name : str
        What it is, in the field's words.
    value : float or None
        In `unit`; None where `reason` says why.
    unit : str
    stderr : float or None
        Standard error over repeated flights, in `unit`; None where `reason` says why, or where
        `ends` alone are known.
    reason : str
        Why the value or its interval is missing; empty where neither is.
    freedom : float or None
        Degrees of freedom behind `stderr`, for Student's distribution; None: normal.
    ends : callable or None
        Ends of an interval that is not even about the value, by its level.
    status : str
        Of a parameter: ``"free"``, ``"at bound"``, ``"fixed"``, ``"tied"`` or ``"derived"``; else
        empty.
    cramer_rao_percent, insensitivity_percent : float or None
        Of a parameter, in the convention of CIFER, percent of the value; no confidence interval.

    Example
    -------
    >>> margin = Estimate("phase margin", 47.3, "deg", 1.6)
    >>> margin
    Estimate(phase margin = 47.3 (44.16 to 50.44) deg)
    >>> low, high = margin.interval(0.68)
    >>> round(low, 1), round(high, 1)
    (45.7, 48.9)
    """

    name: str
    value: Number_co
    unit: str = "1"
    stderr: float | None = None
    reason: str = ""
    freedom: float | None = None
    ends: Ends | None = None
    status: str = ""
    cramer_rao_percent: float | None = None
    insensitivity_percent: float | None = None

    def interval(self, level: float = LEVEL) -> Interval | None:
        """Lower and upper end of the interval, in `unit`; None where `reason` says why.

        Parameters
        ----------
        level : float
            Probability that it holds the truth.

        Raises
        ------
        OptionError
            A level that is no probability.
        """
        if self.ends is not None:
            return self.ends(level)
        if self.value is None or self.stderr is None:
            return None
        half = half_width(level, self.freedom) * self.stderr
        return self.value - half, self.value + half

    def half(self, level: float = LEVEL) -> float | None:
        """Half the width of the interval, in `unit`; None where there is none.

        Example
        -------
        >>> round(Estimate("Lp", -4.0, "1/s", 0.1).half(), 3)
        0.196
        """
        ends = self.interval(level)
        return None if ends is None else (ends[1] - ends[0]) / 2.0

    def range_words(self, level: float = LEVEL, digits: int = 4) -> str:
        """The interval in words, empty where there is none.

        Example
        -------
        >>> Estimate("Lp", -4.0, "1/s", 0.1).range_words(0.9)
        '-4.164 to -3.836'
        """
        ends = self.interval(level)
        return "" if ends is None else f"{ends[0]:.{digits}g} to {ends[1]:.{digits}g}"

    @property
    def interval95(self) -> Interval | None:
        """95 % interval, in `unit`."""
        return self.interval(LEVEL)

    @property
    def is_significant(self) -> bool:
        """Whether zero lies outside the 95 % interval."""
        ends = self.interval95
        return ends is not None and (ends[0] > 0.0 or ends[1] < 0.0)

    @property
    def half_width95(self) -> float | None:
        """Half the width of the 95 % interval, in `unit`."""
        ends = self.interval95
        return None if ends is None else 0.5 * (ends[1] - ends[0])

    def scaled(
        self, factor: float, *, name: str | None = None, unit: str | None = None
    ) -> Estimate[Number_co]:
        """The number times an exact factor: in another unit, or made dimensionless.

        Percentages and status go: they belong to the parameter itself.
        """
        plain = self.as_reading(name)
        if self.value is None:
            return replace(plain, unit=unit or self.unit)
        return replace(
            plain,
            value=cast("Number_co", factor * self.value),
            unit=unit or self.unit,
            stderr=None if self.stderr is None else abs(factor) * self.stderr,
            ends=None if self.ends is None else ScaledEnds(self.ends, factor),
        )

    def as_reading(self, name: str | None = None) -> Estimate[Number_co]:
        """The number without the parameter about it: its status becomes the reason, if need be."""
        reason = self.reason or ("" if self.interval95 is not None else self.status)
        return Estimate(
            name or self.name, self.value, self.unit, self.stderr, reason, self.freedom, self.ends
        )

    @property
    def text(self) -> str:
        """Value, interval and unit in words."""
        if self.value is None:
            return f"none ({self.reason})" if self.reason else "none"
        ends = self.interval95
        around = "" if ends is None else f" ({ends[0]:.4g} to {ends[1]:.4g})"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.value:.4g}{around}{unit}"

    def __repr__(self) -> str:
        """Name, value, interval, unit and status on one line."""
        status = f", {self.status}" if self.status else ""
        return f"Estimate({self.name} = {self.text}{status})"

    def to_dict(self) -> dict[str, object]:
        """Plain values; those of a parameter where it is one."""
        ends = self.interval95
        found: dict[str, object] = {
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "stderr": self.stderr,
            "freedom": None if self.freedom == math.inf else self.freedom,
            "interval95": None if ends is None else list(ends),
            "reason": self.reason,
        }
        if self.status:
            found["status"] = self.status
            found["cramer_rao_percent"] = self.cramer_rao_percent
            found["insensitivity_percent"] = self.insensitivity_percent
        return found


Reading = Estimate[float | None]
"""An estimate whose value may be missing: a margin without a crossing."""


@dataclass(frozen=True)
class ScaledEnds:
    """Ends times an exact factor.

    Example
    -------
    >>> ScaledEnds(lambda level: (1.0, 2.0), -2.0)(0.95)
    (-4.0, -2.0)
    """

    inner: Ends
    factor: float

    def __call__(self, level: float) -> Interval | None:
        """Lower and upper end at a level."""
        ends = self.inner(level)
        if ends is None:
            return None
        low, high = sorted(self.factor * end for end in ends)
        return low, high


def estimate_table(
    title: str,
    estimates: Iterable[Reading],
    notes: tuple[str, ...] = (),
    *,
    level: float | None = None,
) -> Table:
    """Table of estimates, a line each.

    Parameters
    ----------
    title : str
    estimates : iterable of Estimate
    notes : tuple of str
        Put below; reasons follow them, each once.
    level : float, optional
        Of the intervals.

    Example
    -------
    >>> estimate_table("Margins", [Estimate("gain margin", 9.5, "dB")]).rows[0][:3]
    ('gain margin', 9.5, 'dB')
    """
    level = shown(level)
    words = interval_words(level)
    columns = (
        Column("quantity"),
        Column("value", digits=4),
        Column("unit"),
        Column("in Hz", digits=4),
        Column(f"{words} low", digits=4),
        Column(f"{words} high", digits=4),
    )
    rows: list[tuple[Cell, ...]] = []
    reasons: dict[str, list[str]] = {}
    for each in estimates:
        low, high = each.interval(level) or (None, None)
        known = each.unit == "rad/s" and each.value is not None
        hertz = float(cast("float", each.value)) / math.tau if known else None
        unit = "" if each.unit == "1" else each.unit
        rows.append((each.name, each.value, unit, hertz, low, high))
        if each.reason:
            reasons.setdefault(each.reason, []).append(each.name)
    why = tuple(f"{', '.join(names)}: {reason}." for reason, names in reasons.items())
    return Table(title, columns, tuple(rows), (*notes, *why)).without_empty_columns()


def first_order(
    name: str, value: float, unit: str, variance: float, freedom: float | None = None
) -> Reading:
    """An estimate by the variance that a slope carries to it; a variance of nothing is none.

    Example
    -------
    >>> first_order("gain", 2.0, "1", 0.0).reason
    'to first order its error is below what numbers hold'
    """
    if not 0.0 < variance < math.inf:
        return Estimate(name, value, unit, None, UNHEARD)
    return Estimate(name, value, unit, math.sqrt(variance), freedom=freedom)
