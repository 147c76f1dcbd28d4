"""Where a sweep ends, on a closed loop in NumPy: coherence alone does not tell it."""

from __future__ import annotations

import math

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from flightid.inspection.excited_to import power_end
from tests.closeness import assert_close

Array = NDArray[np.float64]
RATE, LAST = 200.0, 12.0


def chirp() -> Array:
    """Exponential sweep from 0.1 to 12 Hz in 90 s with 3 s of fade, and no more."""
    time = np.arange(0.0, 90.0, 1.0 / RATE)
    growth = math.log(LAST / 0.1) / 90.0
    fade = np.clip(np.minimum(time, 90.0 - time) / 3.0, 0.0, 1.0)
    return np.asarray(fade * np.sin(math.tau * 0.1 * (np.exp(growth * time) - 1.0) / growth))


def closed_loop(sweep: Array) -> tuple[Array, Array]:
    """Command and rate: a lagged integrator under P, its rate shaken, the sweep in the command."""
    noise = 0.02 * np.random.default_rng(1).normal(size=sweep.size)
    motor = math.exp(-1.0 / (RATE * 0.03))
    command, rate = np.zeros(sweep.size), np.zeros(sweep.size)
    thrust = spin = 0.0
    for k in range(1, sweep.size):
        thrust = motor * thrust + (1.0 - motor) * command[k - 1]
        spin += (60.0 * thrust - 2.0 * spin) / RATE
        rate[k] = spin + noise[k]
        command[k] = sweep[k] - 0.15 * rate[k]
    return command, rate


def truth(hertz: Array) -> Array:
    z = np.exp(1j * math.tau * hertz / RATE)
    motor = math.exp(-1.0 / (RATE * 0.03))
    lag = (1.0 - motor) / (z - motor)
    return np.asarray(60.0 / RATE * z / (z - 1.0 + 2.0 / RATE) * lag)


def test_coherence_reaches_beyond_a_sweep_and_its_power_does_not() -> None:
    sweep = chirp()
    command, rate = closed_loop(sweep)
    window = int(4.0 * RATE)
    hertz, cross = scipy.signal.csd(command, rate, RATE, nperseg=window)
    _, power = scipy.signal.welch(command, RATE, nperseg=window)
    _, coherence = scipy.signal.coherence(command, rate, RATE, nperseg=window)
    wrong = np.abs(20.0 * np.log10(np.abs(cross / power)[1:] / np.abs(truth(hertz[1:]))))
    hertz, coherence = hertz[1:], coherence[1:]
    end = power_end(sweep, RATE) / math.tau
    assert_close(end, LAST, rtol=0.05, why="last frequency of the sweep")
    below, beyond = (hertz > 0.5) & (hertz < 0.9 * end), hertz > 1.3 * end
    assert wrong[below].max() < 1.0
    assert coherence[beyond].min() > 0.6
    assert np.median(wrong[beyond]) > 6.0


def test_a_sweep_that_was_broken_off_ends_where_it_was() -> None:
    most = chirp()[: int(75.0 * RATE)]
    reached = 0.1 * (LAST / 0.1) ** (75.0 / 90.0)
    assert_close(power_end(most, RATE) / math.tau, reached, rtol=0.15, why="broken off at 75 s")
