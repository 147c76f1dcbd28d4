"""A band limits which margins are found, never whether a model's loop is stable."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flightid as fid
from tests.closeness import assert_close

BANDS = [None, (1.5, 100.0), (0.01, 0.5), (3.0, 30.0), (20.0, 50.0)]


def conditional(gain: float, zero: float = 1.0, lag: float = 0.0) -> fid.LinearSystem:
    """k (s + z)²/(s³ (τ s + 1)): stable between a least and, with a lag, a greatest gain."""
    make = fid.loops
    numerator = [gain, 2.0 * gain * zero, gain * zero**2]
    denominator = [lag, 1.0, 0.0, 0.0, 0.0] if lag else [1.0, 0.0, 0.0, 0.0]
    block = make.transfer("e", "y", numerator, denominator)
    return fid.connect([block], inputs=["e"], outputs=["y"]).linear_system()


def growing(gain: float, zero: float = 1.0, lag: float = 0.0) -> int:
    polynomial = np.polyadd([lag, 1.0, 0.0, 0.0, 0.0], gain * np.poly([-zero, -zero]))
    return int(np.sum(np.roots(np.trim_zeros(polynomial, "f")).real > 0.0))


@pytest.mark.parametrize("band", BANDS)
@pytest.mark.parametrize("gain", [0.3, 4.0])
def test_a_conditionally_stable_loop_is_judged_alike_in_every_band(
    gain: float, band: tuple[float, float] | None
) -> None:
    loop = conditional(gain)
    assert growing(gain) == (2 if gain < 0.5 else 0)
    found = fid.margins(loop, band_rad_s=band)
    assert found.unstable_poles == growing(gain)
    whole = fid.margins(loop)
    assert [each.omega_rad_s for each in found.crossovers] == pytest.approx(
        [
            each.omega_rad_s
            for each in whole.crossovers
            if band is None or band[0] < each.omega_rad_s < band[1]
        ]
    )
    if found.crossovers:
        assert_close(
            found.phase_margin.value, whole.phase_margin.value, rtol=1e-6, why="the same crossing"
        )
    disk = fid.disk_margin(loop, band_rad_s=band)
    assert (disk.alpha.value is None) == (growing(gain) > 0)
    rejected = fid.disturbance_rejection(loop, band_rad_s=band)
    assert ("closed-loop-unstable" in [each.code for each in rejected.findings]) == (gain < 0.5)


def test_the_gain_may_fall_by_what_the_low_crossing_leaves() -> None:
    # On the axis at s = j with |L| = 2 k.
    found = fid.margins(conditional(4.0), band_rad_s=(0.5, 100.0))
    assert_close(found.gain_reduction_margin.value, 20 * np.log10(8.0), rtol=1e-6, why="2 k = 8")
    above = fid.margins(conditional(4.0), band_rad_s=(1.5, 100.0))
    # The limit lies below that band, and is a limit all the same.
    assert_close(above.gain_reduction_margin.value, 20 * np.log10(8.0), rtol=1e-6, why="2 k = 8")
    assert_close(above.gain_reduction_crossing.value, 1.0, rtol=1e-6, why="s = j")
    assert above.phase_margin.value is not None
    assert above.phase_margin.value > 0.0


@given(
    gain=st.floats(0.05, 40.0),
    zero=st.floats(0.05, 3.0),
    lag=st.floats(0.005, 0.2),
    low=st.floats(0.01, 30.0),
    ratio=st.floats(2.0, 100.0),
)
def test_the_count_is_that_of_the_poles(
    gain: float, zero: float, lag: float, low: float, ratio: float
) -> None:
    polynomial = np.polyadd([lag, 1.0, 0.0, 0.0, 0.0], gain * np.poly([-zero, -zero]))
    if np.min(np.abs(np.roots(polynomial).real)) < 1e-3:
        return  # on the edge rounding decides
    found = fid.margins(conditional(gain, zero, lag), band_rad_s=(low, low * ratio))
    assert found.unstable_poles == growing(gain, zero, lag)


def test_a_connection_is_judged_as_by_its_poles() -> None:
    make = fid.loops
    for gain in (0.3, 4.0):
        joined = fid.connect(
            [
                make.sum_of("e", "r", "-y"),
                make.transfer("e", "u", [gain, gain], [1.0, 0.0]),
                make.transfer("u", "y", [1.0, 1.0], [1.0, 0.0, 0.0], delay_s=0.01),
            ],
            inputs=["r"],
            outputs=["y"],
        )
        found = fid.margins(joined.broken_at("u"), band_rad_s=(1.5, 60.0))
        assert found.unstable_poles == joined.stability().n_unstable == (2 if gain < 0.5 else 0)


def test_a_measurement_says_that_its_verdict_is_of_the_band() -> None:
    loop, omega = conditional(4.0), np.geomspace(1.5, 100.0, 120)
    seen = fid.FrequencyResponse.from_values(
        omega, loop.frequency_response(omega), inputs=["e"], outputs=["y"]
    )
    said = {each.code: each for each in fid.margins(seen).findings}
    assert "judged from 1.5 to 100 rad/s" in said["stability-of-the-band"].message
    assert "stability-of-the-band" not in [each.code for each in fid.margins(loop).findings]
