"""Alarms without change, what is found of changes, and what all vehicles share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.fleet_counts.drawing import (
    DAY_S,
    Fleet,
    stepped,
    stepped_at_own_flights,
    worn,
    worn_from_own_dates,
)
from benchmarks.fleet_counts.sections import Section, Words, percent
from flightid.conventions import Light
from flightid.fleet.statistics.answers import TypeAnswers
from flightid.fleet.statistics.change_kind import DRIFT, STEP
from flightid.fleet.statistics.drift import FleetDrift
from flightid.fleet.statistics.events import FleetEvent
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.vehicle_lights import vehicle_light

QUIET = (
    Fleet(10, 24), Fleet(10, 24, a_day=2), Fleet(10, 24, a_day=2, days=0.04),
    Fleet(1, 24, a_day=2, days=0.04), Fleet(3, 24, a_day=4, days=0.08),
    Fleet(4, 24, a_day=6, days=0.08),
    Fleet(10, 24, days=0.04, memory=0.5), Fleet(10, 24, days=0.05, memory=0.9),
    Fleet(10, 24, a_day=2, days=0.05, memory=0.9), Fleet(6, 12, days=0.05, memory=0.9),
    Fleet(6, 12, a_day=2, days=0.05, memory=0.9), Fleet(3, 16, days=0.04, memory=0.8),
    Fleet(4, 10, days=0.05, memory=0.9), Fleet(1, 16, days=0.05, memory=0.9),
    Fleet(6, 9, days=0.05, memory=0.9), Fleet(3, 8, days=0.05, memory=0.9),
    Fleet(6, 20, days=0.04, memory=0.8), Fleet(12, 14, season=0.06), Fleet(2, 12, season=0.06),
    Fleet(3, 12, season=0.06), Fleet(4, 12, season=0.06),
    Fleet(10, 20, errors=(0.2, 0.2), relative=True),
    Fleet(10, 20, errors=(0.1, 0.6), relative=True),
)  # fmt: skip
CHANGED = (
    (Fleet(10, 24), 0.05, 2, 8), (Fleet(10, 24), 0.1, 2, 8), (Fleet(10, 24), 0.2, 2, 8),
    (Fleet(10, 24), 0.1, 5, 8), (Fleet(10, 24, a_day=2), 0.1, 2, 8),
    (Fleet(10, 24, a_day=2, days=0.02), 0.1, 2, 8), (Fleet(10, 24, a_day=2, days=0.04), 0.1, 2, 8),
    (Fleet(6, 12), 0.1, 1, 6), (Fleet(6, 12), 0.2, 1, 6), (Fleet(3, 16), 0.1, 1, 8),
    (Fleet(3, 16), 0.2, 1, 8), (Fleet(6, 9), 0.1, 1, 4), (Fleet(6, 9), 0.2, 1, 4),
    (Fleet(1, 12), 0.1, 1, 5), (Fleet(6, 24, a_day=4, days=0.04), 0.15, 1, 12),
    (Fleet(10, 24), 0.3, 1, 9), (Fleet(10, 24, days=0.05, memory=0.9), 0.3, 1, 9),
    (Fleet(4, 20), 0.15, 2, 8), (Fleet(4, 12, season=0.06), -0.2, 1, 6),
    (Fleet(10, 24, season=0.06), 0.1, 1, 8),
)  # fmt: skip
SHARED = (
    ("nothing", Fleet(6, 12), None, 0.0), ("nothing", Fleet(5, 12), None, 0.0),
    ("nothing", Fleet(8, 12), None, 0.0), ("nothing", Fleet(30, 24), None, 0.0),
    ("step of 10 % of 3", Fleet(6, 12), stepped(-0.1, 3, 6), -10.0),
    ("step of 10 % of 4", Fleet(6, 12), stepped(-0.1, 4, 6), -10.0),
    ("step of 5 % of all", Fleet(6, 12), stepped(-0.05, 6, 6), -5.0),
    ("step of 10 % of all", Fleet(6, 12), stepped(-0.1, 6, 6), -10.0),
    ("step of 8 % of all", Fleet(12, 24), stepped(-0.08, 12, 10), -8.0),
    ("step of 8 % of all", Fleet(30, 24), stepped(-0.08, 30, 10), -8.0),
    ("wear by 10 % of all", Fleet(6, 12), worn(-0.1), -10.0),
    ("wear by 20 % of all", Fleet(6, 12), worn(-0.2), -20.0),
    ("wear by 30 % of all", Fleet(6, 24), worn(-0.3), -30.0),
    ("season of 6 %", Fleet(6, 12, season=0.06), None, 0.0),
    ("season of 3 %", Fleet(30, 40, season=0.03), None, 0.0),
)  # fmt: skip


def alarms(fleets: int) -> Section:
    """Fleets of which no vehicle changes."""

    def rows() -> Iterator[Words]:
        for fleet in QUIET:
            lights = [vehicle_lights(fleet.drift(seed), fleet) for seed in range(fleets)]
            counts = (sum(light in each for each in lights) for light in (Light.RED, Light.AMBER))
            yield fleet.words, *(f"{count} of {fleets}" for count in counts)

    return Section(("fleet", "with a red vehicle", "with an amber one"), rows)


def steps(fleets: int) -> Section:
    """Fleets of which the first vehicles step."""

    def rows() -> Iterator[Words]:
        for fleet, size, vehicles, last in CHANGED:
            moved = replace(fleet, moved=stepped(size, vehicles, last))
            found = [moved.drift(1000 + seed) for seed in range(fleets)]
            lights = [vehicle_lights(each, moved) for each in found]
            said = Counter(light for each in lights for light in each[:vehicles])
            told = [each.count(Light.RED) for each in lights]
            false = [each[vehicles:].count(Light.RED) for each in lights]
            share = np.mean([few / max(every, 1) for few, every in zip(false, told, strict=True)])
            red, held = _found(found, vehicles, 100.0 * size)
            yield (
                *(fleet.words, f"{100.0 * size:g} %, {vehicles} in the last {last}"),
                *(f"{said[Light.RED]} of {vehicles * fleets}", f"{said[Light.AMBER]}"),
                f"{held} of {red}",
                f"{sum(false)} of {sum(told)}",
                f"{100.0 * float(share):.1f} %",
            )

    return Section(
        ("fleet", "step", "red", "amber", "size held", "red ones that did not change",
         "their share, mean of fleets"), rows,
    )  # fmt: skip


def vehicle_lights(drift: FleetDrift, fleet: Fleet) -> list[Light]:
    """Of every vehicle of a fleet, whose changes alone were asked."""
    names = [f"{i:03}" for i in range(fleet.vehicles)]
    one = np.ones((len(names), 1, 1))
    data = FlightEstimates.of(["gain"], names, one[:, 0], one)
    answered = [TypeAnswers("type", "model", data, None, None, drift)]
    return [vehicle_light(name, answered).light for name in names]


def _found(found: list[FleetDrift], vehicles: int, size: float) -> tuple[int, int]:
    """Changed vehicles that are red, and whose size is held."""
    red = [h for each in found for h in each.alarms if int(h.vehicle) < vehicles]
    ends = [each.change_percent.interval95 or (np.inf, -np.inf) for each in red]
    return len(red), sum(low <= size <= high for low, high in ends)


def shared(fleets: int) -> Section:
    """What is said of what all vehicles do by date."""

    def rows() -> Iterator[Words]:
        for words, fleet, moved, size in SHARED:
            drawn = replace(fleet, moved=moved, errors=(0.03, 0.03))
            found = [drawn.drift(2000 + seed) for seed in range(fleets)]
            said: Counter[str] = Counter()
            held: list[bool] = []
            for one in (each for drift in found for each in drift.shared):
                told = [one.change] if one.is_step else []
                told += [one.trend.change] if one.trend is not None else []
                ends = [each.interval95 or (np.inf, -np.inf) for each in told]
                held += [any(low <= size <= high for low, high in ends)] if told else []
                name = "either" if len(told) > 1 else "wear" if one.trend else "step"
                said[name if told else "moved"] += 1
            lights = [vehicle_lights(each, drawn) for each in found]
            red = sum(Light.RED in each for each in lights)
            counts = tuple(f"{said[name]}" for name in ("step", "wear", "either", "moved"))
            amount = f"{sum(held)} of {len(held)}" if size and held else ""
            yield words, f"{fleet.vehicles} × {fleet.flights}", *counts, amount, f"{red}"

    return Section(
        ("what happens", f"of {fleets} fleets", "step", "wear", "either", "moved by date",
         "size held", "a vehicle red"), rows,
    )  # fmt: skip


def kinds(fleets: int) -> Section:
    """Whether a change was at once or gradually, and the size of a drift."""

    def rows() -> Iterator[Words]:
        for n in (12, 40):
            for size in (-0.05, -0.1, -0.2, -0.3):
                for name, moved in (
                    ("step", stepped_at_own_flights),
                    ("wear", worn_from_own_dates),
                ):
                    drawn = Fleet(20, n, moved=moved(size, 5))
                    every = [drawn.drift(3000 + seed).alarms for seed in range(fleets)]
                    found = [h for each in every for h in each if int(h.vehicle) < 5]
                    said = Counter(each.kind for each in found)
                    ends = [h.change_percent.interval95 or (np.inf, -np.inf) for h in found]
                    held = [low <= 100.0 * size <= high for low, high in ends]
                    yield (
                        *(
                            f"{name} by {-100.0 * size:g} %",
                            f"{n}",
                            f"{len(found)} of {5 * fleets}",
                        ),
                        *(f"{said[STEP]}", f"{said[DRIFT]}", f"{said['changed']}"),
                        f"{percent(sum(held), len(held))} of {len(held)}",
                    )

    return Section(
        ("what happens to 5 of 20", "flights", "found", "at once", "gradually", "changed",
         "size held"), rows,
    )  # fmt: skip


def events(fleets: int) -> Section:
    """Events that did nothing, and one that did."""

    def rows() -> Iterator[Words]:
        at = 12 * 3.0 * DAY_S - 1.0
        asked = [FleetEvent("motor", at, (f"{i:03}",)) for i in range(3)]
        for fleet in (QUIET[0], QUIET[6], QUIET[7]):
            for size in (0.0, 0.1):
                drawn = replace(fleet, moved=stepped(size, 1, 12))
                found = [drawn.drift(4000 + seed, asked) for seed in range(fleets)]
                told = [[h.vehicle for h, _ in each.by_event] for each in found]
                others = sum(bool({*each} - ({"000"} if size else set())) for each in told)
                did = f"{sum('000' in each for each in told)} of {fleets}" if size else ""
                ends = [
                    next(h for h in each.histories if h.vehicle == "000").events[0].percent
                    for each in found
                ]
                held = [
                    low <= 100.0 * size <= high
                    for low, high in (each.interval95 or (np.inf, -np.inf) for each in ends)
                ]
                yield (
                    *(fleet.words, f"{100.0 * size:g} %", did),
                    *(f"{others} of {fleets}", f"{percent(sum(held), len(held))} of {fleets}"),
                )

    return Section(
        ("fleet, three events of a vehicle each", "what the first did", "told",
         "one told that did nothing", "interval of the first holds"), rows,
    )  # fmt: skip
