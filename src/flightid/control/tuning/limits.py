"""Requirements as a list: what each asks of which number of which loop, in figures and in words.

The search reads the slack and the table of worst cases reads the words, so a new requirement is a
field in `requirements.py` and its line here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from flightid.control.tuning.requirements import TuningRequirements
from flightid.findings import MOST_DIGITS, digits_apart
from flightid.frozen import dataclass

Array = NDArray[np.float64]
WHOLE, ANGLE = "whole loop", "angle loop"
TARGET = "of the target"
IN_BAND = "in the identified band"
"""Ends of names: which requirement on a number that can have several."""
TINY = 1e-12
"""In place of zero where a logarithm is taken."""


@dataclass(frozen=True)
class Limit:
    """One requirement on one number of one loop.

    Attributes
    ----------
    name : str
        Unique among the requirements of a problem: the loop, a colon, its number as tables name it,
        and which of several is meant.
    loop : str
    field : str
        Of `LoopMetrics`: the number it speaks of.
    bound : float
        What the number may be at least, or at most, in its unit.
    slack : callable
        Values of the number to slack, at least 0 where the requirement is met.
    highest : bool
        Whether the highest crossover is meant where there are several.
    most : bool
        Whether the number may be at most so much: its worst plant has the largest.
    """

    name: str
    loop: str
    field: str
    bound: float
    slack: Callable[[Array], Array]
    highest: bool = False
    most: bool = False

    @property
    def text(self) -> str:
        """In words, as the tables print it."""
        return self.told(0)

    @property
    def digits(self) -> int:
        """Of its bound: what was asked for is told as it was, what follows from data by four."""
        return 4 if self.most else 6

    def told(self, digits: int) -> str:
        """In words beside a number of so many digits."""
        return f"{'≤' if self.most else '≥'} {self.shown(digits):.{MOST_DIGITS}g}"

    def shown(self, digits: int) -> float:
        """The bound beside a number of so many digits."""
        return float(f"{self.bound:.{max(digits, self.digits)}g}")

    def digits_beside(self, value: float, *, promised: bool = True) -> int:
        """How many digits tell a number from the bound; see `flightid.findings.digits_apart`."""
        return digits_apart(
            value, self.bound, least=not self.most, of_limit=self.digits, promised=promised
        )


def limits(
    need: TuningRequirements, loops: Iterable[str], crossover_limit_rad_s: float | None
) -> tuple[Limit, ...]:
    """Every requirement on the margins and frequencies of the loops that there are.

    Parameters
    ----------
    need : TuningRequirements
    loops : iterable of str
        The innermost first; `WHOLE` and `ANGLE` where there is an angle loop.
    crossover_limit_rad_s : float or None
        Highest crossover of the innermost loop that the identified band allows, rad/s.
    """
    names = tuple(loops)
    made = [limit for loop in names for limit in _margins(need, loop)]
    if crossover_limit_rad_s is not None:
        most = crossover_limit_rad_s
        name = f"{names[0]}: crossover {IN_BAND}"
        told = (name, names[0], "crossover_rad_s", most, _below(most))
        made.append(Limit(*told, highest=True, most=True))
    return (*made, *(limit for limit in _targets(need, names[0]) if limit.loop in names))


def noise_limit(most: float) -> Limit:
    """What noise the output of the innermost loop may hold at most."""
    return Limit("output noise", "output", "noise", most, _no_more(most), most=True)


def present(values: Array) -> Array:
    """Zero in place of a frequency that is not there."""
    return np.where(np.isnan(values), TINY, values)


def _margins(need: TuningRequirements, loop: str) -> Iterator[Limit]:
    phase = need.angle_phase_margin_deg if loop == ANGLE else need.phase_margin_deg
    for name, field, least in (
        ("phase margin", "phase_margin_deg", phase),
        ("gain margin", "gain_margin_db", need.gain_margin_db),
        ("gain reduction margin", "gain_reduction_margin_db", need.gain_margin_db),
        ("delay margin", "delay_margin_s", None if loop == ANGLE else need.delay_margin_s),
    ):
        if least is not None:
            yield Limit(f"{loop}: {name}", loop, field, least, _share_above(least))
    yield Limit(
        f"{loop}: sensitivity peak",
        loop,
        "sensitivity_peak",
        need.peak,
        _peak(need.peak),
        most=True,
    )


def _targets(need: TuningRequirements, inner: str) -> Iterator[Limit]:
    for name, loop, field, least in (
        ("crossover", inner, "crossover_rad_s", need.crossover_rad_s),
        (
            "disturbance bandwidth",
            inner,
            "disturbance_bandwidth_rad_s",
            need.disturbance_bandwidth_rad_s,
        ),
        ("crossover", ANGLE, "crossover_rad_s", need.angle_crossover_rad_s),
    ):
        if least is not None:
            yield Limit(f"{loop}: {name} {TARGET}", loop, field, least, _above(least))


def _share_above(least: float) -> Callable[[Array], Array]:
    return lambda values: values / least - 1.0


def _above(least: float) -> Callable[[Array], Array]:
    return lambda values: np.log(present(values) / least)


def _below(most: float) -> Callable[[Array], Array]:
    return lambda values: np.log(most / values)


def _no_more(most: float) -> Callable[[Array], Array]:
    return lambda values: np.log(most / np.maximum(values, TINY))


def _peak(most: float) -> Callable[[Array], Array]:
    # The interval of a measured peak may reach below zero: there it is met.
    return lambda values: np.log(most / np.maximum(values, TINY)) / np.log(most)
