"""One way in which an input comes to a grid in all records that are used together.

How an input moves between samples is a property of the rig, not of one manoeuvre: two rules in one
study would filter in one record the steps that stay steps in another.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from flightid.record.history import JITTERED
from flightid.record.interpolation import Interpolation
from flightid.record.record import Record

UNIFORM = "conditioning.to_uniform"
WAYS = {
    "previous value": Interpolation.PREVIOUS,
    JITTERED: Interpolation.PREVIOUS,
    "linear": Interpolation.LINEAR,
    "band-limited": Interpolation.BAND_LIMITED,
}
"""By the history's words; what was copied or low-passed came to its grid by no choice."""
Asked = Mapping[str, Interpolation | str]
Ways = Asked | Interpolation | str | None


def shared_ways(records: Mapping[str, Sequence[Record]]) -> dict[str, dict[str, Interpolation]]:
    """Inputs that came to their grid in another way than the one that holds for all, by source.

    What is said of an input in one record (`hold`) holds in those that say nothing; where nobody
    says anything, an input that shows steps in one record (two levels alone) steps in all.

    Parameters
    ----------
    records : mapping of str to sequence of Record
        By where they come from.

    Returns
    -------
    dict of str to dict of str to Interpolation
        How these sources are to be read again; none are named whose records agree.
    """
    every = [record for each in records.values() for record in each]
    said: dict[str, set[Interpolation]] = {}
    rule: dict[str, Interpolation] = {}
    for record in every:
        for name, way in _ways(record).items():
            if record.hold is not None:
                said.setdefault(name, set()).add(way)
            elif way is Interpolation.PREVIOUS:
                rule[name] = way
    rule |= {name: next(iter(ways)) for name, ways in said.items() if len(ways) == 1}
    found: dict[str, dict[str, Interpolation]] = {}
    for source, own in records.items():
        for record in own:
            for name, way in _ways(record).items() if record.hold is None else ():
                if rule.get(name, way) is not way:
                    found.setdefault(source, {})[name] = rule[name]
    return found


def read_alike(
    paths: Sequence[Path], asked: Ways, read: Callable[[Path, Ways], list[Record]]
) -> list[list[Record]]:
    """Records of files that are used together, each input in one way in all of them.

    Parameters
    ----------
    paths : sequence of Path
    asked : Interpolation, str or mapping
        Interpolation that was asked for, as in `read_records`.
    read : callable
        Reads a file with an interpolation.
    """
    found = {str(path): read(path, asked) for path in paths}
    for source, ways in shared_ways(found).items():
        again = joined_ways(asked, ways)
        if again is not None:
            found[source] = read(Path(source), again)
    return [found[str(path)] for path in paths]


def joined_ways(asked: Ways, ways: Asked) -> dict[str, Interpolation | str] | None:
    """What was asked for with ways beside it, which never go before; None: nothing is added."""
    if isinstance(asked, str):
        return None
    own = dict(asked or {})
    more = {name: way for name, way in ways.items() if name not in own}
    return {**own, **more} if more else None


def _ways(record: Record) -> dict[str, Interpolation]:
    """How each input came to its grid, where there was a choice."""
    done = [step.options for step in record.history if step.operation == UNIFORM]
    words = {
        name: str(options[name]) for options in done for name in record.inputs if name in options
    }
    return {name: WAYS[said] for name, said in words.items() if said in WAYS}
