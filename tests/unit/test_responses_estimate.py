"""What `estimate_response` does: windows, conditioning, composite, findings, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from flightid import FrequencyResponse, Record, estimate_response
from flightid.errors import DataError, OptionError, ShapeError, UnitError, UnknownNameError
from flightid.responses.cautions import band_findings
from flightid.responses.estimators.conditioned import random_error
from flightid.responses.windows.defaults import (
    automatic_windows,
    overlap_factor,
    plan_of,
    shifts_of,
)
from tests.closeness import assert_close
from tests.examples import examples

DT = 0.02


def _record(
    n: int = 4000, seed: int = 0, noise: float = 0.1, mix: float = 0.4, name: str = "a"
) -> Record:
    rng = np.random.default_rng(seed)
    first, second = rng.standard_normal((2, n))
    second = second + mix * first
    p = signal.lfilter([0.0, 0.3], [1, -0.7], first) + 0.5 * second
    q = signal.lfilter([0.2], [1, -0.8], second)
    p, q = p + noise * rng.standard_normal(n), q + noise * rng.standard_normal(n)
    return Record.from_arrays(
        np.arange(n) * DT,
        inputs={"lat": first, "lon": second},
        outputs={"p": p, "q": q},
        units={"p": "rad/s", "q": "rad/s"},
        name=name,
    )


def _truth(omega: np.ndarray) -> np.ndarray:
    z = np.exp(1j * omega * DT)
    zero = np.zeros_like(z)
    return np.array([[0.3 / (z - 0.7), 0.5 + zero], [zero, 0.2 * z / (z - 0.8)]])


def test_correlated_inputs_are_taken_out() -> None:
    response = estimate_response(
        _record(40000), band_rad_s=(2.0, 60.0), n_omega=30, window_s=[8.0, 4.0], covariance=False
    )
    assert_close(response.response, _truth(response.omega_rad_s), atol=0.02, why="1 % noise left")
    alone = estimate_response(
        _record(40000), inputs="lon", outputs="p", band_rad_s=(2.0, 60.0), n_omega=30,
        window_s=8.0, covariance=False,
    )  # fmt: skip
    off = np.abs(alone.response[0, 0] - _truth(alone.omega_rad_s)[0, 1])
    assert off.max() > 0.1, "without conditioning the correlated input must bias the response"


def test_windows_never_span_two_records() -> None:
    parts = [_record(1000, seed) for seed in range(4)]
    together = estimate_response(
        parts, band_rad_s=(5.0, 50.0), n_omega=10, window_s=8.0, overlap=0.5
    )
    assert together.n_windows == (4 * 4,)
    shuffled = estimate_response(parts[::-1], band_rad_s=(5.0, 50.0), n_omega=10, window_s=8.0)
    assert_close(shuffled.response, together.response, rtol=1e-9, why="order of records is nothing")


def test_independent_windows_are_counted_not_overlapped_ones() -> None:
    record = _record(4000)
    one = estimate_response(record, inputs="lat", outputs="p", window_s=8.0, overlap=0.5)
    assert one.n_windows == (19,)
    assert_close(one.n_independent, 10.0, rtol=1e-12, why="80 s in windows of 8 s")
    expected = np.sqrt(0.55) * np.sqrt((1 - one.coherence) / one.coherence / 20)
    assert_close(one.random_error, expected, rtol=1e-9, why="the published formula")


def test_random_error_spot_values() -> None:
    assert_close(
        random_error(np.array([0.6, 0.8, 0.95]), 5, 2),
        [0.19149, 0.11726, 0.05380],
        atol=6e-6,
        why="published constants, n_d = 5, 50 % overlap",
    )
    assert_close(
        random_error(np.array([0.6, 0.8, 0.95]), 10, 2),
        [0.13540, 0.08292, 0.03804],
        atol=6e-6,
        why="published constants, n_d = 10, 50 % overlap",
    )
    assert_close(
        random_error(np.array([0.6, 0.8]), 5, 1), [0.25820, 0.15811], atol=6e-6, why="no overlap"
    )
    assert_close(overlap_factor(5), np.sqrt(0.5), rtol=1e-12, why="80 % overlap")


def test_composite_follows_the_window_with_the_smaller_error() -> None:
    record = _record(20000, noise=0.02)
    response = estimate_response(
        record, inputs="lat", outputs="p", band_rad_s=(0.7, 60.0), n_omega=40, window_s=[40.0, 4.0]
    )
    short = estimate_response(
        record, inputs="lat", outputs="p", band_rad_s=(0.7, 60.0), n_omega=40, window_s=4.0
    )
    long = estimate_response(
        record, inputs="lat", outputs="p", band_rad_s=(0.7, 60.0), n_omega=40, window_s=40.0
    )
    low = response.omega_rad_s < 4 * np.pi / 4.0
    assert_close(
        response.response[..., low],
        long.response[..., low],
        rtol=1e-9,
        why="the short window has fewer than two cycles there",
    )
    high = response.omega_rad_s > 30.0
    near_short = np.abs(response.response - short.response)[..., high].mean()
    near_long = np.abs(response.response - long.response)[..., high].mean()
    assert near_short < 0.1 * near_long


def test_one_window_is_its_own_composite() -> None:
    one = estimate_response(_record(), window_s=5.0)
    assert_close(
        one.input_spectrum,
        one.input_spectrum.conj().transpose(1, 0, 2),
        atol=1e-15,
        why="Hermitian",
    )
    assert np.all((one.coherence >= 0) & (one.coherence <= 1))
    assert np.all(one.multiple_coherence >= one.coherence.max(axis=1) - 1e-9)


@examples(15)
@given(gain=st.floats(1e-3, 1e3), shift=st.floats(-100, 100), seed=st.integers(0, 99))
def test_scaling_an_output_scales_its_response(gain: float, shift: float, seed: int) -> None:
    record = _record(1200, seed)
    scaled = record.replace({"p": gain * record["p"] + shift})
    options = {"band_rad_s": (5.0, 50.0), "n_omega": 6, "window_s": [4.0, 2.0]}
    before, after = (estimate_response(one, **options) for one in (record, scaled))
    assert_close(after.response[0], gain * before.response[0], rtol=1e-6, why="linear in y")
    assert_close(after.coherence, before.coherence, rtol=1e-6, why="free of scale")
    assert_close(after.random_error, before.random_error, rtol=1e-5, why="free of scale")


@examples(10)
@given(seed=st.integers(0, 99), mix=st.floats(-3, 3))
def test_order_of_inputs_is_nothing_but_labels(seed: int, mix: float) -> None:
    record = _record(1600, seed, mix=mix)
    options = {"band_rad_s": (5.0, 50.0), "n_omega": 6, "window_s": [4.0, 2.0]}
    one = estimate_response(record, inputs=["lat", "lon"], **options)
    other = estimate_response(record, inputs=["lon", "lat"], **options)
    assert_close(other.response[:, ::-1], one.response, rtol=1e-7, atol=1e-10, why="permutation")
    assert_close(other.coherence[:, ::-1], one.coherence, rtol=1e-7, atol=1e-10, why="permutation")
    assert one.coherence.min() >= 0.0
    assert one.coherence.max() <= 1.0


def test_default_band_and_windows() -> None:
    response = estimate_response(_record(6000))
    assert len(response.window_s) == 5
    assert_close(response.window_s[0], 24.0, rtol=1e-9, why="a fifth of 120 s")
    assert_close(response.omega_rad_s[0], 4 * np.pi / 24.0, rtol=1e-9, why="two cycles")
    assert_close(response.omega_rad_s[-1], 2 * np.pi / DT / 5, rtol=1e-9, why="a fifth of the rate")
    assert response.findings == ()
    assert automatic_windows([4.0], 10.0) == (0.8,)


def test_plan_is_even_and_whole_hops() -> None:
    assert plan_of(1.01, 0.01, 2).length == 102 - 2
    assert plan_of(1.0, 0.01, 5).length == 100
    assert plan_of(0.97, 0.01, 5).length == 100


def test_findings_say_what_to_trust() -> None:
    response = estimate_response(
        _record(mix=5.0), band_rad_s=(0.2, 100.0), n_omega=20, window_s=8.0
    )
    codes = {finding.code for finding in response.findings}
    assert codes == {"below-two-cycles", "above-a-fifth-of-the-rate", "inputs-correlated"}


@pytest.mark.parametrize("digits", [3, 4])
def test_bands_as_they_are_written_are_within_their_limits(digits: int) -> None:
    """Two cycles in 7.2 s are 1.7453 rad/s, a fifth of 25 Hz 31.416: rounded either way, both."""
    edge = 2.0 * 2.0 * np.pi / 7.2, 2.0 * np.pi / (5.0 * 0.04)
    low, high = (float(f"{each:.{digits}g}") for each in edge)
    assert band_findings(np.array([low, high]), 7.2, 0.04) == []
    below, above = band_findings(np.array([1.73, 31.6]), 7.2, 0.04)
    assert "from 1.73 rad/s" in below.message
    assert "at 1.75 rad/s" in below.action
    assert "reach 31.6 rad/s; a fifth of the sampling rate is 31.4" in above.message


def test_select_and_pair() -> None:
    response = estimate_response(_record(), band_rad_s=(2.0, 60.0), n_omega=40, window_s=8.0)
    part = response.select(outputs=["q"], inputs=["lon"], band_rad_s=(5.0, 50.0))
    assert part.response.shape == (1, 1, part.n_frequencies)
    assert part.omega_rad_s[0] >= 5.0
    assert part.omega_rad_s[-1] <= 50.0
    pair = response.pair("q", "lon")
    assert pair.unit == "rad/s"
    assert_close(pair.response[-3:], response.response[1, 1, -3:], rtol=1e-15, why="a view")
    assert pair.usable_band()[1] > 30.0
    assert response.select(band_rad_s=(5.0, 50.0), n_omega=8).n_frequencies == 8
    assert response.select(omega_rad_s=[5.0, 50.0]).n_frequencies == 2
    assert len(response.summary().rows) == 4
    assert response.to_dict()["schema"] == "flightid.frequency_response/1"


def test_refusals() -> None:
    record = _record(1000)
    still = record.replace({"lat": np.zeros(1000)})
    twin = record.replace({"lat": 2 * record["lon"]})
    with pytest.raises(DataError, match="no record to estimate"):
        estimate_response([])
    with pytest.raises(DataError, match="'lat' has no power"):
        estimate_response(still, window_s=2.0)
    with pytest.raises(DataError, match="cannot be told apart"):
        estimate_response(twin, window_s=2.0)
    with pytest.raises(DataError, match="no input channel"):
        estimate_response(record.select(["p"]))
    with pytest.raises(OptionError, match="both input and output"):
        estimate_response(record, inputs="p", outputs="p")
    with pytest.raises(OptionError, match="overlap"):
        estimate_response(record, overlap=0.55)
    with pytest.raises(OptionError, match="estimator"):
        estimate_response(record, estimator="magic")
    with pytest.raises(OptionError, match="detrend"):
        estimate_response(record, detrend="cubic")
    with pytest.raises(OptionError, match="window_s"):
        estimate_response(record, window_s="long")
    with pytest.raises(OptionError, match="window_s"):
        estimate_response(record, window_s=[-1.0])
    with pytest.raises(DataError, match="does not fit the records"):
        estimate_response(record, window_s=100.0)
    with pytest.raises(DataError, match="too few independent windows"):
        estimate_response(record, window_s=14.0, overlap=0.8)
    with pytest.raises(OptionError, match="band_rad_s is no band"):
        estimate_response(record, band_rad_s=(5.0, 1.0), n_omega=10)
    with pytest.raises(OptionError, match="what the sample time can show"):
        estimate_response(record, omega_rad_s=[1.0, 1000.0])
    with pytest.raises(DataError, match="too short for a frequency response"):
        estimate_response(record.segment(0.0, 0.5))
    with pytest.raises(UnknownNameError, match="no such channel"):
        estimate_response(record, outputs="r")


def test_records_that_disagree_are_refused() -> None:
    record = _record(1000)
    other = Record.from_arrays(
        np.arange(1000) * 0.01, inputs={"lat": record["lat"]}, outputs={"p": record["p"]}
    )
    with pytest.raises(DataError, match="different sample times"):
        estimate_response([record, other], inputs="lat", outputs="p")
    with pytest.raises(UnitError, match="another unit in another record"):
        estimate_response([record, record.to_units(p="deg/s")])


def test_a_response_of_known_values() -> None:
    omega = np.array([1.0, 2.0, 4.0])
    response = FrequencyResponse.from_values(
        omega, 1 / (1 + 1j * omega), inputs=["tau"], outputs=["p"], units={"p": "rad/s"}
    )
    assert response.covariance is None
    assert_close(response.pair("p", "tau").magnitude_db[0], -3.0103, atol=1e-4, why="half power")
    with pytest.raises(ShapeError, match="response does not fit"):
        FrequencyResponse.from_values(omega, [1.0], inputs=["tau"], outputs=["p"])
    with pytest.raises(ShapeError, match="does not fit"):
        FrequencyResponse.from_values(
            omega, omega, inputs=["tau"], outputs=["p"], coherence=[[[1.0, 1.0, 1.0]]]
        ).select(omega_rad_s=[1.0]).__class__(**{**vars(response), "coherence": np.ones(3)})
    with pytest.raises(DataError, match="not finite"):
        FrequencyResponse.from_values(omega, omega * np.inf, inputs=["tau"], outputs=["p"])
    with pytest.raises(DataError, match="must be positive and increase"):
        FrequencyResponse.from_values(omega[::-1], omega, inputs=["tau"], outputs=["p"])
    with pytest.raises(DataError, match="errors of this response are not known"):
        response.covariance_at([1.0])
    with pytest.raises(UnknownNameError, match="no such output"):
        response.pair("q", "tau")
    with pytest.raises(DataError, match="no frequency of the response lies in the band"):
        response.select(band_rad_s=(5.0, 6.0))
    with pytest.raises(DataError, match="frequencies must be positive"):
        response.select(band_rad_s=(-1.0, 6.0))


def test_overlap_choices() -> None:
    assert [shifts_of(x) for x in (0.0, 0.5, 0.75, 0.8)] == [1, 2, 4, 5]


def test_an_input_that_moves_in_fragments_alone_is_not_said_to_have_no_power() -> None:
    random = np.random.default_rng(0)

    def flown(n: int, second: float) -> Record:
        u, v = random.standard_normal(n), second * random.standard_normal(n)
        y = np.convolve(u + v, [0.0, 0.5, 0.3])[:n]
        return Record.from_arrays(np.arange(n) / 50, inputs={"u": u, "v": v}, outputs={"y": y})

    pieces = [flown(3000, 0.0), flown(300, 1.0), flown(300, 1.0)]
    with pytest.raises(DataError, match=r"'v' moves only in records shorter than a window: .* 6 s"):
        estimate_response(pieces, window_s=20.0)
