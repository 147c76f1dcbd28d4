"""Loops by the names of signals against python-control: joining, responses, time histories."""

from __future__ import annotations

import time
from collections.abc import Callable

import control
import numpy as np

import flightid as fid
from flightid import Table
from flightid.table import Column

N_SAMPLES, N_OMEGA = 20_000, 2_000


def _seconds(work: Callable[[], object], repeats: int = 5) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return sorted(times)[repeats // 2]


def _systems() -> list[fid.LinearSystem]:
    random = np.random.default_rng(0)
    made = []
    for inputs, outputs, n in ((("u", "d"), ("y", "w"), 8), (("y", "r"), ("v",), 4),
                               (("v", "w"), ("u",), 3)):  # fmt: skip
        a = random.standard_normal((n, n))
        a -= (np.max(np.linalg.eigvals(a).real) + 1.0) * np.eye(n)
        b, c = random.standard_normal((n, len(inputs))), random.standard_normal((len(outputs), n))
        scaled = 0.2 * b
        made.append(fid.LinearSystem(a, scaled, c, np.zeros((len(c), b.shape[1])), inputs, outputs))
    return made


def _peer(systems: list[fid.LinearSystem]) -> control.StateSpace:
    parts = [
        control.ss(s.a, s.b, s.c, s.d, inputs=list(s.inputs), outputs=list(s.outputs), name=f"s{k}")
        for k, s in enumerate(systems)
    ]
    return control.interconnect(parts, inplist=["r", "d"], outlist=["y"], inputs=["r", "d"],
                                outputs=["y"])  # fmt: skip


def run() -> Table:
    systems = _systems()
    ours = fid.connect(systems, inputs=["r", "d"], outputs=["y"])
    theirs = _peer(systems)
    omega = np.geomspace(0.01, 100.0, N_OMEGA)
    time_s = 0.01 * np.arange(N_SAMPLES)
    u = np.random.default_rng(1).standard_normal((2, N_SAMPLES))
    record = fid.Record.from_arrays(time_s, inputs={"r": u[0], "d": u[1]})
    difference = np.max(np.abs(ours.frequency_response(omega) - theirs(1j * omega)))
    limited = fid.connect(
        [*systems, fid.loops.limiter("y", "y_limited", 0.5)], inputs=["r", "d"],
        outputs=["y_limited"],
    )  # fmt: skip
    work: list[tuple[str, Callable[[], object], Callable[[], object] | None]] = [
        ("join three systems of 15 states",
         lambda: fid.connect(systems, inputs=["r", "d"], outputs=["y"]), lambda: _peer(systems)),
        (f"response at {N_OMEGA} frequencies",
         lambda: ours.frequency_response(omega), lambda: theirs(1j * omega)),
        (f"time history of {N_SAMPLES} samples", lambda: ours.simulate(record),
         lambda: control.forced_response(theirs, time_s, u)),
        ("the same with a limit", lambda: limited.simulate(record), None),
    ]  # fmt: skip
    rows = []
    for name, mine, other in work:
        seconds = _seconds(mine)
        peer = None if other is None else _seconds(other)
        rows.append((name, seconds, peer, None if peer is None else peer / seconds))
    names = ("work", "seconds", "python-control")
    columns = (*map(Column, names), Column("ratio", digits=3))
    note = f"largest difference of the responses: {difference:.1e}"
    return Table("Loops", columns, tuple(rows), (note,))
