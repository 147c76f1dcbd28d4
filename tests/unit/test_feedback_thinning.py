"""Records are thinned for a loop's test only in step with the clock that holds their inputs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import flightid as fid

STEP_S, SAMPLES = 0.01, 4000


@pytest.mark.parametrize("held", [5, 7, 10])
def test_an_open_rig_with_a_slow_clock_shows_no_loop_in_a_band(held: int) -> None:
    """By every second sample, two levels held for five foretold themselves: 12 of 12 "closed"."""
    random = np.random.default_rng([held, 1])
    u = np.repeat(random.choice([-1.0, 1.0], SAMPLES // held + 1), held)[:SAMPLES]
    b, a, _ = cont2discrete(([2.0], [1.0, 3.0]), STEP_S, method="zoh")
    y = lfilter(b.ravel(), a, u) + 0.01 * random.standard_normal(SAMPLES)
    record = fid.Record.from_arrays(np.arange(SAMPLES) * STEP_S, inputs={"u": u}, outputs={"y": y})
    found = fid.estimate_response(record, band_rad_s=(1.0, 25.0))
    assert not [each for each in found.findings if "seems to be closed" in each.message]
