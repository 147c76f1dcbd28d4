"""Linear simulation against SciPy, and loops of the simulated flight per second."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import scipy.signal

from flightid import Record, Table
from flightid.models.linear.linear_system import LinearSystem
from flightid.simulation import simulate
from flightid.table import Column
from flightid.vehicles import fly

N_SAMPLES = 40_000


def _seconds(work: Callable[[], object]) -> float:
    times = []
    for _ in range(5):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return sorted(times)[2]


def run() -> Table:
    rng = np.random.default_rng(0)
    a = rng.standard_normal((6, 6)) - 6 * np.eye(6)
    b, c, d = rng.standard_normal((6, 2)), rng.standard_normal((3, 6)), np.zeros((3, 2))
    u = rng.standard_normal((2, N_SAMPLES))
    time_s = np.arange(N_SAMPLES) * 0.01
    record = Record.from_arrays(time_s, inputs={"u": u[0], "v": u[1]})
    system = LinearSystem(a, b, c, d, ("u", "v"), ("x", "y", "z"))
    ours = _seconds(lambda: simulate(system, record))
    theirs = _seconds(lambda: scipy.signal.lsim((a, b, c, d), u.T, time_s))
    flight = _seconds(lambda: fly(duration_s=100.0, log_every=4))
    return Table(
        "Simulation",
        (Column("work"), Column("seconds"), Column("peer seconds"), Column("ratio", digits=3)),
        (
            ("6 states, 2 inputs, 40,000 samples: scipy.signal.lsim", ours, theirs, theirs / ours),
            ("100 s of flight at 400 Hz", flight, None, None),
        ),
        (f"the flight runs at {100 * 400 / flight / 1e6:.2f} million loops/s",),
    )
