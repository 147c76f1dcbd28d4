"""Intervals of a type where errors go with the estimate, differ tenfold, or few flights tell."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from tests.short_sweeps import MEAN, NAMES, SPREAD, linear_fleet

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.population import TypeParameter, estimate_population

Array = NDArray[np.float64]
Drawn = tuple[Array, Array]
Draw = Callable[[np.random.Generator], Drawn]
SHORT = ((0.05, 0.25, 0.25, 0.25), (60.0, 10.0, 10.0, 10.0))


def uneven_fleets() -> Iterator[tuple[str, Callable[[], str], str]]:
    """What is counted, how, and of how many fleets."""
    draws = int(os.environ.get("FLIGHTID_FLEET_DRAWS", "400"))
    for k, share, spread in ((10, 0.1, 0.1), (20, 0.1, 0.1), (10, 0.3, 0.1), (20, 0.3, 0.1)):
        words = f"{k} vehicles, errors {share:.0%} of each estimate, spread {spread:.0%}"
        yield words, _counter(_relative(k, share, spread), 1.0, spread, draws), f"{draws} fleets"
    for k, spread in ((3, 1.0), (3, 3.0), (3, 10.0), (5, 3.0), (10, 3.0)):
        words = f"{k} vehicles, errors from 1 to 10, spread {spread:g}"
        yield words, _counter(_tenfold(k, spread), 100.0, spread, draws), f"{draws} fleets"
    some = max(draws // 4, 1)
    yield "one of four flights tells lag and delay", lambda: _short(some), f"{some} linear fleets"


def _relative(k: int, share: float, spread: float) -> Draw:
    """Errors that are a share of each vehicle's truth, told as that share of its estimate."""

    def draw(rng: np.random.Generator) -> Drawn:
        shares = share * np.exp(0.2 * rng.normal(size=k))
        truth = 1.0 + spread * rng.normal(size=k)
        values = truth * (1.0 + shares * rng.normal(size=k))
        return values, (shares * values) ** 2

    return draw


def _tenfold(k: int, spread: float) -> Draw:
    def draw(rng: np.random.Generator) -> Drawn:
        errors = 10.0 ** rng.uniform(0.0, 1.0, k)
        return 100.0 + spread * rng.normal(size=k) + errors * rng.normal(size=k), errors**2

    return draw


def _counter(draw: Draw, mean: float, spread: float, draws: int) -> Callable[[], str]:
    def count() -> str:
        rng, held = np.random.default_rng(17), []
        for _ in range(draws):
            values, variances = draw(rng)
            names = [f"{i:02}" for i in range(len(values))]
            data = FlightEstimates.of(["a"], names, values[:, None], variances[:, None, None])
            held.append(_held(estimate_population(data).parameters["a"], mean, spread))
        return _words(np.mean(held, axis=0))

    return count


def _short(draws: int) -> str:
    held = []
    for seed in range(draws):
        # As a joint fit takes them: errors worked out at the flight's place.
        data = linear_fleet(seed, 8, *SHORT)
        found = estimate_population(data, errors_at_type=False).parameters
        told = zip(NAMES, MEAN, SPREAD, strict=True)
        held += [_held(found[name], float(mean), float(spread)) for name, mean, spread in told]
    return _words(np.mean(held, axis=0))


def _held(one: TypeParameter, mean: float, spread: float) -> list[float]:
    """Whether mean and spread lie in their intervals, and how probably the next vehicle does."""
    nothing, following = (np.inf, -np.inf), NormalDist(mean, spread)
    ends = [each.interval95 or nothing for each in (one.mean, one.spread, one.next_vehicle)]
    inside = following.cdf(ends[2][1]) - following.cdf(ends[2][0])
    told = zip(ends[:2], (mean, spread), strict=True)
    return [*(float(low <= truth <= high) for (low, high), truth in told), max(inside, 0.0)]


def _words(held: Array) -> str:
    mean, spread, following = held
    return f"next {following:.1%}, mean {mean:.1%}, spread {spread:.1%}"
