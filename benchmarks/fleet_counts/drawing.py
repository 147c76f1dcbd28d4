"""Fleets of one parameter, drawn by NumPy alone: what a vehicle does, and what its flights tell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.drift import FleetDrift, find_drift
from flightid.fleet.statistics.events import FleetEvent
from flightid.fleet.statistics.flight_estimates import FlightEstimates

Array = NDArray[np.float64]
Moved = Callable[[np.random.Generator, int, int], Array]
"""What vehicles do beside noise, in shares of their level, shape (vehicles, flights)."""
DAY_S = 86400.0
APART_DAYS = 3.0


@dataclass(frozen=True)
class Fleet:
    """Vehicles whose levels differ by a tenth, a day with flights every third day.

    Errors are drawn between `errors`, or, where `relative`, told of each estimate and drawn between
    them. All flights of a vehicle's day share `days`, correlated from day to day by `memory`; all
    vehicles move by a sine of `season` over the whole time.
    """

    vehicles: int
    flights: int
    errors: tuple[float, float] = (0.02, 0.05)
    a_day: int = 1
    days: float = 0.0
    memory: float = 0.0
    season: float = 0.0
    relative: bool = False
    moved: Moved | None = None

    @property
    def words(self) -> str:
        """Sizes, and what is no change."""
        parts = [f"{self.vehicles} × {self.flights}"]
        parts += [f"{self.a_day} a day"] if self.a_day > 1 else []
        if self.errors != (0.02, 0.05):
            low, high = (f"{100.0 * each:g}" for each in self.errors)
            size = f"{low} %" if low == high else f"{low} to {high} %"
            parts.append(f"errors {size}{' of each estimate' if self.relative else ''}")
        if self.days:
            going = f" that go on by {self.memory:g}" if self.memory else ""
            parts.append(f"days of {100.0 * self.days:g} %{going}")
        parts += [f"season of {100.0 * self.season:g} %"] if self.season else []
        return ", ".join(parts)

    def estimates(self, seed: int) -> FlightEstimates:
        """One drawn fleet."""
        rng, shape = np.random.default_rng((seed, self.vehicles, self.flights)), self._shape
        errors = rng.uniform(*self.errors, shape)
        share = errors * rng.normal(size=shape)
        share += self.season * np.sin(2.0 * np.pi * np.arange(self.flights) / self.flights)
        by_day = self.days * rng.normal(size=(self.vehicles, -(-self.flights // self.a_day)))
        for day in range(1, by_day.shape[1]):
            by_day[:, day] *= np.sqrt(1.0 - self.memory**2)
            by_day[:, day] += self.memory * by_day[:, day - 1]
        share += np.repeat(by_day, self.a_day, axis=1)[:, : self.flights]
        level = 10.0 * (1.0 + 0.1 * rng.normal(size=(self.vehicles, 1)))
        if self.moved is not None:
            level = level * (1.0 + self.moved(rng, self.vehicles, self.flights))
        values = level * (1.0 + share)
        told = (values if self.relative else level) * errors
        flight = np.arange(self.flights)
        time_s = DAY_S * (APART_DAYS * (flight // self.a_day) + 0.1 * (flight % self.a_day))
        return FlightEstimates.of(
            ["gain"],
            np.repeat([f"{i:03}" for i in range(self.vehicles)], self.flights).tolist(),
            values.reshape(-1, 1),
            (told**2).reshape(-1, 1, 1),
            time_s=np.tile(time_s, self.vehicles),
        )

    def drift(self, seed: int, events: Sequence[FleetEvent] = ()) -> FleetDrift:
        """What is found of one drawn fleet."""
        return find_drift(self.estimates(seed), events=events)

    @property
    def _shape(self) -> tuple[int, int]:
        return self.vehicles, self.flights


def stepped(size: float, vehicles: int, last: int) -> Moved:
    """The last flights of the first vehicles, at once."""

    def moved(rng: np.random.Generator, every: int, flights: int) -> Array:
        del rng
        share = np.zeros((every, flights))
        share[:vehicles, flights - last :] = size
        return share

    return moved


def worn(size: float) -> Moved:
    """All vehicles on the same dates, from the first flight to the last."""

    def moved(rng: np.random.Generator, every: int, flights: int) -> Array:
        del rng
        return np.tile(size * np.arange(flights) / (flights - 1), (every, 1))

    return moved


def worn_from_own_dates(size: float, vehicles: int) -> Moved:
    """The first vehicles, each from a flight in the first half of its own on."""

    def moved(rng: np.random.Generator, every: int, flights: int) -> Array:
        start = rng.integers(0, flights // 2, (every, 1))
        share = size * np.clip((np.arange(flights) - start) / (flights - 1 - start), 0.0, 1.0)
        share[vehicles:] = 0.0
        return share

    return moved


def stepped_at_own_flights(size: float, vehicles: int) -> Moved:
    """The first vehicles, each at a flight of its own with three or more on either side."""

    def moved(rng: np.random.Generator, every: int, flights: int) -> Array:
        start = rng.integers(3, flights - 2, (every, 1))
        share = size * (np.arange(flights) >= start).astype(np.float64)
        share[vehicles:] = 0.0
        return share

    return moved
