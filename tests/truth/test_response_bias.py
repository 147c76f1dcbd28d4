"""What windows and polynomials add to a response is foretold, and taken out."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.signal

import flightid as fid
from flightid.responses.errors.pilot import fit_pilots
from flightid.responses.response_band import response_bands
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


def test_bands_of_pairs_together_are_those_of_each() -> None:
    random = np.random.default_rng(2)
    sticks = random.standard_normal((2, 3000))
    moved = {"p": sticks[0] + 0.3 * sticks[1], "r": 0.5 * sticks[1] - 0.2 * sticks[0]}
    outputs = {
        name: scipy.signal.lfilter([0.1], [1.0, -0.9], each) + 0.02 * random.standard_normal(3000)
        for name, each in moved.items()
    }
    record = fid.Record.from_arrays(
        np.arange(3000) / 50.0, inputs={"lat": sticks[0], "ped": sticks[1]}, outputs=outputs
    )
    response = fid.estimate_response(record, band_rad_s=(2.0, 40.0), n_omega=12)
    pairs = [("r", "lat"), ("p", "ped"), ("p", "lat")]
    together = response_bands(response, pairs)
    assert list(together) == pairs
    for (output, source), found in together.items():
        alone = fid.response_band(response, source, output)
        assert alone is not None
        assert found is not None
        assert found.reason == alone.reason
        assert "taken out" in found.reason
        assert_close(found.gain, alone.gain, rtol=1e-9, why="the same kernels")
        assert_close(found.phase_rad, alone.phase_rad, atol=1e-9, why="the same kernels")


def test_a_response_without_records_says_what_its_band_leaves_out() -> None:
    given = fid.FrequencyResponse.from_values(
        [1.0, 2.0], [1.0, 0.5], inputs=["u"], outputs=["y"], random_error=[0.1, 0.1]
    )
    band = fid.response_band(given, "u", "y")
    assert band is not None
    assert "random errors alone" in band.reason
    assert_close(band.gain[:, 1], [0.5 - 0.098, 0.5 + 0.098], atol=0.003, why="1.96 of 10 %")
    with pytest.raises(fid.errors.DataError, match="cannot be foretold"):
        fid.without_bias(given)


def _errors_of_a_pilot(seed: int) -> np.ndarray:
    """Squares of a pilot's errors over its variances beside a narrow peak of the noise."""
    random, step_s, n, pole = np.random.default_rng(seed), 0.05, 400, np.exp(-0.005 + 0.0497j)
    inputs, outputs = [], []
    for _ in range(6):
        control = scipy.signal.lfilter([1.0], [1.0, -0.9], random.standard_normal(n))
        noise = scipy.signal.lfilter(
            [1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], random.standard_normal(n + 2000)
        )[2000:]
        output = scipy.signal.lfilter([0.0, 0.1], [1.0, -0.9], control) + 0.2 * noise / noise.std()
        inputs.append(control[None])
        outputs.append(output[None])
    pilot = fit_pilots(inputs, outputs, step_s, 12.0)[0]
    assert pilot is not None
    omega = np.array([0.8, 1.0, 1.2])
    turn = np.exp(-1j * omega * step_s)
    error = pilot.frequency_response(omega)[0] - 0.1 * turn / (1.0 - 0.9 * turn)
    slopes = pilot.response_slopes(omega)[:, 0]
    variance = [
        np.einsum("if,ij,jf->f", part, pilot.covariance, part)
        for part in (slopes.real, slopes.imag)
    ]
    return np.asarray(np.abs(error) ** 2 / sum(variance))


def test_pilots_know_their_errors_beside_a_narrow_peak_of_noise() -> None:
    """Noise averaged over bins of one record alone: errors were 3.7 times what was said."""
    squares = np.mean([_errors_of_a_pilot(seed) for seed in range(12)])
    assert 0.6 < np.sqrt(squares) < 1.5


@pytest.mark.parametrize("share", [0.0, 1e-5, 1e-3])
def test_bars_hold_however_quiet_a_record_is(share: float) -> None:
    """What inputs do beyond the band leaked into it: errors of 1e-5 beside bars of 1e-8."""
    step_s, held, n_held = 0.02, 0, 0
    numerator, denominator = scipy.signal.cont2discrete(
        ([3.0, 60.0], np.polymul([1.0, 1.2, 9.0], [1.0, 12.0])), step_s, "zoh"
    )[:2]
    for seed in range(4):
        random = np.random.default_rng([11, seed])
        u = random.standard_normal(2400)
        y = scipy.signal.lfilter(numerator.ravel(), denominator, u)
        y = y + share * y.std() * random.standard_normal(len(y))
        record = fid.Record.from_arrays(
            np.arange(len(y)) * step_s, inputs={"u": u}, outputs={"y": y}, loop="open"
        )
        response = fid.estimate_response(record, band_rad_s=(1.0, 15.0), n_omega=20)
        band = fid.response_band(response, "u", "y")
        assert band is not None
        truth = scipy.signal.freqz(numerator.ravel(), denominator, band.omega_rad_s * step_s)[1]
        inside = (band.gain[0] <= np.abs(truth)) & (np.abs(truth) <= band.gain[1])
        held, n_held = held + np.count_nonzero(inside), n_held + len(inside)
        assert np.median(np.ptp(band.gain, axis=0) / np.abs(truth)) < 1e-6 + 20.0 * share
    assert held >= 0.85 * n_held, f"{held} of {n_held}"
