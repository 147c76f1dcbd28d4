"""How long a hand waits for the local page's server: medians of 50, wall and processor time.

    python -m benchmarks.app_latency [LOG]      default: a simulated flight of sweeps of 130 s

Drags of a band go over the socket as the page sends them; a zoom is one view of a channel of 10⁷
samples; the page's list is asked while ten jobs run.
"""

from __future__ import annotations

import asyncio
import http.client
import json
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tests.sweep_log import SweepFlight

from flightid.app import gain_work, model_prediction, work
from flightid.app.guard import Session
from flightid.app.own_folders import draft_of
from flightid.app.pyramid import Pyramid, view
from flightid.app.serving import bound_socket, server_of
from flightid.app.study_edits import KeyEdit, edited, write_study
from flightid.app.workspace import Workspace
from flightid.errors import FlightidError
from flightid.study.gain_preview import preview_fits

REPEATS = 50
JOBS = 10


def medians(call: Callable[[int], object]) -> str:
    """Median wall and processor time of a call, ms."""
    wall, processor = [], []
    for number in range(REPEATS):
        begun, used = time.perf_counter(), time.process_time()
        call(number)
        wall.append(time.perf_counter() - begun)
        processor.append(time.process_time() - used)
    return f"{1e3 * np.median(wall):7.1f} ms wall, {1e3 * np.median(processor):7.1f} ms processor"


def drags(log: Path, folder: Path) -> None:
    """A band dragged, a band let go, a log looked at."""
    study = folder / "studies" / "a.toml"
    study.parent.mkdir()
    begun = time.process_time()
    work.make_overview(log, study, folder / "overview.json")
    print(
        f"log of {log.stat().st_size / 1e6:.0f} MB to verdict: {time.process_time() - begun:.2f} s"
    )
    text = study.read_text()

    def drag(number: int, intervals: bool = False) -> None:
        edit = KeyEdit(("model", 0, "band_rad_s"), [2.0 + 0.01 * number, 20.0])
        work.make_responses(study, text, "Roll rate", [edit], True, intervals)

    drag(0)
    print(f"band dragged → response:            {medians(drag)}")
    print(f"band let go → bars of its windows:  {medians(lambda k: drag(k, True))}")

    def brush(number: int) -> None:
        span = [KeyEdit(("segment", 0), {"name": "brushed", "span_s": [6.0, 60.0 + number]})]
        names = [KeyEdit(("model", 0, "identify"), ["brushed"])]
        write_study(study, edited(text, [*span, *names]))

    print(f"brush → segment written:            {medians(brush)}")
    write_study(study, text)

    def fit(number: int) -> None:
        band = [KeyEdit(("model", 0, "band_rad_s"), [2.0 + 0.001 * number, 20.0])]
        others = [KeyEdit(("model", k), None) for k in (2, 1)]
        with draft_of(study, edited(text, [*band, *others])) as draft:
            preview_fits(draft, cache=work.KEPT)

    fit(0)
    print(f"band let go → fit of one axis:      {medians(fit)}")
    values = dict.fromkeys(["Lp"], -4.0)

    def slide(number: int) -> None:
        moved = {name: value - 0.01 * number for name, value in values.items()}
        model_prediction.predict_model(study, text, [], "Roll rate", moved)

    slide(0)
    print(f"parameter slider → prediction:      {medians(slide)}")


def sliders(log: Path, folder: Path) -> None:
    """A gain moved, where the log tells the gains that flew."""
    study = folder / "studies" / "a.toml"
    text = study.read_text()
    begun = time.process_time()
    try:
        found = gain_work.make_gains(study, text, [])
    except FlightidError as error:
        print(f"gain slider → margins: not measured, {log.name}: {error}")
        return
    print(f"study to gains, all axes:           {time.process_time() - begun:.2f} s")
    axis = found["axes"][0]
    values = {each["name"]: each["value"] for each in axis["sliders"]}
    first = next(iter(values))

    def move(number: int, responses: bool = True) -> None:
        moved = values | {first: values[first] * (1.0 - 0.002 * number)}
        gain_work.move_axis(study, text, [], axis["axis"], moved, responses)

    move(0)
    print(f"gain slider → margins:              {medians(lambda k: move(k, False))}")
    print(f"gain slider → margins, all charts:  {medians(move)}")


def zooms() -> None:
    """A long channel."""
    n = 10_000_000
    time_s, values = np.arange(n) / 1000.0, np.random.default_rng(0).standard_normal(n)
    begun = time.process_time()
    made = Pyramid.of(time_s, values)
    print(f"levels of 10⁷ samples:              {1e3 * (time.process_time() - begun):7.1f} ms")
    spans = np.random.default_rng(1).uniform(0.0, 4000.0, (REPEATS, 2)).cumsum(axis=1)
    told = medians(lambda k: view([made], (spans[k][0], spans[k][1] + 1.0), 1200).tobytes())
    print(f"one view of it, 1200 columns:       {told}")


def crowd(folder: Path) -> None:
    """The page's answers while ten jobs run or wait."""
    for number in range(JOBS):
        made = SweepFlight(rate_hz=400.0, sweep_s=45.0, amplitude=0.1 + 0.001 * number)
        made.write(folder).replace(folder / f"{number}.bin")
    bound = bound_socket(0)
    session = Session(bound.getsockname()[1])
    server = server_of(Workspace(folder), {}, session)
    thread = threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[bound])))
    thread.start()

    def ask(path: str) -> list[dict[str, str]]:
        line = http.client.HTTPConnection("127.0.0.1", session.port, timeout=60)
        cookie = f"{session.cookie}={session.secret}"
        line.request("GET", path, headers={"Cookie": cookie, "Sec-Fetch-Site": "same-origin"})
        told = json.loads(line.getresponse().read())
        line.close()
        return list(told) if isinstance(told, list) else list(told["logs"])

    ask("/api/workspace")
    waiting = len(ask("/api/jobs"))
    print(f"jobs that run or wait, before:      {waiting}")
    for path in ("/api/workspace", "/api/jobs"):
        print(f"{path} beside them:{' ' * (23 - len(path))}{medians(lambda _, p=path: ask(p))}")
    print(f"jobs that run or wait, after:       {len(ask('/api/jobs'))}")
    server.should_exit = True
    thread.join()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        given = [Path(each) for each in sys.argv[1:]]
        path = given[0] if given else SweepFlight(rate_hz=100.0, sweep_s=130.0).write(Path(name))
        drags(path, Path(name))
        sliders(path, Path(name))
        crowded = Path(name) / "crowded"
        crowded.mkdir()
        crowd(crowded)
    zooms()
