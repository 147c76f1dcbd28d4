"""What is told of events: several parameters are asked at each, and most did not change."""

from __future__ import annotations

from collections.abc import Sequence

from flightid.fleet.statistics.events import EventEffect
from flightid.fleet.statistics.multiple_testing import FALSE_SHARE, corrected


def told_effects(effects: Sequence[tuple[str, EventEffect]]) -> list[bool]:
    """Which effects are told, false ones among all events and parameters accounted for.

    A vehicle's parameters at one event are a family, of which m were asked. Families are told by
    Benjamini and Hochberg of m times their least chance; within them a chance p where m p is at
    most the share of the families that are told times `FALSE_SHARE`. Beside one parameter that
    surely changed each other would else be told at 5 %, as if it were alone.

    Parameters
    ----------
    effects : sequence of (str, EventEffect)
        Vehicle and effect.

    Returns
    -------
    list of bool

    Reference
    ---------
    Benjamini & Bogomolov, *J. R. Stat. Soc. B* 76 (2014), 297–318 (selected families).
    """
    families: dict[object, list[float]] = {}
    for vehicle, effect in effects:
        if effect.chance is not None:
            families.setdefault((vehicle, effect.events), []).append(effect.chance)
    shares = corrected([min(1.0, len(each) * min(each)) for each in families.values()])
    told = {key for key, share in zip(families, shares, strict=True) if share <= FALSE_SHARE}
    level = FALSE_SHARE * len(told) / max(len(families), 1)
    return [
        effect.chance is not None
        and (vehicle, effect.events) in told
        and len(families[vehicle, effect.events]) * effect.chance <= level
        for vehicle, effect in effects
    ]
