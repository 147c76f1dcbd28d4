"""Bandwidth and phase delay of K e^(−τs)/(s(Ts + 1)), to every printed digit; and by arithmetic."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.optimize import brentq

import flightid as fid
from flightid.dynamics import attitude_bandwidth
from flightid.dynamics.handling_qualities import attitude_bandwidth as attitude_module
from flightid.dynamics.handling_qualities.attitude_bandwidth import FEW_POINTS, bandwidth_numbers
from flightid.dynamics.handling_qualities.curve import (
    GRID_POINTS,
    GainPhaseCurve,
    Pair,
    smoother_of,
)
from flightid.dynamics.handling_qualities.rating_charts_reading import rating_chart
from flightid.errors import DataError, OptionError, UnknownNameError
from flightid.uncertainty.uncertain import Uncertain
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
    return fid.TransferFunctionModel((response,), fid.Parameters(parameters), {"phi": "rad"})


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
        found = attitude_bandwidth(source, "lat", "phi")
        why = "printed digits"
        assert_close(found.omega_180_rad_s, crossing, atol=digits * 1e-5, why=why)
        assert_close(found.phase_bandwidth_rad_s, phase, atol=digits * 1e-5, why=why)
        assert found.gain_bandwidth_rad_s is not None
        assert_close(found.gain_bandwidth_rad_s, gain, atol=digits * 1e-5, why=why)
        assert found.phase_delay_s is not None
        assert_close(found.phase_delay_s, delay, atol=digits * 1e-6, why=why)
        assert found.bandwidth_rad_s == found.phase_bandwidth_rad_s
        assert found.findings == ()


@pytest.mark.parametrize(("damping", "few"), [(0.05, True), (0.003, False)])
def test_errors_by_fewer_points_are_those_by_all(
    damping: float, few: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mode narrower than the coarse grid, beside −180°, is what it would not see."""
    mode = 5.47**2  # rad/s, squared; ω_180 is 5.41

    def vehicle(numbers: np.ndarray) -> fid.LinearSystem:
        gain, late, lag = numbers
        above = [1.0, 0.8 * damping * np.sqrt(mode), mode]
        below = np.polymul([lag, 1.0, 0.0], [1.0, 2.0 * damping * np.sqrt(mode), mode])
        return fid.loops.transfer("lat", "phi", gain * np.array(above), below, delay_s=late).part

    covariance = np.diag([0.05, 0.002, 0.01]) ** 2
    known = Uncertain(np.array([2.0, 0.1, 0.3]), covariance, vehicle)
    found = attitude_bandwidth(known, "lat", "phi").uncertain
    pair = Pair("phi", "lat", 0.1, 100.0)
    assert (attitude_module._enough(known, pair, found.numbers) == FEW_POINTS) == few
    monkeypatch.setattr(attitude_module, "FEW_POINTS", GRID_POINTS)
    whole = attitude_bandwidth(known, "lat", "phi").uncertain
    assert found.stderr is not None
    assert whole.stderr is not None
    assert_close(found.stderr, whole.stderr, rtol=1e-3, why="a slope over straight pieces")
    assert_close(found.stderr[:4], whole.stderr[:4], rtol=1e-9, why="refined by the model")


def test_against_the_equations() -> None:
    tau, lag = 0.07, 0.15
    crossing = brentq(lambda w: w * tau + np.arctan(w * lag) - np.pi / 2, 0.1, 50, xtol=1e-14)
    found = attitude_bandwidth(model(tau, lag), "lat", "phi")
    assert_close(found.omega_180_rad_s, crossing, rtol=1e-11, why="the phase equation")
    twice = 2.0 * crossing
    beyond = np.degrees(twice * tau + np.arctan(twice * lag)) - 90.0
    assert_close(found.phase_delay_s, beyond / (57.3 * twice), rtol=1e-10, why="definition")
    size = lambda w: 1.0 / (w * np.hypot(1.0, w * lag))  # noqa: E731
    ratio = size(found.gain_bandwidth_rad_s) / size(crossing)
    assert_close(20.0 * np.log10(ratio), 6.0, rtol=1e-9, why="6 dB of gain margin")


def test_points_of_a_flight_are_joined_by_lines() -> None:
    found = attitude_bandwidth(measured(0.1, 0.3, 40), "lat", "phi")
    exact = CASES[(0.1, 0.3)]
    assert_close(found.omega_180_rad_s, exact[0], rtol=5e-3, why="40 points")
    assert found.phase_delay_s is not None
    assert_close(found.phase_delay_s, exact[3], rtol=2e-2, why="40 points")


def test_what_the_band_does_not_show_is_said() -> None:
    short = attitude_bandwidth(measured(0.1, 0.3, 200, high=8.0), "lat", "phi")
    assert short.phase_delay_s is None
    assert [finding.code for finding in short.findings] == ["phase-delay"]
    assert short.phase_slope_delay_s is not None
    omega = np.linspace(short.omega_180_rad_s, 8.0, 2001)
    slope = np.polyfit(omega, -np.degrees(omega * 0.1 + np.arctan(omega * 0.3)), 1)[0]
    assert_close(
        short.phase_slope_delay_s, -slope / 114.6, rtol=2e-3, why="as far as the band goes"
    )
    late = attitude_bandwidth(model(0.1, 0.3), "lat", "phi", band_rad_s=(2.0, 30.0))
    assert late.gain_bandwidth_rad_s is not None
    rising = fid.FrequencyResponse.from_values(
        np.array([1.0, 2.0, 4.0, 8.0, 16.0]),
        np.array([1.0, 1.0, 1.0, 1.0, 1.0]) * np.exp(-1j * np.radians([90, 130, 170, 200, 260])),
        inputs=["lat"],
        outputs=["phi"],
        units={"phi": "rad"},
    )
    flat = attitude_bandwidth(rising, "lat", "phi")
    assert flat.gain_bandwidth_rad_s is None
    assert "gain-bandwidth" in [finding.code for finding in flat.findings]
    assert flat.bandwidth_rad_s == flat.phase_bandwidth_rad_s
    json.dumps(flat.to_dict(), allow_nan=False)
    assert "–" in str(flat.summary())
    assert "<table" in flat._repr_html_()
    nearer = attitude_bandwidth(measured(0.1, 0.3, 200, high=6.0), "lat", "phi")
    assert repr(nearer).startswith("AttitudeBandwidth(phi/lat, 2.142 rad/s, phase delay unknown")
    assert "phase-slope" in [finding.code for finding in nearer.findings]
    chart = rating_chart("attitude_bandwidth", axis="yaw", task="other", speed="hover")
    assert nearer.rate(chart) is None


def test_refusals() -> None:
    with pytest.raises(DataError, match="has no bandwidth in the band"):
        attitude_bandwidth(model(0.1, 0.3), "lat", "phi", band_rad_s=(0.1, 3.0))
    with pytest.raises(DataError, match="has no bandwidth in the band"):
        attitude_bandwidth(model(0.1, 0.3, gain=-2.0), "lat", "phi", band_rad_s=(0.1, 3.0))
    with pytest.raises(DataError, match="begin the band lower"):
        attitude_bandwidth(model(0.1, 0.3), "lat", "phi", band_rad_s=(3.0, 30.0))
    with pytest.raises(DataError, match="no points in the band"):
        attitude_bandwidth(measured(0.1, 0.3, 50), "lat", "phi", band_rad_s=(80.0, 90.0))
    with pytest.raises(OptionError, match="band_rad_s has no meaning"):
        attitude_bandwidth(model(0.1, 0.3), "lat", "phi", band_rad_s=(3.0, 1.0))
    with pytest.raises(UnknownNameError, match="no such channel"):
        attitude_bandwidth(model(0.1, 0.3), "lat", "psi")
    with pytest.raises(OptionError, match="response_type is not known"):
        attitude_bandwidth(model(0.1, 0.3), "lat", "phi", response_type="acceleration")
    with pytest.raises(OptionError, match="output_is is not known"):
        attitude_bandwidth(model(0.1, 0.3), "lat", "phi", output_is="p")
    with pytest.raises(OptionError, match="sign has no meaning"):
        attitude_bandwidth(model(0.1, 0.3), "lat", "phi", sign=0)


def test_a_rate_is_integrated_and_a_sign_turned() -> None:
    response = measured(0.1, 0.3, 400)
    omega = response.omega_rad_s
    rate = fid.FrequencyResponse.from_values(
        omega, -1j * omega * response.response[0, 0], inputs=["lat"], outputs=["p"]
    )
    found = attitude_bandwidth(rate, "lat", "p", output_is="rate", sign=-1)
    plain = attitude_bandwidth(response, "lat", "phi")
    assert_close(found.uncertain.numbers, plain.uncertain.numbers, rtol=1e-9, why="attitude")
    first = fid.load_model("rate_first_order")
    as_rate = attitude_bandwidth(first, "tau_phi", "p", output_is="rate")
    attitude = fid.load_model("attitude_first_order").with_values(
        {name: first.parameters[name].value for name in ("Lp", "Ltphi", "tau")}
    )
    as_angle = attitude_bandwidth(attitude, "tau_phi", "phi")
    assert_close(as_rate.uncertain.numbers, as_angle.uncertain.numbers, rtol=1e-9, why="p = s phi")


def test_a_control_of_the_other_sign_is_told() -> None:
    turned = model(0.1, 0.3, gain=-2.0)
    wrong = attitude_bandwidth(turned, "lat", "phi")
    assert "sign-doubtful" in [finding.code for finding in wrong.findings]
    right = attitude_bandwidth(turned, "lat", "phi", sign=-1)
    assert right.findings == ()
    assert_close(right.phase_bandwidth_rad_s, 2.14214, atol=1e-5, why="printed digits")


def test_what_counts_depends_on_the_response_type() -> None:
    parameters = [fid.Parameter("T", 0.5, "s"), fid.Parameter("tau", 0.2, "s")]
    parameters.append(fid.Parameter("K", 1.0, "1/s"))
    flat = fid.TransferFunctionModel(
        (fid.TransferFunction("phi", "lat", "K", ("T*s + 1",), ("s",), "tau"),),
        fid.Parameters(parameters),
    )
    rate = attitude_bandwidth(flat, "lat", "phi", response_type="rate")
    attitude = attitude_bandwidth(flat, "lat", "phi", response_type="attitude")
    gain = rate.gain_bandwidth_rad_s
    assert gain is not None
    level = np.hypot(1.0 / rate.omega_180_rad_s, 0.5) * 10.0**0.3
    assert_close(gain, 1.0 / np.sqrt(level**2 - 0.25), rtol=1e-9, why="|H|² = 1/ω² + 1/4")
    assert gain < rate.phase_bandwidth_rad_s
    assert rate.bandwidth_rad_s == gain
    assert rate.gain_limited
    assert "gain-limited" in [finding.code for finding in rate.findings]
    assert attitude.bandwidth_rad_s == attitude.phase_bandwidth_rad_s
    assert "gain-limited" not in [finding.code for finding in attitude.findings]


def test_slope_of_the_phase_is_the_least_squares_line() -> None:
    tau, lag = 0.1, 0.3
    found = attitude_bandwidth(model(tau, lag), "lat", "phi")
    low = found.omega_180_rad_s
    omega = np.linspace(low, 2.0 * low, 20001)
    phase = -90.0 - np.degrees(omega * tau + np.arctan(omega * lag))
    slope = np.polyfit(omega, phase, 1)[0]
    assert found.phase_slope_delay_s is not None
    assert_close(found.phase_slope_delay_s, -slope / 114.6, rtol=2e-4, why="200 points of it")


def test_phase_that_is_no_line_is_said_and_its_slope_counts() -> None:
    omega = np.geomspace(0.5, 30.0, 300)
    bend = np.where(omega > 8.0, -90.0 * np.minimum(1.0, (omega - 8.0) / 1.0), 0.0)
    phase = np.radians(-90.0 - 90.0 * omega / 5.0 + bend)
    response = fid.FrequencyResponse.from_values(
        omega, np.exp(1j * phase) / omega, inputs=["lat"], outputs=["phi"]
    )
    found = attitude_bandwidth(response, "lat", "phi")
    assert found.nonlinear
    assert found.rated_delay_s == found.phase_slope_delay_s != found.phase_delay_s
    assert "phase-nonlinear" in [finding.code for finding in found.findings]


def test_smoothing_keeps_parabolas_and_averages_noise() -> None:
    omega = np.geomspace(1.0, 10.0, 40)
    logs = np.log(omega)
    given = fid.FrequencyResponse.from_values(
        omega, 1.0 / omega, inputs=["lat"], outputs=["phi"], random_error=np.full((1, 1, 40), 0.03)
    )
    pair = Pair("phi", "lat", 0.1, 100.0)
    smoother = smoother_of(given, pair)
    assert smoother is not None
    parabola = 3.0 - 2.0 * logs + 0.7 * logs**2
    assert_close(smoother @ parabola, parabola, rtol=1e-9, why="local parabolas hold it")
    middle = np.sum(smoother[20] ** 2)
    assert 0.1 < middle < 0.5
    without = fid.FrequencyResponse.from_values(omega, 1.0 / omega, inputs=["lat"], outputs=["phi"])
    assert smoother_of(without, pair) is None
    assert smoother_of(given.select(omega_rad_s=omega[:4]), pair) is None


def test_low_coherence_and_several_crossings_are_said() -> None:
    response = measured(0.1, 0.3, 120)
    omega = response.omega_rad_s
    wobble = np.radians(25.0 * np.sin(60.0 * np.log(omega)))
    noisy = fid.FrequencyResponse.from_values(
        omega,
        response.response[0, 0] * np.exp(1j * wobble),
        inputs=["lat"],
        outputs=["phi"],
        coherence=np.where((omega > 4.0) & (omega < 7.0), 0.4, 0.9),
    )
    codes = [finding.code for finding in attitude_bandwidth(noisy, "lat", "phi").findings]
    assert {"low-coherence", "several-crossings"} <= set(codes)
    assert "noisy-crossing" not in codes
    uncertain = fid.FrequencyResponse.from_values(
        omega,
        response.response,
        inputs=["lat"],
        outputs=["phi"],
        random_error=np.full((1, 1, len(omega)), 0.05),
    )
    told = attitude_bandwidth(uncertain, "lat", "phi").findings
    assert [finding.code for finding in told] == ["noisy-crossing"]


def test_black_box_models_and_systems_are_read_to_nyquist() -> None:
    continuous = fid.load_model("attitude_first_order")
    sampled = continuous.linear_system().sampled(0.002)
    exact = attitude_bandwidth(continuous, "tau_phi", "phi", band_rad_s=(0.3, 100.0))
    found = attitude_bandwidth(sampled, "tau_phi", "phi", band_rad_s=(0.3, 1e4))
    delayed = continuous.with_values({"tau": continuous.parameters["tau"].value + 0.001})
    half_sample = attitude_bandwidth(delayed, "tau_phi", "phi", band_rad_s=(0.3, 100.0))
    assert found.curve.omega[-1] < np.pi / 0.002
    assert_close(
        found.uncertain.numbers, half_sample.uncertain.numbers, rtol=2e-3, why="half a sample"
    )
    assert abs(found.uncertain.numbers[3] - exact.uncertain.numbers[3]) > 2e-4


def test_intervals_are_those_of_the_parameters() -> None:
    truth = model(0.1, 0.3)
    omega = np.geomspace(0.3, 20.0, 60)
    data = fid.FrequencyResponse.from_values(
        omega,
        truth.frequency_response(omega),
        inputs=["lat"],
        outputs=["phi"],
        units={"phi": "rad"},
        random_error=np.full((1, 1, 60), 0.02),
    )
    fit = fid.identify(truth, data)
    found = attitude_bandwidth(fit, "lat", "phi")
    names = list(fit.names)
    step = {"tau": 1e-6, "T": 1e-6, "K": 1e-6}
    slope = np.array(
        [
            (
                attitude_bandwidth(_moved(fit, name, step[name]), "lat", "phi").uncertain.numbers
                - attitude_bandwidth(_moved(fit, name, -step[name]), "lat", "phi").uncertain.numbers
            )
            / (2.0 * step[name])
            for name in names
        ]
    ).T
    assert found.uncertain.covariance is not None
    expected = slope @ fit.covariance @ slope.T
    assert_close(found.uncertain.covariance, expected, rtol=0.02, why="first order")
    low, high = found.bandwidth.interval95 or (0.0, 0.0)
    half = 1.96 * np.sqrt(expected[1, 1])
    assert_close([low, high], [2.14214 - half, 2.14214 + half], rtol=2e-3, why="quantiles of draws")
    assert all(each.interval95 is not None for each in found.quantities)


def _moved(fit: fid.Fit, name: str, step: float) -> fid.TransferFunctionModel:
    moved = fit.model.with_values({name: fit.parameters[name].value + step})
    assert isinstance(moved, fid.TransferFunctionModel)
    return moved


def test_intervals_of_a_measured_response_are_those_of_its_errors() -> None:
    response = measured(0.1, 0.3, 60)
    random_error = np.full((1, 1, 60), 0.01)
    given = fid.FrequencyResponse.from_values(
        response.omega_rad_s,
        response.response,
        inputs=["lat"],
        outputs=["phi"],
        random_error=random_error,
    )
    found = attitude_bandwidth(given, "lat", "phi")
    random = np.random.default_rng(3)
    pair = Pair("phi", "lat", 0.1, 100.0)
    smoother = smoother_of(given, pair)
    drawn = []
    for _ in range(300):
        noise = random.standard_normal((2, 60)) * 0.01
        values = response.response[0, 0] * (1.0 + noise[0] + 1j * noise[1])
        one = fid.FrequencyResponse.from_values(
            response.omega_rad_s, values, inputs=["lat"], outputs=["phi"]
        )
        drawn.append(bandwidth_numbers(GainPhaseCurve.of(one, pair, smoother)))
    scatter = np.std(drawn, axis=0)
    assert found.uncertain.stderr is not None
    assert_close(found.uncertain.stderr, scatter, rtol=0.15, why="scatter of 300 noisy responses")
