"""What every reader returns: named columns of one length, with the units the file states."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, FileFormatError, OptionError, UnitError, UnknownNameError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.reading import require_memory
from flightid.record.formats.name_units import unit_at_end
from flightid.units import SPELLINGS, canonical

VALUE_BYTES = 3 * 8
"""What a sample takes on its way into a record: as it was read, as a double, in the record."""
SHOWN = 30
"""Columns that an error names; of more the nearest."""
HEADING = re.compile(r"^(?P<name>.*\S)\s*(?:\[(?P<unit>[^\[\]]*)\]|\((?P<round>[^()]*)\))$")
NO_UNIT = re.compile(r"[^AVNWJKsmgh%°]|1|-|min|[A-Z]{2,}|")
"""What round brackets hold beside units: left (L), motor 1, u (min) and u (max)."""


@dataclass(frozen=True, eq=False)
class ColumnStamps:
    """Stamps of columns that have their own.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
    said : str
        Where the stamps come from, in words.
    finding : Finding or None
        What is to be doubted of them.
    """

    time_s: NDArray[np.float64]
    said: str
    finding: Finding | None = None


@dataclass(frozen=True)
class ColumnTable:
    """Columns of a file, read when asked for.

    Attributes
    ----------
    path : Path
        The file.
    lengths : mapping of str to int
        Length of each column by name.
    load : callable
        Takes a column name, returns its values (any one-dimensional array).
    units : mapping of str to str
        Units as the file spells them; columns left out state none.
    advice : str
        What the file holds that is no column, and how to make columns of it.
    clock : callable or None
        Takes a column name, returns its stamps, where not all columns have the same; None: the
        time column holds them.
    encoding : str
        That the text was read by, where it is neither UTF-8 nor UTF-16.

    Example
    -------
    >>> table = ColumnTable(Path("a.csv"), {"p": 2}, lambda name: np.zeros(2), {"p": "deg/s"})
    >>> table.column("p"), table.units["p"]
    (array([0., 0.]), 'deg/s')
    """

    path: Path
    lengths: Mapping[str, int]
    load: Callable[[str], NDArray[Any]]
    units: Mapping[str, str] = field(default_factory=dict)
    advice: str = ""
    clock: Callable[[str], ColumnStamps] | None = None
    encoding: str = ""

    def named(self, headings: Sequence[str]) -> ColumnTable:
        """The same columns under other headings, in their order.

        Raises
        ------
        OptionError
            There are more or fewer headings than columns.
        """
        require_one_each(self.path, headings, tuple(self.lengths))
        names, units = split_headings(headings)
        require_distinct(self.path, names)
        old = dict(zip(names, self.lengths, strict=True))
        own = self.clock
        return ColumnTable(
            self.path,
            {name: self.lengths[key] for name, key in old.items()},
            lambda name: self.load(old[name]),
            {n: self.units[key] for n, key in old.items() if key in self.units} | units,
            self.advice,
            None if own is None else lambda name: own(old[name]),
            self.encoding,
        )

    def require(self, name: str) -> str:
        """The column of a name, which may be that of its channel; see `channel_name`.

        Raises
        ------
        UnknownNameError
            There is no such column; the message lists those there are.
        """
        found = name
        if name not in self.lengths:
            channels = {channel_name(each, self.lengths): each for each in self.lengths}
            found = channels.get(name) or channels.get(channel_name(name), "")
        if not found:
            names = list(self.lengths)
            near = get_close_matches(name, names, SHOWN, 0.0) if len(names) > SHOWN else names
            more = f" and {len(names) - len(near)} others" if len(names) > len(near) else ""
            raise UnknownNameError(
                f"{self.path.name} has no column of this name",
                found=name,
                needed=f"one of {', '.join(near)}{more}",
                action=self.advice or None,
            )
        return found

    def unit(self, name: str) -> str | None:
        """Unit of a column: what the file states, else what the end of its name says for certain.

        Example
        -------
        >>> table = ColumnTable(Path("a.csv"), {"u_mps": 2, "y": 2}, lambda name: np.zeros(2))
        >>> table.unit("u_mps"), table.unit("y")
        ('m/s', None)
        """
        return self.units.get(name) or unit_at_end(name)

    def raw(self, name: str) -> NDArray[Any]:
        """Values of a column as the file holds them."""
        return self.load(self.require(name))

    def column(self, name: str) -> NDArray[np.float64]:
        """Values of a column as numbers.

        Raises
        ------
        UnknownNameError
            There is no such column.
        DataError
            The column holds text or complex numbers.
        """
        values = self.raw(name)
        if values.dtype.kind not in "fiub":
            raise DataError(
                f"column {name!r} of {self.path.name} does not hold real numbers",
                found=f"type {values.dtype}",
                needed="numbers",
                action="leave the column out, or write it as numbers",
            )
        return np.asarray(values, dtype=np.float64)


def channel_name(column: str, columns: Container[str] = ()) -> str:
    """Name of the channel that a column becomes, by its heading too where no column has that name.

    Example
    -------
    >>> channel_name("/imu/rate.x"), channel_name("p"), channel_name("p (deg/s)")
    ('imu.rate.x', 'p', 'p')
    """
    name = column if column in columns else _parted(column)[0]
    return name.strip("/").replace("/", ".")  # a slash parts output and input of a response


def require_readable_size(path: Path, n_values: int) -> None:
    """Refuse a file that declares more samples than fit in memory.

    Raises
    ------
    FileFormatError
        They take more than the memory budget.
    """
    require_memory(path.name, n_values * VALUE_BYTES)


def is_unit(text: str) -> bool:
    """Tell whether a text is a known unit."""
    try:
        canonical(text)
    except UnitError:
        return False
    return True


def split_headings(headings: Iterable[str]) -> tuple[list[str], dict[str, str]]:
    """Names and units of headings such as ``"p [rad/s]"``; brackets must hold a known unit.

    Round brackets that tell columns apart stay in their names.

    Example
    -------
    >>> split_headings(["t [s]", "p", "y [1st]", "q (deg/s)", "roll (L)", "h (ft)", "h (m)"])[0]
    ['t', 'p', 'y [1st]', 'q', 'roll (L)', 'h (ft)', 'h (m)']
    """
    whole = [heading.strip() for heading in headings]
    parted = [_parted(heading) for heading in whole]
    times = Counter(heading.partition("(")[0].strip() for heading in whole)
    names: list[str] = []
    units: dict[str, str] = {}
    for heading, (stem, unit) in zip(whole, parted, strict=True):
        is_shared = heading.endswith(")") and times[stem] > 1
        names.append(heading if is_shared else stem)
        if unit is not None:
            units[names[-1]] = unit
    return names, units


def _parted(heading: str) -> tuple[str, str | None]:
    """Name and unit of a heading, None where it states none."""
    match = HEADING.match(heading.strip())
    if match is None:
        return heading.strip(), None
    square, unit = match["unit"], match["round"]
    if square is None and NO_UNIT.fullmatch(unit) and unit not in SPELLINGS:
        return heading.strip(), None
    unit = unit if square is None else square
    return (match["name"], unit) if is_unit(unit) else (heading.strip(), None)


def require_one_each(path: Path, headings: Sequence[str], columns: Sequence[str]) -> None:
    """Refuse a list of headings that is not as long as a row.

    Raises
    ------
    OptionError
        Both numbers are named.
    """
    if len(headings) != len(columns):
        raise OptionError(
            f"column_names does not name every column of {path.name}",
            found=f"{len(headings)} names for {len(columns)} columns ({', '.join(columns[:8])})",
            needed="one name for each, in their order",
        )


def require_distinct(path: Path, names: Iterable[str]) -> None:
    """Refuse two columns of one name.

    Raises
    ------
    FileFormatError
        A name occurs twice.
    """
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise FileFormatError(
                f"{path.name} has two columns of one name",
                found=name,
                needed="one name for each column",
                action="rename a column in the file",
            )
        seen.add(name)
