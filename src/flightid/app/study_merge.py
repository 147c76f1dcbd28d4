"""Two versions of a study that began as one: what differs, and both together where they can be."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import SequenceMatcher
from itertools import pairwise
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from flightid.app.schemas import MergedStudy, MergeLine
from flightid.app.study_edits import KeyEdit, edited
from flightid.errors import StudyError

MOST_LINES = 4000
"""Of a version that is compared line by line: a study has hundreds."""
AROUND = 2
"""Equal lines that are shown about those that differ."""
Change = tuple[int, int, list[str]]
"""First line, the one behind the last, and what stands in their place."""


def merge_studies(base: str, mine: str, theirs: str, edits: Sequence[KeyEdit] = ()) -> MergedStudy:
    r"""Lay what was meant here beside what was written meanwhile.

    Parameters
    ----------
    base : str
        Text from which both began.
    mine : str
        Text as it was typed here.
    theirs : str
        Text as it stands in the file now.
    edits : sequence of KeyEdit
        Keys that were to change in `mine` besides. Where `mine` is `base`, both can be taken
        together whatever their lines, as long as `theirs` left these keys alone.

    Raises
    ------
    StudyError
        `mine` cannot be edited so.

    Example
    -------
    >>> merge_studies("a = 1\nb = 1\n", "a = 2\nb = 1\n", "a = 1\nb = 3\n").merged
    'a = 2\nb = 3\n'
    """
    whole = edited(mine, edits) if edits else mine
    if edits and mine == base:
        merged = _both_keys(base, theirs, edits)
        why = "the other change is of the same keys"
    else:
        merged = merged_lines(base, whole, theirs)
        short = max(each.count("\n") for each in (base, whole, theirs)) < MOST_LINES
        why = "both changed the same lines" if short else f"one has more than {MOST_LINES} lines"
    if merged is not None and not _is_toml(merged):
        merged, why = None, "the lines of both together are no TOML"
    why = why if merged is None else ""
    return MergedStudy(mine=whole, merged=merged, why=why, lines=shown_lines(theirs, whole))


def merged_lines(base: str, mine: str, theirs: str) -> str | None:
    r"""Both changes of a text; None where they touch, or there is too much to compare.

    Changes of neighbouring lines are apart; two insertions at one place are not.

    Example
    -------
    >>> print(merged_lines("a\nb\nc", "A\nb\nc", "a\nb\nC"))
    A
    b
    C
    >>> merged_lines("a\n", "b\n", "c\n") is None
    True
    """
    if theirs in (mine, base):
        return mine
    if mine == base:
        return theirs
    old = base.split("\n")
    changes: list[Change] = []
    for text in (mine, theirs):
        new = text.split("\n")
        if max(len(old), len(new)) > MOST_LINES:
            return None
        steps = SequenceMatcher(None, old, new, autojunk=False).get_opcodes()
        for kind, a, b, c, d in steps:
            if kind == "replace" and b - a == d - c:
                changes += [(a + k, a + k + 1, [new[c + k]]) for k in range(b - a)]
            elif kind != "equal":
                changes.append((a, b, new[c:d]))
    changes.sort(key=lambda each: each[:2])
    kept = [each for k, each in enumerate(changes) if each not in changes[:k]]
    if any(_touch(one, other) for one, other in pairwise(kept)):
        return None
    for start, end, lines in reversed(kept):
        old[start:end] = lines
    return "\n".join(old)


def _touch(one: Change, other: Change) -> bool:
    """Whether two changes of lines, the earlier first, cannot be told apart."""
    (start, end, _), (after, last, _) = one, other
    inserted = start == end or after == last
    return after < end or (inserted and after == end)


def _both_keys(base: str, theirs: str, edits: Sequence[KeyEdit]) -> str | None:
    """Edits on top of the other change; None where that is of their keys, or moved them."""
    before, now = _tables(base), _tables(theirs)
    if any(_at(before, each.path) != _at(now, each.path) for each in edits):
        return None
    try:
        return edited(theirs, edits)
    except StudyError:
        return None


def _at(document: object, path: Sequence[str | int]) -> list[object]:
    """What stands at a path, with the names of the tables of lists on the way to it."""
    seen: list[object] = []
    place: Any = document
    for key in path:
        try:
            place = place[key]
        except (KeyError, IndexError, TypeError):
            return [*seen, None]
        if isinstance(key, int) and isinstance(place, dict):
            seen.append(place.get("name"))
    return [*seen, place]


def _tables(text: str) -> object:
    try:
        return tomlkit.parse(text).unwrap()
    except (TOMLKitError, RecursionError):
        return {}


def _is_toml(text: str) -> bool:
    try:
        tomlkit.parse(text)
    except (TOMLKitError, RecursionError):
        return False
    return True


def shown_lines(theirs: str, mine: str) -> list[MergeLine]:
    r"""Lines of which two texts differ, with some around them; none of texts too long for that.

    Example
    -------
    >>> [(each.side, each.text) for each in shown_lines("a\nb", "a\nc")]
    [('same', 'a'), ('theirs', 'b'), ('mine', 'c')]
    """
    left, right = theirs.split("\n"), mine.split("\n")
    if max(len(left), len(right)) > MOST_LINES:
        return []
    made: list[MergeLine] = []
    for k, group in enumerate(
        SequenceMatcher(None, left, right, autojunk=False).get_grouped_opcodes(AROUND)
    ):
        if k:
            made.append(MergeLine(side="gap", text="…"))
        for kind, a, b, c, d in group:
            if kind == "equal":
                made += [MergeLine(side="same", text=each) for each in left[a:b]]
                continue
            made += [MergeLine(side="theirs", text=each) for each in left[a:b]]
            made += [MergeLine(side="mine", text=each) for each in right[c:d]]
    return made
