"""Long flights are inspected stretch by stretch: the same coherence, in bounded memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
import scipy.signal

import flightid as fid
from flightid.inspection.signals import Signal
from flightid.inspection.stretches import FlightStretches, packed
from flightid.inspection.thresholds import LONGEST_WINDOW
from flightid.record import Record
from flightid.responses.running import SpectralSum

STEP_S = 0.01


def flown(seconds: float, step_s: float = STEP_S) -> tuple[Signal, Signal]:
    """A command and a rate of a first-order axis, with noise of the rate's own."""
    rng = np.random.default_rng(5)
    time_s = 3.0 + step_s * np.arange(round(seconds / step_s))
    command = rng.standard_normal(time_s.size)
    rate = scipy.signal.lfilter([0.1], [1.0, -0.9], command) + rng.normal(0, 0.1, time_s.size)
    return (
        Signal("u", time_s, command.astype(np.float32).astype(float), "1", "u"),
        Signal("y", time_s.copy(), rate, "rad/s", "y"),
    )


def record(u: np.ndarray, y: np.ndarray) -> Record:
    time_s = STEP_S * np.arange(u.size)
    return fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y})


def test_a_running_sum_is_the_composite_estimate() -> None:
    command, rate = flown(300.0)
    omega = np.geomspace(2.0, 60.0, 20)
    total = SpectralSum(("u", "y"), [20.0, 10.0], omega, STEP_S)
    halves = [slice(None, 13_000), slice(13_000, None)]
    for half in halves:
        total.add(np.array([command.values[half], rate.values[half]]))
    whole = fid.estimate_response(
        [record(command.values[half], rate.values[half]) for half in halves],
        inputs="u", outputs="y", omega_rad_s=omega, window_s=[20.0, 10.0],
        estimator="composite", covariance=False,
    )  # fmt: skip
    found = total.composite(["u"], ["y"])
    np.testing.assert_allclose(found.coherence, whole.coherence, rtol=1e-9)
    np.testing.assert_allclose(found.n_independent, whole.n_independent, rtol=1e-9)


def test_stretches_hold_the_whole_flight_once_and_short_ones_are_not_cut() -> None:
    signals = packed(flown(1000.0))
    assert signals[0].time_s is signals[1].time_s
    assert (signals[0].values.dtype, signals[1].values.dtype) == (np.float32, np.float64)
    long = FlightStretches(signals, frozenset({"u"}), ((10.0, 1000.0),))
    made = list(long)
    assert long.are_long
    assert len(made) == 4
    assert max(each.duration_s for each in made) <= 8 * LONGEST_WINDOW.value
    assert sum(each.duration_s for each in made) == pytest.approx(990.0, abs=5 * STEP_S)
    got = np.concatenate([each["u"] for each in made])
    # Grid points of a flight sampled on the grid: the flight's own samples, in order.
    first = round((10.0 - 3.0) / STEP_S)
    np.testing.assert_allclose(got[:20_000], signals[0].values[first : first + 20_000], atol=1e-5)
    assert not FlightStretches(signals, frozenset({"u"}), ((10.0, 300.0),)).are_long


def test_memory_does_not_grow_with_the_flight() -> None:
    def peak(seconds: float) -> int:
        flight = FlightStretches(packed(flown(seconds, 0.02)), frozenset({"u"}), ((3.0, seconds),))
        assert flight.step_s == pytest.approx(0.02)
        tracemalloc.start()
        assert sum(each.duration_s for each in flight) > 0.9 * seconds
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    assert peak(6400.0) < 1.3 * peak(640.0)
