"""How long a pilot waits: from a stick on the socket to the frame that has flown it.

python -m benchmarks.app_fly [SECONDS]      default: 5 s each, alone and beside ten busy processes
"""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from flightid.app.guard import Session
from flightid.app.serving import bound_socket, server_of
from flightid.app.workspace import Workspace

Values = NDArray[np.float64]
EVERY_S = 1.0 / 60.0
JOBS = 10


def busy(until: float) -> None:
    """Work without a pause, as a job does."""
    while time.time() < until:
        np.linalg.eigvals(np.eye(40))


def waits(line: ClientConnection, seconds: float) -> tuple[Values, Values]:
    """Times from a stick to its frame, and between frames, ms."""
    sent: dict[int, float] = {}
    found: list[float] = []
    beats: list[float] = []
    number = 0
    begun = due = time.perf_counter()
    while (now := time.perf_counter()) < begun + seconds:
        if now >= due:
            number, due = number + 1, due + EVERY_S
            stick = {"pitch": 0.02 * (number % 2)}
            line.send(json.dumps({"do": "stick", "number": number, "stick": stick}))
            sent[number] = time.perf_counter()
        try:
            news = json.loads(line.recv(timeout=max(1e-4, due - time.perf_counter())))
        except TimeoutError:
            continue
        if "frame" not in news:
            continue
        beats.append(time.perf_counter())
        flown = [each for each in sent if each <= news["frame"]["number"]]
        found.extend(beats[-1] - sent.pop(each) for each in flown)
    return 1e3 * np.array(found), 1e3 * np.diff(beats)


def measure(line: ClientConnection, seconds: float, title: str) -> None:
    """Fly so long and print what was found."""
    line.send(json.dumps({"do": "start", "vehicle": "ah64_hover"}))
    while json.loads(line.recv(timeout=20)).get("state") != "flying":
        pass
    found, beats = waits(line, seconds)
    told = ", ".join(f"{q} % {np.percentile(found, q):.1f}" for q in (50, 95, 99))
    print(f"{title}: stick to frame, ms: {told}; between frames: median "
          f"{np.median(beats):.1f}, 99 % {np.percentile(beats, 99):.1f}")  # fmt: skip


def main(seconds: float) -> None:
    """Alone, then beside ten busy processes."""
    with tempfile.TemporaryDirectory() as folder:
        bound = bound_socket(0)
        session = Session(bound.getsockname()[1])
        server = server_of(Workspace(Path(folder)), {}, session)
        thread = threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[bound])))
        thread.start()
        try:
            address = f"ws://127.0.0.1:{session.port}/api/fly"
            cookie = {"Cookie": f"{session.cookie}={session.secret}"}
            origin = Origin(f"http://127.0.0.1:{session.port}")
            with connect(address, additional_headers=cookie, origin=origin) as line:
                measure(line, seconds, "alone")
                until = time.time() + seconds + 2.0
                jobs = [multiprocessing.Process(target=busy, args=(until,)) for _ in range(JOBS)]
                for each in jobs:
                    each.start()
                measure(line, seconds, f"beside {JOBS} busy processes")
                for each in jobs:
                    each.join()
        finally:
            server.should_exit = True
            thread.join()


if __name__ == "__main__":
    multiprocessing.set_start_method("spawn")
    main(float(sys.argv[1]) if sys.argv[1:] else 5.0)
