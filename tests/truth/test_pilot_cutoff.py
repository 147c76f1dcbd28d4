"""Cut-off frequency against closed-form spectra, and how often its interval holds the truth."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.signal import lfilter

import flightid as fid
from flightid.errors import DataError, OptionError, UnknownNameError
from tests.closeness import assert_close

STEP_S = 0.02


def record_of(values: np.ndarray, step_s: float = STEP_S) -> fid.Record:
    time_s = np.arange(len(values)) * step_s
    return fid.Record.from_arrays(time_s, inputs={"lat": values})


def first_order(corner_rad_s: float, duration_s: float, seed: int) -> np.ndarray:
    """Samples of white noise through a first-order filter, unit variance, in their steady state."""
    phi = np.exp(-corner_rad_s * STEP_S)
    noise = np.random.default_rng(seed).standard_normal(round(duration_s / STEP_S) + 4000)
    return np.asarray(lfilter([np.sqrt(1.0 - phi**2)], [1.0, -phi], noise)[4000:])


def true_cutoff(corner_rad_s: float) -> float:
    """Half of the power of an AR(1): tan(θ/2) = (1 − φ)/(1 + φ), the corner as T goes to zero."""
    phi = np.exp(-corner_rad_s * STEP_S)
    return float(2.0 * np.arctan((1.0 - phi) / (1.0 + phi)) / STEP_S)


def test_first_order_noise_has_its_cutoff_at_the_corner() -> None:
    assert_close(true_cutoff(2.0), 2.0, rtol=3e-4, why="the continuous limit")
    records = [record_of(first_order(2.0, 600.0, seed)) for seed in range(6)]
    found = fid.pilot_cutoff(records, "lat")
    assert_close(found.cutoff.value, true_cutoff(2.0), rtol=0.06, why="an hour of flight")
    assert_close(found.rms.value, 1.0, rtol=0.03, why="unit variance")
    low, high = found.cutoff.interval95 or (0.0, 0.0)
    assert low < true_cutoff(2.0) < high
    assert high / low < 1.16
    assert found.findings == ()


def test_second_order_noise_by_quadrature() -> None:
    natural, damping = 4.0, 0.5
    a = np.array([1.0, 2.0 * damping * natural, natural**2])
    step = 0.01
    # Bilinear: exact in shape where ω T is small.
    s = 2.0 / step
    top = natural**2 * np.array([1.0, 2.0, 1.0])
    bottom = np.array([s**2 + a[1] * s + a[2], 2 * a[2] - 2 * s**2, s**2 - a[1] * s + a[2]])
    noise = np.random.default_rng(2).standard_normal(180_000)
    found = fid.pilot_cutoff(record_of(lfilter(top, bottom, noise), step), "lat")

    def density(omega: float) -> float:
        return 1.0 / ((natural**2 - omega**2) ** 2 + (a[1] * omega) ** 2)

    total = quad(density, 0.0, 300.0, limit=500)[0]
    half = brentq(lambda end: quad(density, 0.0, end, limit=500)[0] - total / 2.0, 0.1, 50.0)
    assert_close(found.cutoff.value, half, rtol=0.04, why="half an hour of noise")


def test_two_sines_have_it_between_them() -> None:
    time_s = np.arange(0.0, 200.0, STEP_S)
    values = np.sin(1.0 * time_s) + 1.5 * np.sin(3.0 * time_s) + 7.0
    found = fid.pilot_cutoff(record_of(values), "lat")
    assert_close(found.cutoff.value, 3.0, atol=0.04, why="the stronger line")
    assert_close(found.rms.value, np.sqrt(0.5 + 0.5 * 1.5**2), rtol=2e-3, why="the mean is out")
    upper = fid.pilot_cutoff(record_of(values), "lat", band_rad_s=(0.5, 2.0))
    assert_close(upper.cutoff.value, 1.0, atol=0.04, why="the line in the band")
    assert_close(upper.rms.value, np.sqrt(0.5), rtol=0.01, why="the line in the band")


def test_records_count_by_their_lengths() -> None:
    long, short = first_order(1.0, 900.0, 1), 30.0 * first_order(8.0, 45.0, 2)
    both = fid.pilot_cutoff([record_of(long), record_of(short)], "lat")
    power = np.array([900.0 * np.var(long), 45.0 * np.var(short)])
    assert both.rms.value is not None
    assert_close(both.rms.value**2, power.sum() / 945.0, rtol=0.03, why="pooled mean square")
    alone = fid.pilot_cutoff(record_of(short), "lat")
    assert both.cutoff.value is not None
    assert alone.cutoff.value is not None
    assert 4.0 < both.cutoff.value <= alone.cutoff.value * 1.05


def test_what_is_doubtful_is_said() -> None:
    brief = fid.pilot_cutoff(record_of(first_order(1.0, 60.0, 4)), "lat")
    assert [each.code for each in brief.findings] == ["few-periods"]
    white = np.random.default_rng(5).standard_normal(20_000)
    assert [each.code for each in fid.pilot_cutoff(record_of(white), "lat").findings] == [
        "power-to-the-end"
    ]
    json.dumps(brief.to_dict(), allow_nan=False)
    assert repr(brief).startswith("PilotCutoff(lat, ")
    assert "pilot cut-off frequency" in str(brief.summary())
    assert "<table" in brief._repr_html_()


def test_refusals() -> None:
    flown = record_of(first_order(1.0, 60.0, 4))
    with pytest.raises(DataError, match="there is no record"):
        fid.pilot_cutoff([], "lat")
    with pytest.raises(DataError, match="lat does not move"):
        fid.pilot_cutoff(record_of(np.full(500, 3.0)), "lat")
    with pytest.raises(OptionError, match="band_rad_s has no meaning"):
        fid.pilot_cutoff(flown, "lat", band_rad_s=(2.0, 1.0))
    with pytest.raises(DataError, match="the records do not hold the band"):
        fid.pilot_cutoff(flown, "lat", band_rad_s=(0.001, 5.0))
    with pytest.raises(UnknownNameError):
        fid.pilot_cutoff(flown, "lon")


@pytest.mark.slow
@pytest.mark.parametrize(("corner", "duration_s"), [(2.0, 150.0), (2.0, 400.0)])
def test_intervals_cover_the_truth(corner: float, duration_s: float) -> None:
    inside = np.zeros(2)
    n_flights = 600
    for seed in range(n_flights):
        found = fid.pilot_cutoff(record_of(first_order(corner, duration_s, 50 + seed)), "lat")
        for place, (each, true) in enumerate(
            ((found.cutoff, true_cutoff(corner)), (found.rms, 1.0))
        ):
            low, high = each.interval95 or (0.0, 0.0)
            inside[place] += low <= true <= high
    shares = inside / n_flights
    assert np.all((shares >= 0.93) & (shares <= 0.97)), shares
