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
import shutil
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path
from typing import Any

from pebble import ProcessExpired

from flightid.app import fleet_work, gain_work, run_work, watched, work
from flightid.app.crew import Crew
from flightid.app.kept_parts import kept_part
from flightid.app.own_folders import clear_left, made_name, own_folder, read_plain
from flightid.app.schemas import Job
from flightid.app.stage_cache import shared_folder
from flightid.app.workspace import Workspace
from flightid.errors import FlightidError
from flightid.files import write_atomically
from flightid.fleet.catalogue.catalogue import QUERY_S

LONGEST_S = 900.0
"""Of a job; a hand's request may take `PATIENCE_S`."""
PATIENCE_S = 60.0
NOTE_BYTES = 1 << 16
LOOK_S, END_S = 0.5, 3.0
"""Between looks at the progress of jobs; how long one that was cancelled may take to end itself."""
LONGER_END_S = {"gains": 20.0}
"""The same of kinds whose process holds what a hand waits for: plants take longer to draw again."""
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


def _gains(workspace: Workspace, log: str, path: Path) -> tuple[object, ...]:
    return gain_work.make_gains, path, workspace.result_path(log, "gains.json").parent


WORK: dict[str, Callable[[Workspace, str, Path], tuple[object, ...]]] = {
    "overview": _overview,
    "review": _review,
    "run": _run,
    "fleet": _fleet,
    "gains": _gains,
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
        self._places: dict[str, Path] = {}
        self._ending: set[Path] = set()
        self._prepared: set[str] = set()
        self._stopping = False
        self._look: asyncio.Task[None] | None = None
        self._listeners: list[Listener] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._shared = shared_folder()
        crews = [Crew(self._shared) for _ in range(6)]
        self._live, self._tuning, self._compared, self._planned, self._asked, self._fleets = crews
        self._long = Crew(self._shared, max(1, (os.cpu_count() or 2) - 1))
        self._folder = own_folder(workspace.folder, ".flightid", "jobs")
        self._progress = own_folder(workspace.folder, ".flightid", "progress")
        clear_left(self._progress)
        for job in _interrupted(self._folder):
            self._jobs[job.id] = job

    def start(self) -> None:
        """Load the workers before anybody waits for them; call it inside the event loop."""
        self._loop = asyncio.get_running_loop()
        for crew in (self._live, self._long):
            crew.schedule(work.warm)
        self._look = self._loop.create_task(self._looked())

    def stop(self) -> None:
        """End all processes; what they work on is offered again by the next server."""
        self._stopping = True
        if self._look is not None and self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._look.cancel)
        short = (self._live, self._tuning, self._compared, self._planned, self._asked)
        crews = (*short, self._fleets, self._long)
        for crew in crews:
            crew.stop()
        for crew in crews:
            crew.join()
        for place in {*self._places.values(), *self._ending}:
            watched.forget(place)
        shutil.rmtree(self._shared, ignore_errors=True)

    def listen(self, listener: Listener) -> Callable[[], None]:
        """Hear of every change of a job; returns what ends it."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def of_log(self, log: str) -> list[Job]:
        """Jobs of a log that are not done."""
        return [job for job in self.all() if job.log == log]

    def all(self) -> list[Job]:
        """Every job that is not done."""
        for job in [each for each in self._jobs.values() if each.state == "interrupted"]:
            if self._outlived(job):
                self._change(job.id, "done", "")
        return [job for job in self._jobs.values() if job.state != "done"]

    def _outlived(self, job: Job) -> bool:
        """Whether the process of a server that was killed has brought its work to the end."""
        if job.of or job.kind not in WORK:
            return False  # of each version there is a result: a screen asks for the one it needs
        with suppress(FlightidError, OSError):
            made = self._workspace.result_path(job.log, f"{job.kind}.json")
            return made.stat().st_mtime > job.begun_s
        return False

    def ensure(self, kind: str, log: str, path: Path, *, again: bool = False, of: str = "") -> None:
        """Begin a job, unless its result is there, it runs, or it failed and nobody asks again.

        One of the same kind that works on another version ends first.
        """
        name = f"{kind}-{log}"
        known = self._jobs.get(name)
        repeats = again and kind in REPEATED
        same = known is not None and known.of == of
        if not repeats and kept_part(self._workspace, log, kind, of) is not None:
            if not same:
                self.cancel(name)
            return
        if known is not None and same:
            if known.state == "waiting":
                return
            if known.state in ("failed", "cancelled") and not again:
                return
        self._end(name)
        job = Job(id=name, kind=kind, log=log, state="waiting", of=of, begun_s=time.time())  # type: ignore[arg-type]
        try:
            inputs = WORK[kind](self._workspace, log, path)
        except FlightidError as error:
            self._jobs[name] = job.model_copy(update={"state": "failed", "reason": str(error)})
            self._tell(self._jobs[name])
            return
        write_atomically(self._folder / f"{name}.json", job.model_dump_json())
        self._jobs[name] = job
        crew = {"fleet": self._fleets, "gains": self._tuning}.get(kind, self._long)
        place = self._progress / made_name("now")
        longest = None if kind in ENDLESS else LONGEST_S
        future = crew.schedule(watched.watched, place, *inputs, timeout_s=longest)
        self._futures[name], self._places[name] = future, place
        self._tell(job)
        future.add_done_callback(lambda done: self._soon(self._ended, name, done))

    def cancel(self, name: str) -> bool:
        """End a job, and its process where that does not end the work itself in a moment."""
        job = self._jobs.get(name)
        if job is None or job.state == "done":
            return False
        self._end(name)
        self._change(name, "cancelled", "")
        return True

    def _end(self, name: str) -> None:
        """Ask the work of a job to end, where it has any: what its process holds open stays."""
        future, place = self._futures.pop(name, None), self._places.pop(name, None)
        if future is None or place is None:
            return
        if self._loop is None or not future.running():
            future.cancel()
            watched.forget(place)
            return
        watched.ask_to_end(place)
        self._ending.add(place)
        patience_s = LONGER_END_S.get(name.partition("-")[0], END_S)
        kill = self._loop.call_later(patience_s, future.cancel)

        def ended(_: Future[Any]) -> None:
            watched.forget(place)
            self._ending.discard(place)
            self._soon(kill.cancel)

        future.add_done_callback(ended)

    async def live(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """Result of a hand's request, or the sentence of its refusal."""
        return await _awaited(self._live, PATIENCE_S, call, *inputs)

    async def tuned(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """The same in the process that keeps plants of tunings, where seconds hold up no drag."""
        return await _awaited(self._tuning, LONGEST_S, call, *inputs)

    def prepare(self, key: str, call: Callable[..., Any], *inputs: object) -> None:
        """Have that process make what a hand will wait for, once for each key; nobody is told."""
        if key not in self._prepared:
            self._prepared.add(key)
            self._tuning.schedule(work.answered, call, *inputs, timeout_s=LONGEST_S)

    async def compared(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """The same for comparisons: no tuning holds them up."""
        return await _awaited(self._compared, LONGEST_S, call, *inputs)

    async def planned(self, call: Callable[..., Any], *inputs: object) -> tuple[Any, str, float]:
        """The same for plans."""
        return await _awaited(self._planned, LONGEST_S, call, *inputs)

    async def proposed(
        self, log: str, call: Callable[..., Any], *inputs: object
    ) -> tuple[Any, str, float]:
        """The same for the study of records, told as a job that can be ended; nothing is kept."""
        name = f"proposal-{log}"
        self._end(name)
        job = Job(id=name, kind="proposal", log=log, state="waiting", begun_s=time.time())
        place = self._progress / made_name("now")
        future = self._planned.schedule(watched.watched, place, call, *inputs, timeout_s=LONGEST_S)
        self._jobs[name], self._futures[name], self._places[name] = job, future, place
        self._tell(job)
        try:
            made: tuple[Any, str, float] = await asyncio.wrap_future(future)
        except (TimeoutError, ProcessExpired, BrokenProcessPool) as error:
            made = None, _why_ended(error), 0.0
        except asyncio.CancelledError:
            if not future.cancelled():
                raise
            made = None, watched.ENDED, 0.0
        if self._futures.get(name) is future:
            self._change(name, "done", "")
        return made

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
            if self._stopping:
                return  # its note stays: the next server reads it
            refusal = _why_ended(error)
        except Exception as error:
            refusal = f"a fault in flightid: {type(error).__name__}: {error}"
        self._change(name, "failed" if refusal else "done", refusal)

    def _change(self, name: str, state: str, reason: str) -> None:
        job = self._jobs[name].model_copy(update={"state": state, "reason": reason})
        self._jobs[name] = job
        self._futures.pop(name, None)
        if (place := self._places.pop(name, None)) is not None:
            watched.forget(place)
        (self._folder / f"{name}.json").unlink(missing_ok=True)
        self._tell(job)

    async def _looked(self) -> None:
        """Tell how far jobs are, as long as the server lives."""
        while True:
            await asyncio.sleep(LOOK_S)
            for name, place in list(self._places.items()):
                found, job = await asyncio.to_thread(watched.progress_at, place), self._jobs[name]
                if found is None or (found.label, found.share) == (job.label, job.share):
                    continue
                if name in self._places:
                    told = {"label": found.label, "share": found.share}
                    self._jobs[name] = job.model_copy(update=told)
                    self._tell(self._jobs[name])

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
        except TimeoutError as error:
            return None, _why_ended(error, patience_s), patience_s
        except ProcessExpired as error:
            return None, _why_ended(error), 0.0
        except BrokenProcessPool:
            continue  # a worker was killed while it had no work: another takes this
        return made
    return None, "The worker was ended twice.", 0.0


def _why_ended(error: BaseException, patience_s: float = LONGEST_S) -> str:
    """Why work has no end of its own, in words, and what to do."""
    if isinstance(error, TimeoutError):
        return f"This took more than {patience_s:.0f} s and was ended."
    if isinstance(error, CancelledError):
        return watched.ENDED
    return (
        "The process that worked on this has ended: something else ended it, or it needs more "
        "memory than is allowed. What was finished before is kept; ask again."
    )


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
