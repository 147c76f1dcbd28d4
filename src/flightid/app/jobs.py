"""Long work in processes beside the server: started once, cancelled for good, found again.

A pool for each that may not hold up another. One process keeps logs open for what a hand waits
for, one plants of tunings, one what is compared, one what is planned, one catalogues of fleets, one
runs fleets; others take jobs of seconds.
What is running stands in a file, so that a killed server offers it again.
"""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path
from typing import Any

from pebble import ProcessExpired

from flightid.app import fleet_work, run_work, work
from flightid.app.crew import Crew
from flightid.app.kept_parts import kept_part
from flightid.app.own_folders import own_folder, read_plain
from flightid.app.schemas import Job
from flightid.app.workspace import Workspace
from flightid.errors import FlightidError
from flightid.files import write_atomically
from flightid.fleet.catalogue.catalogue import QUERY_S

LONGEST_S = 900.0
"""Of a job; a hand's request may take `PATIENCE_S`."""
PATIENCE_S = 60.0
NOTE_BYTES = 1 << 16
Listener = Callable[[Job], None]


def _overview(workspace: Workspace, log: str, path: Path) -> tuple[object, ...]:
    result = workspace.result_path(log, "overview.json")
    return work.make_overview, path, workspace.study_path(log), result


def _review(workspace: Workspace, log: str, path: Path) -> tuple[object, ...]:
    return work.make_review, path, workspace.result_path(log, "review.json")


def _run(workspace: Workspace, log: str, path: Path) -> tuple[object, ...]:
    result = workspace.result_path(log, "run.json")
    return run_work.make_run, path, result.parent, result


def _fleet(workspace: Workspace, log: str, path: Path) -> tuple[object, ...]:
    return fleet_work.make_fleet, path, workspace.result_path(log, "fleet.json")


WORK: dict[str, Callable[[Workspace, str, Path], tuple[object, ...]]] = {
    "overview": _overview,
    "review": _review,
    "run": _run,
    "fleet": _fleet,
}
"""Call and inputs of each kind of job (`Job.kind`); its result is a part of `kept_parts.PARTS`."""
REPEATED = ("run", "fleet")
"""Kinds whose result depends on a file of the user: asked for again, they are done again."""
ENDLESS = ("fleet",)
"""Kinds that take as long as they take, in a process of their own."""
QUESTION_S = QUERY_S + 15.0
"""Longest time for a question to a catalogue: what DuckDB does not stop ends with its process."""


class Workers:
    """All pools.

    Parameters
    ----------
    workspace : Workspace
    """

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._jobs: dict[str, Job] = {}
        self._futures: dict[str, Future[Any]] = {}
        self._listeners: list[Listener] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._live, self._tuning, self._compared, self._planned = (Crew() for _ in range(4))
        self._asked, self._fleets = Crew(), Crew()
        self._long = Crew(max(1, (os.cpu_count() or 2) - 1))
        self._folder = own_folder(workspace.folder, ".flightid", "jobs")
        for job in _interrupted(self._folder):
            self._jobs[job.id] = job

    def start(self) -> None:
        """Load the workers before anybody waits for them; call it inside the event loop."""
        self._loop = asyncio.get_running_loop()
        for crew in (self._live, self._long):
            crew.schedule(work.warm)

    def stop(self) -> None:
        """End all processes."""
        short = (self._live, self._tuning, self._compared, self._planned, self._asked)
        crews = (*short, self._fleets, self._long)
        for crew in crews:
            crew.stop()
        for crew in crews:
            crew.join()

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Hear of every change of a job; returns what ends it."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def of_log(self, log: str) -> list[Job]:
        """Jobs of a log that are not done."""
        return [job for job in self._jobs.values() if job.log == log and job.state != "done"]

    def all(self) -> list[Job]:
        """Every job that is not done."""
        return [job for job in self._jobs.values() if job.state != "done"]

    def ensure(self, kind: str, log: str, path: Path, *, again: bool = False) -> None:
        """Begin a job, unless its result is there, it runs, or it failed and nobody asks again."""
        name = f"{kind}-{log}"
        known = self._jobs.get(name)
        repeats = again and kind in REPEATED
        if not repeats and kept_part(self._workspace, log, kind) is not None:
            return
        if known is not None and known.state == "waiting":
            return
        if known is not None and known.state in ("failed", "cancelled") and not again:
            return
        job = Job(id=name, kind=kind, log=log, state="waiting")  # type: ignore[arg-type]
        try:
            inputs = WORK[kind](self._workspace, log, path)
        except FlightidError as error:
            self._jobs[name] = job.model_copy(update={"state": "failed", "reason": str(error)})
            self._tell(self._jobs[name])
            return
        write_atomically(self._folder / f"{name}.json", job.model_dump_json())
        self._jobs[name] = job
        crew, longest = (self._fleets, None) if kind in ENDLESS else (self._long, LONGEST_S)
        future = crew.schedule(work.answered, *inputs, timeout_s=longest)
        self._futures[name] = future
        self._tell(job)
        future.add_done_callback(lambda done: self._soon(self._ended, name, done))

    def cancel(self, name: str) -> bool:
        """End a job; its process too, where it runs."""
        job = self._jobs.get(name)
        if job is None or job.state == "done":
            return False
        future = self._futures.get(name)
        if future is not None:
            future.cancel()
        self._change(name, "cancelled", "")
        return True

    async def live(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """Result of a hand's request, or the sentence of its refusal."""
        return await _awaited(self._live, PATIENCE_S, call, *inputs)

    async def tuned(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """The same in the process that keeps plants of tunings, where seconds hold up no drag."""
        return await _awaited(self._tuning, LONGEST_S, call, *inputs)

    async def compared(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """The same for comparisons: no tuning holds them up."""
        return await _awaited(self._compared, LONGEST_S, call, *inputs)

    async def planned(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """The same for plans."""
        return await _awaited(self._planned, LONGEST_S, call, *inputs)

    async def asked(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """The same for catalogues of fleets, whose answers that process holds."""
        return await _awaited(self._asked, LONGEST_S, call, *inputs)

    async def questioned(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """The same for one question to a catalogue: whatever it does, it ends."""
        return await _awaited(self._asked, QUESTION_S, call, *inputs)

    def _soon(self, call: Callable[..., None], *inputs: object) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(call, *inputs)

    def _ended(self, name: str, future: Future[tuple[Any, str, float]]) -> None:
        if self._futures.get(name) is not future or self._jobs[name].state == "cancelled":
            return
        try:
            _, refusal, _ = future.result()
        except (CancelledError, TimeoutError, ProcessExpired, BrokenProcessPool) as error:
            refusal = f"the work ended early: {type(error).__name__}"
        except Exception as error:
            refusal = f"a fault in flightid: {type(error).__name__}: {error}"
        self._change(name, "failed" if refusal else "done", refusal)

    def _change(self, name: str, state: str, reason: str) -> None:
        job = self._jobs[name].model_copy(update={"state": state, "reason": reason})
        self._jobs[name] = job
        self._futures.pop(name, None)
        (self._folder / f"{name}.json").unlink(missing_ok=True)
        self._tell(job)

    def _tell(self, job: Job) -> None:
        for listener in list(self._listeners):
            listener(job)


async def _awaited(
    crew: Crew, patience_s: float, call: Callable[..., Any], *inputs: object
) -> tuple[Any, str, float]:
    """Result of a call in a process, or the sentence of its refusal."""
    for _ in range(2):
        future = crew.schedule(work.answered, call, *inputs, timeout_s=patience_s)
        try:
            made: tuple[Any, str, float] = await asyncio.wrap_future(future)
        except TimeoutError:
            return None, f"This took more than {patience_s:.0f} s and was ended.", patience_s
        except ProcessExpired:
            return None, "The worker ended; the file may need more memory than is allowed.", 0.0
        except BrokenProcessPool:
            continue  # a worker was killed while it had no work: another takes this
        return made
    return None, "The worker was ended twice.", 0.0


def _interrupted(folder: Path) -> list[Job]:
    """Jobs that a killed server ran; a note that cannot be one of ours is removed."""
    jobs = []
    for path in sorted(folder.glob("*.json")):
        try:
            job = Job(**json.loads(read_plain(path, NOTE_BYTES)))
            if job.id != path.stem or job.id != f"{job.kind}-{job.log}":
                raise ValueError(job.id)
        except (OSError, TypeError, ValueError, RecursionError):
            with suppress(OSError):  # a folder stays
                path.unlink()
        else:
            jobs.append(job.model_copy(update={"state": "interrupted"}))
    return jobs
