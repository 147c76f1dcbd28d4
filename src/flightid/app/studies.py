"""Study files of the workspace: read, edited by one who has seen the last version, else refused."""

from __future__ import annotations

import threading
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from fastapi import HTTPException

from flightid.app.bare_study import UNWRITTEN, bare_study, completed, opened
from flightid.app.kept_parts import kept_overview
from flightid.app.own_folders import call_file, draft_of, read_plain, shown_name
from flightid.app.python_lines import python_lines
from flightid.app.rigs import Rigs
from flightid.app.schemas import Edits, StudyParts, StudyStep, StudyText, WholeText
from flightid.app.study_edits import KeyEdit, edited, etag_of, parts_of, require_study
from flightid.app.study_history import StudyHistory, Versions
from flightid.app.study_reach import outside_places
from flightid.app.workspace import ID, Workspace
from flightid.errors import FlightidError, OptionError, StudyError
from flightid.files import write_atomically
from flightid.reading import DOCUMENT_BYTES, parse_toml
from flightid.study.settings import Settings, read_settings

GONE = "The study is not in the folder any more: studies/{}.toml was removed or renamed"
UNSTORED = "the text to be written"
UNOPENED = "# The study names files outside the folder of the page, which opens none of them.\n"


class Studies:
    """The study of each log: what is known of it, and the one hand that writes it.

    Parameters
    ----------
    workspace : Workspace
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._history = StudyHistory(workspace.folder)
        self._lock = threading.RLock()

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
        """The study in its state, with what the page reads off it; None where there never was one.

        What stands is kept as a version: the page has shown it, and an editor may take it away.
        """
        with self._lock:
            try:
                path = self._workspace.study_path(log)
                if not path.exists():
                    return self._lost(log)
                text = text_of(path)
            except FlightidError as error:
                if not ID.fullmatch(log):
                    raise
                return self._bare(log, "no text", str(error))
            try:
                versions = self._history.seen(log, text)
            except (OSError, OptionError):  # it can be read without
                versions = Versions((text,), 0)
        bare = self._bare(log, "unreadable", "", versions, etag_of(text))
        try:
            with draft_of(path, text) as draft:
                settings = read_settings(draft)
            tables, parts = parse_toml(text, "the study file", path.name), parts_of(text)
        except (FlightidError, OSError) as error:
            return bare.model_copy(update={"lack": str(error)})
        places = outside_places(self._workspace.folder, settings, path.parent)
        outside = [shown_name(each) for each in places]
        python = UNOPENED if outside else _python(settings, path.parent)
        told = {"state": "readable", "parts": parts, "settings": tables, "python": python}
        return bare.model_copy(update={**told, "outside": outside})

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

        Where there is none, a change of `UNWRITTEN` begins the study of a log; not in the place
        of one with models that is gone: they would be gone for good.
        """
        made = [KeyEdit(tuple(each.path), each.value) for each in edits.edits]

        def changed(old: Versions | None, stands: bool) -> Versions | None:
            if not stands:
                bare = None if self._lost(log) else bare_study(self._workspace, log)
                if bare is None:
                    return None
                old = _after(old, bare)
            assert old is not None
            return old.followed_by(completed(edited(opened(old.text), made)))

        return self._write(log, tag, changed)

    def replace(self, log: str, whole: WholeText, tag: str) -> StudyText | None:
        """Put a text in place of the version that `tag` names; another is a conflict (409).

        Where there is none, a text of `UNWRITTEN` is written: of a study that is lost, or the
        first one.
        """
        return self._write(log, tag, lambda old, _: _after(old, whole.text))

    def step(self, log: str, steps: StudyStep, tag: str) -> StudyText | None:
        """Go a version back, or forward again; nothing happens where there is none.

        A version that could not be read comes back as it stood.
        """
        by = -1 if steps.back else 1

        def moved(old: Versions | None, stands: bool) -> Versions | None:
            if old is None or not (old.behind if steps.back else old.ahead):
                return old if stands else None
            return old.moved(by)

        return self._write(log, tag, moved, checked=False)

    def _write(
        self,
        log: str,
        tag: str,
        made: Callable[[Versions | None, bool], Versions | None],
        *,
        checked: bool = True,
    ) -> StudyText | None:
        """The only writer: over nothing but the version that `tag` names, which is kept before.

        Parameters
        ----------
        log, tag : str
            `UNWRITTEN`: nothing stands.
        made : callable
            Versions of the study, the one to be written standing, of those that are kept (None:
            no one is) and whether a file stands; None: nothing is written.
        checked : bool
            Whether a text that `flightid run` would refuse is refused.
        """
        with self._lock:
            path = self._workspace.study_path(log)
            stands = path.exists()
            if stands:
                text = text_of(path)
                if etag_of(text) != tag:
                    raise HTTPException(409, {"text": text, "etag": etag_of(text)})
                old: Versions | None = self._history.seen(log, text)
            elif tag != UNWRITTEN or not self._is_known(log):
                return None
            else:
                text, old = "", self._history.held(log)
            versions = made(old, stands)
            if versions is None:
                return None
            if checked:
                _require(path, versions.text)
            if versions.text != text or not stands:
                write_atomically(path, versions.text)
                self._history.keep(log, versions)
            return self.read(log)

    def _lost(self, log: str) -> StudyText | None:
        """What is left of a study with models that is in the folder no more; None: there was none.

        Who inspected the log saw a study, or its versions are kept.
        """
        if not ID.fullmatch(log) or not self._is_known(log):
            return None
        held, seen = self._history.held(log), kept_overview(self._workspace, log)
        kept = held or Versions(("",), 0)
        if not (seen is not None and seen.has_study) and not _names_models(kept.text):
            return None
        return self._bare(log, "lost", GONE.format(log), kept, UNWRITTEN)

    def _bare(
        self,
        log: str,
        state: Literal["unreadable", "no text", "lost"],
        why: str,
        versions: Versions | None = None,
        tag: str = "",
    ) -> StudyText:
        versions = versions or Versions(("",), 0)
        return StudyText(
            state=state,
            lack=why,
            text=versions.text,
            etag=tag,
            undoable=versions.behind,
            redoable=versions.ahead,
            parts=StudyParts(models="", gains="", views=""),
            settings={},
            python="",
            of_records=bool(Rigs(self._workspace).files(log)),
        )

    def _is_known(self, log: str) -> bool:
        """Whether the log, or the records, are there."""
        workspace = self._workspace
        return workspace.log_path(log) is not None or bool(Rigs(workspace).files(log))


def _after(old: Versions | None, text: str) -> Versions:
    """A text behind those that are kept; the one that stood last is not kept twice."""
    if old is None:
        return Versions((text,), 0)
    return old if old.text == text else old.followed_by(text)


def text_of(path: Path) -> str:
    """Text of a study file.

    Raises
    ------
    StudyError
        It is a link, a folder, too long, no UTF-8, or cannot be read.
    """
    if path.is_dir():
        raise StudyError("the study file is no file", found=f"a folder, {path.name}")
    try:
        return read_plain(path, DOCUMENT_BYTES).decode()
    except UnicodeDecodeError as error:
        found = f"{path.name}: byte {error.start} is none of UTF-8"
        raise StudyError("the study file is no text", found=found, needed="UTF-8") from error
    except OSError as error:
        raise StudyError(
            "the study file cannot be read", found=str(error), needed="a file of UTF-8"
        ) from error


def _require(path: Path, text: str) -> None:
    """Refuse what `flightid run` would refuse, and say that it is not what stands."""
    try:
        require_study(path, text)
    except FlightidError as error:
        call_file(error, path.name, UNSTORED)
        raise


def _names_models(text: str) -> bool:
    """Whether a text that stood names models; one that is no TOML may."""
    try:
        return bool(tomllib.loads(text).get("model"))
    except (tomllib.TOMLDecodeError, RecursionError):
        return True


def _python(settings: Settings, folder: Path) -> str:
    """Python lines of every model, one after the other; why there are none, where it is so."""
    try:
        parts = [
            f"# {model.name}\n{python_lines(settings, model.name, folder)}"
            for model in settings.models
        ]
    except (FlightidError, OSError) as error:
        return f"# {error}\n"
    return "\n".join(parts)
