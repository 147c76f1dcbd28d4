"""Vehicles that differ alike from all others of their type: judged alone, each hides the others.

Whoever is left out alone is held beside others of its kind, which widen what counts as normal.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.population import Population
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.quantiles import shown

Array = NDArray[np.float64]
AMONG = 6
"""Vehicles of which a minority can be told."""
FEWEST = 2
"""Vehicles alike that are more than one odd one."""
CHANCE = 0.02
"""Of a gap as wide in a normal type, over the parameters, from which a minority is told."""
GAP = 2.5
"""Between the kinds, in standard deviations within them: less a long tail has, too."""
DRAWS = 1999
MOST_NUMBERS = 2_000_000
"""Drawn at a time."""
FAR_FROM_ZERO = 3.0
"""Standard errors of a mean from which shares of it are told."""
NAMED = 4
"""Vehicles alike that are named beside one; the others are counted."""


@dataclass(frozen=True)
class VehicleMinority:
    """Vehicles to one side of all others of their type in a parameter, with a gap in between.

    Attributes
    ----------
    name : str
        Parameter.
    vehicles : tuple of str
        The minority, a third of the type at most.
    others : int
        How many the others are.
    apart : Estimate
        Mean of the minority less that of the others: percent of it, or in the parameter's unit
        where that mean may be zero.
    gap : float
        Between the nearest two of either kind, in standard deviations within the kinds.
    chance : float
        Of a gap as wide in a type of one kind, any of its parameters.
    """

    name: str
    vehicles: tuple[str, ...]
    others: int
    apart: Estimate
    gap: float
    chance: float

    def words(self, labels: Mapping[str, str], vehicle: str = "") -> str:
        """What they differ in and by how much; of one of them, who is like it."""
        beside = [each for each in self.vehicles if each != vehicle]
        more = len(beside) - NAMED
        names = [*beside[:NAMED], *((f"{more} more",) if more > 0 else ())]
        who = " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
        side = "below" if self.apart.value < 0.0 else "above"
        unit = "" if self.apart.unit == "1" else f" {self.apart.unit}"
        size = f"{abs(self.apart.value):.2g}{unit}"
        name = labels.get(self.name, self.name)
        if vehicle:
            return f"{name} {size} {side} the {self.others} others, alike with {who}"
        ends = sorted(abs(end) for end in self.apart.interval(shown()) or (self.apart.value,) * 2)
        kind = f"{len(self.vehicles)} vehicles, {who}, differ alike from the {self.others} others"
        return f"{kind}: {name} {size} {side}, {ends[0]:.2g} to {ends[1]:.2g}{unit}"


def find_minorities(population: Population) -> tuple[VehicleMinority, ...]:
    """Find vehicles that differ alike from all others, a third of the type at most.

    Vehicles stand in the order of a parameter. Of every gap between two to a third of them and the
    others the widest, in standard deviations within the two kinds, is held against what it would be
    of normal vehicles with the same spread and errors, drawn 1,999 times.

    Parameters
    ----------
    population : Population

    Returns
    -------
    tuple of VehicleMinority
        One a parameter at most, in its order; none of fewer than six vehicles.

    Assumes
    -------
    A type of one kind is normal. Of skewed ones (gamma 2) of 12 and 20 vehicles with three
    parameters 8 and 17 % are told to be of two kinds.

    Reference
    ---------
    Hawkins, *Identification of Outliers* (1980), chapter 5 (several, by the gap behind them);
    Davies & Gather, *J. Am. Stat. Assoc.* 88 (1993), 782–792 (masking).
    """
    found = []
    for i, name in enumerate(population.names):
        own = population.own
        there = [n for n, each in enumerate(own) if each[2][i]]
        if len(there) < AMONG:
            continue
        there.sort(key=lambda n: float(own[n][0][i]))
        values = np.array([own[n][0][i] for n in there])
        gap, place = (each[0] for each in widest_gaps(values[None]))
        if gap < GAP:
            continue
        errors = np.array([own[n][1][i, i] for n in there])
        spread = errors + population.spreads.between[i, i]
        chance = min(1.0, len(population.names) * _gap_chance(float(gap), spread))
        if chance > CHANCE:
            continue
        low = place <= len(there) // 3
        mine, rest = slice(None, place), slice(place, None)
        mine, rest = (mine, rest) if low else (rest, mine)
        members = [population.data.members[n] for n in there[mine]]
        unit = population.data.units[i]
        apart = _apart(name, unit, values[mine], values[rest])
        others = len(there) - len(members)
        found.append(VehicleMinority(name, tuple(members), others, apart, float(gap), chance))
    return tuple(found)


def widest_gaps(values: Array) -> tuple[Array, NDArray[np.intp]]:
    """The widest gap of each row that has two to a third of its values to one side.

    Parameters
    ----------
    values : ndarray, shape (m, k)
        Ascending in each row, k of at least six.

    Returns
    -------
    gaps : ndarray, shape (m,)
        In standard deviations within the two sides.
    places : ndarray of int, shape (m,)
        How many values are below it.

    Example
    -------
    >>> gaps, places = widest_gaps(np.array([[0.0, 1.0, 2.0, 3.0, 9.0, 10.0]]))
    >>> gaps.round(2).tolist(), places.tolist()
    ([5.12], [4])
    """
    k = values.shape[1]
    most = max(FEWEST, k // 3)
    below = np.arange(1, k)
    asked = np.minimum(below, k - below)
    centred = values - values.mean(axis=1, keepdims=True)
    # About their common mean, the sums of either side are opposite.
    sums = np.cumsum(centred, axis=1)[:, :-1]
    within = np.sum(centred**2, axis=1)[:, None] - sums**2 * (1.0 / below + 1.0 / (k - below))
    least = np.finfo(float).tiny
    gaps = np.diff(values, axis=1) / np.sqrt(np.maximum(within, least) / (k - 2))
    gaps = np.where((asked >= FEWEST) & (asked <= most), gaps, 0.0)
    places = np.argmax(gaps, axis=1)
    return gaps[np.arange(len(gaps)), places], below[places]


def _gap_chance(gap: float, variances: Array) -> float:
    """Chance of a gap as wide were all normal about one mean with these variances."""
    rng, k = np.random.default_rng(0), len(variances)
    wider, left = 0, DRAWS
    while left:
        rows = min(left, max(1, MOST_NUMBERS // k))
        drawn = np.sort(rng.normal(size=(rows, k)) * np.sqrt(variances), axis=1)
        wider += int(np.count_nonzero(widest_gaps(drawn)[0] >= gap))
        left -= rows
    return (1 + wider) / (DRAWS + 1)


def _apart(name: str, unit: str, mine: Array, rest: Array) -> Estimate:
    """Difference of the means of two kinds with one spread within them."""
    freedom = len(mine) + len(rest) - 2
    squares = np.sum((mine - mine.mean()) ** 2) + np.sum((rest - rest.mean()) ** 2)
    variance = float(squares) / freedom
    base, size = float(rest.mean()), float(mine.mean() - rest.mean())
    of_base = variance / len(rest)
    error = variance / len(mine) + of_base
    if abs(base) < FAR_FROM_ZERO * np.sqrt(of_base):
        return Estimate(name, size, unit, float(np.sqrt(error)), freedom=float(freedom))
    share = size / base
    error += (2.0 * share + share**2) * of_base
    scale = 100.0 / abs(base)
    return Estimate(name, scale * size, "%", float(scale * np.sqrt(error)), freedom=float(freedom))
