"""Kill server, worker and browser of the page: `python -m tests.stress.app_kills --kills 100`.

A session in Chromium drops logs, edits studies, keeps models, runs studies. At a random moment of
it one of them is killed, or the process that workers are forked from, or ("machine"), as power
cuts do, the server with all that it began; what the page was told is done must be there after it,
whole, and what it was told is begun must be there or be offered again, on its screen. A line
follows each kill.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import threading
import time
from collections import Counter
from pathlib import Path

from playwright.sync_api import Error as BrowserError
from playwright.sync_api import Playwright, sync_playwright

from tests.stress.app_kept import Kept, losses
from tests.stress.app_session import (
    RefusedError,
    Server,
    Session,
    descendants,
    forkers,
    kill,
    workers,
)

KINDS = ("server", "worker", "forker", "browser", "machine")
FOLDER_KILLS = 10
"""Kills on one folder, before a new one is begun."""
LEFT_S = 40.0
"""In which processes of a killed server end: a study that they run is finished first."""


class Victim:
    """What is killed, once, at a moment of a session."""

    def __init__(self, kind: str, server: Server, session: Session, delay_s: float) -> None:
        self.kind = kind
        self._server, self._session = server, session
        self.fell = threading.Event()
        self.begun_s = time.monotonic()
        self.after_s = delay_s
        self._timer = threading.Timer(delay_s, self._kill)
        self._timer.start()

    def _kill(self) -> None:
        if self.kind == "browser":
            kill(self._session.pid)
        elif self.kind == "server":
            kill(self._server.pid)
        elif self.kind == "machine":
            family = [pid for pid, _ in descendants(self._server.pid)]
            for pid in (self._server.pid, *family):
                kill(pid)
        else:
            find = workers if self.kind == "worker" else forkers
            while not (found := find(self._server.pid)):
                time.sleep(0.05)  # the server begins them
            kill(random.choice(found))
        self.fell.set()

    def wait(self) -> None:
        """Until it has fallen."""
        self.fell.wait()
        self._timer.join()


class Desk:
    """A folder, the server on it and a browser: begun again after what was killed."""

    def __init__(self, tools: Playwright, folder: Path) -> None:
        self.tools, self.folder, self.kept = tools, folder, Kept(folder)
        self.orphans: list[int] = []
        self.open()

    def open(self) -> None:
        """A server and a browser."""
        self.server = Server(self.folder)
        self.session = Session(self.tools, self.server, self.kept)

    def close(self) -> None:
        """End both."""
        self.session.close()
        self.server.close()

    def kill(self, kind: str, delay_s: float) -> tuple[str, list[str]]:
        """Where the session stood, and what is lost."""
        victim = Victim(kind, self.server, self.session, delay_s)
        while not victim.fell.is_set():
            try:
                self.session.round(victim.fell)
            except (BrowserError, RefusedError) as error:
                if not victim.fell.wait(1.0):
                    self.session.problems.append(f"before the kill: {error}")
        victim.wait()
        stood = self.session.step
        if kind in ("server", "machine"):
            self.orphans += self.server.workers
            self.server.close()
            self.server = Server(self.folder)
            self.session.attach(self.server)
        if kind == "browser":
            self.close()
            self.open()
        said = [*losses(self.kept, self.session), *self.session.problems]
        self.session.problems.clear()
        return stood, said


def round_s(tools: Playwright) -> float:
    """Length of a session that nobody disturbs."""
    with tempfile.TemporaryDirectory() as name:
        desk = Desk(tools, Path(name))
        begun = time.monotonic()
        desk.session.round(threading.Event())
        taken = time.monotonic() - begun
        assert not losses(desk.kept, desk.session), "a session without a kill loses something"
        desk.close()
    return taken


def main(arguments: list[str] | None = None) -> int:
    """Kill as often as asked; a line each, and a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    asked = parser.parse_args(arguments)
    chance = random.Random(asked.seed)
    lost, kills, stood_at = Counter[str](), Counter[str](), Counter[str]()
    orphans: list[int] = []
    with sync_playwright() as tools:
        whole_s = round_s(tools)
        print(f"a session without a kill: {whole_s:.1f} s", flush=True)
        done = 0
        while done < asked.kills:
            with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
                desk = Desk(tools, Path(name))
                for _ in range(min(FOLDER_KILLS, asked.kills - done)):
                    kind, delay_s = chance.choice(asked.kinds), chance.uniform(0.0, whole_s)
                    stood, said = desk.kill(kind, delay_s)
                    done += 1
                    kills[kind] += 1
                    stood_at[stood] += 1
                    lost[kind] += len(said)
                    line = f"{done} {kind} at {delay_s:.1f} s, {stood}: {said or 'whole'}"
                    print(line, flush=True)
                desk.close()
                orphans += ended(desk.orphans)
    for kind in asked.kinds:
        print(f"{kind:8}{kills[kind]:4} kills{lost[kind]:4} lost or half")
    print(f"moments: {dict(stood_at.most_common())}")
    print(f"{done} kills, {lost.total()} losses, {len(orphans)} processes left behind")
    return 1 if lost.total() or orphans else 0


def ended(processes: list[int]) -> list[int]:
    """Those that still live when they had time to end."""
    until = time.monotonic() + LEFT_S
    while time.monotonic() < until:
        processes = [pid for pid in processes if Path(f"/proc/{pid}/stat").exists()]
        if not processes:
            break
        time.sleep(0.5)
    return processes


if __name__ == "__main__":
    sys.exit(main())
