"""One printed number with its unit and its 95 % interval, or why it has none."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from flightid.table import Cell, Column, Table


@dataclass(frozen=True, repr=False)
class Quantity:
    """A scalar result.

    Attributes
    ----------
    name : str
        What it is, in the field's words.
    value : float or None
        In `unit`; None where `reason` says why.
    unit : str
    interval95 : tuple of float or None
        95 % interval, in `unit`; None where `reason` says why.
    reason : str
        Why the value or its interval is missing; empty where neither is.

    Example
    -------
    >>> Quantity("phase margin", 47.3, "deg", (44.1, 50.5))
    Quantity(phase margin = 47.3 (44.1 to 50.5) deg)
    """

    name: str
    value: float | None
    unit: str = "1"
    interval95: tuple[float, float] | None = None
    reason: str = ""

    @property
    def text(self) -> str:
        """Value, interval and unit in words."""
        if self.value is None:
            return f"none ({self.reason})" if self.reason else "none"
        spread = ""
        if self.interval95 is not None:
            spread = f" ({self.interval95[0]:.4g} to {self.interval95[1]:.4g})"
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.value:.4g}{spread}{unit}"

    def __repr__(self) -> str:
        """Name, value, interval and unit on one line."""
        return f"Quantity({self.name} = {self.text})"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "value": self.value,
            "unit": self.unit,
            "interval95": None if self.interval95 is None else list(self.interval95),
            "reason": self.reason,
        }


def quantity_table(
    title: str, quantities: Iterable[Quantity], notes: tuple[str, ...] = ()
) -> Table:
    """Table of quantities, a line each.

    Parameters
    ----------
    title : str
    quantities : iterable of Quantity
    notes : tuple of str
        Put below; reasons follow them, each once.

    Returns
    -------
    Table

    Example
    -------
    >>> quantity_table("Margins", [Quantity("gain margin", 9.5, "dB")]).rows[0][:3]
    ('gain margin', 9.5, 'dB')
    """
    columns = (
        Column("quantity"),
        Column("value", digits=4),
        Column("unit"),
        Column("95 % low", digits=4),
        Column("95 % high", digits=4),
    )
    rows: list[tuple[Cell, ...]] = []
    reasons: dict[str, list[str]] = {}
    for each in quantities:
        low, high = each.interval95 if each.interval95 is not None else (None, None)
        rows.append((each.name, each.value, "" if each.unit == "1" else each.unit, low, high))
        if each.reason:
            reasons.setdefault(each.reason, []).append(each.name)
    why = tuple(f"{', '.join(names)}: {reason}." for reason, names in reasons.items())
    return Table(title, columns, tuple(rows), (*notes, *why)).without_empty_columns()
