"""What windows make of a light mode is taken out of the response, not only named."""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete, freqz, lfilter

import flightid as fid

STEP_S, MODE, ZETA = 0.02, 5.0, 0.02


def test_the_response_at_a_light_mode_is_that_of_the_vehicle() -> None:
    time_s = np.arange(3000) * STEP_S
    rate = 0.3 + (25.0 - 0.3) * time_s / time_s[-1]
    held = 0.1 * np.sin(np.cumsum(rate) * STEP_S)
    b, a, _ = cont2discrete(([10.0, 0.0], [1.0, 2 * ZETA * MODE, MODE**2]), STEP_S, method="zoh")
    noise = np.random.default_rng(3).standard_normal(3000)
    record = fid.Record.from_arrays(
        time_s,
        inputs={"d": held},
        outputs={"p": lfilter(np.ravel(b), a, held) + 0.02 * noise},
        units={"d": "1", "p": "rad/s"},
        hold="zero",
    )
    estimate = fid.estimate_response(record, band_rad_s=(0.8, 20.0), n_omega=50)
    # From samples of a held input to samples: with half a sample of delay.
    _, true = freqz(np.ravel(b), a, estimate.omega_rad_s * STEP_S)
    near = np.abs(estimate.omega_rad_s - MODE) < 1.5
    plain = np.abs(estimate.pair("p", "d").response / true - 1.0)[near]
    mended = np.abs(fid.without_bias(estimate).pair("p", "d").response / true - 1.0)[near]
    assert plain.max() > 0.1
    assert mended.max() < 0.02
