"""A study's output folder appears whole or not at all."""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path

import pytest

from flightid.errors import StudyError
from flightid.study.output import SCHEMA, WRITTEN, clear_stale, require_replaceable, whole_folder
from flightid.study.owner import OWNER


def _write_results(folder: Path, mark: str) -> None:
    (folder / "results.json").write_text(json.dumps({"schema": SCHEMA, "mark": mark}))


def _break_off(final: Path, failure: type[BaseException]) -> None:
    with whole_folder(final) as folder:
        _write_results(folder, "half")
        raise failure


def _names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir() if entry.name != WRITTEN)


def test_folder_appears_when_the_work_is_done(tmp_path: Path) -> None:
    final = tmp_path / "deep" / "out"
    with whole_folder(final) as folder:
        _write_results(folder, "new")
        assert not final.exists()
    assert _names(final) == ["results.json"]
    assert _names(tmp_path / "deep") == ["out"]


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt])
def test_nothing_half_written_remains(tmp_path: Path, failure: type[BaseException]) -> None:
    with pytest.raises(failure):
        _break_off(tmp_path / "out", failure)
    assert _names(tmp_path) == []


def test_an_earlier_result_is_replaced_whole(tmp_path: Path) -> None:
    final = tmp_path / "out"
    for mark in ("first", "second"):
        with whole_folder(final) as folder:
            _write_results(folder, mark)
            (folder / mark).touch()
    assert _names(final) == ["results.json", "second"]
    assert _names(tmp_path) == ["out"]


def test_an_earlier_result_survives_a_failure(tmp_path: Path) -> None:
    final = tmp_path / "out"
    with whole_folder(final) as folder:
        _write_results(folder, "first")
    with pytest.raises(KeyboardInterrupt):
        _break_off(final, KeyboardInterrupt)
    assert json.loads((final / "results.json").read_text())["mark"] == "first"
    assert _names(tmp_path) == ["out"]


def test_an_earlier_result_returns_when_the_exchange_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    final = tmp_path / "out"
    with whole_folder(final) as folder:
        _write_results(folder, "first")
    replace = Path.replace

    def failing(self: Path, target: Path) -> Path:
        if self.suffix == ".part":
            raise OSError("disk full")
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", failing)
    with pytest.raises(OSError, match="disk full"), whole_folder(final) as folder:
        _write_results(folder, "second")
    assert json.loads((final / "results.json").read_text())["mark"] == "first"
    assert _names(tmp_path) == ["out"]


@pytest.mark.parametrize("content", ["notes.txt", "results.json"])
def test_a_strangers_folder_is_left_alone(tmp_path: Path, content: str) -> None:
    final = tmp_path / "out"
    final.mkdir()
    (final / content).write_text("not json")
    with pytest.raises(StudyError, match="holds something else"), whole_folder(final):
        pass
    assert (final / content).read_text() == "not json"


def test_an_empty_folder_may_be_used_and_a_file_may_not(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with whole_folder(tmp_path / "out") as folder:
        _write_results(folder, "new")
    (tmp_path / "file").touch()
    with pytest.raises(StudyError, match="holds something else"), whole_folder(tmp_path / "file"):
        pass


def test_files_of_the_user_in_an_earlier_result_stay(tmp_path: Path) -> None:
    final = tmp_path / "out"
    for mark in ("first", "second"):
        with whole_folder(final) as folder:
            _write_results(folder, mark)
            (folder / "gains.param").write_text(mark)
            (folder / mark).touch()
        if mark == "first":
            (final / "notes").mkdir()
            (final / "notes" / "mine.txt").write_text("mine")
            (final / "gains.param").write_text("edited")
    assert _names(final) == ["gains.kept1.param", "gains.param", "notes", "results.json", "second"]
    assert (final / "gains.kept1.param").read_text() == "edited"
    assert (final / "notes" / "mine.txt").read_text() == "mine"
    assert _names(tmp_path) == ["out"]


def test_a_folder_that_holds_inputs_is_refused(tmp_path: Path) -> None:
    data = tmp_path / "out" / "data.csv"
    with pytest.raises(StudyError, match="holds what the study reads"):
        require_replaceable(tmp_path / "out", [data])
    require_replaceable(tmp_path / "out", [tmp_path / "outer" / "data.csv"])


def test_a_result_that_does_not_list_its_files_is_left_alone(tmp_path: Path) -> None:
    with whole_folder(tmp_path / "out") as folder:
        _write_results(folder, "first")
    (tmp_path / "out" / WRITTEN).unlink()
    with pytest.raises(StudyError, match="holds something else"), whole_folder(tmp_path / "out"):
        pass


def _left(parent: Path, end: str, mark: str, process: int | None) -> Path:
    folder = parent / f".out.{end}"
    folder.mkdir()
    _write_results(folder, mark)
    if process is not None:
        note = {"machine": platform.node(), "process": process}
        (folder / OWNER).write_text(json.dumps(note))
    return folder


@pytest.mark.skipif(os.name == "nt", reason="Windows cannot say whether a process lives")
def test_the_next_run_clears_what_a_killed_one_left(tmp_path: Path) -> None:
    _left(tmp_path, "0123456789ab.part", "half", 2**22 + 1)
    living = _left(tmp_path, "1123456789ab.part", "half", os.getpid())
    young = _left(tmp_path, "2123456789ab.part", "half", None)
    foreign = tmp_path / ".out.mine.part"
    foreign.mkdir()
    clear_stale(tmp_path / "out")
    assert sorted(tmp_path.iterdir()) == sorted([living, young, foreign])


def test_a_folder_put_aside_gets_its_name_back_or_hands_over(tmp_path: Path) -> None:
    final = tmp_path / "out"
    _left(tmp_path, "0123456789ab.old", "first", None)
    clear_stale(final)
    assert json.loads((final / "results.json").read_text())["mark"] == "first"
    aside = _left(tmp_path, "1123456789ab.old", "older", None)
    (aside / "notes.txt").write_text("mine")
    with whole_folder(tmp_path / "else"):
        pass
    clear_stale(final)
    assert not aside.exists()
    assert (final / "notes.txt").read_text() == "mine"
    assert json.loads((final / "results.json").read_text())["mark"] == "first"
