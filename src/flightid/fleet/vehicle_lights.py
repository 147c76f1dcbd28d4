"""The light of one vehicle: changed is red; its newest flight off, or unlike its type, amber."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from flightid.conventions import Light
from flightid.findings import Finding
from flightid.fleet.normality import newest_red_words, quiet_light
from flightid.fleet.statistics.answers import TypeAnswers
from flightid.fleet.statistics.change_kind import DRIFT, STEP
from flightid.fleet.statistics.event_shares import EventShares, event_shares
from flightid.fleet.statistics.events import EventEffect
from flightid.fleet.statistics.parameter_history import ParameterHistory
from flightid.uncertainty.estimate import Reading
from flightid.uncertainty.quantiles import shown


def vehicle_light(vehicle: str, types: Sequence[TypeAnswers]) -> Finding:
    """Light of one vehicle: changed is red; its newest flight off, or unlike its type, amber."""
    said: list[str] = []
    done: list[str] = []
    light = Light.GREEN
    for each in types:
        done += _events_words(vehicle, each)
        alike = each.drift.alike if each.drift is not None else ()
        for history in each.drift.alarms if each.drift is not None else ():
            if history.vehicle == vehicle:
                said.append(change_words(history, each.labels))
                shared = any(e.name == history.name and vehicle in e.vehicles for e in alike)
                behind = "" if shared else _left_behind(history, each)
                said[-1] += ", as the others did" if shared else behind
                own = not (shared or behind)
                light = Light.RED if own or light is Light.RED else Light.AMBER
        doubts = list(_doubts(vehicle, each))
        if each.outliers is not None:
            doubts += each.outliers.differences(vehicle, each.labels)
        said += doubts
        light = Light.AMBER if doubts and light is not Light.RED else light
    if not said:
        quiet = quiet_light(vehicle, types)
        if not done:
            return quiet
        rest = quiet.message.removeprefix(f"{vehicle}: ")
        return replace(quiet, message=f"{vehicle}: {'; '.join(done)}; beyond that {rest}")
    said += done
    act = "look at what was done to it, and verify its model on a new flight"
    return Finding("vehicle", light, f"{vehicle}: {'; '.join(said)}", act)


def _events_words(vehicle: str, each: TypeAnswers) -> Iterator[str]:
    """What events did to it, and what of that those of all did and its own, where others tell."""
    if each.drift is None:
        return
    told = [effect for history, effect in each.drift.by_event if history.vehicle == vehicle]
    for history in (one for one in each.drift.histories if one.vehicle == vehicle):
        for effect in history.events:
            shares = event_shares(history, effect, each.drift.histories)
            if any(effect is one for one in told) or (shares is not None and shares.is_sure):
                words = event_words(history, effect, each.labels)
                yield words if shares is None else f"{words}: {shares_words(shares)}"


def _doubts(vehicle: str, each: TypeAnswers) -> Iterator[str]:
    """What of its flights may be a change, in words."""
    if each.drift is None:
        return
    for history in each.drift.going_on:
        if history.vehicle == vehicle:
            yield going_on_words(history, each.labels)
    for newest in each.drift.newest_off:
        if newest.vehicle == vehicle:
            yield newest.words(each.labels)
    if lost := newest_red_words(vehicle, each):
        yield lost


def _left_behind(history: ParameterHistory, each: TypeAnswers) -> str:
    """Where most changed, and a vehicle the other way beside them: what else that may be."""
    every = each.drift.shared if each.drift is not None else ()
    mine = [one for one in every if one.name == history.name]
    if each.drift is None or not any(history.vehicle in each.drift.apart(one) for one in mine):
        return ""
    return ", beside what the others did: it may be one that did not change"


def change_words(history: ParameterHistory, labels: Mapping[str, str]) -> str:
    """What changed, by how much, in words."""
    how = {STEP: " at once", DRIFT: " gradually, the last flight beside those before"}.get(
        history.kind, ""
    )
    name, change = labels.get(history.name, history.name), history.change_percent
    explained = any(each.change.value is not None for each in history.events)
    beyond = ", beside what its events explain" if explained else ""
    if _holds_zero(change):
        return f"{name} changed{how}{beyond}; by how much is not told{_ends_words(change)}"
    return f"{name} changed{_size_words(change)}{how}{beyond}"


def going_on_words(history: ParameterHistory, labels: Mapping[str, str]) -> str:
    """What may have changed, or may have gone on, and what would tell."""
    name, size = labels.get(history.name, history.name), _size_words(history.change_percent)
    did = "may have changed" if _holds_zero(history.change_percent) else "changed"
    said = f"{name} {did}{size}, or its flights go on as their neighbours did"
    if not history.more_days:
        return f"{said}, as those of all vehicles do: flights on more days tell"
    days = f"{history.more_days} more days" if history.more_days > 1 else "one more day"
    return f"{said}, which so few do not tell: flights of each vehicle on some {days} would"


def event_words(history: ParameterHistory, effect: EventEffect, labels: Mapping[str, str]) -> str:
    """What an event changed, by how much: of what was told, no reason to look at it."""
    name, size = labels.get(history.name, history.name), effect.percent
    size = effect.change if size.value is None else size
    did = "may have changed" if _holds_zero(size) else "changed"
    said = (
        f"{name} {did}{_size_words(size)} at the event{'s' * bool(effect.together)} {effect.what}"
    )
    if not effect.together:
        return said
    return f"{said} together" if effect.between else f"{said}, which no flight tells apart"


def shares_words(shares: EventShares) -> str:
    """What events of all did of one change, and what that leaves to those of the vehicle."""
    return (
        f"{shares.common} did{_size_words(shares.by_common, '')} on {shares.vehicles} others, "
        f"which leaves{_size_words(shares.by_own, '')} to {shares.own}"
    )


def _holds_zero(change: Reading) -> bool:
    """Whether the interval that is shown holds no change at all."""
    ends = change.interval(shown())
    return ends is not None and ends[0] <= 0.0 <= ends[1]


def _size_words(change: Reading, by: str = " by") -> str:
    unit = "" if change.unit == "1" else f" {change.unit}"
    size = "" if change.value is None else f"{by} {change.value:+.2g}{unit}"
    return size + _ends_words(change)


def _ends_words(change: Reading) -> str:
    ends = change.interval(shown())
    unit = "" if change.unit == "1" else f" {change.unit}"
    return "" if ends is None else f" ({ends[0]:+.2g} to {ends[1]:+.2g}{unit})"
