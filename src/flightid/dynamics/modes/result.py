"""Modes of a model as results: each with its numbers, its states and its words."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.modes.delays import EACH_ONE_SAMPLE, delays_apart
from flightid.dynamics.modes.names import NamedMode
from flightid.errors import UnknownNameError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import interval_words, shown

ORIGIN = "poles at the origin"
LEAST_SHOWN = 0.01
"""Participation below which the table of participations leaves a state out."""


@dataclass(frozen=True)
class Participation:
    """How one state takes part in a mode.

    Attributes
    ----------
    state, unit : str
    factor : complex
        Participation factor wᵢ vᵢ: no unit, sum one over the states, the same for any scaling of
        the states.
    share : Estimate
        Size of the factor over the sum of the sizes.
    size : Estimate
        Size in the eigenvector, in `unit` for one unit of the mode's leading state.
    phase_rad : float
        Phase in the eigenvector against the leading state, rad.

    Example
    -------
    >>> from flightid.uncertainty.estimate import Estimate
    >>> one = Estimate("share", 1.0)
    >>> Participation("q", "rad/s", 1 + 0j, one, one, 0.0)
    Participation(q: 100 %)
    """

    state: str
    unit: str
    factor: complex
    share: Reading
    size: Reading
    phase_rad: float

    def __repr__(self) -> str:
        """State and share on one line."""
        return f"Participation({self.state}: {100.0 * (self.share.value or 0.0):.0f} %)"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        return {
            "unit": self.unit,
            "factor": [self.factor.real, self.factor.imag],
            "share": self.share.to_dict(),
            "size": self.size.to_dict(),
            "phase_rad": self.phase_rad,
        }


@dataclass(frozen=True, repr=False, eq=False)
class Mode:
    """One eigenvalue, or the upper one of a complex pair.

    Attributes
    ----------
    eigenvalue : complex or None
        rad/s; of a sampled model ln z / T; None for a pole z that has no continuous counterpart.
    root : complex
        Eigenvalue of the model's matrix: the same, or z.
    named : NamedMode
        Name, character and parts in words.
    real, imaginary : Estimate
        rad/s.
    natural_frequency, damping_ratio : Estimate
        rad/s and 1.
    period : Estimate
        2π over the imaginary part, s.
    time_constant : Estimate
        −1 over the real part, s; negative for growth.
    time_to_half, time_to_double : Estimate
        ln 2 over the size of the real part, s; one of them.
    participations : tuple of Participation
        Largest share first; none for a black box, whose states mean nothing.
    covariance : ndarray, shape (2, 2), or None
        Of real and imaginary part, (rad/s)².
    reason : str
        Why there are no intervals, or no continuous counterpart.

    Example
    -------
    >>> import flightid as fid
    >>> fid.modes(fid.load_model("short_period")).modes[0]
    Mode(short period, damped oscillation: -2.5 ± 2.599i rad/s)
    """

    eigenvalue: complex | None
    root: complex
    named: NamedMode
    real: Reading
    imaginary: Reading
    natural_frequency: Reading
    damping_ratio: Reading
    period: Reading
    time_constant: Reading
    time_to_half: Reading
    time_to_double: Reading
    participations: tuple[Participation, ...] = ()
    covariance: NDArray[np.float64] | None = None
    reason: str = ""

    @property
    def is_pair(self) -> bool:
        """Whether the conjugate eigenvalue belongs to it."""
        return self.root.imag != 0.0

    @property
    def name(self) -> str:
        """Name, such as ``"short period"``."""
        return self.named.name

    @property
    def description(self) -> str:
        """Name, character and what takes part."""
        return str(self.named)

    @property
    def quantities(self) -> tuple[Reading, ...]:
        """All numbers that are there."""
        every = (
            self.real, self.imaginary, self.natural_frequency, self.damping_ratio, self.period,
            self.time_constant, self.time_to_half, self.time_to_double,
        )  # fmt: skip
        return tuple(each for each in every if each.value is not None)

    def share(self, state: str) -> float:
        """Share of a state; zero for one that the mode does not know."""
        found = (p.share.value for p in self.participations if p.state == state)
        return next(found, 0.0) or 0.0

    @property
    def place_words(self) -> str:
        """Character and eigenvalue."""
        return f"{self.named.character}: {_place(self)}"

    def __repr__(self) -> str:
        """Name, character and eigenvalue on one line."""
        return f"Mode({self.named.name}, {self.place_words})"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        value = self.eigenvalue
        return {
            "name": self.name,
            "description": self.description,
            "eigenvalue": None if value is None else [value.real, value.imag],
            "root": [self.root.real, self.root.imag],
            **{each.name.replace(" ", "_"): each.to_dict() for each in self.quantities},
            "participations": {each.state: each.to_dict() for each in self.participations},
            "covariance": None if self.covariance is None else self.covariance.tolist(),
            "reason": self.reason,
        }


def _place(mode: Mode) -> str:
    value = mode.root if mode.eigenvalue is None else mode.eigenvalue
    unit = " in z" if mode.eigenvalue is None else " rad/s"
    return f"{value.real:.4g}" + (f" ± {value.imag:.4g}i" if value.imag else "") + unit


@dataclass(frozen=True, repr=False, eq=False)
class Modes(Result, schema="flightid.modes/1"):
    """Result of `flightid.modes`.

    Attributes
    ----------
    name : str
        The model's.
    modes : tuple of Mode
        Slowest first; those without continuous counterpart last.
    sample_time_s : float or None
        Of a sampled model.
    reason : str
        Why no mode has an interval; empty where there is a covariance.
    findings : tuple of Finding

    Example
    -------
    >>> import flightid as fid
    >>> found = fid.modes(fid.load_model("fixed_wing_lateral"))
    >>> found
    Modes('Fixed wing, lateral-directional': 4 eigenvalues, least damping 0.204, stable)
    >>> [mode.name for mode in found]
    ['spiral', 'Dutch roll', 'roll']
    """

    name: str
    modes: tuple[Mode, ...]
    sample_time_s: float | None
    reason: str = ""
    findings: tuple[Finding, ...] = ()

    def __iter__(self) -> Iterator[Mode]:
        return iter(self.modes)

    def __len__(self) -> int:
        return len(self.modes)

    def mode(self, name: str) -> Mode:
        """The first mode of a name.

        Parameters
        ----------
        name : str
            Its name, or the start of it.

        Raises
        ------
        UnknownNameError
            There is no such mode.
        """
        for each in self.modes:
            if each.name.startswith(name):
                return each
        raise UnknownNameError(
            "there is no such mode", found=repr(name), needed=", ".join(m.name for m in self.modes)
        )

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """All eigenvalues with their conjugates, rad/s; those without counterpart left out."""
        found = []
        for mode in self.modes:
            if mode.eigenvalue is not None:
                found += [mode.eigenvalue]
                found += [mode.eigenvalue.conjugate()] if mode.is_pair else []
        return np.array(found, dtype=np.complex128)

    @property
    def damping(self) -> NDArray[np.float64]:
        """Damping ratio of each mode, shape (n_modes,); NaN where it has none."""
        return _values([mode.damping_ratio for mode in self.modes])

    @property
    def natural_frequency_rad_s(self) -> NDArray[np.float64]:
        """Natural frequency of each mode, rad/s, shape (n_modes,); NaN where it has none."""
        return _values([mode.natural_frequency for mode in self.modes])

    @property
    def is_stable(self) -> bool:
        """Whether no root lies right of the imaginary axis, or outside the unit circle."""
        if self.sample_time_s is None:
            return all(mode.root.real <= 0.0 for mode in self.modes)
        return all(abs(mode.root) <= 1.0 for mode in self.modes)

    def table(self, *, level: float | None = None) -> Table:
        """Table of all modes; ± is half an interval, or the interval where it is not even.

        Parameters
        ----------
        level : float, optional
            Of the intervals.
        """
        level = shown(level)
        columns = (
            Column("mode"),
            Column("real", "rad/s"),
            Column("±", "rad/s", 2),
            Column("ω_n", "rad/s"),
            Column("±", "rad/s", 2),
            Column("f_n", "Hz", 4),
            Column("corner", "Hz", 4),
            Column("ζ", digits=3),
            Column("±", digits=2),
            Column("period", "s"),
            Column("time constant", "s"),
            Column("to half", "s"),
            Column("to double", "s"),
            Column(interval_words(level), "s"),
        )
        moving, delays = delays_apart(self.modes)
        rows = [_row(mode, level) for mode in moving] + _delay_rows(delays, level)
        table = Table(f"Modes of {self.name}", columns, tuple(rows), self._notes(level))
        return table.without_empty_columns()

    def _notes(self, level: float) -> tuple[str, ...]:
        # What a mode is would be a column of ten lines beside so many numbers.
        moving, delays = delays_apart(self.modes)
        notes = [f"{mode.description}." for mode in (*moving, *delays[:1])]
        if len(delays) > 1:
            notes[-1] = f"{len(delays)} {ORIGIN}: {EACH_ONE_SAMPLE}."
        notes.append("One line for a complex pair.")
        if not all(mode.is_pair for mode in moving):
            notes.append("Corner: where a real pole's gain bends, its size over 2π.")
        if self.reason:
            notes.append(f"No intervals: {self.reason}.")
        else:
            words = interval_words(level)
            notes.append(f"± is half a {words} interval; the last times have their whole interval.")
            notes += [f"{m.name}: {m.reason}." for m in delays_apart(self.modes)[0] if m.reason]
        if self.sample_time_s is not None:
            notes.append(f"From the z plane by s = ln z / T, T = {self.sample_time_s:.4g} s.")
        return (*notes, *map(str, self.findings))

    def participation_table(self, *, level: float | None = None) -> Table:
        """Table of states by mode: share, and size in the eigenvector with its phase.

        Parameters
        ----------
        level : float, optional
            Of the intervals, half of which is ±.
        """
        level = shown(level)
        columns = (
            Column("mode"),
            Column("state"),
            Column("participation", "%", 3),
            Column("±", "%", 2),
            Column("size, leading state 1", digits=3),
            Column("±", digits=2),
            Column("unit"),
            Column("phase", "deg", 3),
        )
        rows: list[tuple[Cell, ...]] = []
        for mode in self.modes:
            for each in mode.participations:
                if (each.share.value or 0.0) < LEAST_SHOWN:
                    continue
                share = (100.0 * (each.share.value or 0.0), _percent(each.share.half(level)))
                size = (each.size.value, each.size.half(level), each.unit)
                rows.append(
                    (mode.name, each.state, *share, *size, float(np.degrees(each.phase_rad)))
                )
        notes = (
            "Participation: size of the factor wᵢvᵢ over the sum of the sizes, free of units.",
            f"States below {100 * LEAST_SHOWN:.0f} % are left out; phase against the leading "
            "state.",
        )
        return Table(
            f"Participation of the states, {self.name}", columns, tuple(rows), notes
        ).without_empty_columns()

    def summary(self, *, level: float | None = None) -> Table:
        """Same as `table`."""
        return self.table(level=level)

    def __repr__(self) -> str:
        """Size, least damping of the pairs and stability on one line."""
        count = sum(2 if mode.is_pair else 1 for mode in self.modes)
        pairs = [m.damping_ratio.value for m in self.modes if m.is_pair]
        known = [value for value in pairs if value is not None]
        least = f", least damping {min(known):.3g}" if known else ""
        stable = "stable" if self.is_stable else "unstable"
        plural = "" if count == 1 else "s"
        return f"Modes({self.name!r}: {count} eigenvalue{plural}{least}, {stable})"


def _delay_rows(found: list[Mode], level: float) -> list[tuple[Cell, ...]]:
    """Poles at the origin, which have no numbers of their own, in one row."""
    rows = [_row(mode, level) for mode in found[:1]]
    if len(found) > 1:
        return [(f"{len(found)} {ORIGIN}", *row[1:]) for row in rows]
    return rows


def _values(quantities: list[Reading]) -> NDArray[np.float64]:
    return np.array([np.nan if q.value is None else q.value for q in quantities])


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def _row(mode: Mode, level: float) -> tuple[Cell, ...]:
    pair = mode.is_pair
    last = mode.time_to_half if mode.time_to_half.value is not None else mode.time_to_double
    interval = last.range_words(level, 3)
    numbers: list[Cell] = []
    for each, there in (
        (mode.real, True),
        (mode.natural_frequency, pair),
        (mode.damping_ratio, pair),
    ):
        numbers += [each.value, each.half(level)] if there else [None, None]
    hertz = (mode.natural_frequency.value or 0.0) / math.tau or None
    numbers[-2:-2] = [hertz, None] if pair else [None, hertz]
    times = (mode.period, mode.time_constant, mode.time_to_half, mode.time_to_double)
    return (mode.name, *numbers, *(each.value for each in times), interval)
