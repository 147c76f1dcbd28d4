"""Steps of rate loops from ordinary flights, beside PID-Analyzer's way and SciPy's spectra.

Run: python -m benchmarks flight_steps

Every way gets the same flights of a simulator that is not flightid's
(`tests/strangers/ordinary_flights.py`): one minute by sticks in gusts, logged at every tick of the
loop. Truth is the same loop's quiet answer.

- **flightid**: `flightid.review.deconvolution.closed_loop`, thinned as `flightid flight` does.
- **PID-Analyzer** (Plasmatree, version 0.40), written here from its formulas: frames of 1 s, 16 of
  them begun each second, Hann tapers, zeros up to a multiple of 1,024, Y R* / (R R* + 0.2) with
  unitary transforms of deg/s; running sums less their first value; frames whose set-point stays
  below 20 deg/s are left out; of the rest the mode at each instant: a histogram of 1,000 cells from
  -1.5 to 3.5, smoothed by a Gaussian of 7 cells, and the mean weighted by its squares. Its width is
  half of the cells that any frame fell into. It promises no level for that width; counted is what
  it holds.
- **Welch**: the quotient of `scipy.signal.csd` and `welch`, frames of 2 s, back in time.

Error is the rms over 0 to 0.45 s of the estimate less the truth, in percent of the step, mean and
worst over the flights. Rise time and overshoot are read off every curve by one rule, off the truth
at the same instants too.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.signal import csd, welch
from tests.strangers.ordinary_flights import Axis, Flown, ordinary, step
from tests.strangers.ordinary_steps import BETAFLIGHT, HELICOPTER, PLANE, PX4, QUADROTOR

from flightid.errors import FlightidError
from flightid.review.deconvolution import closed_loop
from flightid.review.loop_samples import LoopSamples
from flightid.review.step_features import window_features
from flightid.table import Cell, Column, Table
from flightid.uncertainty.quantiles import tails

Array = NDArray[np.float64]
FLIGHTS, FLIGHT_S, SHOWN_S, FIRST_SEED = 20, 60.0, 0.45, 40_000
CASES: tuple[tuple[str, Axis, bool], ...] = (
    ("quadrotor, ArduPilot, angle mode", QUADROTOR, False),
    ("quadrotor, ArduPilot, acro", QUADROTOR, True),
    ("quadrotor, PX4, angle mode", PX4, False),
    ("quadrotor, Betaflight, acro", BETAFLIGHT, True),
    ("helicopter, angle mode", HELICOPTER, False),
    ("plane, angle mode", PLANE, False),
)
FRAME_S, FRAMES_PER_LENGTH, SMALLEST_DEG_S, DAMPING = 1.0, 16, 20.0, 0.2
CELLS, RANGE, SMOOTHED_CELLS = 1000, (-1.5, 3.5), 7


@dataclass(frozen=True)
class Curve:
    """A step at instants after the set-point's jump, with what it is said to lie within."""

    time_s: Array
    value: Array
    low: Array
    high: Array


def run(flights: int = FLIGHTS) -> Table:
    """Errors, what bands hold, and the processor time of each way."""
    rows = [row for case in CASES for row in _rows(*case, flights)]
    columns = (
        Column("flights"),
        Column("way"),
        Column("error, mean", "%", 3),
        Column("error, worst", "%", 3),
        Column("rise time, rms error", "%", 3),
        Column("overshoot, rms error", "points", 3),
        Column("band's mean half width", "%", 3),
        Column("truth in its band", "%", 3),
        Column("no step"),
        Column("processor time", "s", 3),
    )
    title = f"Steps of {flights} flights of {FLIGHT_S:g} s each against simulated truth"
    return Table(title, columns, tuple(rows))


def _rows(name: str, axis: Axis, acro: bool, flights: int) -> list[tuple[Cell, ...]]:
    made = [
        ordinary(axis, FIRST_SEED + k, FLIGHT_S, acro=acro, size=1.0 if acro else 0.25)
        for k in range(flights)
    ]
    ticks = step(axis, 1.0)
    known = np.arange(ticks.size) / axis.loop_hz
    return [(name, *_row(way, axis, made, ticks, known)) for way in WAYS]


def _row(way: str, axis: Axis, made: list[Flown], ticks: Array, known: Array) -> tuple[Cell, ...]:
    found, begun = [], time.process_time()
    for flown in made:
        with contextlib.suppress(FlightidError):
            found.append(WAYS[way](axis, flown))
    spent = (time.process_time() - begun) / len(made)
    exact = [replace(curve, value=np.interp(curve.time_s, known, ticks)) for curve in found]
    pairs = list(zip(found, exact, strict=True))
    off = np.array([_rms(curve.value - true.value) for curve, true in pairs])
    held = np.mean([np.mean((c.low <= t.value) & (t.value <= c.high)) for c, t in pairs])
    width = float(np.mean([np.mean(c.high - c.low) / 2.0 for c in found]))
    (rises, peaks), (true_rises, true_peaks) = _read(found), _read(exact)
    banded = np.isfinite(width)
    return (
        way,
        100.0 * float(off.mean()),
        100.0 * float(off.max()),
        100.0 * _rms(rises / true_rises - 1.0),
        _rms(peaks - true_peaks),
        100.0 * width if banded else None,
        100.0 * float(held) if banded else None,
        len(made) - len(found),
        spent,
    )


def _read(curves: list[Curve]) -> tuple[Array, Array]:
    """Rise times (s) and overshoots (%), of the level at the window's end, by one rule for all."""
    read = [window_features(np.array([c.value, c.value]), c.time_s) for c in curves]
    told = [(each[2].value, each[3].value) for each in read]
    rises, overshoots = np.array(told, dtype=float).T
    return rises, overshoots


def _rms(values: Array) -> float:
    """Root mean square; what is not told is left out."""
    return float(np.sqrt(np.nanmean(values**2)))


def flightid_step(axis: Axis, flown: Flown) -> Curve:
    """The estimate and its 95 % band."""
    every = max(1, round(axis.loop_hz / 100.0)) if axis.loop_hz < 1000.0 else 4
    tick_s = 1.0 / axis.loop_hz
    rows = (flown.rate_wanted, flown.rate, flown.angle)
    loop = closed_loop(LoopSamples.of([rows], tick_s, every))
    count = round(SHOWN_S / loop.sample_time_s)
    steps = loop.step(count)
    low, high = np.quantile(steps[1:], tails(0.95), axis=0)
    return Curve(loop.instants(count, tick_s), steps[0], low, high)


def pid_analyzer_step(axis: Axis, flown: Flown) -> Curve:
    """Wiener deconvolution of short frames, and their mode."""
    n = int(FRAME_S * axis.loop_hz)
    hop = n // FRAMES_PER_LENGTH
    starts = range(0, hop * (flown.rate.size // hop - FRAMES_PER_LENGTH), hop)
    taper = np.hanning(n)
    wanted = np.degrees([flown.rate_wanted[at : at + n] for at in starts]) * taper
    moved = np.degrees([flown.rate[at : at + n] for at in starts]) * taper
    padded = n + 1024 - n % 1024
    r, y = (np.fft.fft(each, padded, norm="ortho") for each in (wanted, moved))
    pulses = np.fft.ifft(y * r.conj() / (r * r.conj() + DAMPING)).real
    steps = np.cumsum(pulses, axis=1)[:, : round(SHOWN_S * axis.loop_hz)]
    steps -= steps[:, :1]
    lively = np.abs(wanted).max(axis=1) > SMALLEST_DEG_S
    value, width = _mode(steps[lively])
    time_s = np.arange(steps.shape[1]) / axis.loop_hz
    return Curve(time_s, value, value - width, value + width)


def _mode(steps: Array) -> tuple[Array, Array]:
    """Where most frames lie at each instant, and half of the cells that hold any."""
    levels = np.linspace(*RANGE, CELLS)
    counts = np.array(
        [np.histogram(each, bins=CELLS, range=RANGE)[0] for each in steps.T], dtype=float
    )
    smooth = gaussian_filter1d(counts, SMOOTHED_CELLS, axis=1, mode="constant")
    weights = (smooth / smooth.max(axis=1, keepdims=True)) ** 2
    cell = (RANGE[1] - RANGE[0]) / CELLS
    return (weights @ levels) / weights.sum(axis=1), 0.5 * cell * (counts > 0.5).sum(axis=1)


def welch_step(axis: Axis, flown: Flown) -> Curve:
    """Quotient of spectra, back in time; it tells no band."""
    length = int(2.0 * axis.loop_hz)
    wanted = flown.rate_wanted
    _, cross = csd(wanted, flown.rate, axis.loop_hz, nperseg=length, detrend="constant")
    _, power = welch(wanted, axis.loop_hz, nperseg=length, detrend="constant")
    pulses = np.fft.irfft(cross / (power + 1e-5 * power.max()), length)
    value = np.asarray(np.cumsum(pulses)[: round(SHOWN_S * axis.loop_hz)], dtype=np.float64)
    none = np.full(value.size, np.nan)
    return Curve(np.arange(value.size) / axis.loop_hz, value, none, none)


WAYS: dict[str, Callable[[Axis, Flown], Curve]] = {
    "flightid": flightid_step,
    "PID-Analyzer": pid_analyzer_step,
    "Welch": welch_step,
}


if __name__ == "__main__":
    print(run())
