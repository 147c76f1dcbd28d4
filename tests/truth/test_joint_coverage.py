"""95 % intervals of joint fits cover 93 to 97 of 100 pairs of flights."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from tests.joint_flights import BAND, flight, lag, swept

FLIGHTS = 500


@pytest.mark.slow
@pytest.mark.parametrize("window_s", [[10.0], "auto"])
def test_joint_intervals_cover_the_truth(window_s: str | list[float]) -> None:
    truth = lag()
    inside, shares, untold = [], [], 0
    for seed in range(FLIGHTS):
        response = swept(truth, 2 * seed, noise=0.3, window_s=window_s)
        record = flight(truth, 2 * seed + 1, noise=0.3)
        fit = fid.identify(truth, (response, record), band_rad_s=BAND)
        alone = fid.identify(truth, record)
        if alone.covariance is None or fit.covariance is None:
            untold += 1  # residuals that a test of 1 % accuses by chance
            continue
        for name in fit.names:
            low, high = fit.parameters[name].interval95
            narrow, wide = fit.parameters[name].stderr, alone.parameters[name].stderr
            inside.append(low <= float(truth.parameters[name].value or 0.0) <= high)
            shares.append(narrow / wide)
    share = float(np.mean(inside))
    assert untold <= 0.03 * FLIGHTS
    assert 0.93 <= share <= 0.97, (share, np.mean(shares))
    assert np.mean(shares) < 0.9
