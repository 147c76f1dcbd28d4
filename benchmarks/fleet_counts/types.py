"""What is counted of types: intervals of odd shapes, vehicles that are unlike, least sizes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.fleet_counts.drawing import Fleet, stepped_at_own_flights
from benchmarks.fleet_counts.sections import Section, Words, percent
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.heterogeneity import VehicleEstimates
from flightid.fleet.statistics.least_difference import least_differences
from flightid.fleet.statistics.odd_flights import without_odd_flights
from flightid.fleet.statistics.outliers import find_outliers
from flightid.fleet.statistics.population import estimate_population

Array = NDArray[np.float64]
Draw = Callable[[np.random.Generator, int], Array]


def _outlying(rng: np.random.Generator, k: int) -> Array:
    """One in ten scatters four times as far; their spread is 1 together."""
    wide = np.where(np.arange(k) % 10 == 0, 4.0, 1.0)
    return np.asarray(wide * rng.normal(size=k) / np.sqrt(np.mean(wide**2)))


SHAPES: tuple[tuple[str, Draw], ...] = (
    ("normal", lambda rng, k: rng.normal(size=k)),
    ("two clusters", lambda rng, k: (rng.choice([-1.0, 1.0], k) + 0.2 * rng.normal(size=k)) / 1.02),
    ("skewed (gamma 2)", lambda rng, k: (rng.gamma(2.0, 1.0, k) - 2.0) / np.sqrt(2.0)),
    ("Student's t of 5", lambda rng, k: rng.standard_t(5, k) / np.sqrt(5.0 / 3.0)),
    ("Student's t of 3", lambda rng, k: rng.standard_t(3, k) / np.sqrt(3.0)),
    ("one of ten four times as far", _outlying),
)


def shapes(fleets: int) -> Section:
    """Intervals of spread and next vehicle where vehicles are not normal."""

    def rows() -> Iterator[Words]:
        for name, draw in SHAPES:
            for k in (5, 10, 20):
                rng, held = np.random.default_rng((7, k)), np.zeros(2, dtype=int)
                for _ in range(3 * fleets):
                    variances = rng.uniform(0.1, 0.5, k)
                    values = draw(rng, k) + np.sqrt(variances) * rng.normal(size=k)
                    found = VehicleEstimates(values, variances)
                    low, high = found.spread_ends()
                    held[0] += low <= 1.0 <= high
                    low, high = found.next_ends() or found.mean_ends()
                    held[1] += low <= rng.permutation(draw(rng, k))[0] <= high
                counts = (percent(int(each), 3 * fleets) for each in held)
                yield name, f"{k}", *counts, f"{3 * fleets}"

    return Section(("vehicles", "of", "spread held", "next vehicle held", "fleets"), rows)


def _type(rng: np.random.Generator, k: int, p: int, draw: Draw = SHAPES[0][1]) -> Array:
    """Values of mean 100, spread 4 and errors 1, by parameter."""
    return np.column_stack([100.0 + 4.0 * draw(rng, k) + rng.normal(size=k) for _ in range(p)])


def _estimates(values: Array) -> FlightEstimates:
    k, p = values.shape
    ids = [f"{i:03}" for i in range(k)]
    return FlightEstimates.of([*"abc"[:p]], ids, values, np.tile(np.eye(p), (k, 1, 1)))


def unlike(fleets: int) -> Section:
    """Vehicles that are called unlike their type, alone or as a minority."""

    def rows() -> Iterator[Words]:
        for name, draw in (SHAPES[0], SHAPES[2], SHAPES[4]):
            for k in (12, 20):
                found = [
                    find_outliers(
                        estimate_population(
                            _estimates(_type(np.random.default_rng((11, k, s)), k, 3, draw))
                        )
                    )
                    for s in range(fleets)
                ]
                odd = sum(bool(each.odd) for each in found)
                kinds = sum(bool(each.minorities) for each in found)
                yield f"{k} {name}, none apart", f"{odd} of {fleets}", f"{kinds} of {fleets}"
        for k, few, apart in (
            (12, 1, 6),
            (9, 3, 6),
            (12, 3, 6),
            (20, 5, 6),
            (12, 4, 8),
            (20, 6, 8),
        ):
            alone = exact = 0
            for s in range(fleets):
                values = _type(np.random.default_rng((12, k, few, s)), k, 1)
                values[:few, 0] += 4.0 * apart
                one, mine = find_outliers(estimate_population(_estimates(values))), range(few)
                alone += {int(each.vehicle) for each in one.odd} == {*mine}
                exact += any({int(v) for v in m.vehicles} == {*mine} for m in one.minorities)
            words = f"{k} normal, {few} of them {apart} spreads apart"
            yield words, f"{alone} of {fleets}", f"{exact} of {fleets}"

    return Section(("type", "unlike by themselves", "told as a minority"), rows)


def least(fleets: int) -> Section:
    """Sizes of which four of five are promised to be found."""

    def rows() -> Iterator[Words]:
        for vehicles, n, a_day in (
            (6, 8, 1), (6, 12, 1), (10, 24, 1), (6, 24, 2), (10, 24, 2), (6, 24, 4), (10, 24, 4)
        ):  # fmt: skip
            quiet = Fleet(vehicles, n, errors=(0.03, 0.03), a_day=a_day)
            found: list[bool] = []
            sizes: list[float] = []
            for seed in range(fleets):
                least_step = quiet.drift(5000 + seed).histories[0].least_step
                if least_step is None or least_step.value is None or least_step.value >= 100.0:
                    continue
                sizes.append(least_step.value)
                step = replace(quiet, moved=stepped_at_own_flights(0.01 * least_step.value, 1))
                found.append(step.drift(6000 + seed).histories[0].is_alarm)
            size = f"{np.median(sizes):.3g} %" if sizes else "–"
            yield f"step, {quiet.words}", size, f"{sum(found)} of {len(found)}"
        for k, p in ((4, 1), (6, 1), (6, 2), (12, 2)):
            told: list[float] = []
            seen = 0
            for seed in range(fleets):
                values = _type(np.random.default_rng((13, k, p, seed)), k, p)
                promised = least_differences(estimate_population(_estimates(values)))["000"][0]
                told.append(promised.value)
                # The same fleet, the first vehicle as far from the mean as is promised.
                other, drawn = values.copy(), np.random.default_rng((14, k, p, seed))
                other[0] = _type(drawn, 1, p)[0]
                apart = promised.value * (1.0 if seed % 2 else -1.0)
                other[0, 0] = 100.0 + apart + drawn.normal()
                odd = find_outliers(estimate_population(_estimates(other))).odd
                seen += "000" in {each.vehicle for each in odd}
            words = f"difference, {k} vehicles, {p} parameter{'s' * (p > 1)}"
            yield words, f"{np.median(told):.3g} %", f"{seen} of {fleets}"

    return Section(("what is promised", "size (median)", "found"), rows)


def relative(fleets: int) -> Section:
    """Intervals of a type whose errors are shares of each estimate."""

    def rows() -> Iterator[Words]:
        for flights in (1, 6):
            for share, apart in ((0.1, 0.0), (0.1, 0.5), (0.3, 0.0), (0.3, 0.5)):
                rng, k, held = np.random.default_rng((15, flights)), 20, np.zeros(2, dtype=int)
                for _ in range(fleets):
                    truth = np.repeat(1.0 + 0.1 * rng.normal(size=k), flights)
                    shares = share * np.exp(apart * rng.normal(size=truth.size))
                    values = truth * (1.0 + shares * rng.normal(size=truth.size))
                    ids = np.repeat([f"{i:03}" for i in range(k)], flights).tolist()
                    told = ((shares * values) ** 2)[:, None, None]
                    found = estimate_population(
                        FlightEstimates.of(["a"], ids, values[:, None], told)
                    ).parameters["a"]
                    following = 1.0 + 0.1 * float(rng.normal())
                    for place, (each, what) in enumerate(
                        ((found.mean, 1.0), (found.next_vehicle, following))
                    ):
                        low, high = each.interval95 or (np.inf, -np.inf)
                        held[place] += low <= what <= high
                words = f"{100.0 * share:g} %"
                words += (
                    f", by a factor of {np.exp(apart):.2g} from flight to flight" if apart else ""
                )
                counts = (f"{each} of {fleets}" for each in held)
                yield words, f"{flights}", *counts

    return Section(("errors", "flights of each", "mean held", "next vehicle held"), rows)


def odd_flights(fleets: int) -> Section:
    """Flights that are left out of a type though none went astray."""

    def rows() -> Iterator[Words]:
        for vehicles, n in ((6, 8), (8, 12), (10, 24)):
            fleet, left = Fleet(vehicles, n), 0
            for seed in range(fleets):
                told = without_odd_flights(fleet.estimates(7000 + seed))[1]
                left += sum(map(len, told.values()))
            yield fleet.words, f"{left} of {fleets * vehicles * n}"

    return Section(("fleet without odd flights", "flights left out"), rows)
