"""The light of a vehicle of which no alarm was raised: green only where both questions were judged.

A question that was not asked, or that the data could not answer, is no answer of "no"; and "no
change" says which one would have been found.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Container, Iterable, Iterator, Sequence

import numpy as np

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.statistics.answers import UNDATED, TypeAnswers
from flightid.fleet.statistics.largest_step import FEWEST, SHORTEST
from flightid.fleet.statistics.least_step import POWER
from flightid.fleet.statistics.parameter_history import ParameterHistory
from flightid.fleet.statistics.shared_level import SharedLevel
from flightid.uncertainty.estimate import Reading

WHOLE = 100.0
"""Percent of a level: where no smaller step would be found, nothing is said of change."""
NAMED = 4
"""Parameters whose least step stands in a line; of more the smallest and the largest."""
INSIDE = f", {SHORTEST} flights or more on either side,"
"""Where steps are looked for: of those nearer to an end few are found, the newest by itself."""
SEVERAL = 2
"""Vehicles from which a parameter or a model is the type's, and newest flights that are a sign."""
MORE = "log more flights of it, and of more vehicles of its type"
WITH_ALL = (
    "look for what all share, and name what was done to all as an event; a vehicle that did not "
    "fly meanwhile tells wear from the rest"
)
NEAR = 1
"""Flights of a vehicle that may lie between an event of all and the step that all share."""


def quiet_light(vehicle: str, types: Iterable[TypeAnswers]) -> Finding:
    """Light of a vehicle that raised no alarm.

    Parameters
    ----------
    vehicle : str
    types : iterable of TypeAnswers
        Of the whole fleet; those without this vehicle do not count.

    Returns
    -------
    Finding
        Green where every parameter of it was held beside its history and its type, amber where one
        moved with all vehicles and no event of all says why they stepped; unknown, with the
        reason, where a question that was asked has no answer.
    """
    every = list(types)
    mine = [each for each in every if vehicle in each.data.members]
    known, open_ = [], []
    seen = [(h, each) for each in mine for h in _judged(vehicle, each) if _is_seen(h)]
    if seen:
        beside = " beside what the others did" if any(_is_shared(h, of) for h, of in seen) else ""
        known.append(f"no change{beside}{_seen_words(seen)}")
    for each in mine:
        open_ += [f"cannot tell {why}" for why in _unjudged(vehicle, each)]
    open_ += [f"cannot tell of {why}" for why in _unfitted(vehicle, mine, every)]
    reasons = [_no_type(vehicle, each) for each in mine]
    missing = list(dict.fromkeys(each for each in reasons if each))
    if missing:
        open_.append(f"cannot tell whether it is like its type ({'; '.join(missing)})")
    elif any(each is not None for each in reasons):
        known.append(f"like its type{_apart_words(vehicle, mine)}")
    if open_:
        said = "; ".join([*known, *open_])
        return Finding("vehicle", Light.UNKNOWN, f"{vehicle}: {said}", MORE)
    if not known:
        return Finding("vehicle", Light.UNKNOWN, f"{vehicle}: nothing was asked of it")
    if together := [words for history, of in seen for words in _together_words(history, of)]:
        said = f"{', '.join(known)}; {'; '.join(together)}"
        return Finding("vehicle", Light.AMBER, f"{vehicle}: {said}", WITH_ALL)
    return Finding("vehicle", Light.GREEN, f"{vehicle}: {', '.join(known)}")


def normal_light(vehicles: Collection[str], types: Iterable[TypeAnswers]) -> Finding:
    """Light of the vehicles of a large fleet that are green, all together.

    As of one alone it says of which steps most would have been found: smaller ones may hide.
    """
    seen = [
        (history, each)
        for each in types
        for history in (() if each.drift is None else each.drift.histories)
        if history.vehicle in vehicles and history.false_share is not None and _is_seen(history)
    ]
    words = f"{counted(len(vehicles), 'vehicle')}: no change of any was found{_seen_words(seen)}"
    return Finding("vehicles-normal", Light.GREEN, f"{words}, and none unlike its type")


def _judged(vehicle: str, each: TypeAnswers) -> list[ParameterHistory]:
    """Histories of a vehicle that were asked whether it changed."""
    histories = () if each.drift is None else each.drift.histories
    return [one for one in histories if one.vehicle == vehicle and one.false_share is not None]


def _is_shared(history: ParameterHistory, each: TypeAnswers) -> bool:
    """Whether what all vehicles did by date is out of a history."""
    every = each.drift.shared if each.drift is not None else ()
    return any(one.name == history.name for one in every)


def _together_words(history: ParameterHistory, each: TypeAnswers) -> Iterator[str]:
    """Where a parameter went with all vehicles to another level: beside them it did not change."""
    for one in each.drift.shared if each.drift is not None else ():
        if one.name != history.name or not _is_moved(history, one):
            continue
        name = each.labels.get(one.name, one.name)
        if one.is_step and history.vehicle not in one.telling:
            yield (
                f"{name} was held beside all vehicles, which {one.course}; its own flights do not "
                "tell that it went along"
            )
        else:
            yield f"{name} went with all vehicles, which {one.course}"


def _is_moved(history: ParameterHistory, shared: SharedLevel) -> bool:
    """Whether a vehicle went along to another level that no event of all explains."""
    time_s, since = history.time_s, shared.since_s
    if not shared.is_step:
        return True
    if not time_s[0] < since <= time_s[-1]:
        return shared.trend is not None
    ends = [sorted((each.time_s, since)) for each in history.happened if not each.vehicles]
    return all(np.count_nonzero((time_s >= a) & (time_s < b)) > NEAR for a, b in ends)


def _is_seen(history: ParameterHistory) -> bool:
    """Whether any step that leaves something of the parameter would be found."""
    least = history.least_step
    return least is None or least.unit != "%" or (least.value or 0.0) < WHOLE


def _seen_words(seen: Sequence[tuple[ParameterHistory, TypeAnswers]]) -> str:
    """The step of which most would have been found, by parameter."""
    told = [(h.least_step, of.labels.get(h.name, h.name)) for h, of in seen if h.least_step]
    said = _sizes(told)
    return f" ({100.0 * POWER:.0f} % of such steps{INSIDE} would be found: {said})" if told else ""


def _apart_words(vehicle: str, mine: Sequence[TypeAnswers]) -> str:
    """The difference from its type of which most would have been found, by parameter."""
    told = [
        (least, each.labels.get(least.name, least.name))
        for each in mine
        for least in each.least_differences.get(vehicle, ())
    ]
    said = _sizes(told)
    return f" ({100.0 * POWER:.0f} % of such differences would be found: {said})" if told else ""


def _sizes(told: Sequence[tuple[Reading, str]]) -> str:
    """Sizes by parameter, or the smallest and the largest of many."""
    sizes = [(each.value or 0.0, f"{name} {_size(each)}") for each, name in told]
    if len(sizes) > NAMED:
        return f"from {min(sizes)[1]} to {max(sizes)[1]}"
    return ", ".join(words for _, words in sizes)


def least_words(history: ParameterHistory) -> str:
    """The step of one parameter of which most would be found; empty where it was not asked."""
    if history.least_step is None:
        return ""
    size = _size(history.least_step)
    return f"{100.0 * POWER:.0f} % of steps by {size}{INSIDE} would be found"


def _size(least: Reading) -> str:
    unit = "" if least.unit == "1" else f" {least.unit}"
    return f"{least.value:.2g}{unit}"


def _unjudged(vehicle: str, each: TypeAnswers) -> Iterator[str]:
    """What of its changes was asked and not judged, with the reason."""
    if each.drift is None:
        if UNDATED in each.reasons:
            yield "whether it changed (its flights have no date)"
        return
    own = [one for one in each.drift.histories if one.vehicle == vehicle]
    judged = _judged(vehicle, each)
    if not judged:
        most = max((len(one.values) for one in own), default=0)
        yield f"whether it changed ({_too_few(vehicle, each, most)})"
        return
    flights = {one.name: len(one.values) for one in own}
    for name in _of_type(each, flights):
        if name not in {one.name for one in judged}:
            label, few = each.labels.get(name, name), flights.get(name, 0)
            yield f"whether {label} changed ({_too_few_of(few)})"
    for one in judged:
        if not _is_seen(one) and one.least_step is not None:
            label = each.labels.get(one.name, one.name)
            yield f"whether {label} changed (only steps above {_size(one.least_step)} would show)"


def _of_type(each: TypeAnswers, own: Container[str]) -> list[str]:
    """Parameters that a vehicle tells, and those that several of its type do."""
    known, member = each.data.known, each.data.member_of
    told = [len(set(member[known[:, i]])) for i in range(len(each.data.names))]
    pairs = zip(each.data.names, told, strict=True)
    return [name for name, several in pairs if name in own or several >= SEVERAL]


def _unfitted(
    vehicle: str, mine: Sequence[TypeAnswers], every: Sequence[TypeAnswers]
) -> Iterator[str]:
    """Models of its type that no flight of a vehicle tells, and what its newest one does not."""
    types = {each.type_name for each in mine}
    for each in every:
        asked = each.drift is not None or each.outliers is not None or each.reasons
        if each.type_name not in types or not asked:
            continue
        red = each.red.get(vehicle, 0)
        if vehicle in each.data.members:
            if each.newest_red.get(vehicle):
                yield f"its newest flight, of which model “{each.model}” is red"
        elif red:
            yield f"model “{each.model}” (red in {red} of its {counted(red, 'flight')} with it)"
        elif len(each.data.members) >= SEVERAL:
            yield f"model “{each.model}” (none of its flights gives one that counts)"


def newest_red_words(vehicle: str, each: TypeAnswers) -> str:
    """Of a vehicle whose newest flights do not count, for their model is red; else empty.

    A change that no model fits any more would otherwise be read as none.
    """
    newest = each.newest_red.get(vehicle, 0)
    if newest < SEVERAL or not _judged(vehicle, each):
        return ""
    every = each.red[vehicle] + sum(name == vehicle for name in each.data.vehicles)
    return (
        f"model “{each.model}” is red in its newest {newest} flights, and in "
        f"{each.red[vehicle]} of {every}: nothing tells whether it changed since"
    )


def _too_few_of(told: int) -> str:
    """How many flights tell a parameter, and how many are needed."""
    if told >= FEWEST:
        return f"fewer than {FEWEST} flights that count beside its events"
    verb = "tells" if told == 1 else "tell"
    said = f"{counted(told, 'flight')} {verb}" if told else "no flight tells"
    return f"{said} it, {FEWEST} are needed"


def _too_few(vehicle: str, each: TypeAnswers, told: int) -> str:
    """How many flights count, of how many with a model, and how many are needed."""
    if told >= FEWEST:
        return f"fewer than {FEWEST} flights that count beside its events"
    sound, red = sum(name == vehicle for name in each.data.vehicles), each.red.get(vehicle, 0)
    bad = f"{red} {'is' if red == 1 else 'are'} red and " if red else ""
    which = f"of its {counted(sound + red, 'flight')} with model “{each.model}” {bad}{told}"
    rest = "" if told == sound else " with a date and an interval"
    verb = "counts" if told == 1 else "count"
    return f"{which} {verb}{rest}, {FEWEST} are needed"


def _no_type(vehicle: str, each: TypeAnswers) -> str | None:
    """Why a vehicle was not held beside its type; empty where it was, None where nobody asked."""
    if each.outliers is None:
        return "; ".join(_others(each.reasons)) or None
    every = {one.vehicle: [e.name for e in one.deviations] for one in each.outliers.vehicles}
    if vehicle in every:
        asked = dict.fromkeys(name for names in every.values() for name in names)
        left = [each.labels.get(k, k) for k in asked if k not in every[vehicle]]
        untold = f"its flights do not tell {', '.join(left)}" if left else ""
        hidden = each.outliers.beside(vehicle, each.labels) or untold
        return hidden or _too_far(vehicle, each)
    return each.outliers.reason or "its flights tell none of its parameters"


def _too_far(vehicle: str, each: TypeAnswers) -> str:
    """Parameters in which none but a whole level's difference would be found; empty without."""
    far = [
        e for e in each.least_differences.get(vehicle, ())
        if not math.isfinite(e.value) or (e.unit == "%" and e.value >= WHOLE)
    ]  # fmt: skip
    said = ", ".join(
        f"{each.labels.get(e.name, e.name)} {_size(e)}"
        if math.isfinite(e.value)
        else f"{each.labels.get(e.name, e.name)} none"
        for e in far
    )
    count = counted(len(each.data.members), "vehicle")
    return f"of {count} only differences above these would show: {said}" if far else ""


def _others(reasons: Iterable[str]) -> Iterator[str]:
    return (reason for reason in reasons if reason != UNDATED)
