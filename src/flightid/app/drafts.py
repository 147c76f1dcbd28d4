"""Words that are typed and not stored yet: files of the workspace, for every port and browser.

A browser keeps what it keeps by address, and another port of the same machine is another one.
"""

from __future__ import annotations

import hashlib
from contextlib import suppress
from pathlib import Path

from pydantic import ValidationError

from flightid.app.draft_schemas import Drafts, PlacedDraft
from flightid.app.own_folders import own_folder, read_plain
from flightid.app.workspace import HIDDEN, Workspace
from flightid.files import write_atomically

FOLDER, ENDING = "drafts", ".json"
MOST = 200
"""That are kept; the oldest go."""
MOST_BYTES = 8 << 20


def all_drafts(workspace: Workspace) -> Drafts:
    """Drafts of a workspace; a file that is none is passed over."""
    found = [each for path in _paths(workspace)[:MOST] if (each := _draft(path)) is not None]
    named = hashlib.sha256(str(workspace.folder).encode("utf-8", "surrogateescape")).hexdigest()
    return Drafts(folder=named[:16], drafts=[each for each in found if each.draft is not None])


def keep_draft(workspace: Workspace, typed: PlacedDraft) -> PlacedDraft:
    """Write a draft in the place of the one before, or remove the one that is known.

    Another one was typed in another window, which may be closed: it stays.

    Returns
    -------
    PlacedDraft
        What the folder has there now.

    Raises
    ------
    OptionError
        The folder is a link.
    OSError
        It cannot be written.
    """
    name = hashlib.sha256(typed.place.encode("utf-8", "surrogatepass")).hexdigest()[:32]
    path = own_folder(workspace.folder, HIDDEN, FOLDER) / f"{name}{ENDING}"
    if typed.draft is None:
        stands = _draft(path)
        if stands is not None and stands.draft not in (None, typed.known):
            return stands
        path.unlink(missing_ok=True)
        return PlacedDraft(place=typed.place, draft=None)
    made = PlacedDraft(place=typed.place, draft=typed.draft)
    write_atomically(path, made.model_dump_json())
    for old in _paths(workspace)[MOST:]:
        old.unlink(missing_ok=True)
    return made


def _draft(path: Path) -> PlacedDraft | None:
    """A draft as it was written; None where a file is none."""
    with suppress(OSError, ValueError, ValidationError, RecursionError):
        return PlacedDraft.model_validate_json(read_plain(path, MOST_BYTES))
    return None


def _paths(workspace: Workspace) -> list[Path]:
    """Files of drafts, the youngest first."""
    folder = own_folder(workspace.folder, HIDDEN, FOLDER)
    return sorted(folder.glob(f"*{ENDING}"), key=lambda each: -each.lstat().st_mtime_ns)
