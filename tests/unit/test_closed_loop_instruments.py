"""ARX by instruments in a closed loop, on a loop that NumPy alone runs."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from tests.closeness import assert_close

TRUTH = {"a1": -1.5, "a2": 0.7, "b1": 0.5, "b2": 0.3}
GAIN, COLOUR = 0.35, 0.9


def looped(seed: int, *, n: int = 2000, noise: float = 0.3, shown: bool = True) -> fid.Record:
    """u = r - K y under an ARX vehicle whose output carries slow noise."""
    rng = np.random.default_rng(seed)
    r = np.repeat(rng.choice([-1.0, 1.0], n // 4 + 1), 4)[:n]
    white, drift = noise * rng.standard_normal(n), np.zeros(n)
    x, y, u = np.zeros(n), np.zeros(n), np.zeros(n)
    for k in range(2, n):
        drift[k] = COLOUR * drift[k - 1] + white[k]
        x[k] = 1.5 * x[k - 1] - 0.7 * x[k - 2] + 0.5 * u[k - 1] + 0.3 * u[k - 2]
        y[k] = x[k] + drift[k]
        u[k] = r[k] - GAIN * y[k]
    return fid.Record.from_arrays(
        np.arange(n) * 0.1,
        inputs={"u": u},
        outputs={"y": y},
        excitations={"r": r} if shown else {},
        loop="closed",
    )


STRUCTURE = fid.PolynomialModel.arx("u", "y", na=2, nb=2, nk=1, method="iv4")


def departures(seed: int) -> np.ndarray:
    found = fid.identify(STRUCTURE, looped(seed)).parameters
    return np.array([(found[n].value - TRUTH[n]) / (found[n].stderr or np.nan) for n in TRUTH])


def test_the_excitation_takes_the_bias_of_the_loop_away() -> None:
    """Instruments made of inputs carry the noise and get no bars; those of the excitation do."""
    refused = fid.identify(STRUCTURE, looped(0, shown=False))
    assert refused.covariance is None
    assert np.abs(np.mean([departures(seed) for seed in range(4)], axis=0)).max() < 1.5


def test_without_noise_both_find_the_vehicle() -> None:
    found = fid.identify(STRUCTURE, looped(1, noise=0.0)).parameters
    for name, value in TRUTH.items():
        assert_close(found[name].value, value, atol=1e-9, why="no noise, exact model")


@pytest.mark.nightly
def test_intervals_hold_the_vehicle_as_often_as_they_say() -> None:
    inside = np.abs([departures(seed) for seed in range(300)]) < 1.96
    assert 0.92 < inside.mean() < 0.975
