"""The noun: tuned gains flown again, with what they promised beside what the flight shows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from flightid.control.margins.margins import Margins
from flightid.control.tuning.worst_cases import to_the_worse
from flightid.conventions import Light
from flightid.findings import MOST_DIGITS, SHOWN_DIGITS, Finding
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import LEVEL, interval_words

SATURATED = 0.99
"""Of the full command: beyond it the mixer gives no more."""


@dataclass(frozen=True, eq=False)
class FlownMargin:
    """One number of one loop, promised and measured.

    Attributes
    ----------
    axis, loop, name : str
    promised : Estimate
        Of the identified model, with the middle 95 % of all plants that the data allow.
    worst : float or None
        Of those plants.
    before : float or None
        Of the identified model with the gains that flew first.
    measured : Estimate
        In the flight with the new gains.
    required : str
        Empty where nothing was.
    slack : float or None
        Of the requirement, at the end of the measured interval that meets it best; below 0 it is
        broken.
    digits : int
        How many show the worst on the side of what is required that it is on.
    """

    axis: str
    loop: str
    name: str
    promised: Reading
    worst: float | None
    before: float | None
    measured: Reading
    required: str = ""
    slack: float | None = None
    digits: int = SHOWN_DIGITS

    @property
    def agrees(self) -> bool | None:
        """Whether both 95 % intervals meet; None where one is missing."""
        ends = (self.promised.interval95, self.measured.interval95)
        if ends[0] is None or ends[1] is None:
            return None
        return ends[1][0] <= ends[0][1] and ends[0][0] <= ends[1][1]

    @property
    def shown_worst(self) -> float | None:
        """The worst at its digits, rounded to the worse."""
        return to_the_worse(self.name, self.worst, self.promised.value, self.digits)

    @property
    def words(self) -> str:
        """Both numbers in words."""
        shown = [
            "none" if each.value is None else f"{each.value:.3g}"
            for each in (self.promised, self.measured)
        ]
        unit = "" if self.promised.unit == "1" else f" {self.promised.unit}"
        return f"{self.axis}, {self.loop}: {self.name} {shown[0]} promised, {shown[1]}{unit} flown"

    def to_dict(self) -> dict[str, object]:
        """Plain values."""
        told = {"promised": self.promised.to_dict(), "measured": self.measured.to_dict()}
        return {**vars(self), **told, "agrees": self.agrees}


@dataclass(frozen=True, eq=False, repr=False)
class GainFlight(Result, schema="flightid.gain_flight/1"):
    """Result of `flightid.vehicles.fly_gains`.

    Attributes
    ----------
    gains : mapping of str to float
        What flew, by the autopilot's names.
    margins : tuple of FlownMargin
    loops : mapping of str to Margins
        Measured broken loops by ``"axis, loop"``.
    largest_command : mapping of str to float
        By axis, before any sweep and with the stick in the middle, of the full command.
    lost : mapping of str to str
        Loops that could not be measured, by ``"axis, loop"``, with the reason.

    Example
    -------
    >>> GainFlight({}, (), {}, {}, {})
    GainFlight(0 gains, 0 of 0 pairs of 95 % intervals meet)
    """

    gains: Mapping[str, float]
    margins: tuple[FlownMargin, ...]
    loops: Mapping[str, Margins]
    largest_command: Mapping[str, float]
    lost: Mapping[str, str]

    @property
    def judged(self) -> tuple[FlownMargin, ...]:
        """Numbers that have both intervals."""
        return tuple(each for each in self.margins if each.agrees is not None)

    @property
    def meeting(self) -> int:
        """How many pairs of 95 % intervals meet."""
        return int(np.sum([bool(each.agrees) for each in self.judged]))

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Whether the vehicle stays quiet, keeps the requirements, and is as promised."""
        found = [
            Finding("not-flown", Light.RED, f"{name} was not measured: {why}",
                    "do not fly these gains: the simulated vehicle does not stand them")
            for name, why in self.lost.items()
        ]  # fmt: skip
        found += [
            Finding("saturated", Light.RED,
                    f"{axis}: hands off, the command reaches {100.0 * size:.0f} % of what there is",
                    "do not fly these gains: the vehicle oscillates, and no margin counts")
            for axis, size in self.largest_command.items() if size >= SATURATED
        ]  # fmt: skip
        broken = [each for each in self.margins if each.slack is not None and each.slack < 0.0]
        found += [
            Finding("requirement-broken", Light.RED, f"{each.words}; required {each.required}",
                    "do not fly these gains: identify what the model lacks")
            for each in broken
        ]  # fmt: skip
        if self.margins and not broken and not found:
            said = "the simulated vehicle keeps every requirement that was measured"
            found.append(Finding("requirements-flown", Light.GREEN, said))
        if not self.margins and not found:
            said = "nothing was promised of a loop that a sweep shows"
            found.append(
                Finding(
                    "not-measured", Light.UNKNOWN, said, "tune the angle loop too, angle_loop=True"
                )
            )
        apart = [each for each in self.judged if not each.agrees]
        said = f"{self.meeting} of {len(self.judged)} pairs of 95 % intervals meet"
        if apart:
            named = "; ".join(each.words for each in apart)
            action = "look for what the model lacks: promises are its own"
            found.append(Finding("promise-missed", Light.AMBER, f"{said}; not: {named}", action))
        elif self.judged:
            found.append(Finding("promise-kept", Light.GREEN, said))
        return tuple(found)

    def __repr__(self) -> str:
        """Gains and agreement on one line."""
        pairs = f"{self.meeting} of {len(self.judged)} pairs of 95 % intervals meet"
        return f"GainFlight({len(self.gains)} gains, {pairs})"

    def summary(self, *, level: float = LEVEL) -> Table:
        """Promised beside flown.

        Parameters
        ----------
        level : float
            Of the intervals.
        """
        words = interval_words(level)
        columns = (
            *(Column("axis"), Column("loop"), Column("quantity"), Column("required")),
            *(Column("old gains", digits=3), Column("promised", digits=3)),
            *(Column(f"{words} low", digits=3), Column(f"{words} high", digits=3)),
            *(Column("worst", digits=MOST_DIGITS), Column("flown", digits=3)),
            *(Column("flown, low", digits=3), Column("flown, high", digits=3)),
            *(Column("unit"), Column("agree")),
        )
        rows: list[tuple[Cell, ...]] = []
        for each in self.margins:
            low, high = each.promised.interval(level) or (None, None)
            least, most = each.measured.interval(level) or (None, None)
            rows.append(
                (
                    *(each.axis, each.loop, each.name, each.required, each.before),
                    *(each.promised.value, low, high),
                    *(each.shown_worst, each.measured.value),
                    *(least, most, each.promised.unit, each.agrees),
                )
            )
        notes = (
            "Old gains: of the identified model. Promised: of it with the new gains, with the "
            f"middle {words} of the plants that the data allow. Flown: measured from sweeps of the "
            f"nonlinear simulation with the new gains, {words} of that measurement.",
            *map(str, self.findings),
        )
        return Table("Promised and flown", columns, tuple(rows), notes)
