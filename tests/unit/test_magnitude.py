"""Intervals of sizes of complex numbers, against Rice's distribution and by counting."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from flightid.responses import FrequencyResponse
from flightid.responses.errors.random_error import StoredCovariance
from flightid.responses.response_band import response_band
from flightid.uncertainty.magnitude import chance_within, magnitude_interval
from tests.closeness import assert_close


@pytest.mark.parametrize("size", [0.0, 0.7, 3.0, 40.0])
def test_chance_within_a_radius_is_rices_distribution(size: float) -> None:
    radius = np.array([0.3, 1.0, 2.5, 6.0, 41.0])
    found = chance_within(radius, np.full(5, size), np.ones(5), np.ones(5))
    expected = stats.rice.cdf(radius, size) if size else stats.rayleigh.cdf(radius)
    assert_close(found, expected, atol=1e-7, why="the sum over noise across")


@pytest.mark.parametrize("ratio", [0.3, 1.0, 3.0])
def test_lower_ends_are_exceeded_by_one_in_forty(ratio: float) -> None:
    """The measured size less 1.96 standard errors lies above the truth in 7 to 15 of 100."""
    random = np.random.default_rng(1)
    n = 1000
    along, across = np.full(n, 1.0), np.full(n, ratio)
    for true in (0.5, 1.5, 4.0):
        size = np.hypot(true + random.standard_normal(n), ratio * random.standard_normal(n))
        low, high = magnitude_interval(size, along, across)
        assert np.mean(low > true) < 0.025 + 3.3 * np.sqrt(0.025 * 0.975 / n)
        assert np.mean((low <= true) & (true <= high)) > 0.95 - 3.3 * np.sqrt(0.05 * 0.95 / n)


def test_a_band_of_a_response_below_its_noise_begins_at_zero() -> None:
    """Of noise alone 15 of 100 gains lay beyond 1.96 standard errors; 2.5 do so now."""
    random = np.random.default_rng(2)
    n = 1000
    noise = random.standard_normal(n) + 1j * random.standard_normal(n)
    response = FrequencyResponse.from_values(
        np.linspace(1.0, 2.0, n),
        noise,
        inputs=["u"],
        outputs=["y"],
        errors=_Alone(n),
    )
    band = response_band(response, "u", "y")
    assert band is not None
    assert 0.01 < np.mean(band.gain[0] > 0.0) < 0.025 + 3.3 * np.sqrt(0.025 * 0.975 / n)
    known = np.ptp(band.phase_rad, axis=0) < 2.0 * np.pi - 1e-9
    assert np.array_equal(known, band.gain[0] > 0.0), "a direction of what may be nothing"


class _Alone(StoredCovariance):
    """Unit errors, none shared."""

    def __init__(self, n: int) -> None:
        super().__init__(np.eye(2 * n)[None], n)
