"""How long a hand waits for the local page's server: medians of 50, wall and processor time.

    python -m benchmarks.app_latency [LOG]      default: a simulated flight of sweeps of 130 s

Drags and sliders are what a worker does for each; a log of 60 MB is sent to a server and asked for
until its screen has a verdict, `DROPS` times; a zoom is one view of a channel of 10⁷ samples; the
page's list is asked while ten jobs run. Gains are those of a quadrotor that flew a sweep.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from tests.sweep_log import SweepFlight

from benchmarks.app_served import Served, processor_s
from flightid.app import gain_work, model_prediction, work
from flightid.app.own_folders import draft_of
from flightid.app.pyramid import Pyramid, view
from flightid.app.study_edits import KeyEdit, edited, require_study
from flightid.errors import FlightidError
from flightid.files import write_atomically
from flightid.study.gain_preview import preview_fits
from flightid.vehicles import PilotDoublet, SidActivation, fly
from flightid.vehicles.ardupilot_log import write_ardupilot_log

REPEATS = 50
JOBS = 10
DROPS = 7
"""Of the large log: each is another one, by a few bytes."""
DROPPED = SweepFlight(rate_hz=400.0, sweep_s=297.0)


def medians(
    call: Callable[[int], object],
    repeats: int = REPEATS,
    clock: Callable[[], float] = time.process_time,
) -> str:
    """Median wall and processor time of a call, ms."""
    wall, processor = [], []
    for number in range(repeats):
        begun, used = time.perf_counter(), clock()
        call(number)
        wall.append(time.perf_counter() - begun)
        processor.append(clock() - used)
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
        brushed = edited(text, [*span, *names])
        require_study(study, brushed)
        write_atomically(study, brushed)

    print(f"brush → segment written:            {medians(brush)}")
    write_atomically(study, text)

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


def flown(folder: Path) -> Path:
    """Roll of a quadrotor swept for half a minute: gains are found from it."""
    sweep = SidActivation(
        axis=10, start_s=5.0, magnitude=0.15, start_hz=0.15, stop_hz=12.0,
        fade_in_s=3.0, record_s=30.0, fade_out_s=1.0, leave_after_s=40.0,
    )  # fmt: skip
    sticks = [PilotDoublet("roll", start_s=47.0 + 3.37 * k, amplitude=0.25) for k in range(10)]
    flight = fly(runs=[sweep], doublets=sticks, log_every=2, seed=1)
    return write_ardupilot_log(flight, folder / "flown.bin")


def sliders(log: Path, folder: Path) -> None:
    """A gain moved, where the log tells the gains that flew."""
    study = folder / "studies" / f"{log.stem}-gains.toml"
    work.make_overview(log, study, folder / "gains-overview.json")
    text = study.read_text()
    begun = time.process_time()
    try:
        found = gain_work.gains_of(study, text).model_dump()
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


def drops(folder: Path) -> None:
    """A large log dropped, until its screen says what it can carry."""
    content = DROPPED.write(folder).read_bytes()
    served = Served(folder / "drops")
    mark = b"V4.6.0 (test)"

    def drop(number: int) -> None:
        body = content.replace(mark, b"V4.6.0 (%04d)" % number)
        log = served.ask("/api/logs?name=large.bin", "PUT", body)["id"]
        while served.ask(f"/api/logs/{log}")["overview"] is None:
            time.sleep(0.1)

    drop(1000)
    told = medians(lambda k: drop(1001 + k), DROPS, processor_s)
    print(f"log of {len(content) / 1e6:.0f} MB dropped → verdict:      {told}")
    served.close()


def crowd(folder: Path) -> None:
    """The page's answers while ten jobs run or wait."""
    for number in range(JOBS):
        made = SweepFlight(rate_hz=400.0, sweep_s=45.0, amplitude=0.1 + 0.001 * number)
        made.write(folder).replace(folder / f"{number}.bin")
    served = Served(folder)
    served.ask("/api/workspace")
    print(f"jobs that run or wait, before:      {len(served.ask('/api/jobs'))}")
    for path in ("/api/workspace", "/api/jobs"):
        told = medians(lambda _, asked=path: served.ask(asked))
        print(f"{path} beside them:{' ' * (23 - len(path))}{told}")
    print(f"jobs that run or wait, after:       {len(served.ask('/api/jobs'))}")
    served.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        if sys.argv[1:]:  # the page opens no file outside its folder
            path = Path(shutil.copy(sys.argv[1], place))
        else:
            path = SweepFlight(rate_hz=100.0, sweep_s=130.0).write(place)
        drags(path, place)
        sliders(path if sys.argv[1:] else flown(place), place)
        for each in ("drops", "crowded"):
            (place / each).mkdir()
        drops(place)
        crowd(place / "crowded")
    zooms()
