"""Flights of a roll axis for tests of joint fits: a sweep for the response, waves as records."""

from __future__ import annotations

import numpy as np

import flightid as fid

BAND = (0.8, 25.0)
DEVIATION = 0.15
"""Of the noise on the roll rate, rad/s."""
SAMPLE_TIME_S = 0.02


def lag() -> fid.TransferFunctionModel:
    """Roll rate of a first-order roll axis."""
    model = fid.load_model("rate_first_order").with_values({"Lp": -5.0, "Ltphi": 150.0})
    assert isinstance(model, fid.TransferFunctionModel)
    return model


def _flown(
    model: fid.TransferFunctionModel, moment: np.ndarray, seed: int, noise: float
) -> fid.Record:
    time_s = np.arange(len(moment)) * SAMPLE_TIME_S
    driven = fid.Record.from_arrays(time_s, inputs={"tau_phi": moment})
    clean = fid.simulate(model, driven, units={"p": "rad/s"})
    added = noise * DEVIATION * np.random.default_rng(seed).standard_normal(len(moment))
    return clean.replace({"p": clean["p"] + added})


def flight(
    model: fid.TransferFunctionModel, seed: int, *, noise: float = 1.0, n_samples: int = 600
) -> fid.Record:
    """Some sines."""
    time_s = np.arange(n_samples) * SAMPLE_TIME_S
    waves = np.sin(1.7 * time_s) + np.sin(4.1 * time_s + 1.0) + np.sin(9.0 * time_s + 2.0)
    return _flown(model, 0.02 * waves, seed, noise)


def swept(
    model: fid.TransferFunctionModel,
    seed: int,
    *,
    noise: float = 1.0,
    window_s: str | list[float] = "auto",
    estimator: str = "auto",
    n_omega: int = 30,
) -> fid.FrequencyResponse:
    """Response estimated from a sweep of forty seconds."""
    time_s = np.arange(2000) * SAMPLE_TIME_S
    ratio = np.log(BAND[1] / BAND[0])
    phase = BAND[0] * 40.0 / ratio * np.expm1(time_s / 40.0 * ratio)
    moment = 0.03 * np.sin(phase) * np.minimum(1.0, np.minimum(time_s, 40.0 - time_s) / 2.0)
    flown = _flown(model, moment, seed, noise)
    return fid.estimate_response(
        flown, band_rad_s=BAND, n_omega=n_omega, window_s=window_s, estimator=estimator
    )
