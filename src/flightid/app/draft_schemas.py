"""What page and server tell each other of words that are typed and not stored yet."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from flightid.app.schemas import Message

MOST_LETTERS = 1 << 19


class Draft(Message):
    """Words as they are typed."""

    text: Annotated[str, Field(max_length=MOST_LETTERS)]
    name: Annotated[str, Field(max_length=400)]
    """Name of the file, where that is typed too."""
    before: Annotated[str, Field(max_length=MOST_LETTERS)]
    """What stood there when it was begun: another text means that somebody has written since."""


class PlacedDraft(Message):
    """A draft and where it is typed, such as ``study:`` and the hash of a log."""

    place: Annotated[str, Field(min_length=1, max_length=400)]
    draft: Draft | None
    """None: it is stored, or thrown away."""
    known: Draft | None = None
    """What is removed where there is none to be kept: the draft that whoever asks has seen."""


class Drafts(Message):
    """All drafts of a folder."""

    folder: str
    """Tells folders apart that one address has served, one after the other."""
    drafts: list[PlacedDraft]
