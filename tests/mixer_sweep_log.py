"""A small log of a mixer sweep with the loop order of ArduCopter, for tests of its reading."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid.logs import DataflashWriter

LOOP_HZ = 400.0
COMMANDS = {"ROut": ("PIDR", 10), "POut": ("PIDP", 11), "YOut": ("PIDY", 12)}


def chirp(clock_s: NDArray[np.float64], magnitude: float, record_s: float) -> NDArray[np.float64]:
    """A faded sweep from 0.5 to 5 Hz that begins one second after the mode does."""
    t = clock_s - 1.0
    phase = 2 * np.pi * (0.5 * t + 0.5 * 4.5 / record_s * t**2)
    window = np.clip(np.minimum(t, record_s - t) / 2.0, 0.0, 1.0)
    return np.where((t > 0) & (t < record_s), magnitude * window * np.sin(phase), 0.0)


def write_sweep(
    path: Path,
    *,
    axis: int = 10,
    injected: str | None = "ROut",
    sign: float = 1.0,
    lag_loops: int = 1,
    divider: int = 1,
    record_s: float = 12.0,
    starts_s: Sequence[float] = (2.0,),
    pid: bool = True,
    magnitude: float = 0.15,
    firmware: str = "ArduCopter V4.7.0 (sweep)",
) -> Path:
    """Write a log in which `injected` holds the chirp `lag_loops` late, on top of the terms."""
    rng = np.random.default_rng(3)
    writer = DataflashWriter()
    writer.message(0, firmware)
    writer.parameter("SCHED_LOOP_RATE", LOOP_HZ)
    n_loops = int((starts_s[-1] + record_s + 4.0) * LOOP_HZ)
    time_us = np.arange(n_loops) * int(1e6 / LOOP_HZ)
    written_us = time_us + 1200 + rng.integers(0, 300, n_loops)
    signal = np.zeros(n_loops)
    clocks = []
    for start_s in starts_s:
        first = int(start_s * LOOP_HZ)
        rows = np.arange(first, min(first + int((record_s + 3.0) * LOOP_HZ), n_loops))
        clock = (rows - first) / LOOP_HZ
        clocks.append((rows, clock))
        signal[rows] = chirp(clock, magnitude, record_s)
        values = (axis, magnitude, 0.5, 5.0, 2.0, 0.0, record_s, 2.0)
        names = ("Ax", "Mag", "FSt", "FSp", "TFin", "TC", "TR", "TFout")
        writer.add("SIDS", [written_us[first] - 10], dict(zip(names, values, strict=True)))
    _add_loops(writer, time_us, written_us, signal, injected, sign, lag_loops, divider, pid)
    for rows, clock in clocks:
        kept = slice(None, None, divider)
        columns = {"Time": clock[kept], "Targ": signal[rows][kept]}
        writer.add("SIDD", written_us[rows][kept], columns)
    return writer.write(path)


def _add_loops(
    writer: DataflashWriter,
    time_us: NDArray[np.int64],
    written_us: NDArray[np.int64],
    signal: NDArray[np.float64],
    injected: str | None,
    sign: float,
    lag_loops: int,
    divider: int,
    pid: bool,
) -> None:
    kept = slice(None, None, divider)
    t = time_us / 1e6
    rate = {}
    for place, (command, (controller, _)) in enumerate(COMMANDS.items()):
        terms = {
            "P": 0.02 * np.sin(3 * t + place),
            "I": 0.01 * np.cos(0.3 * t),
            "D": 0.005 * np.sin(20 * t),
            "FF": 0.001 * np.cos(t),
        }
        stored = {key: value.astype(np.float32) for key, value in terms.items()}
        total = np.sum([value.astype(np.float64) for value in stored.values()], axis=0)
        if command == injected:
            total = total + sign * np.concatenate([np.zeros(lag_loops), signal])[: signal.size]
        rate[command] = total[kept]
        if pid:
            columns = {key: value[kept] for key, value in stored.items()}
            writer.add(controller, written_us[kept] - 50, columns)
    rate |= {"R": np.degrees(0.1 * np.sin(t))[kept], "P": np.cos(t)[kept]}
    writer.add("RATE", time_us[kept], rate)
