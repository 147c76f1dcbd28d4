"""Work of the local page beside the server: how far it is, how it ends, what takes its place."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from pebble import ProcessExpired

from flightid.app import jobs
from flightid.app.jobs import Workers
from flightid.app.schemas import Job
from flightid.app.watched import ENDED, ask_to_end, forget, progress_at, watched
from flightid.app.work import StageCache
from flightid.app.workspace import Workspace
from flightid.progress import progress
from tests.contract.source import ROOT

LOG = "0" * 16


def steps(place: Path, end: bool) -> list[object]:
    """Work in two parts, the inner told while it goes on; it may be asked to end meanwhile."""
    seen: list[object] = []
    with progress(None, "tuning"):
        seen.append(progress_at(place))
        with progress(4, "roll") as advance:
            for _ in range(4):
                time.sleep(0.21)
                if end:
                    ask_to_end(place)
                advance()
                seen.append(progress_at(place))
    return seen


def test_work_tells_how_far_it_is_and_ends_where_it_is_asked(tmp_path: Path) -> None:
    place = tmp_path / "now"
    seen, refusal, _ = watched(place, steps, place, False)
    assert not refusal
    told = [(each.label, each.share) for each in seen]
    assert told == [("tuning", None), *(("roll", k / 4) for k in range(1, 5))]
    assert watched(place, steps, place, True)[:2] == (None, ENDED)
    forget(place)
    assert (progress_at(place), [*tmp_path.iterdir()]) == (None, [])
    place.write_text('{"label": "half')
    assert progress_at(place) is None


def test_results_that_were_taken_last_are_kept() -> None:
    cache = StageCache()
    for k in range(60):
        cache[str(k)] = k
        assert cache["0"] == 0
    assert ("1" in cache, "0" in cache, len(cache)) == (False, True, 48)


@pytest.mark.parametrize("error", [ProcessExpired("died"), BrokenProcessPool("died")])
def test_work_whose_process_was_killed_says_what_to_do(error: Exception) -> None:
    future: Future[tuple[object, str, float]] = Future()
    future.set_exception(error)
    workers, heard = Workers.__new__(Workers), list[str]()
    workers._jobs = {"run": Job(id="run", kind="run", log=LOG, state="waiting")}
    workers._futures, workers._stopping = {"run": future}, False
    workers._change = lambda name, state, reason: heard.extend((name, state, reason))
    workers._ended("run", future)
    assert heard[:2] == ["run", "failed"]
    assert "ask again" in heard[2]
    assert type(error).__name__ not in heard[2]


def test_work_of_a_server_that_is_stopped_is_offered_by_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An ordinary end of the server took its note away, where a killed one's stayed."""
    place = tmp_path / "pids"
    monkeypatch.setitem(jobs.WORK, "run", lambda *_: (silent, place))

    async def begun() -> None:
        workers = Workers(Workspace(tmp_path))
        workers.start()
        workers.ensure("run", LOG, tmp_path)
        await _until(place.is_file)
        await asyncio.to_thread(workers.stop)
        await asyncio.sleep(0.1)

    asyncio.run(begun())
    workers = Workers(Workspace(tmp_path))
    assert [(each.kind, each.state) for each in workers.all()] == [("run", "interrupted")]
    workers.stop()


def test_work_that_outlived_its_server_is_not_offered_again(tmp_path: Path) -> None:
    """The process of a killed server brings its work to the end; its note stays behind."""
    workspace = Workspace(tmp_path)
    Workers(workspace).stop()
    mark = tmp_path / ".flightid" / "jobs" / f"run-{LOG}.json"
    begun = Job(id=mark.stem, kind="run", log=LOG, state="waiting", begun_s=time.time() - 10.0)
    mark.write_text(begun.model_dump_json())
    workers = Workers(workspace)
    workspace.keep_result(LOG, "run", {})
    result = workspace.result_path(LOG, "run.json")
    os.utime(result, (0.0, begun.begun_s - 1.0))
    assert [each.state for each in workers.of_log(LOG)] == ["interrupted"], "of the run before"
    os.utime(result, (0.0, begun.begun_s + 1.0))
    assert (workers.of_log(LOG), workers.all(), mark.exists()) == ([], [], False)
    workers.stop()


BEGUN = """
import asyncio, pathlib, sys
from flightid.app import jobs
from flightid.app.workspace import Workspace
from tests.unit.test_app_watched import LOG, silent
folder = pathlib.Path(sys.argv[1])
jobs.WORK["run"] = lambda *_: (silent, folder / "pids")
async def begin():
    workers = jobs.Workers(Workspace(folder))
    workers.start()
    workers.ensure("run", LOG, folder)
    await asyncio.sleep(600)
asyncio.run(begin())
"""


@pytest.mark.slow
def test_work_that_fell_with_its_server_and_all_processes_is_offered(tmp_path: Path) -> None:
    """As a power cut leaves it: nobody brings the work to its end."""
    words = [sys.executable, "-c", BEGUN, str(tmp_path)]
    server = subprocess.Popen(words, cwd=ROOT, start_new_session=True)
    asyncio.run(_until((tmp_path / "pids").is_file))
    os.killpg(server.pid, signal.SIGKILL)
    server.wait()
    workers = Workers(Workspace(tmp_path))
    assert [(each.kind, each.state) for each in workers.of_log(LOG)] == [("run", "interrupted")]
    workers.stop()


@pytest.mark.slow
def test_work_on_a_newer_version_takes_the_place_of_the_older(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process that holds plants and fits lives on where its work ends by itself."""
    place = tmp_path / "pids"
    monkeypatch.setitem(jobs.WORK, "gains", lambda *_: (slow, place))
    monkeypatch.setattr(jobs, "LOOK_S", 0.05)

    async def asked() -> tuple[list[Job], list[str]]:
        workers, heard = Workers(Workspace(tmp_path)), list[Job]()
        workers.start()
        workers.listen(heard.append)
        workers.ensure("gains", LOG, tmp_path, of="a")
        await _until(lambda: any(each.label == "slow" for each in heard))
        workers.ensure("gains", LOG, tmp_path, of="a")  # It runs.
        workers.ensure("gains", LOG, tmp_path, of="b")
        await _until(lambda: len(place.read_text().split()) == 2)
        assert workers.cancel(f"gains-{LOG}")
        workers.ensure("gains", LOG, tmp_path, of="b")  # Cancelled: nobody asks again.
        states = [(each.of, each.state) for each in workers.of_log(LOG)]
        assert states == [("b", "cancelled")]
        pids = place.read_text().split()
        await asyncio.to_thread(workers.stop)
        return heard, pids

    heard, pids = asyncio.run(asked())
    assert len(set(pids)) == 1, "one process did both"
    assert {each.of for each in heard} == {"a", "b"}
    assert all(each.begun_s > 0.0 for each in heard)
    assert not list((tmp_path / ".flightid" / "progress").iterdir())


@pytest.mark.slow
def test_plants_outlive_work_that_is_silent_when_it_is_asked_to_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second move of a slider ended the first one's work, and with its process all plants."""
    place = tmp_path / "pids"
    monkeypatch.setitem(jobs.WORK, "gains", lambda *_: (silent, place))
    monkeypatch.setattr(jobs, "END_S", 0.1)

    async def asked() -> None:
        workers = Workers(Workspace(tmp_path))
        workers.start()
        for move in range(1, 4):
            workers.ensure("gains", LOG, tmp_path, of=str(move))
            await _until(lambda n=move: place.is_file() and len(place.read_text().split()) == n)
        await asyncio.to_thread(workers.stop)

    asyncio.run(asked())
    assert len(set(place.read_text().split())) == 1, "one process did all"


@pytest.mark.slow
def test_what_a_hand_will_wait_for_is_made_once_and_before_it(tmp_path: Path) -> None:
    """A server that was started anew drew the plants of known gains at the first slider's move."""
    place = tmp_path / "pids"

    async def asked() -> None:
        workers = Workers(Workspace(tmp_path))
        workers.start()
        for _ in range(3):
            workers.prepare("plants", noted, place)
        await workers.tuned(noted, place)
        assert workers.all() == [], "nobody is told"
        await asyncio.to_thread(workers.stop)

    asyncio.run(asked())
    first, moved = place.read_text().split()
    assert first == moved, "in the process that the hand asks"


def noted(place: Path) -> None:
    with place.open("a") as stream:
        stream.write(f"{os.getpid()}\n")


def silent(place: Path) -> None:
    with place.open("a") as stream:
        stream.write(f"{os.getpid()}\n")
    time.sleep(1.0)
    with progress(1000, "silent") as advance:
        for _ in range(1000):
            advance()
            time.sleep(0.01)


def slow(place: Path) -> None:
    with place.open("a") as stream:
        stream.write(f"{os.getpid()}\n")
    with progress(1000, "slow") as advance:
        for _ in range(1000):
            time.sleep(0.02)
            advance()


async def _until(true: object) -> None:
    for _ in range(600):
        if true():  # type: ignore[operator]
            return
        await asyncio.sleep(0.05)
    pytest.fail("nothing came")
