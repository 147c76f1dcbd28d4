"""A study in every state that a page can meet, and every act on it: no text is lost, none wrong."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from fastapi import HTTPException

from flightid.app.bare_study import UNWRITTEN
from flightid.app.rig_routes import _proposed
from flightid.app.rig_schemas import RigProposal
from flightid.app.schemas import Edit, Edits, StudyStep, StudyText, WholeText
from flightid.app.studies import Studies
from flightid.app.study_history import StudyHistory
from flightid.app.workspace import Workspace
from flightid.errors import FlightidError
from tests.unit.test_app_lost_studies import BROKEN, RIG, TEXT

LOG = "b" * 16
OTHER = TEXT.replace('"A rig"', '"Of an editor"')
TYPED = TEXT.replace('"A rig"', '"As typed"')
NONSENSE = TEXT.replace('structure = "arx"', "structure = 3")
"""TOML, and no study."""
LEFT: dict[str, tuple[str | bytes | Path | None, str]] = {
    "as known": (TEXT, "readable"),
    "changed": (OTHER, "readable"),
    "a slip": (BROKEN, "unreadable"),
    "nonsense": (NONSENSE, "unreadable"),
    "emptied": ("", "unreadable"),
    "no text": (b"\xff\xfe", "no text"),
    "a link": (Path(__file__), "no text"),
    "removed": (None, "lost"),
}
"""What an editor leaves, and the state in which the page shall be told of it."""
ACTS: dict[str, Callable[[Studies, str, str], StudyText | None]] = {
    "save": lambda at, log, tag: at.replace(log, WholeText(text=TYPED), tag),
    "save what was seen": lambda at, log, tag: at.replace(log, WholeText(text=TEXT), tag),
    "save a slip": lambda at, log, tag: at.replace(log, WholeText(text=BROKEN), tag),
    "save nonsense": lambda at, log, tag: at.replace(log, WholeText(text=NONSENSE), tag),
    "undo": lambda at, log, tag: at.step(log, StudyStep(back=True), tag),
    "redo": lambda at, log, tag: at.step(log, StudyStep(back=False), tag),
    "click": lambda at, log, tag: at.change(
        log, Edits(edits=[Edit(path=["study", "title"], value="Clicked")]), tag
    ),
}
AT_ONCE = ("save", "undo", "click")
"""Tried by a page too that has not looked again."""
SAVED = {"save": TYPED, "save what was seen": TEXT}


class _Desk:
    """A folder with a log or records, their study as it was written first, and its file."""

    def __init__(self, folder: Path, log: str) -> None:
        self.folder, self.log, self.said = folder, log, list[str]()
        self.workspace = Workspace(folder)
        (folder / "records" / RIG).mkdir(parents=True)
        (folder / "records" / RIG / "a.csv").write_text("time,u,y\n0,1,2\n1,0,3\n2,1,1\n")
        (folder / "logs" / "x.bin").write_bytes(b"x")
        self.workspace.index.put("logs/x.bin", LOG, 1, 0)
        self.studies = Studies(self.workspace)
        self.path = folder / "studies" / f"{log}.toml"
        self.begin()

    def begin(self) -> StudyText:
        """The study as it is first, with nothing before it."""
        self.path.unlink(missing_ok=True)
        (self.folder / ".flightid" / "undo" / f"{self.log}.json").unlink(missing_ok=True)
        if self.log == RIG:
            self.propose()
        else:
            self.path.write_text(TEXT)
        told = self.studies.read(self.log)
        assert told is not None
        return told

    def propose(self) -> None:
        """*Write the study* of the screen Records."""

        async def made(*_: object) -> tuple[dict[str, Any], str, float]:
            return {"text": TEXT, "models": [], "said": [], "findings": []}, "", 0.0

        stage = SimpleNamespace(
            workspace=self.workspace, studies=self.studies, workers=SimpleNamespace(proposed=made)
        )
        asyncio.run(_proposed(cast("Any", stage), RIG, RigProposal()))

    def leave(self, content: str | bytes | Path | None) -> None:
        """As an editor does."""
        if content is None or isinstance(content, Path):
            self.path.unlink()
            if content is not None:
                self.path.symlink_to(content)
        else:
            self.path.write_bytes(content if isinstance(content, bytes) else content.encode())

    @property
    def bytes(self) -> bytes | None:
        return self.path.read_bytes() if self.path.exists() else None

    def act(self, name: str, tag: str) -> StudyText | None:
        """An act, and what it was refused with; a refusal names no file that nobody knows."""
        try:
            return ACTS[name](self.studies, self.log, tag)
        except (FlightidError, HTTPException) as error:
            self.said.append(str(error))
            return None

    def told(self) -> StudyText:
        """What a page hears that has just been opened."""
        told = Studies(self.workspace).read(self.log)
        assert told is not None
        assert bool(told.lack) == (told.state != "readable")
        assert ".draft-" not in told.lack
        return told

    def kept(self) -> set[str]:
        """Every text to which Undo and Redo lead."""
        held = StudyHistory(self.folder).held(self.log)
        assert held is not None
        return set(held.texts)


def _try(desk: _Desk, left: str, act: str, *, looked: bool) -> None:
    first = desk.begin()
    content, state = LEFT[left]
    desk.leave(content)
    before, cell = desk.bytes, (desk.log, left, looked, act)
    if not looked:  # the page acts on what it has shown before
        made = desk.act(act, first.etag)
        if left != "as known":
            assert made is None, cell
            assert desk.bytes == before, cell
    told = desk.told()
    if looked or left != "as known":
        assert told.state == state, cell
        last = TEXT if content is None else content
        assert told.text == (last if isinstance(last, str) else ""), cell
    if looked:
        made = desk.act(act, told.etag)
    known = {TEXT} | ({content} if isinstance(content, str) else set())
    if act in SAVED and made is not None:
        assert desk.bytes == SAVED[act].encode(), cell
        known.add(SAVED[act])
    elif act not in ("undo", "redo", "click") or made is None:
        assert desk.bytes == before, cell
    # What may be written is: whatever stands that is a text, or nothing.
    assert made is not None or act not in SAVED or not looked or state == "no text", cell
    if act.startswith("save ") and act not in SAVED:
        assert made is None, cell
    assert known <= desk.kept(), cell


def test_no_act_on_a_study_in_any_state_loses_a_text_or_tells_a_wrong_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four looks found another of these cells each; here is the whole table."""
    monkeypatch.setattr("flightid.files.flush", lambda _: None)  # no disk is lost here
    for log in (LOG, RIG):
        (tmp_path / log).mkdir()
        desk = _Desk(tmp_path / log, log)
        for left, act in product(LEFT, ACTS if log == RIG else AT_ONCE):
            _try(desk, left, act, looked=True)
            if act in AT_ONCE:
                _try(desk, left, act, looked=False)
        assert not [each for each in desk.said if ".draft-" in each]
        desk.workspace.index.close()


def test_what_was_kept_of_a_lost_study_outlives_all_that_is_begun_in_its_place(
    tmp_path: Path,
) -> None:
    desk = _Desk(tmp_path, RIG)
    desk.leave(OTHER)
    desk.told()
    desk.leave(None)
    # A click does not begin another one, *Write the study* does, and Undo leads to the one before.
    assert desk.act("click", UNWRITTEN) is None
    desk.propose()
    assert desk.bytes == TEXT.encode()
    assert {TEXT, OTHER} <= desk.kept()
    desk.leave(BROKEN)
    assert desk.told().undoable
    desk.leave(None)
    back = desk.act("undo", UNWRITTEN)
    assert back is not None
    assert back.state == "readable"
    with suppress(OSError):
        (tmp_path / ".flightid" / "undo" / f"{RIG}.json").unlink()
    desk.leave(None)
    assert Studies(desk.workspace).read(RIG) is None
    desk.workspace.index.close()
