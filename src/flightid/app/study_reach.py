"""How far a study reaches: files that it names outside the folder of the page, which opens none.

A folder may come from a stranger, and its study may name any file of the machine. `flightid run`
on the terminal is for who means it; the page says which files, and does not look into them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flightid.app.own_folders import draft_of, shown_name
from flightid.errors import StudyError
from flightid.study.run import named_paths
from flightid.study.settings import Settings, read_settings

MOST_NAMED = 5
"""Files that a refusal lists."""


def named_places(study: Path) -> list[Path]:
    """Every file that a study names, links followed.

    Raises
    ------
    StudyError
        The study cannot be carried out as written.
    """
    return _places(read_settings(study), study.parent)


def outside_places(folder: Path, settings: Settings, beside: Path) -> list[Path]:
    """Files that a study in the folder `beside` names and that do not lie in `folder`."""
    root = folder.resolve()
    return [each for each in _places(settings, beside) if not each.is_relative_to(root)]


def _places(settings: Settings, beside: Path) -> list[Path]:
    named = dict.fromkeys(named_paths(settings))
    places = (path if path.is_absolute() else beside / path for path in named)
    return list(dict.fromkeys(_followed(each) for each in places))


def require_inside(folder: Path, study: Path) -> None:
    """Refuse a study that names a file outside a folder.

    Raises
    ------
    StudyError
        With the files.
    """
    if outside := outside_places(folder, read_settings(study), study.parent):
        named = ", ".join(map(shown_name, outside[:MOST_NAMED]))
        more = f" and {len(outside) - MOST_NAMED} more" if len(outside) > MOST_NAMED else ""
        raise StudyError(
            "the study names files outside the folder of the page, which opens none of them",
            found=named + more,
            needed="files in this folder",
            action="copy them into the folder and name them there, or run the study by flightid "
            "run on the terminal",
        )


@contextmanager
def draft_inside(study: Path, text: str) -> Iterator[Path]:
    """A text as a file beside a study of the workspace, which names nothing outside of that.

    Raises
    ------
    StudyError
        It does, or cannot be carried out as written.
    OSError
        The folder is a link, or cannot be written.
    """
    with draft_of(study, text) as draft:
        require_inside(study.parent.parent, draft)
        yield draft


def _followed(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):  # links that end nowhere
        return path.absolute()
