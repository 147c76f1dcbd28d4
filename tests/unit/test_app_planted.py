"""A workspace out of a stranger's archive: links, names and half files that were planted in it."""

from __future__ import annotations

import asyncio
import os
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from flightid.app import jobs
from flightid.app.jobs import Workers
from flightid.app.kept_parts import kept_fields, kept_overview
from flightid.app.own_folders import made_name
from flightid.app.schemas import Job, WholeText
from flightid.app.studies import Studies
from flightid.app.study_edits import KeyEdit, edited, etag_of, require_study
from flightid.app.workspace import NAME_BYTES, Workspace, plain_name
from flightid.errors import OptionError, StudyError
from tests.sweep_log import SweepFlight

LINKS = os.name != "nt"
NOBODY = 4_999_999
"""A process that no Linux has."""
OURS = ("logs", "studies", ".flightid", *(f".flightid/{x}" for x in ("uploads", "results", "jobs")))
pytestmark = pytest.mark.skipif(not LINKS, reason="links need a right of their own there")


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    flight = SweepFlight(sweep_s=4.0, rate_hz=50.0)
    return flight.write(tmp_path_factory.mktemp("log")).read_bytes()


async def _pieces(content: bytes) -> AsyncIterator[bytes]:
    yield content


def test_a_folder_of_ours_that_is_a_link_is_refused(tmp_path: Path) -> None:
    outside = tmp_path / "documents"
    outside.mkdir()
    (outside / "thesis.txt").write_text("mine")
    for number, name in enumerate(OURS):
        place = tmp_path / str(number) / name
        place.parent.mkdir(parents=True)
        place.symlink_to(outside)
        with pytest.raises(OptionError, match="is a link, or no folder"):
            Workspace(tmp_path / str(number))
        assert [path.name for path in outside.iterdir()] == ["thesis.txt"]


def test_a_draft_is_never_written_through_a_link(tmp_path: Path) -> None:
    target = tmp_path / "bashrc"
    target.write_text("original")
    study = tmp_path / "study.toml"
    for name in (".draft-study.toml", ".draft-live-study.toml"):
        (tmp_path / name).symlink_to(target)
    with pytest.raises(StudyError):
        require_study(study, "echo = 'a stranger'")
    assert target.read_text() == "original"
    workspace = Workspace(tmp_path)
    (tmp_path / "studies" / f"{'0' * 16}.toml").symlink_to(target)
    told = Studies(workspace).read("0" * 16)
    assert told is not None
    assert (told.state, told.text, told.etag) == ("no text", "", "")
    assert "a study file is a link" in told.lack
    with pytest.raises(OptionError, match="a study file is a link"):
        Studies(workspace).replace("0" * 16, WholeText(text="a = 1"), etag_of("original"))
    assert target.read_text() == "original"


def test_what_a_living_app_uploads_is_left_alone(tmp_path: Path) -> None:
    Workspace(tmp_path).index.close()
    uploads = tmp_path / ".flightid" / "uploads"
    living, dead = made_name("part.bin"), f"{NOBODY}-{'a' * 16}.part.bin"
    old, mine = made_name("part"), "letter.txt"
    for name in (living, dead, old, mine):
        (uploads / name).write_bytes(b"half")
    os.utime(uploads / old, (time.time() - 7200.0,) * 2)
    (uploads / f"{NOBODY}-{'b' * 16}.part").mkdir()
    (uploads / f"{NOBODY}-{'c' * 16}.part").symlink_to(tmp_path)
    Workspace(tmp_path)
    left = {path.name for path in uploads.iterdir()}
    assert {living, mine} <= left
    assert not {dead, old} & left
    assert len(left) == 4  # the folder and the link are nobody's upload


def test_one_bad_file_is_told_and_the_others_are_listed(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "good.bin").write_bytes(content)
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe.bin")).write_bytes(content)
    (tmp_path / "again").symlink_to(tmp_path, target_is_directory=True)
    expected = {"\ufffd\ufffd.bin": "its name is not UTF-8"}
    if os.geteuid():
        (tmp_path / "bad.bin").write_bytes(content)
        (tmp_path / "bad.bin").chmod(0)
        (tmp_path / "locked").mkdir(mode=0)
        expected |= {"bad.bin": "Permission denied", "locked": "Permission denied"}
    workspace = Workspace(tmp_path)
    workspace.scan()
    (entry,) = workspace.index.entries()
    assert workspace.index.paths(entry.id) == ["good.bin"]  # folder links are not followed
    assert workspace.left_out == expected


def test_a_file_that_cannot_be_opened_is_told(
    tmp_path: Path, content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("bad.bin", "good.bin"):
        (tmp_path / name).write_bytes(content)
    (tmp_path / "locked").mkdir()
    listed = Path.iterdir

    def refusing(folder: Path) -> Any:
        if folder.name == "locked":
            raise PermissionError(13, "Permission denied")
        return listed(folder)

    def hashed(path: Path) -> str:
        if path.name == "bad.bin":
            raise PermissionError(13, "Permission denied")
        return "0" * 64

    monkeypatch.setattr(Path, "iterdir", refusing)
    monkeypatch.setattr("flightid.app.workspace.sha256_of_file", hashed)
    workspace = Workspace(tmp_path)
    workspace.scan()
    assert workspace.left_out == dict.fromkeys(("bad.bin", "locked"), "Permission denied")
    assert [entry.path for entry in workspace.index.entries()] == ["good.bin"]


def test_a_broken_cache_is_as_none(tmp_path: Path) -> None:
    workspace, log = Workspace(tmp_path), "0" * 16
    outside = tmp_path / "outside.json"
    outside.write_text('{"groups": []}')
    for broken in ("{", "[]", "\udcff", '{"a": 1}', "[" * 100_000):
        for kind, read in (("overview", kept_overview), ("fields", kept_fields)):
            path = workspace.result_path(log, f"{kind}.json")
            path.write_bytes(broken.encode(errors="surrogateescape"))
            assert read(workspace, log) is None
            assert not path.exists()
    workspace.result_path(log, "fields.json").symlink_to(outside)
    assert kept_fields(workspace, log) is None
    workspace.forget(log)
    (tmp_path / ".flightid" / "results" / log).symlink_to(tmp_path)
    assert workspace.result(log, "overview") is None
    assert outside.exists()


def test_a_broken_note_of_a_job_is_removed(tmp_path: Path) -> None:
    marks = tmp_path / ".flightid" / "jobs"
    marks.mkdir(parents=True)
    outside = tmp_path / "victim.json"
    foreign = Job(id="../../victim", kind="review", log="x", state="waiting").model_dump_json()
    outside.write_text(foreign)
    for name, text in (("x", "{"), ("y", "[]"), ("review-x", foreign)):
        (marks / f"{name}.json").write_text(text)
    (marks / "link.json").symlink_to(outside)
    (marks / "folder.json").mkdir()
    workers = Workers(Workspace(tmp_path))
    workers.stop()
    assert workers.all() == []
    assert [path.name for path in marks.iterdir()] == ["folder.json"]
    assert outside.read_text() == foreign


def test_an_upload_stays_in_the_list_whatever_its_name(tmp_path: Path, content: bytes) -> None:
    workspace, taken = Workspace(tmp_path), set()
    for name in ("flight.dat", "flight", "飛" * 110 + ".BIN", "x" * 299 + ".BIN"):
        taken.add(asyncio.run(workspace.take(name, _pieces(content + name.encode()))))
    workspace.scan()
    assert {entry.id for entry in workspace.index.entries()} == taken
    assert len(taken) == 4
    assert NAME_BYTES == len(plain_name("x" * 300).encode()) == 120
    assert plain_name("飛" * 110 + ".BIN").endswith("飛.BIN")


def test_half_a_pair_is_no_text_of_a_study(tmp_path: Path) -> None:
    for path, value in ((("title",), "\ud800"), (("\ud800",), 1)):
        with pytest.raises(StudyError, match="cannot be changed there") as error:
            edited("title = 'a'\n", [KeyEdit(path, value)])
        str(error.value).encode()
    with pytest.raises(StudyError, match="is no text"):
        require_study(tmp_path / "study.toml", "a = '\ud800'")


def test_a_hand_is_not_kept_waiting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert jobs.PATIENCE_S == 60.0
    assert jobs.LONGEST_S == 900.0
    monkeypatch.setattr(jobs, "PATIENCE_S", 0.2)
    workers = Workers(Workspace(tmp_path))
    try:
        _, refusal, _ = asyncio.run(workers.live(time.sleep, 30.0))
    finally:
        workers.stop()
    assert "was ended" in refusal
