"""Few vehicles that moved alike: of what they share, or of each: a vehicle that stayed tells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.fleet.statistics.parameter_history import ParameterHistory
from flightid.fleet.statistics.shared_level import FEWEST_VEHICLES
from flightid.frozen import dataclass

Array = NDArray[np.float64]
FEWEST_ALIKE = 2
"""Vehicles, below which nothing is alike."""
NEARLY_ALL = 0.7
"""Share of the vehicles that move alike, from which it may be of all: three of four, not two of
three, of which the third is a witness."""
ALIKE = 0.7
"""Correlation of a vehicle's level with that of the others that changed, from which half of its
squares are theirs: two steps of one sign at the 8th and the 14th of 20 flights have 0.53."""
STAYED, FURTHER, SURE = 0.5, 2.0, 2.58
"""Share of the others' movement below which a vehicle stayed, and above which it went further than
they; and by how many standard errors: at 99 %."""


@dataclass(frozen=True)
class MovedAlike:
    """One parameter of vehicles, too few for `shared_level`, that all changed alike.

    Attributes
    ----------
    name : str
    vehicles : tuple of str
        Those that changed alike; not one that surely went more than twice as far as the others,
        whose change is its own.
    judged : int
        Vehicles whose history of it was judged.
    """

    name: str
    vehicles: tuple[str, ...]
    judged: int

    def words(self, labels: Mapping[str, str]) -> str:
        """What is seen, and what it may be."""
        many = len(self.vehicles)
        whose = f"all {many}" if many == self.judged else f"{many} of {self.judged}"
        return (
            f"{labels.get(self.name, self.name)}: {whose} vehicles moved alike: of the type "
            f"(season, firmware) or of each, which fewer than {FEWEST_VEHICLES} do not tell"
        )


def moved_alike(histories: Sequence[ParameterHistory]) -> tuple[MovedAlike, ...]:
    """Parameters of which all, or nearly all, of fewer than five vehicles changed alike.

    Parameters
    ----------
    histories : sequence of ParameterHistory
        Judged, of one type.

    Returns
    -------
    tuple of MovedAlike
        None of five vehicles or more: what these share is taken out before (`shared_level`). None
        where a vehicle surely stayed while the others moved: then it is theirs.
    """
    found = []
    for name in dict.fromkeys(each.name for each in histories):
        judged = [e for e in histories if e.name == name and e.false_share is not None]
        alike = _alike([each for each in judged if each.is_alarm or each.goes_on])
        many = len(alike) >= max(FEWEST_ALIKE, NEARLY_ALL * len(judged))
        others = [each for each in judged if each not in alike]
        if len(judged) < FEWEST_VEHICLES and many and not any(_stayed(e, alike) for e in others):
            own = [e for e in alike if _went_further(e, [o for o in alike if o is not e])]
            told = tuple(each.vehicle for each in alike if each not in own)
            found.append(MovedAlike(name, told, len(judged)))
    return tuple(found)


def _alike(changed: Sequence[ParameterHistory]) -> list[ParameterHistory]:
    """Those of changed histories whose level goes with that of the others."""
    return [
        each
        for each in changed
        if _correlation(each, [other for other in changed if other is not each]) >= ALIKE
    ]


def _stayed(one: ParameterHistory, moved: Sequence[ParameterHistory]) -> bool:
    """Whether a vehicle surely did not go half as far as others did, by its flights and errors."""
    share, error = _share(one, moved)
    return share + SURE * error < STAYED


def _went_further(one: ParameterHistory, others: Sequence[ParameterHistory]) -> bool:
    share, error = _share(one, others)
    return share - SURE * error > FURTHER


def _share(one: ParameterHistory, moved: Sequence[ParameterHistory]) -> tuple[float, float]:
    """Of the mean movement of others that a vehicle's flights show, and its standard error."""
    beside = np.mean([np.interp(one.time_s, e.time_s, _course(e)) for e in moved], axis=0)
    scale = max(abs(float(one.track.level.mean())), float(np.finfo(np.float64).tiny))
    weights = scale**2 / one.variances
    beside, values = (v - np.average(v, weights=weights) for v in (beside, one.values / scale))
    information = float(np.sum(weights * beside**2))
    if information <= 0.0:
        return 1.0, np.inf
    return float(np.sum(weights * beside * values)) / information, 1.0 / np.sqrt(information)


def _correlation(one: ParameterHistory, others: Sequence[ParameterHistory]) -> float:
    """Of a vehicle's level with the mean of others at its flights; 0 without others."""
    if not others:
        return 0.0
    beside = np.mean([np.interp(one.time_s, e.time_s, _course(e)) for e in others], axis=0)
    own, beside = _course(one), beside - beside.mean()
    size = float(np.sqrt((own @ own) * (beside @ beside)))
    return float(own @ beside) / size if size > 0.0 else 0.0


def _course(history: ParameterHistory) -> Array:
    """Level about its mean, in shares of it: vehicles differ."""
    level = history.track.level
    scale = max(abs(float(level.mean())), float(np.finfo(np.float64).tiny))
    return np.asarray((level - level.mean()) / scale)
