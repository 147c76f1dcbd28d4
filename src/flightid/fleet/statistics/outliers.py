"""Vehicles that are unlike their type: how far from what all others predict, and in what."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.heterogeneity import VehicleEstimates
from flightid.fleet.statistics.minorities import VehicleMinority, find_minorities
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE, chance_cell, corrected
from flightid.fleet.statistics.population import Population
from flightid.fleet.statistics.spread_search import SpreadFit, search_spreads
from flightid.frozen import dataclass
from flightid.result import Result
from flightid.table import Cell, Column, Table
from flightid.threads import on_one_thread
from flightid.uncertainty.estimate import Estimate

Array = NDArray[np.float64]
FEWEST = 4
"""Vehicles without which none is called odd: three others tell what is normal."""
REFITS = 30
"""Vehicles up to which every one is left out of a search of its own; of more, suspects alone."""
SUSPECT = 6.0
"""Over the number of vehicles: chance beside all of them below which one is left out of a search.

Of many vehicles one moves their spread little, and as many are left out however many there are.
"""
PAIR_AMONG = 5
"""Vehicles of which two alike can hide: three others tell what is normal."""
PAIR_CHANCE = 0.2
"""Over vehicles times parameters: how rarely the outer two of a side lie as far by chance.

Of 150 normal draws each of 5, 6, 8, 12 vehicles 5 % had both outer ones, held beside the others,
at chances below 0.041, 0.040, 0.023, 0.017.
"""
FAR_FROM_ZERO = 3.0
"""Standard errors of a mean from which shares of it are told."""


@dataclass(frozen=True)
class VehicleDeviation:
    """One parameter of a vehicle beside its type.

    Attributes
    ----------
    name : str
    deviation : Estimate
        Of the vehicle from the mean of all others, percent of it, or in its unit where that mean
        may be zero.
    chance : float
        Chance of the next vehicle's lying as far away.
    is_odd : bool
        Whether that is below 5 % for the number of parameters (Benjamini–Hochberg).
    """

    name: str
    deviation: Estimate
    chance: float
    is_odd: bool

    def words(self, label: str = "") -> str:
        """In words, for example ``"Lp 14 % below the type, 11 to 17 %"``."""
        name = label or self.name
        if not self.is_odd:
            return f"{name} normal"
        side = "below" if self.deviation.value < 0.0 else "above"
        ends = self.deviation.interval95 or (self.deviation.value, self.deviation.value)
        sign = -1.0 if self.deviation.value < 0.0 else 1.0
        low, high = sorted(sign * end for end in ends)
        unit = "" if self.deviation.unit == "1" else f" {self.deviation.unit}"
        size = f"{abs(self.deviation.value):.2g}{unit}"
        return f"{name} {size} {side} the type, {low:.2g} to {high:.2g}{unit}"


@dataclass(frozen=True)
class VehicleNormality:
    """One vehicle beside its type.

    Attributes
    ----------
    vehicle : str
    distance2 : float
        Mahalanobis distance to what all others predict, squared.
    told : int
        Parameters that its flights tell.
    chance : float
        Chance of the next vehicle's lying as far away.
    deviations : tuple of VehicleDeviation
    false_share : float
        Benjamini–Hochberg over all vehicles.
    """

    vehicle: str
    distance2: float
    told: int
    chance: float
    deviations: tuple[VehicleDeviation, ...]
    false_share: float = 1.0

    @property
    def is_odd(self) -> bool:
        """Whether it is unlike its type, false alarms of the whole fleet accounted for."""
        return self.false_share <= FALSE_SHARE

    def words(self, labels: Mapping[str, str] | None = None) -> str:
        """What differs, and what does not, in one line."""
        if not self.is_odd:
            return "like its type"
        named = labels or {}
        odd = [each.words(named.get(each.name, "")) for each in self.deviations if each.is_odd]
        usual = [named.get(each.name, each.name) for each in self.deviations if not each.is_odd]
        if not odd:
            return "no parameter alone, but all together are unlike the type"
        return "; ".join([*odd, *([f"{', '.join(usual)} normal"] if usual else [])])


@dataclass(frozen=True, repr=False)
class FleetOutliers(Result, schema="flightid.fleet_outliers/1"):
    """Vehicles of a type, the oddest first.

    Attributes
    ----------
    type_name : str
    vehicles : tuple of VehicleNormality
    reason : str
        Why none was judged; empty where they were.
    pairs : tuple of tuple of str
        A parameter and two vehicles that lie to one side of all others in it: each hides the other,
        which widens what counts as normal, and neither is called like its type.
    minorities : tuple of VehicleMinority
        Two to a third of the vehicles that differ alike from the others.

    Example
    -------
    >>> from flightid.fleet.statistics.population import estimate_population
    >>> rng = np.random.default_rng(1)
    >>> values = -5.0 + 0.1 * rng.normal(size=12)
    >>> values[3] = -4.0
    >>> data = FlightEstimates.of(["Lp"], [*"abcdefghijkl"], values[:, None],
    ...                           np.full((12, 1, 1), 0.0025))
    >>> found = find_outliers(estimate_population(data, "quad"))
    >>> found, found.vehicles[0].vehicle
    (FleetOutliers(12 vehicles, 1 unlike its type), 'd')
    """

    type_name: str
    vehicles: tuple[VehicleNormality, ...]
    reason: str = ""
    pairs: tuple[tuple[str, str, str], ...] = ()
    minorities: tuple[VehicleMinority, ...] = ()

    def differences(self, vehicle: str, labels: Mapping[str, str] | None = None) -> list[str]:
        """In what a vehicle is unlike its type, alone or alike with others, in words."""
        odd = [each.words(labels) for each in self.odd if each.vehicle == vehicle]
        mine = (each for each in self.minorities if vehicle in each.vehicles)
        return [*odd, *(each.words(labels or {}, vehicle) for each in mine)]

    def beside(self, vehicle: str, labels: Mapping[str, str] | None = None) -> str:
        """What hides whether a vehicle is like its type; empty where nothing does."""
        for name, *two in self.pairs:
            if vehicle in two:
                other = next(each for each in two if each != vehicle)
                named = (labels or {}).get(name, name)
                return f"it and {other} are alike in {named}, and apart from all others"
        return ""

    def _said(self, each: VehicleNormality, labels: Mapping[str, str] | None) -> str:
        said = self.differences(each.vehicle, labels)
        hidden = self.beside(each.vehicle, labels)
        return "; ".join(said) or (f"cannot tell: {hidden}" if hidden else each.words(labels))

    @property
    def odd(self) -> tuple[VehicleNormality, ...]:
        """Vehicles that are unlike their type."""
        return tuple(each for each in self.vehicles if each.is_odd)

    def __repr__(self) -> str:
        """Vehicles and odd ones."""
        count = len(self.odd)
        whose = "its" if count == 1 else "their"
        return f"FleetOutliers({len(self.vehicles)} vehicles, {count} unlike {whose} type)"

    def summary(self, labels: Mapping[str, str] | None = None) -> Table:
        """One row a vehicle: distance, chance, what differs."""
        columns = (
            Column("vehicle"),
            Column("distance", digits=3),
            Column("share of false alarms", digits=2),
            Column("what differs"),
        )
        rows: tuple[tuple[Cell, ...], ...] = tuple(
            (
                *(each.vehicle, float(np.sqrt(each.distance2))),
                *(chance_cell(each.false_share), self._said(each, labels)),
            )
            for each in self.vehicles
        )
        note = (
            "Distance from what all other vehicles say of the next one, at the spread that they "
            "show. Few vehicles tell a spread badly, and a large distance is then no rarity: the "
            f"share decides, so that at most {100 * FALSE_SHARE:.0f} % of the vehicles called "
            "unlike their type are not."
        )
        alike = (
            f"{each.words(labels or {})}. What the type has in common spans both kinds; a type of "
            "their own in the table of vehicles parts them."
            for each in self.minorities
        )
        notes = (self.reason or note, *alike)
        return Table(f"Vehicles of type “{self.type_name}”", columns, rows, notes)


@on_one_thread
def find_outliers(population: Population) -> FleetOutliers:
    """Hold every vehicle beside what all others predict for the next one.

    Parameters
    ----------
    population : Population

    Returns
    -------
    FleetOutliers
        Without vehicles, and the reason, where there are fewer than four.

    Assumes
    -------
    One odd vehicle at a time: several that are odd alike widen what counts as normal. They are told
    as a minority where a gap parts them from the others, two also as a pair where it may be one.

    Reference
    ---------
    Mahalanobis, *Proc. Natl. Inst. Sci. India* 2 (1936), 49–55; Hotelling, *Ann. Math. Stat.* 2
    (1931), 360–378 (a full spread; of another the oddest parameter decides, times their number);
    Satterthwaite, *Biometrics Bulletin* 2 (1946), 110–114 (a
    spread that is known from few vehicles beside errors that are known).
    """
    data = population.data
    if len(data.members) < FEWEST:
        why = f"fewer than {FEWEST} vehicles: nothing says what is normal"
        return FleetOutliers(population.type_name, (), why)
    everyone = tuple(_everyone(population, i) for i in range(len(data.names)))
    found = [_judged(population, everyone, place) for place in range(len(data.members))]
    shares = corrected([each.chance for each in found])
    judged = [replace(e, false_share=float(s)) for e, s in zip(found, shares, strict=True)]
    ranked = sorted(judged, key=lambda each: (each.chance, -each.distance2))
    pairs, alike = tuple(_pairs(population)), find_minorities(population)
    return FleetOutliers(population.type_name, tuple(ranked), "", pairs, alike)


def _pairs(population: Population) -> Iterator[tuple[str, str, str]]:
    """The outer two of a side that would both be rare beside the others."""
    names, members = population.names, population.data.members
    for i, name in enumerate(names):
        there = [n for n, own in enumerate(population.own) if own[2][i]]
        if len(there) < PAIR_AMONG:
            continue
        there.sort(key=lambda n: float(population.own[n][0][i]))
        for two, rest in ((there[:2], there[2:]), (there[-2:], there[:-2])):
            others = VehicleEstimates(*_column(population, rest, i))
            chances = map(others.next_chance, *_column(population, two, i))
            if max(chances) < PAIR_CHANCE / (len(there) * len(names)):
                yield (name, members[two[0]], members[two[1]])


def _column(population: Population, places: Sequence[int], i: int) -> tuple[Array, Array]:
    """Estimates of vehicles and their variances."""
    own = [population.own[n] for n in places]
    return np.array([each[0][i] for each in own]), np.array([each[1][i, i] for each in own])


def _everyone(population: Population, i: int) -> VehicleEstimates:
    """A parameter of all vehicles that tell it."""
    there = [n for n, own in enumerate(population.own) if own[2][i]]
    return VehicleEstimates(*_column(population, there, i))


def _judged(
    population: Population, everyone: Sequence[VehicleEstimates], place: int
) -> VehicleNormality:
    data, kept = population.data, population.spreads
    quick = _mean_without(kept, place)
    if len(data.members) > REFITS:
        found = _beside(population, everyone, place, kept, quick)
        if found.chance > SUSPECT / len(data.members):
            return found
    others = data.chosen(data.member_of != place)
    told = [len(set(others.member_of[others.known[:, i]])) for i in range(len(data.names))]
    if min(told) < FEWEST - 1:
        return _beside(population, everyone, place, kept, quick)
    spreads = search_spreads(others, structure=kept.structure)
    mean = (spreads.mean, spreads.mean_covariance)
    return _beside(population, everyone, place, spreads, mean)


def _mean_without(spreads: SpreadFit, place: int) -> tuple[Array, Array]:
    """Mean of the other vehicles and its covariance, at the spread of all."""
    p = len(spreads.mean)
    own = spreads.information[place]
    shrink = np.linalg.inv(np.eye(p) + spreads.between @ own)
    information = np.linalg.inv(spreads.mean_covariance)
    left = information - own @ shrink
    covariance = np.linalg.inv(left)
    mean = covariance @ (information @ spreads.mean - shrink.T @ spreads.score[place])
    return np.asarray(mean), np.asarray(covariance)


def _beside(
    population: Population,
    everyone: Sequence[VehicleEstimates],
    place: int,
    spreads: SpreadFit,
    mean: tuple[Array, Array],
) -> VehicleNormality:
    """A vehicle beside a mean of the others and their spread."""
    data = population.data
    value, covariance, told = population.own[place]
    where = np.flatnonzero(told)
    inside = np.ix_(where, where)
    between, error = spreads.between[inside], mean[1][inside]
    total = between + error + covariance[inside]
    apart = (value - mean[0])[where]
    distance2 = float(apart @ np.linalg.solve(total, apart))
    freedom = float(len(data.members) - 2)
    single = np.array([_single(population, everyone[int(i)], place, int(i)) for i in where])
    odd = corrected(single) <= FALSE_SHARE
    if spreads.structure == "full":
        chance = _chance(distance2, len(where), freedom)
    else:
        # A diagonal does not know how parameters of vehicles hang together: each for itself.
        chance = min(1.0, len(single) * float(single.min()))
    deviations = tuple(
        VehicleDeviation(
            data.names[i],
            _deviation(data, int(i), value, covariance, mean, freedom),
            float(single[n]),
            bool(odd[n]),
        )
        for n, i in enumerate(where)
    )
    return VehicleNormality(data.members[place], distance2, len(where), chance, deviations)


def _single(population: Population, everyone: VehicleEstimates, place: int, i: int) -> float:
    """Chance that the next vehicle's parameter lies as far from those of all others."""
    value, covariance, _ = population.own[place]
    one = float(value[i]), float(covariance[i, i])
    if len(everyone.values) > REFITS:
        chance = everyone.next_chance(*one)
        if chance > SUSPECT / len(everyone.values):
            return chance
    if len(everyone.values) < FEWEST:
        return 1.0
    there = [n for n, own in enumerate(population.own) if n != place and own[2][i]]
    return VehicleEstimates(*_column(population, there, i)).next_chance(*one)


def _chance(distance2: float, q: int, freedom: float) -> float:
    """Chance of a distance as large (Hotelling), all of the spread known by the vehicles alone.

    What is known of the estimates' errors is not counted for more freedom: the spread is told by
    the same estimates, and 13 of 72 fleets of normal vehicles had one called unlike then, not 2.
    """
    left = freedom - q + 1.0
    return float(fdtrc(q, left, distance2 * left / (freedom * q))) if left > 0.0 else 1.0


def _deviation(
    data: FlightEstimates,
    i: int,
    value: Array,
    covariance: Array,
    mean: tuple[Array, Array],
    freedom: float,
) -> Estimate:
    base, error = float(mean[0][i]), float(mean[1][i, i])
    far = abs(base) > FAR_FROM_ZERO * np.sqrt(error)
    share = float(value[i]) / base if far else 1.0
    scale = 100.0 / abs(base) if far else 1.0
    of_mean = share**2 * error
    variance = float(covariance[i, i]) + of_mean
    known = min(freedom * (variance / max(of_mean, 1e-9 * variance)) ** 2, 1e9)
    return Estimate(
        data.names[i],
        scale * (float(value[i]) - base),
        "%" if far else data.units[i],
        float(scale * np.sqrt(variance)),
        freedom=known,
    )
