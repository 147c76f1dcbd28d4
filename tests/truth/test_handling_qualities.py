"""Bandwidth and phase delay of K e^(−τs)/(s(Ts + 1)), to every printed digit; and by arithmetic."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.optimize import brentq

import flightid as fid
from flightid.dynamics import AttitudeBandwidth, attitude_bandwidth
from flightid.errors import DataError, OptionError, UnknownNameError
from tests.closeness import assert_close

# τ, T: ω_180, phase bandwidth, gain bandwidth, phase delay.
CASES = {
    (0.1, 0.3): (5.47161, 2.14214, 3.58772, 0.072976),
    (0.05, 0.2): (9.60189, 3.49822, 6.40903, 0.036734),
    (0.0991, 0.1): (8.65284, 4.04586, 5.10726, 0.068818),
}


def model(tau: float, lag: float, gain: float = 2.0) -> fid.TransferFunctionModel:
    parameters = [fid.Parameter("K", gain, "rad/s"), fid.Parameter("tau", tau, "s")]
    parameters.append(fid.Parameter("T", lag, "s"))
    response = fid.TransferFunction("phi", "lat", "K", denominator=("s", "T*s + 1"), delay="tau")
    return fid.TransferFunctionModel((response,), fid.Parameters(parameters))


def measured(tau: float, lag: float, n: int, high: float = 60.0) -> fid.FrequencyResponse:
    omega = np.geomspace(0.2, high, n)
    values = model(tau, lag).frequency_response(omega)
    return fid.FrequencyResponse.from_values(
        omega, values, inputs=["lat"], outputs=["phi"], units={"phi": "rad"}
    )


@pytest.mark.parametrize("case", CASES)
def test_printed_values(case: tuple[float, float]) -> None:
    crossing, phase, gain, delay = CASES[case]
    for source, digits in ((model(*case), 0.5), (measured(*case, 20000), 0.6)):
        found = attitude_bandwidth(source, "phi", "lat")
        why = "printed digits"
        assert_close(found.omega_180_rad_s, crossing, atol=digits * 1e-5, why=why)
        assert_close(found.phase_bandwidth_rad_s, phase, atol=digits * 1e-5, why=why)
        assert found.gain_bandwidth_rad_s is not None
        assert_close(found.gain_bandwidth_rad_s, gain, atol=digits * 1e-5, why=why)
        assert found.phase_delay_s is not None
        assert_close(found.phase_delay_s, delay, atol=digits * 1e-6, why=why)
        assert found.bandwidth_rad_s == found.phase_bandwidth_rad_s
        assert found.findings == ()


def test_against_the_equations() -> None:
    tau, lag = 0.07, 0.15
    crossing = brentq(lambda w: w * tau + np.arctan(w * lag) - np.pi / 2, 0.1, 50, xtol=1e-14)
    found = attitude_bandwidth(model(tau, lag), "phi", "lat")
    assert_close(found.omega_180_rad_s, crossing, rtol=1e-11, why="the phase equation")
    twice = 2.0 * crossing
    beyond = np.degrees(twice * tau + np.arctan(twice * lag)) - 90.0
    assert_close(found.phase_delay_s, beyond / (57.3 * twice), rtol=1e-10, why="definition")
    size = lambda w: 1.0 / (w * np.hypot(1.0, w * lag))  # noqa: E731
    ratio = size(found.gain_bandwidth_rad_s) / size(crossing)
    assert_close(20.0 * np.log10(ratio), 6.0, rtol=1e-9, why="6 dB of gain margin")


def test_points_of_a_flight_are_joined_by_lines() -> None:
    found = attitude_bandwidth(measured(0.1, 0.3, 40), "phi", "lat")
    exact = CASES[(0.1, 0.3)]
    assert_close(found.omega_180_rad_s, exact[0], rtol=5e-3, why="40 points")
    assert found.phase_delay_s is not None
    assert_close(found.phase_delay_s, exact[3], rtol=2e-2, why="40 points")


def test_what_the_band_does_not_show_is_said() -> None:
    short = attitude_bandwidth(measured(0.1, 0.3, 200, high=8.0), "phi", "lat")
    assert short.phase_delay_s is None
    assert [finding.code for finding in short.findings] == ["phase-delay"]
    late = attitude_bandwidth(model(0.1, 0.3), "phi", "lat", band_rad_s=(2.0, 30.0))
    assert late.gain_bandwidth_rad_s is not None
    rising = fid.FrequencyResponse.from_values(
        np.array([1.0, 2.0, 4.0, 8.0, 16.0]),
        np.array([1.0, 1.0, 1.0, 1.0, 1.0]) * np.exp(-1j * np.radians([90, 130, 170, 200, 260])),
        inputs=["lat"],
        outputs=["phi"],
        units={"phi": "rad"},
    )
    flat = attitude_bandwidth(rising, "phi", "lat")
    assert flat.gain_bandwidth_rad_s is None
    assert "gain-bandwidth" in [finding.code for finding in flat.findings]
    assert flat.bandwidth_rad_s == flat.phase_bandwidth_rad_s
    json.dumps(flat.to_dict(), allow_nan=False)
    assert "–" in str(flat.summary())
    assert "<table" in flat._repr_html_()
    assert repr(AttitudeBandwidth(5.0, 2.0, 1.5, None)) == (
        "AttitudeBandwidth(1.5 rad/s, phase delay unknown)"
    )


def test_refusals() -> None:
    with pytest.raises(DataError, match="has no bandwidth in the band"):
        attitude_bandwidth(model(0.1, 0.3), "phi", "lat", band_rad_s=(0.1, 3.0))
    with pytest.raises(DataError, match="has no bandwidth in the band"):
        attitude_bandwidth(model(0.1, 0.3, gain=-2.0), "phi", "lat", band_rad_s=(0.1, 3.0))
    with pytest.raises(DataError, match="no points in the band"):
        attitude_bandwidth(measured(0.1, 0.3, 50), "phi", "lat", band_rad_s=(80.0, 90.0))
    with pytest.raises(OptionError, match="band_rad_s has no meaning"):
        attitude_bandwidth(model(0.1, 0.3), "phi", "lat", band_rad_s=(3.0, 1.0))
    with pytest.raises(UnknownNameError, match="no such channel"):
        attitude_bandwidth(model(0.1, 0.3), "psi", "lat")
