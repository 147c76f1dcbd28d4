"""The light of a vehicle of which no alarm was raised: green only where both questions were judged.

A question that was not asked, or that the data could not answer, is no answer of "no".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from flightid.conventions import Light
from flightid.findings import Finding, counted
from flightid.fleet.statistics.answers import UNDATED, TypeAnswers
from flightid.fleet.statistics.largest_step import FEWEST

MORE = "log more flights of it, and of more vehicles of its type"


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
        Green where every model of it was held beside its history and its type; unknown, with the
        reason, where a question that was asked has no answer.
    """
    mine = [each for each in types if vehicle in each.data.members]
    known, open_ = [], []
    for words, question, reasons in (
        ("no change", "whether it changed", [_no_history(vehicle, each) for each in mine]),
        ("like its type", "whether it is like its type", [_no_type(vehicle, e) for e in mine]),
    ):
        asked = [each for each in reasons if each is not None]
        missing = list(dict.fromkeys(each for each in asked if each))
        if missing:
            open_.append(f"cannot tell {question} ({'; '.join(missing)})")
        elif asked:
            known.append(words)
    if open_:
        said = "; ".join([*known, *open_])
        return Finding("vehicle", Light.UNKNOWN, f"{vehicle}: {said}", MORE)
    if not known:
        return Finding("vehicle", Light.UNKNOWN, f"{vehicle}: nothing was asked of it")
    return Finding("vehicle", Light.GREEN, f"{vehicle}: {', '.join(known)}")


def _no_history(vehicle: str, each: TypeAnswers) -> str | None:
    """Why a history was not judged; empty where it was, None where nobody asked."""
    if each.drift is None:
        return "its flights have no date" if UNDATED in each.reasons else None
    own = [one for one in each.drift.histories if one.vehicle == vehicle]
    if any(one.false_share is not None for one in own):
        return ""
    return _too_few(vehicle, each, max((len(one.values) for one in own), default=0))


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
    if any(one.vehicle == vehicle for one in each.outliers.vehicles):
        return each.outliers.beside(vehicle)
    return each.outliers.reason or "its flights tell none of its parameters"


def _others(reasons: Iterable[str]) -> Iterator[str]:
    return (reason for reason in reasons if reason != UNDATED)
