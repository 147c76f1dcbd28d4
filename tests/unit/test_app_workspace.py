"""The folder that the page works in: found by content, never left, never lost with its index."""

from __future__ import annotations

import asyncio
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from fastapi import HTTPException
from tools.build_page import is_built, require_in
from tools.page_types import TARGET, page_types

from flightid.app import bare_study
from flightid.app.bare_study import UNWRITTEN
from flightid.app.plot_layouts import keep_layout, plot_layouts, remove_layout
from flightid.app.plot_schemas import PlotLayout
from flightid.app.schemas import Edit, Edits, StudyStep, StudyText, WholeText
from flightid.app.studies import Studies
from flightid.app.study_edits import KeyEdit, edited, etag_of, require_study
from flightid.app.workspace import Workspace
from flightid.errors import OptionError, StudyError
from flightid.study.settings import read_settings
from tests.sweep_log import SweepFlight


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return SweepFlight(sweep_s=4.0, rate_hz=50.0).write(tmp_path_factory.mktemp("log"))


async def _pieces(content: bytes) -> AsyncIterator[bytes]:
    for start in range(0, len(content), 10_000):
        yield content[start : start + 10_000]


def test_a_log_is_kept_once_by_its_content_inside_the_folder(tmp_path: Path, log: Path) -> None:
    workspace = Workspace(tmp_path)
    content = log.read_bytes()
    names = ("../../../evil flight.bin", "C:\\logs\\again.bin", "/etc/passwd.bin")
    taken = {asyncio.run(workspace.take(name, _pieces(content))) for name in names}
    assert len(taken) == 1
    (known,) = taken
    path = workspace.log_path(known)
    assert path == tmp_path.resolve() / "logs" / known / "evil flight.bin"
    assert path.read_bytes() == content
    assert [entry.id for entry in workspace.index.entries()] == [known]
    for name in ("", "..", "///"):
        with pytest.raises(OptionError, match="needs a name"):
            asyncio.run(workspace.take(name, _pieces(content)))
    with pytest.raises(OptionError, match="no log that flightid reads"):
        asyncio.run(workspace.take("page.bin", _pieces(b"<html><script>")))
    assert not list((tmp_path / ".flightid" / "uploads").iterdir())


def test_no_identifier_leads_out_of_the_folder(tmp_path: Path, log: Path) -> None:
    outside = tmp_path / "outside.bin"
    outside.write_bytes(log.read_bytes())
    folder = tmp_path / "workspace"
    folder.mkdir()
    (folder / "link.bin").symlink_to(outside)
    workspace = Workspace(folder)
    workspace.scan()
    assert not workspace.index.entries()
    for name in (
        "../outside",
        "..%2foutside",
        "0" * 15,
        "0" * 16 + "/",
        "g" * 16,
        "../" + "0" * 16,
    ):
        assert workspace.log_path(name) is None
        for place in (workspace.study_path, lambda each: workspace.result_path(each, "x")):
            with pytest.raises(OptionError, match="no log of the workspace"):
                place(name)


def test_the_index_can_be_made_again(tmp_path: Path, log: Path) -> None:
    for damage in ("gone", "garbage"):
        folder = tmp_path / damage
        folder.mkdir()
        _made_again(folder, log, damage)


def _made_again(tmp_path: Path, log: Path, damage: str) -> None:
    (tmp_path / "mine.bin").write_bytes(log.read_bytes())
    (tmp_path / "notes.log").write_text("no log of an autopilot\n")
    first = Workspace(tmp_path)
    first.scan()
    entries = first.index.entries()
    assert [entry.path for entry in entries] == ["mine.bin"]
    first.keep_result(entries[0].id, "overview", {"a": 1})
    first.index.close()
    for path in (tmp_path / ".flightid").glob("index.sqlite*"):
        path.unlink()
        if damage == "garbage" and path.suffix == ".sqlite":
            path.write_bytes(b"\0garbage" * 1000)
    again = Workspace(tmp_path)
    again.scan()
    assert again.index.entries() == entries
    assert again.result(entries[0].id, "overview") == {"a": 1}
    (tmp_path / "mine.bin").unlink()
    again.scan()
    assert again.log_path(entries[0].id) is None


STUDY = """# mine
[study]
title = "A" # of the flight

[log]
path = "flight.bin"

[[segment]]
name = "sweep"
span_s = [1.0, 2.0]

[[model]]
name = "Roll rate"
template = "rate_motor_lag"
axis = "roll"
identify = ["sweep"]
band_rad_s = [1.0, 20.0] # by hand
"""


def test_an_edit_changes_its_key_and_nothing_else(tmp_path: Path) -> None:
    band = KeyEdit(("model", 0, "band_rad_s"), [2.5, 31.4])
    assert edited(STUDY, [band]) == STUDY.replace("[1.0, 20.0]", "[2.5, 31.4]")
    # A table of a list that the file had not begins below an empty line, and one alone.
    spikes = KeyEdit(("conditioning", 0, "outliers"), {"deviations": 9.0})
    for end in ("", "\n"):
        assert "\n\n[[conditioning]]\n" in (made := edited(STUDY.rstrip() + "\n" + end, [spikes]))
        assert "\n\n\n" not in made
    more = edited(
        STUDY,
        [
            KeyEdit(("segment", 1), {"name": "brush", "span_s": [3.0, 4.0]}),
            KeyEdit(("model", 0, "identify"), ["brush"]),
            KeyEdit(("model", 0, "response", "estimator"), "composite"),
        ],
    )
    path = tmp_path / "study.toml"
    require_study(path, more)
    assert "# of the flight" in more
    assert "# by hand" in more
    with pytest.raises(StudyError, match="band_rads"):
        require_study(path, edited(more, [KeyEdit(("model", 0, "band_rads"), [1.0, 2.0])]))
    with pytest.raises(StudyError, match="cannot be changed there"):
        edited(STUDY, [KeyEdit(("model", 7, "name"), "x")])
    assert list(tmp_path.iterdir()) == []


def test_a_table_that_is_begun_amid_others_stands_apart() -> None:
    text = "[[model]]\nname = 'Roll' # mine\n\n[[model]]\nname = 'Pitch'\n"
    first = edited(text, [KeyEdit(("model", 0, "response", "compare"), ["composite"])])
    again = edited(first, [KeyEdit(("model", 0, "response", "n_omega"), 23)])
    own = '[model.response]\ncompare = ["composite"]\nn_omega = 23\n\n'
    assert again == text.replace("\n\n", f"\n\n{own}", 1)


def test_undo_goes_back_beyond_a_reload_and_a_kill(tmp_path: Path) -> None:
    """Each step is asked of a server of its own: what it knows lies in the folder."""
    workspace, log = Workspace(tmp_path), "0" * 16
    path = workspace.study_path(log)
    path.parent.mkdir(exist_ok=True)
    path.write_text(STUDY, "utf-8")

    def bands() -> tuple[float, int, int]:
        told = Studies(workspace).read(log)
        assert told is not None
        low = told.settings["model"][0]["band_rad_s"][0]
        return low, told.undoable, told.redoable

    def changed(low: float) -> None:
        made = Edits(edits=[Edit(path=["model", 0, "band_rad_s"], value=[low, 20.0])])
        Studies(workspace).change(log, made, etag_of(path.read_text("utf-8")))

    def stepped(*, back: bool) -> tuple[float, int, int]:
        Studies(workspace).step(log, StudyStep(back=back), etag_of(path.read_text("utf-8")))
        return bands()

    assert bands() == stepped(back=True) == (1.0, 0, 0)
    changed(2.0)
    changed(3.0)
    assert (stepped(back=True), stepped(back=True)) == ((2.0, 1, 1), (1.0, 0, 2))
    assert (stepped(back=False), bands()) == ((2.0, 1, 1), (2.0, 1, 1))
    # A kill after the study was written and before its history was: nothing of it is lost.
    history = tmp_path / ".flightid" / "undo" / f"{log}.json"
    kept = history.read_bytes()
    stepped(back=False)
    history.write_bytes(kept)
    assert (bands(), stepped(back=True)) == ((3.0, 2, 0), (2.0, 1, 1))
    # A hand in an editor is a version as well; what was ahead lies before all others.
    path.write_text(STUDY.replace("[1.0, 20.0]", "[5.0, 20.0]"), "utf-8")
    assert (bands(), stepped(back=True)) == ((5.0, 3, 0), (2.0, 2, 1))
    assert (stepped(back=True), stepped(back=False)) == ((1.0, 1, 2), (2.0, 2, 1))
    with pytest.raises(HTTPException):
        Studies(workspace).step(log, StudyStep(back=True), "of another version")
    for broken in (b"", b"[1]", b'{"texts": [], "at": 0}', b'{"texts": ["a"], "at": 4}', b"\xff"):
        history.write_bytes(broken)
        assert bands() == (2.0, 0, 0)


def test_what_a_log_without_a_model_asks_begins_its_study(
    tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plan, filters and plots of it were gone after a reload."""
    workspace = Workspace(tmp_path)
    known = asyncio.run(workspace.take("calm.bin", _pieces(log.read_bytes())))
    studies = Studies(workspace)

    def changed(key: str, value: object, tag: str, of: str = known) -> StudyText | None:
        return studies.change(of, Edits(edits=[Edit(path=[key], value=value)]), tag)

    # The job that inspects a log writes the study of its models: nothing goes before.
    assert changed("plan", {"amplitude": 0.05}, UNWRITTEN) is None
    monkeypatch.setattr(bare_study, "kept_overview", lambda *_: object())
    assert changed("plan", {"amplitude": 0.05}, UNWRITTEN, "0" * 16) is None
    with pytest.raises(StudyError):
        changed("plan", {"amplitude": -1.0}, UNWRITTEN)
    assert studies.read(known) is None
    told = changed("plan", {"amplitude": 0.05}, UNWRITTEN)
    assert told is not None
    assert told.settings["plan"] == {"amplitude": 0.05}
    read = read_settings(workspace.study_path(known)).log
    assert read is not None
    assert read.resolve() == workspace.log_path(known)
    with pytest.raises(HTTPException):
        changed("plan", {"amplitude": 0.1}, UNWRITTEN)
    # What is taken back leaves a study that reads; what is asked instead stands alone.
    for key, value, tables in (("plan", None, {"plan"}), ("plot", [{"series": ["A.B"]}], {"plot"})):
        told = changed(key, value, told.etag)
        assert told is not None
        assert told.settings.keys() - {"study", "log"} == tables
    for _ in range(3):
        told = studies.step(known, StudyStep(back=True), told.etag)
        assert told is not None
    assert (told.undoable, told.redoable, told.settings["plan"]) == (0, 3, {})


def test_a_deleted_study_is_written_again_from_its_text_alone(tmp_path: Path, log: Path) -> None:
    """The page had the words, and the folder took them no more."""
    workspace = Workspace(tmp_path)
    known = asyncio.run(workspace.take("calm.bin", _pieces(log.read_bytes())))
    studies, path = Studies(workspace), workspace.study_path(known)
    text = f'[study]\ntitle = "t"\n[log]\npath = "../logs/{known}/calm.bin"\n[plan]\n'
    path.parent.mkdir(exist_ok=True)
    assert studies.replace(known, WholeText(text=text), '"some"') is None
    assert studies.replace("0" * 16, WholeText(text=text), UNWRITTEN) is None
    with pytest.raises(StudyError):
        studies.replace(known, WholeText(text="[model"), UNWRITTEN)
    assert not path.exists()
    told = studies.replace(known, WholeText(text=text), UNWRITTEN)
    assert told is not None
    assert (told.text, path.read_text("utf-8")) == (text, text)
    # Somebody may have written it first: that is asked about, not overwritten.
    with pytest.raises(HTTPException) as other:
        studies.replace(known, WholeText(text=text + "\n"), UNWRITTEN)
    assert other.value.status_code == 409


def test_the_page_has_the_types_of_the_server() -> None:
    assert TARGET.read_text(encoding="utf-8") == page_types()


def test_a_wheel_without_the_page_fails(tmp_path: Path) -> None:
    wheel = tmp_path / "flightid-0-py3-none-any.whl"
    names = ["index.html", "page.js", "sources.sha256"]
    for kept in (names[1:], names[:1], []):
        with zipfile.ZipFile(wheel, "w") as made:
            for name in kept:
                made.writestr(f"flightid/app/page/{name}", "x")
        with pytest.raises(SystemExit, match="lacks the page"):
            require_in(wheel)
    with zipfile.ZipFile(wheel, "w") as made:
        for name in names:
            made.writestr(f"flightid/app/page/{name}", "x")
    with pytest.raises(SystemExit, match=r"lacks sboms/flightid\.cdx\.json"):
        require_in(wheel)
    with zipfile.ZipFile(wheel, "a") as made:
        made.writestr("flightid-0.dist-info/sboms/flightid.cdx.json", "{}")
    require_in(wheel)
    page, sources = tmp_path / "page", tmp_path / "app"
    page.mkdir()
    sources.mkdir()
    for name in names:
        (page / name).write_text("x")
    assert is_built(page, sources)  # an sdist: the page, and no sources of it
    (sources / "package.json").write_text("{}")
    assert not is_built(page, sources)


def test_layouts_of_plots_are_files_that_lead_nowhere_else(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    panes = [["RATE.R", "RATE.RDes"], ['=RCOU.C1 - RCOU.C2 + "µ"']]
    made = PlotLayout(name="motors", panes=panes)
    keep_layout(workspace, made)
    assert plot_layouts(workspace) == [made]
    for name, text in (("b", "[[pane]]"), ("c", "no TOML"), ("d", "[[pane]]\nseries = [1]")):
        (tmp_path / "plots" / f"{name}.toml").write_text(text)
    (tmp_path / "plots" / "e.toml").symlink_to("/etc/passwd")
    assert plot_layouts(workspace) == [made]
    for name in ("../a", "", "a/b", ".hidden"):
        with pytest.raises(ValueError, match="pattern"):
            PlotLayout(name=name, panes=panes)
    assert (remove_layout(workspace, "motors"), remove_layout(workspace, "motors")) == (True, False)
    assert plot_layouts(workspace) == []
