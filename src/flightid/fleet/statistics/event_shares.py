"""Events of one vehicle and of the whole fleet on one date: what each did, as the others tell."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from flightid.fleet.statistics.events import EventEffect, event_names
from flightid.fleet.statistics.parameter_history import ParameterHistory
from flightid.frozen import dataclass
from flightid.uncertainty.estimate import Estimate

SURE = 0.99
FEWEST_OTHERS = 3
"""Vehicles with the event of all by itself, below which they do not tell what it does."""


@dataclass(frozen=True)
class EventShares:
    """One change of a vehicle by events of all and of its own, between which it did not fly.

    Attributes
    ----------
    common, own : str
        Those of all, and the others, as words of a sentence.
    by_common : Estimate
        Mean of the other vehicles, percent of the level before.
    by_own : Estimate
        What that leaves; how far the others differ is in its interval.
    vehicles : int
        Others that tell it.
    """

    common: str
    own: str
    by_common: Estimate
    by_own: Estimate
    vehicles: int

    @property
    def is_sure(self) -> bool:
        """Whether its own events did something, at 99 %: both together may have done nothing."""
        low, high = self.by_own.interval(SURE) or (0.0, 0.0)
        return low > 0.0 or high < 0.0


def event_shares(
    history: ParameterHistory, effect: EventEffect, histories: Iterable[ParameterHistory]
) -> EventShares | None:
    """Part one change of a vehicle between events of all and of its own.

    With the changes x ± e of k other vehicles by the events of all by themselves, their mean m and
    scatter s: x₀ − m, of variance e₀² + max(s² − ē², 0) + s² / k, by Student's t of k − 1 degrees
    of freedom.

    Parameters
    ----------
    history : ParameterHistory
    effect : EventEffect
        Of it.
    histories : iterable of ParameterHistory
        Of the type.

    Returns
    -------
    EventShares or None
        None where the events are of one kind, flights lie between them, or fewer than three other
        vehicles tell those of all.

    Assumes
    -------
    Events of all do as much to this vehicle as to others, but for how far these differ.
    """
    common = tuple(each for each in effect.events if not each.vehicles)
    own = tuple(each for each in effect.events if each.vehicles)
    mine = _sized(effect)
    if effect.between or not common or not own or mine is None:
        return None
    others = [
        sized
        for each in histories
        if each.name == history.name and each.vehicle != history.vehicle
        for one in each.events
        if set(one.events) == set(common) and (sized := _sized(one)) is not None
    ]
    if len(others) < FEWEST_OTHERS:
        return None
    found, errors = np.array(others).T
    k, mean, variance = len(found), float(found.mean()), float(found.var(ddof=1))
    differ = max(variance - float(np.mean(errors**2)), 0.0)
    left = float(np.sqrt(mine[1] ** 2 + differ + variance / k))
    return EventShares(
        *(event_names(common), event_names(own)),
        Estimate(history.name, mean, "%", float(np.sqrt(variance / k)), freedom=k - 1.0),
        Estimate(history.name, mine[0] - mean, "%", left, freedom=k - 1.0),
        k,
    )


def _sized(effect: EventEffect) -> tuple[float, float] | None:
    """Percent and its standard error, that of the level before apart; None where there is none."""
    percent, change = effect.percent.value, effect.change.value
    if percent is None or not change or effect.change.stderr is None:
        return None
    return percent, abs(percent / change) * effect.change.stderr
