"""Slow stages of one worker are taken by the others, and by one that was begun anew."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

pytest.importorskip("pebble", reason="the extra app is not installed")

from flightid.app import stage_cache
from flightid.app.stage_cache import StageCache, shared_folder
from flightid.study.stage_runner import StageRunner


def test_a_slow_stage_is_made_once_by_all_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stage_cache, "SLOW_S", 0.0)
    caches = [StageCache(), StageCache()]
    for each in caches:
        each.share(tmp_path)
    first, second = (StageRunner(each) for each in caches)
    for runner in (first, second):
        assert runner.stage("slow", sorted, [3, 1]).value == [1, 3]
    assert (first.carried_out, second.from_cache) == (["slow"], ["slow"])
    # What holds something open stays with its worker; a damaged file is made again.
    assert first.stage("open", threading.Lock).key not in {each.name for each in tmp_path.iterdir()}
    (kept,) = tmp_path.iterdir()
    kept.write_bytes(b"\x80\x05damaged")
    third = StageRunner(StageCache())
    assert third.stage("slow", sorted, [3, 1]).value == [1, 3]
    anew = StageCache()
    anew.share(tmp_path)
    fourth = StageRunner(anew)
    assert fourth.stage("slow", sorted, [3, 1]).value == [1, 3]
    assert fourth.carried_out == ["slow"]


def test_the_folder_is_of_this_user_alone_and_ends_with_its_server(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stage_cache.tempfile, "tempdir", str(tmp_path))
    left = tmp_path / f"{stage_cache.NAME}{2**22 + 1}-of-a-killed-server"
    left.mkdir()
    mine = shared_folder()
    assert not left.exists()
    assert mine.stat().st_mode & 0o77 == 0
    assert shared_folder() != mine
    assert mine.exists()
