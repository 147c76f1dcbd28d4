"""Flights of a short-period model for the tests of the regression methods."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

import flightid as fid

DEVIATIONS = {"alpha": 0.0006, "q": 0.0012, "nz": 0.01}
FIXED = {"Malphadot": -0.9}
SMOOTH_STEP_S = 0.002


def short_period(**fixed: float) -> fid.StateSpaceModel:
    """The library's model, its downwash lag and what is named fixed."""
    model = fid.load_model("short_period")
    assert isinstance(model, fid.StateSpaceModel)
    return model.with_fixed(**{**FIXED, **fixed})


def values(model: fid.StateSpaceModel) -> dict[str, float]:
    """Free parameters."""
    return {p.name: float(p.value or 0.0) for p in model.parameters.free}


def steps(duration_s: float, sample_time_s: float) -> tuple[NDArray, NDArray]:
    """Rounded square waves of two periods, from rest."""
    time_s = np.arange(round(duration_s / sample_time_s) + 1) * sample_time_s
    slow, fast = np.sign(np.sin(2.0 * np.pi * time_s / np.array([[3.1], [1.3]])))
    elevator = (0.04 * slow + 0.02 * fast) * (time_s > 1.0)
    return time_s, gaussian_filter1d(elevator, 0.08 / sample_time_s)


def fly(
    model: fid.StateSpaceModel, duration_s: float = 20.0, sample_time_s: float = 0.02
) -> fid.Record:
    """A flight without noise, computed ten times finer than it is sampled."""
    time_s, elevator = steps(duration_s, SMOOTH_STEP_S)
    driven = fid.Record.from_arrays(
        time_s, inputs={"elevator": elevator}, units={"elevator": "rad"}
    )
    fine = fid.simulate(model, driven, units=model.units)
    every = round(sample_time_s / SMOOTH_STEP_S)
    return fid.Record.from_arrays(
        time_s[::every],
        inputs={"elevator": elevator[::every]},
        outputs={name: fine[name][::every] for name in model.outputs},
        units=model.units,
        hold="band_limited",
    )


def noisy(flight: fid.Record, seed: int, factor: float = 1.0) -> fid.Record:
    """The flight with white noise on its outputs."""
    generator = np.random.default_rng(seed)
    added = {
        name: flight[name] + factor * size * generator.standard_normal(flight.n_samples)
        for name, size in DEVIATIONS.items()
        if name in flight
    }
    return flight.replace(added)
