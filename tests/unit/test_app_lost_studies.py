"""Studies that are lost to the page: removed, or left by an editor so that nobody can read them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from fastapi import HTTPException

from flightid.app.bare_study import UNWRITTEN
from flightid.app.schemas import Edit, Edits, StudyStep, StudyText, WholeText
from flightid.app.studies import Studies
from flightid.app.study_edits import etag_of
from flightid.app.work import _settings_of
from flightid.app.workspace import Workspace
from flightid.errors import StudyError

RIG = "a" * 16
TEXT = """[study]
title = "A rig"
[[record]]
name = "one"
path = "../records/aaaaaaaaaaaaaaaa/a.csv"
[[model]]
name = "y from u"
identify = ["one"]
inputs = ["u"]
outputs = ["y"]
structure = "arx"
na = 2
nb = 2
nk = 1
"""
BROKEN = TEXT.replace('"A rig"', '"A rig')


@pytest.fixture
def studies(tmp_path: Path) -> Studies:
    """A set of records with a study that the page has written twice."""
    table = tmp_path / "records" / RIG / "a.csv"
    table.parent.mkdir(parents=True)
    table.write_text("time,u,y\n0,1,2\n1,0,3\n2,1,1\n")
    path = tmp_path / "studies" / f"{RIG}.toml"
    path.parent.mkdir()
    path.write_text(TEXT)
    made = Studies(Workspace(tmp_path))
    made.change(RIG, Edits(edits=[Edit(path=["study", "title"], value="The rig")]), etag_of(TEXT))
    return made


def _told(studies: Studies) -> StudyText:
    told = studies.read(RIG)
    assert told is not None
    return told


def test_a_slip_is_told_with_its_line_and_mended_from_the_page(
    studies: Studies, tmp_path: Path
) -> None:
    """It was as if there were no study."""
    path = tmp_path / "studies" / f"{RIG}.toml"
    assert (_told(studies).lack, _told(studies).of_records) == ("", True)
    path.write_text(BROKEN)
    told = _told(studies)
    assert "line 2" in told.lack
    assert (told.text, told.etag, told.of_records) == (BROKEN, etag_of(BROKEN), True)
    with pytest.raises(StudyError, match=r"stands there, and nothing was written over it.*line 2"):
        studies.require_readable(RIG)
    with pytest.raises(StudyError):
        studies.change(RIG, Edits(edits=[Edit(path=["plan"], value={})]), told.etag)
    with pytest.raises(HTTPException):
        studies.replace(RIG, WholeText(text=TEXT), UNWRITTEN)
    assert path.read_text() == BROKEN
    # The version before is there, as is the slip itself.
    back = studies.step(RIG, StudyStep(back=True), told.etag)
    assert back is not None
    assert (back.lack, back.settings["study"]["title"]) == ("", "The rig")
    path.write_text(BROKEN)
    mended = studies.replace(RIG, WholeText(text=TEXT), etag_of(BROKEN))
    assert mended is not None
    assert (mended.lack, path.read_text()) == ("", TEXT)
    studies.require_readable(RIG)


def test_what_is_no_text_is_told_and_has_no_tag_to_write_over_it(
    studies: Studies, tmp_path: Path
) -> None:
    path = tmp_path / "studies" / f"{RIG}.toml"
    path.write_bytes(b"\xff\xfe")
    assert (_told(studies).text, _told(studies).etag) == ("", "")
    assert "UTF-8" in _told(studies).lack


def test_one_that_is_gone_is_not_begun_anew_without_its_models(
    studies: Studies, tmp_path: Path
) -> None:
    """A plot wrote a study without models in its place."""
    path = tmp_path / "studies" / f"{RIG}.toml"
    stood = path.read_text()
    path.unlink()
    told = _told(studies)
    assert f"studies/{RIG}.toml" in told.lack
    assert (told.state, told.text, told.etag, told.undoable) == ("lost", stood, UNWRITTEN, 1)
    plot = Edits(edits=[Edit(path=["plot"], value=[{"series": ["A.B"]}])])
    assert studies.change(RIG, plot, UNWRITTEN) is None
    assert not path.exists()
    again = studies.replace(RIG, WholeText(text=told.text), told.etag)
    assert again is not None
    assert (again.lack, path.read_text(), again.undoable) == ("", stood, 1)
    # None that stood once is not lost.
    assert studies.read("b" * 16) is None


def test_a_log_is_inspected_whatever_stands_in_its_study(tmp_path: Path) -> None:
    """The slip was the reason for no flight, and "No model" for one that carries three."""
    path = tmp_path / "a.toml"
    made = cast("Any", SimpleNamespace(models=("y from u",), text=TEXT))
    assert _settings_of(path, made) is None
    path.write_text(BROKEN)
    settings = _settings_of(path, made)
    assert settings is not None
    assert [each.name for each in settings.models] == ["y from u"]
    assert _settings_of(path, cast("Any", SimpleNamespace(models=(), text=""))) is None
