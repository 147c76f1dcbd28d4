"""Margins of a measurement: what lies beyond its coherence is not read."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.control.margins.usable_points import read_band, unread
from flightid.uncertainty.uncertain import uncertain_numbers

OMEGA = np.geomspace(0.5, 40.0, 120)
TRUE = 4.0 * np.exp(-0.02j * OMEGA) / (1j * OMEGA)
PHASE_DEG = 90.0 - np.degrees(4.0 * 0.02)


def measured(end: float, *, begin: float = 0.0, gain: float = 1.0, error: float = 0.02):
    """An integrator with delay; beyond its coherence turns of noise about −1, of gain 0.5 to 2."""
    known = (begin <= OMEGA) & (end >= OMEGA)
    places = np.arange(len(OMEGA))
    noise = np.exp(0.7 * np.sin(1.3 * places) + 1j * (np.pi + 2.0 * places))
    shape = (1, 1, len(OMEGA))
    return fid.FrequencyResponse.from_values(
        OMEGA,
        np.where(known, gain * TRUE, noise),
        inputs=["e"],
        outputs=["y"],
        coherence=np.where(known, 0.95, 0.1).reshape(shape),
        random_error=np.where(known, error, 2.0).reshape(shape),
    )


def codes(found):
    return {each.code: each.light.value for each in found.findings}


def test_noise_beyond_the_coherence_neither_crosses_nor_turns():
    found = fid.margins(measured(15.0))
    assert found.is_stable
    assert found.crossover.value == pytest.approx(4.0, rel=1e-3)
    assert found.phase_margin.value == pytest.approx(PHASE_DEG, abs=0.05)
    assert len(found.crossovers) == 1
    assert not {"closed-loop-unstable", "nyquist-criterion-contradicted"} & set(codes(found))
    assert codes(found)["not-read"] == "unknown"
    assert found.gain_margin.value is None
    assert "not read: coherence falls below 0.6 beyond" in found.gain_margin.reason
    assert found.curve.omega_rad_s[-1] <= 15.0


def test_disturbance_rejection_ends_with_the_coherence():
    found = fid.disturbance_rejection(measured(15.0))
    below = (OMEGA > 0.5) & (OMEGA < 15.0)
    peak = 20.0 * np.log10(np.max(np.abs(1.0 / (1.0 + TRUE[below]))))
    assert found.peak.value == pytest.approx(peak, abs=0.02)
    assert len(found.crossings_rad_s) == 1
    assert codes(found)["not-read"] == "unknown"
    none = fid.disturbance_rejection(measured(40.0, begin=15.0, gain=0.1))
    assert none.bandwidth.value is None
    assert "not read: coherence falls below 0.6 under" in none.bandwidth.reason


def test_a_disk_margin_ends_with_the_coherence():
    half = np.full(len(OMEGA), 0.5 + 0j)
    for controller, loop in ((None, TRUE), (half, 0.5 * TRUE)):
        found = fid.disk_margin(measured(15.0), controller=controller)
        assert found.omega_rad_s[-1] <= 15.0
        assert codes(found)["not-read"] == "unknown"
        assert "closed-loop-unstable" not in codes(found)
        sizes = np.abs((1.0 - loop) / (1.0 + loop))[OMEGA <= 15.0] / 2.0
        assert found.alpha.value == pytest.approx(1.0 / np.max(sizes), rel=0.01)


def test_stability_is_not_told_where_reading_ends_above_one():
    found = fid.margins(measured(3.0))
    assert codes(found)["stability-not-read"] == "unknown"
    assert found.crossover.value is None
    assert "not read" in found.crossover.reason
    # The phase passes −180° at 15.7 rad/s: seen, but with the gain above one at the end.
    wound = fid.FrequencyResponse.from_values(
        OMEGA,
        400.0 * np.exp(-0.1j * OMEGA) / (1j * OMEGA),
        inputs=["e"],
        outputs=["y"],
        coherence=np.where(OMEGA <= 30.0, 0.9, 0.1).reshape(1, 1, -1),
    )
    turned = fid.margins(wound)
    assert codes(turned)["stability-not-read"] == "amber"
    for each in (found, turned):
        assert each.is_stable is None
        assert each.to_dict()["stable"] is None
        assert "stability not known" in repr(each)


def test_values_of_a_controller_stand_at_all_frequencies_of_the_measurement():
    by_values = fid.margins(measured(15.0), controller=np.full(len(OMEGA), 0.5 + 0j))
    assert by_values.crossover.value == pytest.approx(2.0, rel=1e-3)


def test_an_interval_of_a_frequency_holds_no_negative_one():
    found = fid.margins(measured(40.0, error=2.0))
    for reading in found.quantities:
        ends = reading.interval95
        if reading.unit == "rad/s" and ends is not None:
            assert ends[0] >= 0.0, reading
    assert found.crossover.interval95[0] == 0.0
    value, low = found.crossover.value, found.crossover.interval(0.01)[0]
    assert 0.0 < low < value


def test_chance_between_coherent_neighbours_does_not_end_the_band():
    n = len(OMEGA)

    def with_dip(dip: float, error: float) -> fid.FrequencyResponse:
        coherence = np.full(n, 0.7)
        coherence[60], coherence[100:] = dip, 0.1
        return fid.FrequencyResponse.from_values(
            OMEGA,
            TRUE,
            inputs=["e"],
            outputs=["y"],
            coherence=coherence.reshape(1, 1, n),
            random_error=np.full((1, 1, n), error),
        )

    assert read_band(with_dip(0.5, 0.3)) == (OMEGA[0], OMEGA[99])
    assert read_band(with_dip(0.02, 0.01)) == (OMEGA[0], OMEGA[59])
    assert unread(OMEGA, (OMEGA[0], OMEGA[-1])) == ""
    assert unread(OMEGA, (1.0, 10.0)).endswith("beyond 1 to 10 rad/s")


def test_a_disk_that_is_least_at_an_end_has_no_bar_of_zero_for_its_place():
    """No error moves that place to first order: 12.45 ± 0 rad/s stood there."""
    ended = fid.disk_margin(measured(6.0, gain=0.6), controller=np.full(len(OMEGA), 1.0 + 0j))
    assert ended.frequency.value == pytest.approx(ended.omega_rad_s[-1])
    assert ended.frequency.interval95 is None
    assert "at an end of what was read" in ended.frequency.reason
    inside = fid.disk_margin(measured(30.0))
    assert inside.omega_rad_s[0] < inside.frequency.value < inside.omega_rad_s[-1]
    assert "at an end" not in inside.frequency.reason


def test_a_number_that_no_error_moves_has_no_bar_of_zero():
    carried = uncertain_numbers([1.0], np.eye(1)).carried(lambda x: [x[0], 3.0])
    assert carried.number(0, "moved").stderr == pytest.approx(1.0)
    assert carried.number(1, "still").interval95 is None


def test_a_peak_at_an_end_of_what_was_read_is_no_peak():
    """1.1 ± 2.5 dB stood where the peak of 25 dB lay beyond the coherence, and held 4 of 100."""
    ended = fid.disturbance_rejection(measured(3.9))
    assert ended.peak.value is not None
    assert ended.peak.interval95 is None
    assert ended.peak.reason == "worst at an end of what was read, and may be worse beyond"
    assert codes(ended)["disturbance-peak"] == "unknown"
    margins = fid.margins(measured(3.9))
    assert margins.modulus_margin.interval95 is None
    assert margins.sensitivity_peak.interval95 is None
    assert fid.margins(measured(40.0)).modulus_margin.interval95 is not None
    whole = fid.disturbance_rejection(measured(40.0))
    assert whole.peak.interval95 is not None
    assert codes(whole)["disturbance-peak"] == "green"
