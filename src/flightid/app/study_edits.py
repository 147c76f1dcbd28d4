"""Edits of a study file: one key at a time, comments and order kept, never over another's edit."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Comment, Table, Whitespace

from flightid.app.own_folders import draft_of
from flightid.app.schemas import StudyParts
from flightid.errors import StudyError
from flightid.frozen import dataclass
from flightid.reading import DOCUMENT_BYTES
from flightid.study.settings import read_settings

VIEWS = ("filters", "plot", "plan")
"""Tables of a study on which neither models nor gains rest."""


@dataclass(frozen=True)
class KeyEdit:
    """One key of a study, and what it shall say.

    Attributes
    ----------
    path : tuple of str or int
        Keys from the top; a number counts the tables of a list, and one behind the last adds one.
    value : object
        Plain value; None takes the key out.
    """

    path: tuple[str | int, ...]
    value: Any


def etag_of(text: str) -> str:
    """What a version of a study file is known by.

    Example
    -------
    >>> etag_of("") == etag_of(""), etag_of("a = 1") == etag_of("a = 2")
    (True, False)
    """
    return f'"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'


def parts_of(text: str) -> StudyParts:
    r"""What the parts of a study that are shown apart are known by; comments count nowhere.

    Raises
    ------
    StudyError
        The text is no TOML.

    Example
    -------
    >>> before, after = parts_of("a = 1"), parts_of("a = 1 # mine\n[tune]\npreset = 'firm'")
    >>> before.models == after.models, before.gains == after.gains
    (True, False)
    """
    try:
        document = tomlkit.parse(text).unwrap()
    except (TOMLKitError, RecursionError) as error:
        raise StudyError("the study file is no TOML", found=str(error)) from error
    gains = document.pop("tune", None)
    views = {key: document.pop(key) for key in VIEWS if key in document}
    models, tuned, viewed = (etag_of(repr(each)) for each in (document, gains, views))
    return StudyParts(models=models, gains=tuned, views=viewed if views else "")


def edited(text: str, edits: Sequence[KeyEdit]) -> str:
    r"""A study file with some keys changed.

    Raises
    ------
    StudyError
        The text is no TOML, a path leads nowhere, or a value is no text (half a surrogate pair).

    Example
    -------
    >>> text = "[[model]]\nname = 'Roll' # mine\n"
    >>> print(edited(text, [KeyEdit(("model", 0, "band_rad_s"), [1.0, 20.0])]))
    [[model]]
    name = 'Roll' # mine
    band_rad_s = [1.0, 20.0]
    <BLANKLINE>
    """
    try:
        document: Any = tomlkit.parse(text)
        begun = [made for edit in edits for made in _apply(document, edit)]
        for table in begun:
            table.add(tomlkit.nl())
        made = str(tomlkit.dumps(document))
        made.encode()
        return made
    except (
        TOMLKitError,
        AttributeError,
        KeyError,
        IndexError,
        TypeError,
        ValueError,
        RecursionError,
    ) as error:
        said = f"{type(error).__name__}: {error}".encode(errors="replace").decode()
        raise StudyError(
            "the study file cannot be changed there",
            found=said,
            needed="a key of docs/study.md",
        ) from error


def _apply(document: Any, edit: KeyEdit) -> list[Any]:  # noqa: ANN401 - a parsed document
    """Change one key; tables that were begun amid others, each to end with an empty line."""
    *parents, last = edit.path
    begun = []
    place = around = document
    for number, key in enumerate(parents):
        following = edit.path[number + 1]
        if isinstance(following, int) and isinstance(key, str) and place.get(key) == []:
            # A list that was emptied: values go into it, no tables.
            del place[key]
        if isinstance(key, str) and key not in place:
            # Beside `parameters.T_m = {…}` a header would open a table of the whole document.
            inline = number > 0 and edit.path[number - 1] == "parameters"
            made = tomlkit.inline_table() if inline else tomlkit.table()
            if not number and not str(tomlkit.dumps(document)).endswith("\n\n"):
                document.add(tomlkit.nl())
            place.append(key, tomlkit.aot() if isinstance(following, int) else made)
            if number and not inline and not isinstance(following, int):
                begun.append(place[key])
        elif isinstance(key, int) and key == len(place):
            _append(place, tomlkit.table())
        around, place = place, place[key]
    if edit.value is None:
        if isinstance(last, int) or last in place:
            del place[last]
        if isinstance(last, int) and not place:
            del around[parents[-1]]
    elif isinstance(last, int) and last == len(place):
        _append(place, tomlkit.item(edit.value))
    else:
        place[last] = edit.value
    return begun


def _append(tables: Any, made: Any) -> None:  # noqa: ANN401 - of a parsed document
    """One more table of a list: what stands behind the last, above the next header, stays there.

    A parser takes comments above a header as the end of the table before it.
    """
    last = tables[-1] if len(tables) and isinstance(made, Table) else None
    tables.append(made)
    if last is None:
        return
    while isinstance(last, (Table, AoT)):
        body: list[Any] = last.value.body if isinstance(last, Table) else [(None, last[-1])]
        if not body or not isinstance(body[-1][1], (Table, AoT)):
            break
        last = body[-1][1]
    start = len(body)
    while start and isinstance(body[start - 1][1], (Comment, Whitespace)):
        start -= 1
    # A comment right below the keys is of them: what follows the first empty line is of the next.
    empty = (k for k in range(start, len(body)) if isinstance(body[k][1], Whitespace))
    behind = body[next(empty, len(body)) :]
    if any(isinstance(each, Comment) for _, each in behind):
        del body[len(body) - len(behind) :]
        body.append((None, Whitespace("\n")))
        for _, each in behind:
            tables[-1].add(each)


def _bytes_of(text: str) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError as error:
        raise StudyError(
            "the study file is no text", found="half a surrogate pair", needed="UTF-8"
        ) from error


def require_study(path: Path, text: str) -> None:
    """Refuse what `flightid run` would refuse; paths are those beside `path`.

    Raises
    ------
    StudyError
        Names every key that does not fit.
    """
    if len(_bytes_of(text)) > DOCUMENT_BYTES:
        raise StudyError("the study file is too long", needed=f"{DOCUMENT_BYTES} bytes at most")
    with draft_of(path, text) as draft:
        read_settings(draft)
