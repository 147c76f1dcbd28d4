"""Spectra of residuals: bounds that hold the truth, coherence that finds a fault, peaks."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.signal import find_peaks

import flightid as fid
from flightid.errors import DataError, OptionError
from flightid.plot.residuals import residual_spectra as draw_spectra
from flightid.plot.residuals import spectrum_comparison
from flightid.validation import compare_spectra, residual_spectra
from flightid.validation.spectra.prominent_peaks import prominent_peaks
from flightid.validation.spectra.spectra import lags_of_spectrum
from tests.closeness import assert_close

SAMPLE_TIME_S = 0.02


def _record(e: np.ndarray, u: np.ndarray) -> fid.Record:
    return fid.Record.from_arrays(
        np.arange(e.size) * SAMPLE_TIME_S,
        inputs={"u": u},
        outputs={"e": e},
        units={"e": "rad/s"},
    )


def _mode(omega: float) -> fid.LinearSystem:
    return fid.LinearSystem(
        [[0.0, 1.0], [-(omega**2), -0.1 * omega]],
        [[0.0], [omega**2]],
        [[1.0, 0.0]],
        [[0.0]],
        ("u",),
        ("y",),
    )


def test_bounds_hold_the_level_of_white_noise_and_coherence_its_limit() -> None:
    inside, above = [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        made = residual_spectra(_record(3.0 * rng.normal(size=2000), rng.normal(size=2000)))
        level = 9.0 * 2.0 * SAMPLE_TIME_S
        inside.append(np.mean((made.low < level) & (level < made.high)))
        above.append(np.mean(made.coherence > made.coherence_limit))
    assert 0.90 < np.mean(inside) < 0.98
    assert 0.02 < np.mean(above) < 0.09


def test_coherence_shows_the_band_that_is_missed() -> None:
    rng = np.random.default_rng(1)
    u = rng.normal(size=6000)
    time_s = np.arange(u.size) * SAMPLE_TIME_S
    missed = fid.simulate(_mode(6.0), fid.Record.from_arrays(time_s, inputs={"u": u}))["y"]
    made = residual_spectra(_record(missed + 0.3 * rng.normal(size=u.size), u))
    coherence, omega = made.coherence[0, 0], made.omega_rad_s
    assert omega[np.argmax(coherence)] < 7.5
    assert np.median(coherence[omega < 5.0]) > 0.8, "the mode passes what lies below 6 rad/s"
    high = omega > 35.0
    assert np.mean(coherence[high] > made.coherence_limit[0, 0][high]) < 0.3
    assert made.findings[0].light == "amber"
    assert "mend the model" in made.findings[0].action
    json.dumps(made.to_dict(), allow_nan=False)
    assert "coherent" in repr(made)
    assert "<table>" in made._repr_html_()
    drawn = draw_spectra(made, "e")
    assert drawn.layout.yaxis.title.text == "e error [(rad/s)²/Hz]"


def test_a_verification_gives_the_spectra_of_its_residuals_and_its_peaks() -> None:
    rng = np.random.default_rng(2)
    time_s = np.arange(6000) * SAMPLE_TIME_S
    flown = fid.Record.from_arrays(time_s, inputs={"u": rng.normal(size=time_s.size)})
    seen = fid.simulate(_mode(6.0), flown)
    noisy = seen.replace({"y": seen["y"] + 0.05 * rng.normal(size=time_s.size)})
    good = fid.verify(_mode(6.0), noisy)
    assert_close(
        np.median(residual_spectra(good).density[0]),
        0.05**2 * 2.0 * SAMPLE_TIME_S,
        rtol=0.25,
        why="what is left is the noise that was added",
    )
    same = compare_spectra(good)
    matched = [peak for peak in same.peaks if peak.omega_rad_s and peak.predicted_rad_s]
    assert any(5.0 < (peak.omega_rad_s or 0.0) < 7.0 for peak in matched)
    json.dumps(same.to_dict(), allow_nan=False)
    assert "<table>" in same._repr_html_()
    assert "measured peak" in {trace.name for trace in spectrum_comparison(same).data}
    other = compare_spectra(fid.verify(_mode(14.0), noisy))
    codes = {finding.code for finding in other.findings}
    assert {"peak-missed", "peak-of-model-alone"} <= codes
    assert {f.light.value for f in other.findings if f.code == "peak-missed"} == {"amber"}


def test_a_comparison_needs_both_sides_once() -> None:
    rng = np.random.default_rng(3)
    record = _record(rng.normal(size=900), rng.normal(size=900))
    with pytest.raises(OptionError, match="one measurement and one prediction"):
        compare_spectra(record)
    assert len(residual_spectra([record, record]).outputs) == 1


def test_lags_span_the_slowest_peak_up_to_a_bound_and_need_one() -> None:
    rng = np.random.default_rng(3)
    time_s = np.arange(6000) * SAMPLE_TIME_S
    driven = fid.Record.from_arrays(time_s, inputs={"u": rng.normal(size=6000)})
    lags, finding = lags_of_spectrum([fid.simulate(_mode(25.0), driven)], ["u"], "y")
    assert (lags, str(finding.light)) == (
        pytest.approx(2 * np.pi / 25 / SAMPLE_TIME_S, abs=1),
        "green",
    )
    lags, finding = lags_of_spectrum([fid.simulate(_mode(4.0), driven)], ["u"], "y")
    assert (lags, str(finding.light)) == (20, "amber")
    assert "resample records to 0.07" in finding.action
    silent = _record(rng.normal(size=6000), rng.normal(size=6000))
    with pytest.raises(
        DataError, match="no peak with 5 % of the power stands out of the spectrum of e"
    ):
        lags_of_spectrum([silent], ["u"], "e")


def test_prominent_peaks_are_those_of_scipy() -> None:
    random = np.random.default_rng(3)
    for rounds in range(200):
        # Rounded, so that there are plateaus and peaks of one height.
        curve = np.round(np.cumsum(random.standard_normal(60)), rounds % 2)
        least = random.uniform(0.0, 3.0, 60)
        assert prominent_peaks(curve, least) == find_peaks(curve, prominence=least)[0].tolist()
    assert prominent_peaks(np.ones(5), np.zeros(5)) == []
