"""Margins of a thousand loops against python-control and a competent NumPy recipe."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flightid import Table
from flightid.control.margins.loop_metrics import loop_metrics
from flightid.table import Column

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
DRAWS, FREQUENCIES = 1000, 300
OMEGA = np.geomspace(0.1, 200.0, FREQUENCIES)
PEER_DRAWS = 40
"""Loops that the slow peer judges; its time is scaled up."""


def coefficients() -> tuple[Array, Array]:
    """Rate loops with PI and an actuator, one for each draw of a plant."""
    rng = np.random.default_rng(0)
    gain, damping, motor = (
        centre * (1.0 + 0.1 * rng.standard_normal(DRAWS)) for centre in (120.0, 4.0, 30.0)
    )
    above = np.stack([0.1 * gain * motor, 0.1 * gain * motor * 3.0], axis=1)
    below = [
        np.polymul([1.0, 0.0], np.polymul([1.0, d], [1.0, m]))
        for d, m in zip(damping, motor, strict=True)
    ]
    return above, np.array(below)


def responses(above: Array, below: Array) -> Complex:
    s = 1j * OMEGA
    top = above[:, :1] * s + above[:, 1:]
    return top / sum(below[:, [k]] * s ** (3 - k) for k in range(4))


def recipe(loops: Complex) -> Array:
    """Unwrapped phase and decibels of all, then crossings by interpolation, loop by loop."""
    logs = np.log(OMEGA)
    decibel = 20.0 * np.log10(np.abs(loops))
    degrees = np.degrees(np.unwrap(np.angle(loops), axis=1))
    rejection = -20.0 * np.log10(np.abs(1.0 + loops))
    found = np.full((len(loops), 5), np.nan)
    for row in range(len(loops)):
        places = np.flatnonzero(np.diff(np.sign(decibel[row])))
        margins = []
        for k in places:
            share = decibel[row, k] / (decibel[row, k] - decibel[row, k + 1])
            phase = degrees[row, k] + share * (degrees[row, k + 1] - degrees[row, k])
            margins.append((abs((phase + 360.0) % 360.0 - 180.0), k + share))
        if margins:
            found[row, 0], place = min(margins)
            found[row, 1] = np.exp(np.interp(place, np.arange(FREQUENCIES), logs))
        places = np.flatnonzero(np.diff(np.floor((degrees[row] + 180.0) / 360.0)))
        for k in places:
            level = 360.0 * np.round((degrees[row, k] + 180.0) / 360.0) - 180.0
            share = (degrees[row, k] - level) / (degrees[row, k] - degrees[row, k + 1])
            value = -(decibel[row, k] + share * (decibel[row, k + 1] - decibel[row, k]))
            found[row, 2] = np.fmin(found[row, 2], value)
        found[row, 3] = np.max(rejection[row])
        rising = np.flatnonzero((rejection[row, :-1] < -3.0) & (rejection[row, 1:] >= -3.0))
        if len(rising):
            k = rising[0]
            found[row, 4] = np.exp(np.interp(-3.0, rejection[row, k : k + 2], logs[k : k + 2]))
    return found


def _seconds(work: Callable[[], object], repeats: int = 5) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def run() -> Table:
    """Time of each for all loops, and the largest difference of the phase margin."""
    above, below = coefficients()
    loops = responses(above, below)
    ours = loop_metrics(OMEGA, loops)
    seconds = _seconds(lambda: loop_metrics(OMEGA, loops))
    rows: list[tuple[str | float | None, ...]] = [("flightid, loop_metrics", seconds, 1.0, 0.0)]
    theirs = recipe(loops)
    difference = float(np.nanmax(np.abs(np.abs(ours.phase_margin_deg) - theirs[:, 0])))
    elapsed = _seconds(lambda: recipe(loops), 3)
    rows.append(("NumPy recipe, loop by loop", elapsed, elapsed / seconds, difference))
    if importlib.util.find_spec("control") is None:
        print("python-control is not installed: left out")
    else:
        import control  # noqa: PLC0415 — a peer that may be missing

        systems = [control.tf(above[k], below[k]) for k in range(PEER_DRAWS)]
        margins = np.array([control.stability_margins(each)[1] for each in systems])
        difference = float(np.max(np.abs(ours.phase_margin_deg[:PEER_DRAWS] - margins)))
        elapsed = _seconds(lambda: [control.stability_margins(each) for each in systems], 3)
        elapsed *= DRAWS / PEER_DRAWS
        rows.append(("python-control, stability_margins", elapsed, elapsed / seconds, difference))
    columns = (
        Column("what"),
        Column("time", "s", 3),
        Column("ratio", digits=3),
        Column("largest difference of the phase margin", "deg", 2),
    )
    notes = (
        f"{DRAWS} loops at {FREQUENCIES} frequencies; both others find fewer numbers "
        f"(python-control: no sensitivity bandwidth; {PEER_DRAWS} loops timed and scaled).",
    )
    return Table("Margins of many loops", columns, tuple(rows), notes)
