"""Study files of the workspace: read, edited by one who has seen the last version, else refused."""

from __future__ import annotations

import threading
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fastapi import HTTPException

from flightid.app.bare_study import UNWRITTEN, bare_study, completed, opened
from flightid.app.kept_parts import kept_overview
from flightid.app.own_folders import read_plain, shown_name
from flightid.app.python_lines import python_lines
from flightid.app.rigs import Rigs
from flightid.app.schemas import Edits, StudyParts, StudyStep, StudyText, WholeText
from flightid.app.study_edits import KeyEdit, edited, etag_of, parts_of, write_study
from flightid.app.study_history import StudyHistory, Versions
from flightid.app.study_reach import outside_places
from flightid.app.workspace import ID, Workspace
from flightid.errors import FlightidError, StudyError
from flightid.reading import DOCUMENT_BYTES, read_toml
from flightid.study.settings import read_settings

GONE = "The study is not in the folder any more: studies/{}.toml was removed or renamed"
UNOPENED = "# The study names files outside the folder of the page, which opens none of them.\n"


class Studies:
    """The study of each log.

    Parameters
    ----------
    workspace : Workspace
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._history = StudyHistory(workspace)
        self._lock = threading.Lock()

    def path(self, log: str) -> Path | None:
        """Study file of a log; None where there is none."""
        path = self._workspace.study_path(log)
        return path if path.is_file() else None

    def opened(self, log: str) -> tuple[Path, str]:
        """Study file of a log and its text, for work that needs both.

        Raises
        ------
        StudyError
            There is none, or `text_of` refuses it: a link is not followed.
        """
        path = self.path(log) if ID.fullmatch(log) else None
        if path is None:
            raise StudyError("there is no study of this log or these records", found=log)
        return path, text_of(path)

    def read(self, log: str) -> StudyText | None:
        """The study file with what the page reads off it; None where there never was one.

        One that cannot be read, or stood and is gone, is told as a lack: the reason, and its text.
        """
        path = self.path(log)
        if path is None:
            return self._missing(log)
        text = ""
        try:
            text = text_of(path)
            settings, parts = _tables(path), parts_of(text)
        except FlightidError as error:
            return self._lacking(log, str(error), text, etag_of(text) if text else "")
        outside = _outside(self._workspace.folder, path)
        versions = self._history.versions(log, text)
        return StudyText(
            undoable=versions.behind,
            redoable=versions.ahead,
            text=text,
            etag=etag_of(text),
            parts=parts,
            settings=settings,
            python=UNOPENED if outside else _python(path),
            outside=outside,
            of_records=bool(Rigs(self._workspace).files(log)),
        )

    def require_readable(self, log: str) -> None:
        """Refuse a file that stands where the study is, and cannot be read.

        Raises
        ------
        StudyError
            With the reason; nothing is wrong where no file stands.
        """
        told = None if self.path(log) is None else self.read(log)
        if told is not None and told.lack:
            raise StudyError(
                "a study file that cannot be read stands there, and nothing was written over it",
                found=told.lack,
                action="mend it, or propose anew in its place",
            )

    def change(self, log: str, edits: Edits, tag: str) -> StudyText | None:
        """Change keys of the version that `tag` names; another version is a conflict (409).

        Where there is none, a change of `UNWRITTEN` begins the study of a log.
        """
        made = [KeyEdit(tuple(each.path), each.value) for each in edits.edits]

        def changed(old: Versions) -> Versions:
            return old.followed_by(completed(edited(opened(old.text), made)))

        if tag == UNWRITTEN and self.path(log) is None:
            return self._begin(log, changed)
        return self._put(log, tag, changed)

    def replace(self, log: str, whole: WholeText, tag: str) -> StudyText | None:
        """Put a text in place of the version that `tag` names; another is a conflict (409).

        Where there is none, a text of `UNWRITTEN` is written: of a study that was deleted.
        """
        if tag == UNWRITTEN and self.path(log) is None:
            return self._written_again(log, whole.text)
        return self._put(log, tag, lambda old: old.followed_by(whole.text))

    def step(self, log: str, steps: StudyStep, tag: str) -> StudyText | None:
        """Go a version back, or forward again; nothing happens where there is none."""
        by = -1 if steps.back else 1

        def moved(old: Versions) -> Versions:
            return old.moved(by) if (old.behind if steps.back else old.ahead) else old

        return self._put(log, tag, moved)

    def _missing(self, log: str) -> StudyText | None:
        """What is left of a study with models that is in the folder no more; None: there was none.

        Who inspected the log saw a study, or its versions are kept.
        """
        if not ID.fullmatch(log) or not self._is_known(log):
            return None
        text, seen = self._history.last(log), kept_overview(self._workspace, log)
        if not (seen is not None and seen.has_study) and not _names_models(text):
            return None
        return self._lacking(log, GONE.format(log), text, UNWRITTEN)

    def _lacking(self, log: str, why: str, text: str, tag: str) -> StudyText:
        undoable = self._history.versions(log, text).behind if tag not in ("", UNWRITTEN) else 0
        return StudyText(
            text=text,
            etag=tag,
            parts=StudyParts(models="", gains="", views=""),
            settings={},
            python="",
            undoable=undoable,
            of_records=bool(Rigs(self._workspace).files(log)),
            lack=why,
        )

    def _is_known(self, log: str) -> bool:
        """Whether the log, or the records, are there."""
        workspace = self._workspace
        return workspace.log_path(log) is not None or bool(Rigs(workspace).files(log))

    def _begin(self, log: str, made: Callable[[Versions], Versions]) -> StudyText | None:
        """Write the first version of a study that no proposal wrote; None where it has no place.

        In the place of one with models that is gone it has none: they would be gone for good.
        """
        with self._lock:
            bare = bare_study(self._workspace, log)
            path = self._workspace.study_path(log)
            if bare is None or path.exists() or self._missing(log) is not None:
                return None
            versions = made(Versions((bare,), 0))
            write_study(path, versions.text)
            self._history.keep(log, versions)
            return self.read(log)

    def _written_again(self, log: str, text: str) -> StudyText | None:
        """Write the study of a log or of records that are there; None where they are not."""
        known = self._is_known(log)
        with self._lock:
            path = self._workspace.study_path(log)
            if not known or path.exists():
                return None
            write_study(path, text)
            self._history.keep(log, self._history.versions(log, text))
            return self.read(log)

    def _put(self, log: str, tag: str, made: Callable[[Versions], Versions]) -> StudyText | None:
        path = self.path(log)
        if path is None:
            return None
        with self._lock:
            text = text_of(path)
            if etag_of(text) != tag:
                raise HTTPException(409, {"text": text, "etag": etag_of(text)})
            versions = made(self._history.versions(log, text))
            if versions.text != text:
                write_study(path, versions.text)
                self._history.keep(log, versions)
            return self.read(log)


def text_of(path: Path) -> str:
    """Text of a study file.

    Raises
    ------
    StudyError
        It is a link, too long, no UTF-8, or cannot be read.
    """
    try:
        return read_plain(path, DOCUMENT_BYTES).decode()
    except (OSError, UnicodeError) as error:
        raise StudyError(
            "the study file cannot be read", found=str(error), needed="a file of UTF-8"
        ) from error


def _names_models(text: str) -> bool:
    """Whether a text that stood names models; one that is no TOML may."""
    try:
        return bool(tomllib.loads(text).get("model"))
    except (tomllib.TOMLDecodeError, RecursionError):
        return True


def _tables(path: Path) -> dict[str, Any]:
    return read_toml(path, "the study file")


def _outside(folder: Path, path: Path) -> list[str]:
    """Files outside the folder; none of a study that cannot be read."""
    try:
        return [shown_name(each) for each in outside_places(folder, path)]
    except FlightidError:
        return []


def _python(path: Path) -> str:
    """Python lines of every model, one after the other; why there are none, where it is so."""
    try:
        settings = read_settings(path)
        folder = path.parent
        parts = [
            f"# {model.name}\n{python_lines(settings, model.name, folder)}"
            for model in settings.models
        ]
    except (FlightidError, OSError) as error:
        return f"# {error}\n"
    return "\n".join(parts)
