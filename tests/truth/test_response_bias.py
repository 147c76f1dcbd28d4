"""What windows and polynomials add to a response is foretold, and taken out."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from tests.closeness import assert_close
from tests.strangers.response_bands import discrete, oscillator_record


@pytest.mark.parametrize("estimator", ["composite", "local_polynomial"])
def test_the_bias_at_a_light_mode_is_taken_out(estimator: str) -> None:
    record = oscillator_record(1, zeta=0.02, duration_s=20.0, colour=0.0, roughness=1e-6)
    response = fid.estimate_response(record, band_rad_s=(1.3, 8.0), n_omega=12, estimator=estimator)
    truth = discrete(response.omega_rad_s, 0.02)
    assert np.max(np.abs(response.response[0, 0] / truth - 1.0)) > 1.0
    clean = fid.without_bias(response)
    assert_close(clean.response[0, 0], truth, rtol=0.03, why="a composite is linear to first order")
    band = fid.response_band(response, "u", "y")
    assert band is not None
    assert_close(band.centre, clean.response[0, 0], rtol=1e-12, why="the same numbers")
    assert "taken out" in band.reason


def test_a_response_without_records_says_what_its_band_leaves_out() -> None:
    given = fid.FrequencyResponse.from_values(
        [1.0, 2.0], [1.0, 0.5], inputs=["u"], outputs=["y"], random_error=[0.1, 0.1]
    )
    band = fid.response_band(given, "u", "y")
    assert band is not None
    assert "random errors alone" in band.reason
    assert_close(band.gain[:, 1], [0.5 - 0.098, 0.5 + 0.098], atol=1e-4, why="1.96 of 10 %")
    with pytest.raises(fid.errors.DataError, match="cannot be foretold"):
        fid.without_bias(given)
