"""The local page's server in a thread of a benchmark, and what it and its processes cost."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flightid.app.guard import Session
from flightid.app.serving import bound_socket, server_of
from flightid.app.workspace import Workspace

TICKS_A_SECOND = os.sysconf("SC_CLK_TCK")


class Served:
    """A folder behind a server in a thread, asked as the page asks."""

    def __init__(self, folder: Path, files: Mapping[str, tuple[str, bytes]] | None = None) -> None:
        bound = bound_socket(0)
        self.session = Session(bound.getsockname()[1])
        self.server = server_of(Workspace(folder), dict(files or {}), self.session)
        self.thread = threading.Thread(
            target=lambda: asyncio.run(self.server.serve(sockets=[bound]))
        )
        self.thread.start()

    def ask(self, path: str, way: str = "GET", body: bytes | None = None) -> Any:
        """What it answers."""
        line = http.client.HTTPConnection("127.0.0.1", self.session.port, timeout=60)
        said = {"Cookie": f"{self.session.cookie}={self.session.secret}"}
        said |= {"Sec-Fetch-Site": "same-origin", "Content-Type": "application/octet-stream"}
        line.request(way, path, body, headers=said)
        told = json.loads(line.getresponse().read())
        line.close()
        return told

    def close(self) -> None:
        """End it."""
        self.server.should_exit = True
        self.thread.join()


def processor_s() -> float:
    """Processor time of this process and of those that it started and that live, s."""
    return time.process_time() + sum(used for used, _ in started().values())


def started() -> dict[int, tuple[float, str]]:
    """Processor time, s, and command line of the living processes that this one has started."""
    children: dict[int, list[int]] = {}
    used: dict[int, float] = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = place.read_text().rpartition(")")[2].split()
        except OSError:  # It has ended.
            continue
        children.setdefault(int(words[1]), []).append(int(place.parent.name))
        used[int(place.parent.name)] = (int(words[11]) + int(words[12])) / TICKS_A_SECOND
    found: dict[int, tuple[float, str]] = {}
    waiting = [os.getpid()]
    while waiting:
        for pid in children.get(waiting.pop(), []):
            waiting.append(pid)
            try:
                found[pid] = (used[pid], Path(f"/proc/{pid}/cmdline").read_text())
            except OSError:
                continue
    return found
