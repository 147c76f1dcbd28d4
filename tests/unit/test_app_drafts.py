"""What is typed and not stored yet: kept by the folder, whatever port or browser opens it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from flightid.app import drafts
from flightid.app.draft_schemas import Draft, PlacedDraft
from flightid.app.drafts import all_drafts, keep_draft
from flightid.app.workspace import Workspace
from flightid.errors import OptionError


def _typed(place: str, text: str) -> PlacedDraft:
    return PlacedDraft(place=place, draft=Draft(text=text, name="", before=""))


def test_a_draft_outlives_the_server_that_took_it(tmp_path: Path) -> None:
    first = Workspace(tmp_path)
    keep_draft(first, _typed("study:0123", "[study"))
    keep_draft(first, _typed("study:0123", "[study]"))
    keep_draft(first, _typed("model:0123", "half \U0001f681 a model"))
    first.index.close()
    again = Workspace(tmp_path)
    told = {each.place: each.draft.text for each in all_drafts(again).drafts if each.draft}
    assert told == {"study:0123": "[study]", "model:0123": "half \U0001f681 a model"}
    known = _typed("study:0123", "[study]").draft
    keep_draft(again, PlacedDraft(place="study:0123", draft=None, known=known))
    keep_draft(again, PlacedDraft(place="never typed", draft=None))
    assert [each.place for each in all_drafts(again).drafts] == ["model:0123"]
    again.index.close()


def test_a_window_removes_no_draft_but_the_one_that_it_knows(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    mine, other = (_typed("study:0123", text) for text in ("A", "B"))
    for each in (mine, other):
        keep_draft(workspace, each)
    for known in (mine.draft, None):
        there = keep_draft(workspace, PlacedDraft(place="study:0123", draft=None, known=known))
        assert all_drafts(workspace).drafts == [other] == [there]
    keep_draft(workspace, PlacedDraft(place="study:0123", draft=None, known=other.draft))
    assert all_drafts(workspace).drafts == []
    workspace.index.close()


def test_folders_are_told_apart_and_the_oldest_drafts_go(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drafts, "MOST", 2)
    made = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        made.append(Workspace(tmp_path / name))
    one, other = made
    for k in range(3):
        keep_draft(one, _typed(f"place {k}", "x"))
        for path in (one.folder / ".flightid" / "drafts").iterdir():
            os.utime(path, ns=(path.stat().st_mtime_ns - 10**9,) * 2)
    assert [each.place for each in all_drafts(one).drafts] == ["place 2", "place 1"]
    assert all_drafts(other).drafts == []
    assert all_drafts(one).folder != all_drafts(other).folder
    for each in made:
        each.index.close()


@pytest.mark.skipif(os.name == "nt", reason="links need a right of their own there")
def test_planted_drafts_are_passed_over_and_links_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "w").mkdir()
    workspace = Workspace(tmp_path / "w")
    folder = workspace.folder / ".flightid" / "drafts"
    keep_draft(workspace, _typed("here", "mine"))
    (tmp_path / "secret.json").write_text(_typed("secret", "x").model_dump_json())
    (folder / "a.json").symlink_to(tmp_path / "secret.json")
    (folder / "b.json").write_text("[" * 100_000)
    (folder / "c.json").write_bytes(b"\xff\xfe")
    (folder / "d.json").mkdir()
    assert [each.place for each in all_drafts(workspace).drafts] == ["here"]
    for path in folder.iterdir():
        path.rmdir() if path.is_dir() and not path.is_symlink() else path.unlink()
    folder.rmdir()
    folder.symlink_to(tmp_path)
    with pytest.raises(OptionError, match="a link"):
        keep_draft(workspace, _typed("here", "mine"))
    workspace.index.close()
