"""Bars of prewhitened responses hold what the noise model itself leaves out."""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete, lfilter

import flightid as fid

STEP_S, SECONDS, FLIGHTS = 0.05, 40.0, 8
GROWTH, LAG = 0.1, 3.0
A, B, *_ = cont2discrete(
    (np.array([[GROWTH, 0.0], [LAG, -LAG]]), np.array([[1.0], [0.0]]), np.eye(2), np.zeros((2, 1))),
    STEP_S,
)


def _flown(seed: int, *, calm: bool = False) -> fid.Record:
    """A growing mode behind a lag, swept by a pilot who holds it against gusts, late by 0.1 s."""
    random = np.random.default_rng([seed, 31])
    n = round(SECONDS / STEP_S)
    time_s = np.arange(n) * STEP_S
    rate = np.log(10.0 / 0.4) / SECONDS
    sweep = np.sin(0.4 * np.expm1(rate * time_s) / rate)
    gusts = (not calm) * lfilter([np.sqrt(1.0 - 0.95**2)], [1.0, -0.95], random.standard_normal(n))
    state, seen, u, y = np.zeros(2), [0.0, 0.0, 0.0], np.zeros(n), np.zeros(n)
    for k in range(n):
        y[k] = state[1]
        seen = [y[k], *seen[:2]]
        u[k] = sweep[k] - 0.8 * seen[2] + (not calm) * 0.05 * random.standard_normal()
        state = A @ state + B[:, 0] * (u[k] + gusts[k])
    noisy = y + (0.001 if calm else 0.02) * np.std(y) * random.standard_normal(n)
    return fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": noisy}, hold="zero")


def _exact(omega: np.ndarray) -> np.ndarray:
    each = [np.linalg.solve(np.exp(1j * w * STEP_S) * np.eye(2) - A, B)[1, 0] for w in omega]
    return np.array(each)


def test_bars_know_what_a_longer_memory_would_move() -> None:
    """By the noise alone 85 of 100 held."""
    held, points = 0, 0
    for seed in range(FLIGHTS):
        found = fid.estimate_response(
            _flown(seed), band_rad_s=(0.4, 8.0), n_omega=14, estimator="prewhitened"
        ).pair("y", "u")
        truth = np.abs(_exact(found.omega_rad_s))
        away = np.abs(np.abs(found.response) / truth - 1.0)
        held += np.count_nonzero(away <= 1.96 * found.random_error)
        points += len(truth)
    assert held / points >= 0.91


def test_bars_know_what_narrower_blocks_of_lags_would_move() -> None:
    """A delay of 45 samples, blocks of 8 there: half the memory sees the same, and 78 % held."""
    omega, held = np.geomspace(0.02, 0.3, 20), []
    for seed in range(4):
        u, noise = np.random.default_rng(seed).standard_normal((2, 4000))
        y = np.concatenate([np.zeros(45), u[:-45]]) + 1e-3 * noise
        record = fid.Record.from_arrays(
            np.arange(4000.0), inputs={"u": u}, outputs={"y": y}, hold="zero"
        )
        found = fid.estimate_response(record, omega_rad_s=omega, estimator="prewhitened")
        band = fid.response_band(found, "u", "y")
        assert band is not None
        away = np.angle(np.exp(-45j * omega - 1j * band.phase_rad.mean(axis=0)))
        held.append(np.abs(away) <= 0.5 * np.ptp(band.phase_rad, axis=0))
    assert np.mean(held) >= 0.93


def test_below_a_sweep_that_was_cut_off_nothing_is_known() -> None:
    """Where a loop alone moves an input, models of any memory lean to it alike."""
    omega = np.geomspace(0.08, 9.0, 20)
    record = _flown(0, calm=True).segment(15.0, 35.0)
    found = fid.estimate_response(record, omega_rad_s=omega, estimator="prewhitened").shown
    assert found.input_spectrum is not None
    power = omega * np.real(found.input_spectrum[0, 0])
    strong = np.flatnonzero(power >= 0.01 * power.max())
    alone = (omega < omega[strong[0]]) | (omega > omega[strong[-1]])
    assert alone[0]
    assert alone[-1]
    pair = found.pair("y", "u")
    assert np.all(pair.random_error[alone] > 100.0)
    assert not np.any(pair.coherence[alone] >= 0.1)
    assert np.any(pair.coherence[~alone] >= 0.6)
    assert "not-excited" in [each.code for each in found.findings]
    told = record.declare(loop="open")
    open_ = fid.estimate_response(told, omega_rad_s=omega, estimator="prewhitened")
    assert np.all(open_.random_error < 100.0)
