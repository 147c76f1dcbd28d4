"""Who works in a temporary folder, so that another run knows whether it was left behind."""

from __future__ import annotations

import json
import os
import platform
import time
from pathlib import Path

from flightid.errors import FileFormatError
from flightid.files import process_lives
from flightid.reading import bounded_bytes, parse_json

OWNER = ".owner.json"
UNKNOWN_S = 86_400.0
"""Where nobody can say whether the owner lives, a folder that nothing touched for so long goes."""


def mark_owner(folder: Path) -> None:
    """Write down which process of which machine works in a folder."""
    text = json.dumps({"machine": platform.node(), "process": os.getpid()})
    (folder / OWNER).write_text(text, encoding="utf-8")


def is_owned(folder: Path) -> bool:
    """Whether a living process may still work in a folder.

    Folders of other machines, of Windows and without a note are taken for owned for `UNKNOWN_S`.
    A folder that was put aside has no note, and its owner needs milliseconds: it is never owned.
    """
    if folder.suffix == ".old":
        return False
    try:
        note = parse_json(bounded_bytes(folder / OWNER, 4096), "a note of the owner", OWNER)
    except (OSError, FileFormatError):
        note = None
    process = note.get("process") if isinstance(note, dict) else None
    is_here = isinstance(note, dict) and note.get("machine") == platform.node()
    if not is_here or not isinstance(process, int) or os.name == "nt":
        return time.time() - folder.stat().st_mtime < UNKNOWN_S
    return process_lives(process)
