"""A stretch of a sweep in a loop in gusts: no leakage is foretold by what the loop feeds back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

import flightid as fid
from flightid.record.record import Record
from flightid.responses.bands import COHERENT

Array = NDArray[np.float64]
STEP_S = 0.02
NUMERATOR, DENOMINATOR = (
    each.ravel() for each in signal.cont2discrete(([8.0], [1.0, 2.0, 9.0]), STEP_S, "zoh")[:2]
)


def flown(seed: int, *, gusts: float = 0.9, part: slice = slice(600, 2250)) -> Record:
    """From 12 to 45 s of a sweep of .6 to 15 rad/s in 60 s: gusts by way of rate feedback too."""
    random, n = np.random.default_rng(seed), 3000
    t = np.arange(n) * STEP_S
    rate = np.log(15.0 / 0.6) / t[-1]
    command = np.sin(0.6 / rate * np.expm1(rate * t)) * np.minimum(1.0, t / 3.0)
    gust = gusts * signal.lfilter([0.1], [1.0, -0.9], random.standard_normal(n))
    sensed = 0.003 * random.standard_normal(n)
    u, y = np.zeros(n), np.zeros(n)
    past_in, past_out, held = np.zeros(2), np.zeros(2), 0.0
    for k in range(n):
        move = NUMERATOR[1:] @ past_in - DENOMINATOR[1:] @ past_out  # nothing within a sample
        y[k] = move + sensed[k]
        held += 0.3 * (0.6 * y[k] - held)
        u[k] = command[k] - held
        past_in = np.array([u[k] + gust[k], past_in[0]])
        past_out = np.array([move, past_out[0]])
    return fid.Record.from_arrays(
        t[part],
        inputs={"u": u[part]},
        outputs={"y": y[part]},
        excitations={"r": command[part]},
        loop="closed",
    )


def test_bars_of_a_stretch_in_a_loop_hold() -> None:
    """A pilot of measured inputs leans to the controller: 4 of 5 held."""
    held, counted = 0, 0
    for seed in range(6):
        response = fid.estimate_response(
            flown(seed), band_rad_s=(0.8, 12.0), n_omega=25, estimator="instrument"
        )
        band = fid.response_band(response, "u", "y")
        assert band is not None
        truth = signal.freqz(NUMERATOR, DENOMINATOR, band.omega_rad_s * STEP_S)[1]
        usable = response.shown.coherence[0, 0] >= COHERENT
        for ends, true in ((band.gain, np.abs(truth)), (band.phase_rad, np.angle(truth))):
            middle = np.mean(ends, axis=0)
            off = true - middle if ends is band.gain else np.angle(np.exp(1j * (true - middle)))
            held += np.count_nonzero(np.abs(off[usable]) <= 0.5 * np.ptp(ends, axis=0)[usable])
            counted += np.count_nonzero(usable)
    assert counted > 100
    assert held >= 0.9 * counted, f"{held} of {counted}"


@pytest.mark.parametrize("seed", [1, 2])
def test_a_pilot_by_instruments_leans_to_no_controller(seed: int) -> None:
    response = fid.estimate_response(
        flown(seed), band_rad_s=(0.8, 12.0), n_omega=25, estimator="instrument"
    )
    assert response.linear is not None
    (pilot,) = response.linear.pilots_of_outputs() or []
    excited = np.geomspace(1.3, 5.0, 12)
    truth = signal.freqz(NUMERATOR, DENOMINATOR, excited * STEP_S)[1]
    error = np.abs(pilot.frequency_response(excited)[0] / truth - 1.0)
    slopes = pilot.response_slopes(excited)[:, 0]
    variance = np.real(np.einsum("if,ij,jf->f", slopes.conj(), pilot.covariance, slopes))
    assert np.sqrt(np.mean((error * np.abs(truth)) ** 2 / variance)) < 1.8


def test_bars_of_calm_air_are_as_long_as_errors_scatter() -> None:
    """What local fits on the excitation left was leakage, not noise: bars 15 times as long."""
    errors, bars = [], []
    for seed in range(5):
        found = fid.estimate_response(
            flown(seed, gusts=0.0, part=slice(None)),
            band_rad_s=(1.2, 10.0),
            n_omega=20,
            estimator="instrument",
        ).shown
        truth = signal.freqz(NUMERATOR, DENOMINATOR, found.omega_rad_s * STEP_S)[1]
        errors.append(np.abs(found.response[0, 0] / truth - 1.0))
        bars.append(found.random_error[0, 0])
    scatter = np.sqrt(np.mean(np.square(errors), axis=0) / 2.0)
    times = np.sqrt(np.mean(np.square(bars), axis=0)) / scatter
    assert 0.6 < np.median(times) < 1.8
    assert np.max(times) < 4.0
    assert np.mean(np.array(errors) < 1.96 * np.sqrt(2.0) * np.array(bars)) > 0.9
