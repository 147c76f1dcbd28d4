"""Charts of flying-qualities levels: regions of numbers, as a standard bounds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.errors import UnknownNameError
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Column, Table

Samples = Mapping[str, NDArray[np.float64]]
Limits = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Region:
    """Where a level holds.

    Attributes
    ----------
    limits : mapping of str to tuple of float
        Lowest and highest value by quantity, both inside; infinite where there is no limit.
    boundary : ndarray, shape (n, 2), or None
        Points of a line in the chart's axes, the second coordinate increasing: the level holds to
        its right, and not beyond its last point.

    Example
    -------
    >>> region = Region({"damping": (0.35, 1.3)})
    >>> region.holds({"damping": np.array([0.2, 0.7])}, ())
    array([False,  True])
    """

    limits: Limits
    boundary: NDArray[np.float64] | None = None

    def holds(self, samples: Samples, axes: tuple[str, ...]) -> NDArray[np.bool_]:
        """Whether each sample lies inside."""
        size = len(next(iter(samples.values())))
        found = np.ones(size, dtype=np.bool_)
        for name, (low, high) in self.limits.items():
            found &= (samples[name] >= low) & (samples[name] <= high)
        if self.boundary is not None:
            x, y = samples[axes[0]], samples[axes[1]]
            line = np.interp(y, self.boundary[:, 1], self.boundary[:, 0])
            found &= (x >= line) & (y <= self.boundary[-1, 1])
        return found


@dataclass(frozen=True, eq=False, repr=False)
class RatingChart(Result, schema="flightid.rating_chart/1"):
    """One requirement of a standard for one case of its use.

    Attributes
    ----------
    key, standard, title, source : str
        Name, standard, what it is about, and the paragraph or figure.
    regions : tuple of Region
        Levels 1, 2, … ; a level holds where its region does and no better one.
    labels, units : mapping of str to str
        Of the quantities that it needs.
    axes : tuple of str
        Quantities of the drawn chart: none for a table, or two.
    conditions : mapping of str to str
        The case: class, category, axis, task, …
    worse : str
        What lies outside all regions.
    valid : mapping of str to tuple of float
        Beyond these a level is the best that it can be: the stored boundary ends there.
    confirmed : bool
        Whether the numbers were checked against another transcription of the standard.
    note : str
        What to know.

    Example
    -------
    >>> from flightid.dynamics.handling_qualities.rating_charts_reading import rating_chart
    >>> rating_chart("roll_mode", category="B")
    RatingChart(MIL-F-8785C, Roll mode, category B)
    """

    key: str
    standard: str
    title: str
    source: str
    regions: tuple[Region, ...]
    labels: Mapping[str, str]
    units: Mapping[str, str]
    axes: tuple[str, ...] = ()
    conditions: Mapping[str, str] = field(default_factory=dict)
    worse: str = ""
    valid: Limits = field(default_factory=dict)
    confirmed: bool = True
    note: str = ""

    @property
    def case(self) -> str:
        """Conditions in words."""
        return ", ".join(f"{name} {value}" for name, value in self.conditions.items())

    def level_name(self, level: int) -> str:
        """Name of a level; one more than there are regions is what lies outside all of them."""
        if level <= len(self.regions):
            return f"Level {level}"
        return self.worse or f"worse than Level {len(self.regions)}"

    def levels(self, samples: Samples) -> NDArray[np.intp]:
        """Level of each sample, from 1; one more than there are regions outside all of them.

        Raises
        ------
        UnknownNameError
            A quantity of the chart is missing.
        """
        for name in self.labels:
            if name not in samples:
                raise UnknownNameError(
                    f"{self.title} needs another quantity",
                    found=", ".join(samples) or "none",
                    needed=name,
                )
        found = np.full(len(next(iter(samples.values()))), len(self.regions) + 1, dtype=np.intp)
        for place in reversed(range(len(self.regions))):
            found[self.regions[place].holds(samples, self.axes)] = place + 1
        return found

    def within(self, samples: Samples) -> NDArray[np.bool_]:
        """Whether each sample lies where the stored boundaries are complete."""
        return Region(self.valid).holds(samples, ())

    def __repr__(self) -> str:
        """Standard, title and case on one line."""
        parts = (self.standard, self.title, self.case)
        return f"RatingChart({', '.join(part for part in parts if part)})"

    def summary(self) -> Table:
        """Table of the limits, a line for each level and quantity."""
        rows = []
        for place, region in enumerate(self.regions, start=1):
            for name, (low, high) in region.limits.items():
                ends = (low if np.isfinite(low) else None, high if np.isfinite(high) else None)
                rows.append((self.level_name(place), self.labels[name], *ends, self.units[name]))
            if region.boundary is not None:
                drawn = f"right of a line of {len(region.boundary)} points"
                rows.append((self.level_name(place), drawn, None, None, ""))
        columns = (
            Column("level"),
            Column("quantity"),
            Column("at least"),
            Column("at most"),
            Column("unit"),
        )
        notes = (f"{self.standard}: {self.source}.", self.case, self.note, self.doubt)
        table = Table(self.title, columns, tuple(rows), tuple(note for note in notes if note))
        return table.without_empty_columns()

    @property
    def doubt(self) -> str:
        """Warning where the numbers are not confirmed; else empty."""
        if self.confirmed:
            return ""
        return "Boundaries not confirmed: check them against your copy of the standard."
