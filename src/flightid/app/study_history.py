"""Versions of a study, for Undo and Redo: kept beside the workspace, so that a reload loses none.

``.flightid/undo/<id>.json`` holds the texts in their order and which of them stands, those of an
editor too, as soon as the page has read them. What stands is kept before another text is written
over it; that one is kept after: whoever reads the history later sees by the text that stands how
far it came.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from flightid.app.own_folders import own_folder, read_plain
from flightid.app.workspace import HIDDEN, ID
from flightid.errors import OptionError
from flightid.files import write_atomically
from flightid.frozen import dataclass

FOLDER = "undo"
MOST_VERSIONS, MOST_LETTERS = 100, 2_000_000
"""Of one study; the oldest go first."""
MOST_BYTES = 16 << 20


@dataclass(frozen=True)
class Versions:
    """Texts of a study in the order in which they stood, and the place of the one that stands.

    Example
    -------
    >>> made = Versions(("a",), 0).followed_by("b").followed_by("c")
    >>> made.moved(-1).text, made.moved(-1).followed_by("d").texts
    ('b', ('c', 'a', 'b', 'd'))
    >>> made.behind, made.ahead, made.standing("b").ahead, made.standing("x").texts
    (2, 0, 1, ('a', 'b', 'c', 'x'))
    """

    texts: tuple[str, ...]
    at: int

    @property
    def text(self) -> str:
        """The one that stands."""
        return self.texts[self.at]

    @property
    def behind(self) -> int:
        """How many can be gone back."""
        return self.at

    @property
    def ahead(self) -> int:
        """How many can be gone forward again."""
        return len(self.texts) - 1 - self.at

    def moved(self, steps: int) -> Versions:
        """So many versions on, or back."""
        return Versions(self.texts, self.at + steps)

    def followed_by(self, text: str) -> Versions:
        """With a version after the one that stands; what was ahead of that lies before all others.

        So Undo goes back as it would without them, and whatever stood once is reached in the end.
        """
        stood, ahead = self.texts[: self.at + 1], self.texts[self.at + 1 :]
        return Versions(_bounded((*ahead, *stood, text)), -1)._counted()

    def standing(self, text: str) -> Versions:
        """Where a text stands that nobody told of: a kill cut the step off, or a hand wrote it."""
        for at in (self.at, self.at - 1, self.at + 1):
            if 0 <= at < len(self.texts) and self.texts[at] == text:
                return Versions(self.texts, at)
        return self.followed_by(text)

    def _counted(self) -> Versions:
        return Versions(self.texts, len(self.texts) - 1)


class StudyHistory:
    """Versions of the studies of a workspace: every text that stood, whoever wrote it.

    Parameters
    ----------
    folder : Path
        Of the workspace.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def seen(self, log: str, text: str) -> Versions:
        """Versions of a study that stands so, this one among them: it is kept before it may go.

        Of a history that is broken, this one alone.

        Raises
        ------
        OSError, OptionError
            They cannot be kept: the folder is a link, or cannot be written.
        """
        held = self.held(log)
        now = Versions((text,), 0) if held is None else held.standing(text)
        if now != held:
            self.keep(log, now)
        return now

    def held(self, log: str) -> Versions | None:
        """All that are kept, and which stood last; None where none is, or it is broken."""
        try:
            held = json.loads(read_plain(self._path(log), MOST_BYTES))
            texts, at = tuple(held["texts"]), held["at"]
        except (OSError, OptionError, ValueError, KeyError, TypeError, RecursionError):
            return None
        sound = bool(texts) and isinstance(at, int) and 0 <= at < len(texts)
        if not sound or not all(isinstance(each, str) for each in texts):
            return None
        return Versions(texts, at)

    def keep(self, log: str, versions: Versions) -> None:
        """Write them."""
        path = self._path(log)
        write_atomically(path, json.dumps({"texts": versions.texts, "at": versions.at}))

    def _path(self, log: str) -> Path:
        if not ID.fullmatch(log):
            raise OptionError("no name of a study", found=log)
        return own_folder(self._folder, HIDDEN, FOLDER) / f"{log}.json"


def _bounded(texts: Sequence[str]) -> tuple[str, ...]:
    """The youngest, as many as are kept; the last always is."""
    kept: list[str] = []
    letters = 0
    for text in reversed(texts[-MOST_VERSIONS:]):
        letters += len(text)
        if kept and letters > MOST_LETTERS:
            break
        kept.append(text)
    return tuple(reversed(kept))
