"""Counting: how often printed intervals hold the truth, and how often green stands by a miss."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field

import numpy as np

import flightid as fid

NOMINAL, Z = 0.95, 3.3
"""Of intervals, and standard deviations of chance that a count may lie off."""


@dataclass(frozen=True)
class Reading:
    """One printed number beside its truth; no interval where none was printed."""

    name: str
    truth: float
    value: float
    stderr: float | None = None
    interval95: tuple[float, float] | None = None
    amounts: Mapping[str, float] = field(default_factory=dict)
    """By how much each other hold would move it, as said beside a light that is not green."""

    def holds_as(self, hold: str) -> bool | None:
        """Whether the interval, or the same moved by the amount of a hold, holds the truth."""
        if self.interval95 is None:
            return None
        low, high = (end - self.truth for end in self.interval95)
        return any(low <= -by <= high for by in (0.0, self.amounts.get(hold, 0.0)))

    @property
    def holds(self) -> bool | None:
        """Whether the interval holds the truth; None where there is none."""
        if self.interval95 is None:
            return None
        low, high = self.interval95
        return low <= self.truth <= high


@dataclass(frozen=True)
class Trial:
    """What one flight gave: readings, its light, seconds, and a typed refusal if there was one."""

    readings: tuple[Reading, ...] = ()
    light: str = ""
    seconds: float = 0.0
    refusal: str = ""

    @property
    def green_and_missed(self) -> bool:
        """Green beside at least one interval that misses."""
        return self.light == "green" and any(r.holds is False for r in self.readings)

    @property
    def shown(self) -> int:
        """Intervals beside a green light."""
        held = [r.holds for r in self.readings if r.holds is not None]
        return len(held) if self.light == "green" else 0


@dataclass(frozen=True)
class Case:
    """A condition: its name, and what a seed's flight gives there."""

    name: str
    fly: Callable[[int], Trial]
    true_hold: str = ""
    """Of inputs that were told otherwise: the amount of this hold is to reach the truth, for bars
    are those of the word where the data do not contradict it."""


@dataclass(frozen=True)
class Tally:
    """A case counted over many flights."""

    name: str
    trials: tuple[Trial, ...]

    def coverage(self, quantity: str | None = None, *, true_hold: str = "") -> tuple[float, int]:
        """Share of intervals that hold the truth, and how many intervals there were."""
        held = [
            r.holds_as(true_hold) if true_hold else r.holds
            for t in self.trials
            for r in t.readings
            if r.holds is not None and quantity in (None, r.name)
        ]
        return (float(np.mean(held)) if held else float("nan"), len(held))

    def rms_z(self) -> float:
        """Root mean square of error over standard error."""
        z = [
            (r.value - r.truth) / r.stderr
            for t in self.trials
            for r in t.readings
            if r.stderr is not None
        ]
        return float(np.sqrt(np.mean(np.square(z)))) if z else float("nan")

    def share(self, light: str) -> float:
        """Share of flights with that light."""
        return float(np.mean([t.light == light for t in self.trials]))

    def green_and_missed(self) -> float:
        """Share of flights with a green light beside a miss."""
        return float(np.mean([t.green_and_missed for t in self.trials]))

    def ceiling(self) -> float:
        """Share of flights with green beside a miss that chance allows sound intervals.

        Each of k intervals beside a green light misses in 5 %: independent ones, the worst there
        are, make 1 - 0.95^k of a flight, and chance over the flights adds 3.3 deviations.
        """
        missing = np.array([1.0 - NOMINAL**trial.shown for trial in self.trials])
        chance = np.sqrt(np.sum(missing * (1.0 - missing))) / max(len(missing), 1)
        return float(np.mean(missing) + Z * chance) if missing.size else float("nan")

    def refusals(self) -> float:
        """Share of flights that ended in a typed refusal."""
        return float(np.mean([bool(t.refusal) for t in self.trials]))

    def quantities(self) -> tuple[str, ...]:
        """Names of what was read, in order."""
        return tuple(dict.fromkeys(r.name for t in self.trials for r in t.readings))

    def bad_bars(self) -> int:
        """Standard errors that are zero, infinite or not a number."""
        bars = [r.stderr for t in self.trials for r in t.readings if r.stderr is not None]
        return sum(1 for bar in bars if not (np.isfinite(bar) and bar > 0))

    def row(self) -> str:
        """One line of the table."""
        share, count = self.coverage()
        seconds = float(np.median([t.seconds for t in self.trials]))
        lights = " ".join(f"{100 * self.share(c):4.0f}" for c in ("green", "amber", "red"))
        missed, refused = 100 * self.green_and_missed(), 100 * self.refusals()
        most = 100 * self.ceiling()
        above = "!" if missed > most else " "
        return (
            f"{self.name:44s} {100 * share:6.1f} {count:7d} {self.rms_z():7.2f}  {lights} "
            f"{missed:6.1f}{above}{most:6.1f} {refused:6.1f} {1e3 * seconds:8.0f} "
            f"{len(self.trials):5d}"
        )


HEADING = (
    f"{'case':44s} {'held %':>6s} {'of':>7s} {'rms z':>7s}  "
    f"{'grn':>4s} {'amb':>4s} {'red':>4s} {'g&miss':>6s} {'most':>6s} {'refuse':>6s} "
    f"{'ms':>8s} {'runs':>5s}"
)


def fit_trial(fit: Callable[[], fid.Fit], truth: Mapping[str, float]) -> Trial:
    """Run a fit and read every parameter whose truth is known; a typed error is a refusal."""
    begun = time.perf_counter()
    try:
        result = fit()
    except fid.FlightidError as error:
        return Trial(refusal=str(error), seconds=time.perf_counter() - begun)
    seconds = time.perf_counter() - begun
    readings = [
        Reading(name, value, float(p.value), p.stderr, p.interval95, amounts_of(result, name))
        for name, value in truth.items()
        if (p := result.parameters.get(name)) is not None
    ]
    return Trial(tuple(readings), str(result.evidence.light), seconds)


def amounts_of(fit: fid.Fit, name: str) -> dict[str, float]:
    """What a fit says other holds would add to an estimate; nothing where its light is green."""
    others = fit.provenance.get("other_holds")
    if str(fit.evidence.light) == "green" or not isinstance(others, Mapping):
        return {}
    return {hold: float(each["shift"].get(name, 0.0)) for hold, each in others.items()}


def count(case: Case, runs: int, *, first_seed: int = 0, jobs: int = 1) -> Tally:
    """Fly a case with consecutive seeds, in `jobs` processes."""
    seeds = range(first_seed, first_seed + runs)
    if jobs == 1:
        return Tally(case.name, tuple(case.fly(seed) for seed in seeds))
    with ProcessPoolExecutor(jobs) as pool:
        return Tally(case.name, tuple(pool.map(case.fly, seeds, chunksize=max(runs // 40, 1))))


def limits(n: int, *, nominal: float = NOMINAL, z: float = Z) -> tuple[float, float]:
    """Shares that chance allows a nominal interval over `n` independent readings."""
    slack = z * np.sqrt(nominal * (1.0 - nominal) / max(n, 1))
    return nominal - slack, nominal + slack


def table(tallies: Iterable[Tally]) -> str:
    """The cases as lines under a heading."""
    return "\n".join([HEADING, *(tally.row() for tally in tallies)])
