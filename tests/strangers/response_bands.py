"""Bands of responses, and what is read off them: at modes, at low frequency, in short records."""

from __future__ import annotations

import time
from functools import partial

import numpy as np

import flightid as fid
from tests.strangers import noises
from tests.strangers.counting import Case, Reading, Trial
from tests.strangers.responses import NATURAL, ROUGHNESS, STEP_S, held, multisine, sweep

Array = noises.Array
GAIN = 8.0
N_OMEGA = 12


def discrete(omega: Array, zeta: float) -> Array:
    """Response of the held oscillator between samples, exact."""
    pole = np.sqrt(NATURAL) * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
    residue = GAIN / (2j * pole.imag)
    z = np.exp(1j * omega * STEP_S)
    parts = [
        r / p * (np.exp(p * STEP_S) - 1.0) / (z - np.exp(p * STEP_S))
        for r, p in ((residue, pole), (residue.conjugate(), pole.conjugate()))
    ]
    return np.asarray(parts[0] + parts[1])


def oscillator_record(
    seed: int,
    *,
    zeta: float,
    duration_s: float,
    colour: float,
    repeats: bool = False,
    roughness: float = ROUGHNESS,
) -> fid.Record:
    """One record of a second-order vehicle from rest."""
    random = np.random.default_rng(seed)
    n = round(duration_s / STEP_S)
    u = multisine(n) if repeats else sweep(n)
    damping = 2.0 * zeta * np.sqrt(NATURAL)
    y = held([[0.0, 1.0], [-NATURAL, -damping]], [0.0, GAIN], [[1.0, 0.0]], u)[0]
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"u": u},
        outputs={"y": y + roughness * y.std() * noises.ar1(random, n, colour)},
        units={"u": "1", "y": "1"},
        hold="zero",
        period_s=10.0 if repeats else None,
    )


def fly_band(
    seed: int,
    *,
    zeta: float,
    duration_s: float,
    estimator: str,
    colour: float = 0.0,
    window_s: str | float = "auto",
) -> Trial:
    """Gain and phase intervals at every frequency of one estimate."""
    begun = time.perf_counter()
    repeats = estimator == "periodic"
    record = oscillator_record(
        seed, zeta=zeta, duration_s=duration_s, colour=colour, repeats=repeats
    )
    low = 4.0 * np.pi / (duration_s / 5.0) if estimator == "composite" else 0.7
    response = fid.estimate_response(
        record,
        band_rad_s=(max(low, 0.7), 10.0),
        n_omega=N_OMEGA,
        estimator=estimator,
        window_s=window_s,
    )
    band = fid.response_band(response, "u", "y")
    seconds = time.perf_counter() - begun
    if band is None:
        return Trial(seconds=seconds)
    truth = discrete(band.omega_rad_s, zeta)
    readings = []
    for k, (gain, angle) in enumerate(zip(np.abs(truth), np.angle(truth), strict=True)):
        value = band.centre[k]
        turn = float(np.angle(np.exp(1j * (angle - band.phase_rad[:, k].mean()))))
        half = 0.5 * float(np.ptp(band.phase_rad[:, k]))
        readings.append(
            Reading(
                f"gain {k}",
                float(gain),
                float(abs(value)),
                float(band.gain[1, k] - abs(value)) / 1.96,
                (float(band.gain[0, k]), float(band.gain[1, k])),
            )
        )
        readings.append(Reading(f"phase {k}", turn, 0.0, half / 1.96, (-half, half)))
    return Trial(tuple(readings), "", seconds)


CASES = (
    *(
        Case(
            f"band, {estimator}, zeta {zeta:g}, {duration_s:.0f} s",
            partial(fly_band, zeta=zeta, duration_s=duration_s, estimator=estimator),
        )
        for estimator in ("composite", "local_polynomial", "periodic")
        for zeta in (0.02, 0.05, 0.3)
        for duration_s in (20.0, 60.0)
    ),
    *(
        Case(
            f"band, composite, zeta {zeta:g}, 60 s, AR(1) {colour:g}",
            partial(fly_band, zeta=zeta, duration_s=60.0, estimator="composite", colour=colour),
        )
        for zeta, colour in ((0.05, 0.9), (0.3, 0.9), (0.3, 0.98))
    ),
    *(
        Case(
            f"band, one window, zeta {zeta:g}, 60 s",
            partial(fly_band, zeta=zeta, duration_s=60.0, estimator="composite", window_s=20.0),
        )
        for zeta in (0.05, 0.3)
    ),
)
