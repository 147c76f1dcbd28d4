"""Runs, their zips and records of a rig, where a stranger planted links, pipes and half files."""

from __future__ import annotations

import asyncio
import json
import os
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from flightid.app import run_work
from flightid.app.kept_parts import kept_part
from flightid.app.rigs import Rigs
from flightid.app.run_routes import _left_out, _packed
from flightid.app.run_schemas import RunPart
from flightid.app.studies import Studies
from flightid.app.study_edits import KeyEdit, edited, etag_of, parts_of
from flightid.app.workspace import Workspace
from flightid.errors import OptionError, StudyError
from flightid.report.content import Document

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links need a right of their own there")
STUDY = (
    '[study]\ntitle = "t"\naircraft = "a"\n[[record]]\nname = "r"\npath = "{path}"\n'
    '[[model]]\nname = "m"\nstructure = "oe"\ninputs = ["u"]\noutputs = "y"\n'
    'identify = "r"\nnb = 1\nnf = 1\nnk = 1\n'
)
TABLE = b"t,u,y\n0,1,2\n1,0,3\n2,1,1\n"


async def _unread(path: Path) -> str:
    del path
    return ""


async def _pieces(content: bytes) -> AsyncIterator[bytes]:
    yield content


def test_a_pipe_among_the_records_is_not_waited_for(tmp_path: Path) -> None:
    rigs = Rigs(Workspace(tmp_path))

    async def take() -> str:
        first = await rigs.take("a.csv", _pieces(TABLE), check=_unread)
        os.mkfifo(tmp_path / "records" / first / "b.csv")
        return await asyncio.wait_for(rigs.take("b.csv", _pieces(TABLE), first, check=_unread), 5.0)

    held = sorted(each.name for each in (tmp_path / "records" / asyncio.run(take())).iterdir())
    assert len(held) == 3, held
    assert held[1].startswith("b ")


def test_a_run_takes_and_removes_nothing_that_a_link_leads_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study, folder, mine = tmp_path / "s.toml", tmp_path / "results", tmp_path / "mine"
    study.write_text(STUDY.format(path="a.csv"))
    folder.mkdir()
    mine.mkdir()
    (mine / "notes.txt").write_text("mine")
    own = folder / f"run-{etag_of(study.read_text()).strip(chr(34))[:16]}"
    for planted in (own, folder / "run-zzz", folder / f"run-{'0' * 16}"):
        planted.symlink_to(mine)
    (folder / f"run-{'1' * 16}").mkdir()

    def run_study(path: Path, *, output: Path, cache: str) -> Any:
        del path, cache
        assert not output.is_symlink()
        output.mkdir()
        return SimpleNamespace(document=Document("t", "", ()))

    monkeypatch.setattr(run_work, "run_study", run_study)
    run_work.make_run(study, folder, folder / "run.json")
    assert [each.name for each in mine.iterdir()] == ["notes.txt"]
    assert sorted(each.name for each in folder.glob("run-*") if each.is_dir()) == [own.name]
    ran = RunPart.model_validate_json((folder / "run.json").read_text()).parts
    # Words and gains asked for since leave what a run has found of the models as it is.
    more = f"# mine\n{study.read_text()}\n[tune]\npreset = 'firm'\n"
    assert (parts_of(more).models, parts_of(more).gains != ran.gains) == (ran.models, True)
    assert parts_of(edited(more, [KeyEdit(("fit", "starts"), 1)])).models != ran.models


def test_a_run_that_names_another_folder_is_none(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    whole = {"etag": "e", "parts": {"models": "m", "gains": "g"}, "title": "t", "tally": "",
             "verdict": "green", "seconds": 1.0, "figures": 0, "sections": []}  # fmt: skip
    for folder, held in ((f"run-{'a' * 16}", True), ("..", False), ("/etc", False),
                         (f"run-{'a' * 16}\n", False)):  # fmt: skip
        path = workspace.result_path("0" * 16, "run.json")
        path.write_text(json.dumps(whole | {"folder": folder}))
        assert (kept_part(workspace, "0" * 16, "run") is not None) is held, folder


def test_a_zip_follows_no_link_and_says_what_it_lacks(tmp_path: Path) -> None:
    folder, secret, far = tmp_path / "w", tmp_path / "secret", tmp_path / "far.csv"
    secret.write_text("secret")
    far.write_bytes(TABLE)
    folder.mkdir()
    workspace = Workspace(folder)
    study = workspace.study_path("0" * 16)
    study.write_text(STUDY.format(path=far))
    made = folder / "run"
    made.mkdir()
    (made / "old.txt").write_text("kept")
    os.utime(made / "old.txt", (0, 0))
    (made / "k.txt").symlink_to(secret)
    backstage: Any = SimpleNamespace(workspace=workspace)
    assert _left_out(workspace, "0" * 16) == [str(far)]
    assert _left_out(workspace, "1" * 16) == []
    with _packed(backstage, "0" * 16, made) as packed, zipfile.ZipFile(packed) as archive:
        names = archive.namelist()
        assert str(far) in archive.read("NOT_IN_HERE.txt").decode()
    assert [each.rpartition("/")[2] for each in names] == [study.name, "NOT_IN_HERE.txt", "old.txt"]


def test_a_study_behind_a_link_is_neither_run_nor_packed(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    (tmp_path / "theirs.toml").write_text("[study]\n")
    workspace.study_path("0" * 16).symlink_to(tmp_path / "theirs.toml")
    with pytest.raises(OptionError, match="is a link"):
        Studies(workspace).opened("0" * 16)
    with pytest.raises(StudyError, match="no study"):
        Studies(workspace).opened("../x")
