"""Fleets that break what drift assumes, drawn by NumPy; `fleet_statistics` counts each once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from flightid.fleet.statistics.drift import FleetDrift, find_drift
from flightid.fleet.statistics.flight_estimates import FlightEstimates

DAY_S = 86400.0
VEHICLES, FLEETS = 200, 100


@dataclass(frozen=True)
class BrokenFleet:
    """A fleet with a flight every three days, errors told as `least` to 5 % of the parameter.

    Errors are `understated` times as large, flights differ by `spread` more, all move by `season`
    in a sine over the whole time, and the last flights of the last vehicles by `change`. Errors of
    the first vehicle are `first_understated` times as large again. Of `a_day` flights on each third
    day all share `days`, correlated from day to day by `memory`. Errors that are `relative` are of
    that size, and told of each estimate.
    """

    vehicles: int = VEHICLES
    flights: int = 40
    least: float = 0.02
    understated: float = 1.0
    spread: float = 0.0
    season: float = 0.0
    change: float = 0.0
    changed: int = 0
    last: int = 14
    first_understated: float = 1.0
    a_day: int = 1
    days: float = 0.0
    relative: float | None = None
    memory: float = 0.0

    def drift(self, seed: int) -> FleetDrift:
        """What is found of one drawn fleet."""
        rng, shape = np.random.default_rng(seed), (self.vehicles, self.flights)
        base = 10.0 * (1.0 + 0.1 * rng.normal(size=(self.vehicles, 1)))
        errors = rng.uniform(self.least, 0.05, shape)
        if self.relative is not None:
            errors[:] = self.relative
        moved = self.understated * errors * rng.normal(size=shape)
        moved[0] *= self.first_understated
        moved += self.spread * rng.normal(size=shape)
        moved += self.season * np.sin(2.0 * np.pi * np.arange(self.flights) / self.flights)
        by_day = self.days * rng.normal(size=(self.vehicles, -(-self.flights // self.a_day)))
        for day in range(1, by_day.shape[1]):
            by_day[:, day] *= np.sqrt(1.0 - self.memory**2)
            by_day[:, day] += self.memory * by_day[:, day - 1]
        moved += np.repeat(by_day, self.a_day, axis=1)[:, : self.flights]
        moved[self.vehicles - self.changed :, self.flights - self.last :] += self.change
        sized = base if self.relative is None else base * (1.0 + moved)
        flight = np.arange(self.flights)
        time_s = DAY_S * (3.0 * (flight // self.a_day) + 0.1 * (flight % self.a_day))
        return find_drift(
            FlightEstimates.of(
                ["gain"],
                np.repeat([f"{i:03}" for i in range(self.vehicles)], self.flights).tolist(),
                (base * (1.0 + moved)).reshape(-1, 1),
                ((sized * errors) ** 2).reshape(-1, 1, 1),
                time_s=np.tile(time_s, self.vehicles),
            )
        )

    def told(self, seed: int) -> str:
        """Alarms without change, and what is found of changes, in words."""
        found, sound = self.drift(seed), self.vehicles - self.changed
        hit = [each for each in found.alarms if int(each.vehicle) >= sound]
        said = f"{len(found.alarms) - len(hit)} of {sound} alarmed without change"
        off = [int(each.vehicle) >= sound for each in found.newest_off]
        said += f", newest flight off of {off.count(False)}"
        if not self.changed:
            return said
        ends = [each.change_percent.interval95 or (np.inf, -np.inf) for each in hit]
        held = sum(low <= 100.0 * self.change <= high for low, high in ends)
        said += f"; {len(hit)} of {self.changed} found, size held of {held}"
        return f"{said}, newest flight off of {off.count(True)}"


def broken_fleets() -> Iterator[tuple[str, BrokenFleet]]:
    """Fleets of 200 vehicles by what they break."""
    wide = BrokenFleet(least=0.005, spread=0.03)
    wider = BrokenFleet(least=0.01, spread=0.05)
    season = BrokenFleet(season=0.03)
    step = {"change": 0.1, "changed": 20}
    yield "flights differ by 3 %, errors 0.5 to 5 %", wide
    yield "the same, step of 10 %", replace(wide, **step)
    yield "flights differ by 5 %, errors 1 to 5 %", wider
    yield "the same, step of 10 %", replace(wider, **step)
    yield "season of 1.5 %", replace(season, season=0.015)
    yield "season of 3 %", season
    yield "the same, step of 10 %", replace(season, **step)
    yield "step of 10 % of 40 %", BrokenFleet(change=0.1, changed=80)
    yield "step of 10 % of 70 %", BrokenFleet(change=0.1, changed=140)
    yield "step of 10 % of 95 %", BrokenFleet(change=0.1, changed=190)
    yield "step of 10 % of all", BrokenFleet(change=0.1, changed=200)
    for last in (1, 2, 3):
        for change in (-0.1, -0.2, -0.3):
            words = f"{change:+.0%} in the last {last} of 20 flights"
            yield words, BrokenFleet(flights=20, change=change, changed=100, last=last)


def small_fleets() -> Iterator[tuple[str, BrokenFleet]]:
    """Fleets of one to eight vehicles, of which 100 of each are drawn."""
    for vehicles, flights, understated in (
        (1, 12, 1.0), (1, 12, 2.0), (1, 20, 2.0), (2, 10, 2.0), (3, 7, 2.0), (8, 12, 1.0),
    ):  # fmt: skip
        words = f"{vehicles} of {flights} flights, errors understated by {understated:g}"
        yield words, BrokenFleet(vehicles, flights, understated=understated)
    for vehicles, flights, first in ((6, 20, 2.0), (6, 20, 3.0), (20, 12, 2.0)):
        words = f"{vehicles} of {flights} flights, errors of one understated by {first:g}"
        yield words, BrokenFleet(vehicles, flights, first_understated=first)
    yield "8 of 12 flights, season of 3 %", BrokenFleet(8, 12, season=0.03)
    for vehicles, days in ((10, 0.0), (10, 0.04), (1, 0.04)):
        words = f"{vehicles} of 24 flights, two a day, days differ by {days:.0%}"
        yield words, BrokenFleet(vehicles, 24, a_day=2, days=days)
    for a_day, days, memory in ((1, 0.04, 0.5), (1, 0.05, 0.9), (2, 0.04, 0.5), (2, 0.05, 0.9)):
        words = f"10 of 24 flights, {a_day} a day, days differ by {days:.0%} and go on by {memory}"
        yield words, BrokenFleet(10, 24, a_day=a_day, days=days, memory=memory)
    for relative in (0.1, 0.2):
        words = f"10 of 20 flights, errors {relative:.0%} of each estimate"
        yield words, BrokenFleet(10, 20, relative=relative)
    yield "1 of 12 flights, step of 10 %", BrokenFleet(1, 12, change=0.1, changed=1, last=5)


def fleets_alarmed(fleet: BrokenFleet) -> str:
    """Of how many small fleets any vehicle is alarmed, or its newest flight off, in words."""
    found = [fleet.drift(seed) for seed in range(FLEETS)]
    alarmed = sum(bool(each.alarms) for each in found)
    off = sum(bool(each.newest_off) for each in found)
    return f"{alarmed} of {FLEETS} fleets with an alarm, {off} with a newest flight off"
