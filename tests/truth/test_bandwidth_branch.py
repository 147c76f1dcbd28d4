"""Bandwidths above slow unstable modes: branch and sign are those near crossover."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import flightid as fid
from flightid.conventions import Light
from flightid.dynamics import attitude_bandwidth
from flightid.errors import DataError
from tests.closeness import assert_close

TAU, LAG = 0.1, 0.3


def phase_deg(omega: float) -> float:
    """Of `hover` above its pair, each factor by its own arc, none of them unwrapped."""
    zero, pair = np.arctan2(-0.03, omega), np.arctan2(0.018 * omega, omega**2 - 0.09)
    return float(np.degrees(zero - pair - TAU * omega - np.arctan(LAG * omega))) - 90.0


CROSSING = brentq(lambda omega: phase_deg(omega) + 180.0, 1.0, 20.0)
PHASE = brentq(lambda omega: phase_deg(omega) + 135.0, 1.0, 20.0)


def hover(sign: float, *, low: float = 0.1) -> fid.FrequencyResponse:
    """2 e^(−τs)/(s(Ts + 1)), and an unstable pair (0.009 ± 0.3j) with two zeros."""
    omega = np.geomspace(low, 60.0, 4000)
    s = 1j * omega
    slow = s * (s + 0.03) / (s**2 - 0.018 * s + 0.09)
    values = sign * 2.0 * slow / (s * (LAG * s + 1.0)) * np.exp(-TAU * s)
    return fid.FrequencyResponse.from_values(
        omega, values, inputs=["lat"], outputs=["phi"], units={"phi": "rad"}
    )


@pytest.mark.parametrize("low", [0.05, 0.1, 0.2, 0.6])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_slow_unstable_pair_moves_no_bandwidth(sign: int, low: float) -> None:
    found = attitude_bandwidth(hover(sign, low=low), "lat", "phi", sign=sign)
    assert found.findings == ()
    assert_close(found.omega_180_rad_s, CROSSING, rtol=1e-5, why="the factors of phi/lat")
    assert_close(found.phase_bandwidth_rad_s, PHASE, rtol=1e-5, why="the factors of phi/lat")
    other = attitude_bandwidth(hover(sign, low=low), "lat", "phi", sign=-sign)
    assert "sign-doubtful" in [finding.code for finding in other.findings]


def test_a_sign_found_above_an_unstable_pair_is_not_green() -> None:
    axes = {"roll": ("phi", "lat")}
    found = fid.handling_qualities(hover(-1.0), axes=axes)
    lights = {finding.code: finding.light for finding in found.findings}
    assert lights["sign-found"] is Light.AMBER
    assert found.bandwidths["roll"].omega_180_rad_s == pytest.approx(CROSSING, rel=1e-5)
    assert "sign-found" not in {
        f.code for f in fid.handling_qualities(hover(1), axes=axes).findings
    }


def test_library_helicopters_in_hover() -> None:
    expected = {"ah64_hover": (1, 5.473, 1.997), "r50_hover": (1, 13.35, 11.16)}
    for name, (sign, crossing, phase) in expected.items():
        model = fid.load_model(name)
        found = attitude_bandwidth(model, "lat", "phi", sign=sign)
        at = model.frequency_response(np.array([crossing, phase]))
        inside = at[model.outputs.index("phi"), model.inputs.index("lat")]
        degrees = np.degrees(np.angle(inside)) % 360.0 - 360.0
        assert_close(degrees, [-180.0, -135.0], atol=0.2, why="the model's own phase there")
        assert_close(found.omega_180_rad_s, crossing, rtol=5e-4, why="four digits")
        assert_close(found.phase_bandwidth_rad_s, phase, rtol=5e-4, why="four digits")
        assert "sign-doubtful" not in [finding.code for finding in found.findings]


def test_a_phase_that_never_leads_enough_says_so() -> None:
    with pytest.raises(DataError, match="close an inner loop"):
        attitude_bandwidth(fid.load_model("ah64_hover"), "lon", "theta")


def test_an_aeroplane_turns_by_its_short_period() -> None:
    found = fid.handling_qualities(fid.load_model("fixed_wing_longitudinal"))
    pitch = found.bandwidths["pitch"]
    assert_close(pitch.phase_bandwidth_rad_s, 4.411, rtol=5e-4, why="above the phugoid")


@pytest.mark.parametrize("low", [0.05, 0.2, 0.5])
def test_a_model_shows_its_sign_by_what_lies_below_the_band(low: float) -> None:
    """A hovering helicopter by NumPy: its unstable pair ends where a band from 0.5 rad/s begins."""
    g, lag = 32.174, 0.1
    craft = fid.LinearSystem(
        [
            [-0.02, 0.0, 0.0, 0.0, -g, 0.0, -g, 0.0],
            [0.0, -0.05, 0.0, 0.0, 0.0, g, 0.0, g],
            [0.004, 0.003, 0.0, 0.0, 0.0, 0.0, 7.0, 0.0],
            [0.004, -0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 32.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0 / lag, -0.2 / lag],
            [0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.15 / lag, -1.0 / lag],
        ],
        np.array([[0.0] * 6 + [0.025 / lag, 0.004 / lag]]).T,
        np.eye(8)[[4]], [[0.0]], ("lon",), ("theta",), [0.035],
    )  # fmt: skip
    found = attitude_bandwidth(craft, "lon", "theta", band_rad_s=(low, 60.0))
    assert_close(found.bandwidth.value, 0.59, rtol=0.01, why="above the pair, whatever the band")
    assert not [each for each in found.findings if each.code == "sign-doubtful"]
    with pytest.raises(DataError, match=r"has passed −135° where it begins\.$"):
        attitude_bandwidth(craft, "lon", "theta", band_rad_s=(1.0, 60.0))


def test_a_last_point_of_noise_turns_no_phase() -> None:
    """The gain of noise at the band's end asked for any phase: a bandwidth went missing by it."""
    omega = np.geomspace(0.6, 16.0, 70)
    s = 1j * omega
    values = 20.0 * np.exp(-0.1 * s) / (s * (0.3 * s + 1.0))
    coherence = np.full(70, 0.95)
    values[-3:] *= np.array([0.98, 0.85, 0.5]) * np.exp(1j * np.array([0.0, 0.2, 1.0]))
    coherence[-2:] = 0.5, 0.06
    measured = fid.FrequencyResponse.from_values(
        omega, values, inputs=["lat"], outputs=["phi"], units={"phi": "rad"}, coherence=coherence
    )
    found = attitude_bandwidth(measured, "lat", "phi", band_rad_s=(0.6, 16.0))
    assert_close(found.omega_180_rad_s, 5.47161, atol=0.02, why="lines between 70 points")
    assert_close(found.phase_bandwidth_rad_s, 2.14214, atol=0.02, why="lines between 70 points")
    assert not [each for each in found.findings if each.code == "reversed"]
