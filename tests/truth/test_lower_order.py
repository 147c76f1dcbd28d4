"""Equivalent systems: exact where the vehicle is one, and a delay for what is fast."""

from __future__ import annotations

import json

import numpy as np
import pytest

import flightid as fid
from flightid.dynamics.lower_order.structures import STRUCTURES, equivalent_model
from flightid.errors import DataError, OptionError, UnknownNameError
from tests.closeness import assert_close

UNITS = {"y": "rad/s", "u": "rad"}
# By kind: values unlike the start values, gains of both signs.
TRUTHS = {
    "short_period": {"K": -11.0, "inverse_T_theta2": 1.9, "zeta": 0.69, "omega": 3.6},
    "pitch_attitude": {"K": 6.0, "inverse_T_theta2": 0.6, "zeta": 0.35, "omega": 2.4},
    "roll": {"K": -3.0, "T_R": 0.21},
    "roll_attitude": {"K": 14.0, "T_R": 0.8},
    "roll_spiral": {"K": 5.0, "spiral": 0.12, "T_R": 0.4},
    "roll_dutch_roll": {
        "K": 2.5, "zeta_phi": 0.24, "omega_phi": 2.1, "T_R": 0.3, "zeta": 0.12, "omega": 2.6,
    },
    "dutch_roll": {"K": 9.0, "zeta": 0.15, "omega": 2.9},
    "yaw": {"K": -4.0, "inverse_T_r": 0.5, "zeta": 0.2, "omega": 2.2},
    "yaw_spiral": {
        "K": -3.5, "zeta_r": 0.1, "omega_r": 0.6, "spiral": -0.05, "zeta": 0.2, "omega": 2.4,
    },
}  # fmt: skip


def truth_of(kind: str, tau: float = 0.07) -> fid.TransferFunctionModel:
    return equivalent_model(kind, "y", "u", UNITS).with_values({**TRUTHS[kind], "tau": tau})


@pytest.mark.parametrize("kind", STRUCTURES)
def test_a_system_of_the_kind_is_found_exactly(kind: str) -> None:
    found = fid.lower_order(truth_of(kind), kind=kind)
    for name, value in {**TRUTHS[kind], "tau": 0.07}.items():
        assert_close(found.value(name), value, rtol=1e-5, why=f"{kind}: {name} is there")
    assert found.mismatch_cost < 1e-8
    assert found.mismatch.inside_percent == (100.0,)
    assert repr(found) == f"LowerOrder({kind}, y/u, mismatch 0.0)"
    json.dumps(found.to_dict(), allow_nan=False)
    assert "<table" in found._repr_html_()
    ratings = found.ratings(category="B", aircraft_class="II")
    assert ratings[-1].chart.key == "equivalent_delay"
    assert ratings[-1].text == "Level 1"


def with_lags(lags: tuple[float, ...], delay: float) -> fid.TransferFunctionModel:
    response = fid.TransferFunction(
        "p", "u", "K", (), ("T*s + 1", *(f"T{k}*s + 1" for k in range(len(lags)))), "tau"
    )
    parameters = [fid.Parameter("K", 20.0, "rad/s"), fid.Parameter("T", 0.5, "s")]
    parameters += [fid.Parameter(f"T{k}", lag, "s") for k, lag in enumerate(lags)]
    parameters.append(fid.Parameter("tau", delay, "s"))
    return fid.TransferFunctionModel((response,), fid.Parameters(parameters), {"p": "rad/s"})


def test_fast_lags_become_delay() -> None:
    lags, delay = (0.03, 0.02, 0.01), 0.04
    found = fid.lower_order(with_lags(lags, delay), kind="roll")
    assert_close(found.value("tau"), sum(lags) + delay, rtol=0.03, why="ω T is small in the band")
    assert_close(found.value("T_R"), 0.5, rtol=0.03, why="the slow lag stays")
    nearly = fid.lower_order(with_lags(lags, delay), kind="roll", band_rad_s=(0.05, 2.0))
    assert_close(nearly.value("tau"), sum(lags) + delay, rtol=0.02, why="the lower, the better")
    slow = fid.lower_order(with_lags((0.2, 0.15), 0.1), kind="roll")
    assert slow.ratings()[-1].level == 4
    assert [rating.chart.key for rating in slow.ratings()] == ["roll_mode", "equivalent_delay"]


def test_the_cost_is_the_mismatch() -> None:
    vehicle = with_lags((0.2, 0.1), 0.0)
    found = fid.lower_order(vehicle, kind="roll", n_omega=33)
    omega = np.geomspace(0.1, 10.0, 33)
    ratio = (found.model.frequency_response(omega) / vehicle.frequency_response(omega))[0, 0]
    decibels, degrees = 20.0 * np.log10(np.abs(ratio)), np.degrees(np.angle(ratio))
    expected = 20.0 / 33.0 * np.sum(decibels**2 + 0.01745 * degrees**2)
    assert_close(found.mismatch_cost, expected, rtol=1e-9, why="its definition")
    shaken = found.model.with_values({"T_R": found.value("T_R") * 1.02})
    other = (shaken.frequency_response(omega) / vehicle.frequency_response(omega))[0, 0]
    worse = np.sum(
        (20.0 * np.log10(np.abs(other))) ** 2 + 0.01745 * np.degrees(np.angle(other)) ** 2
    )
    assert 20.0 / 33.0 * worse > found.mismatch_cost


def test_short_period_of_the_navion() -> None:
    navion = fid.load_model("short_period")
    found = fid.lower_order(navion, "elevator", "q", kind="short_period", airspeed_m_s=53.645)
    mode = fid.modes(navion).mode("short period")
    assert_close(found.value("omega"), mode.natural_frequency.value, rtol=1e-6, why="its mode")
    assert_close(found.value("zeta"), mode.damping_ratio.value, rtol=1e-6, why="its mode")
    assert_close(found.value("tau"), 0.02, atol=1e-7, why="the model's delay")
    # Steady n and alpha of the same model: C (-A)^-1 B + D.
    a, b, c, d, _ = navion.state_space()
    steady = (d - c @ np.linalg.solve(a, b))[:, 0]
    n_alpha = steady[navion.outputs.index("nz")] / steady[navion.outputs.index("alpha")]
    exact = fid.lower_order(navion, "elevator", "q", kind="short_period", n_alpha=n_alpha)
    assert_close(found.value("n_alpha"), n_alpha, rtol=0.05, why="but for the tail's lift")
    assert_close(
        exact.value("cap"), mode.natural_frequency.value**2 / n_alpha, rtol=1e-6, why="definition"
    )
    keys = [rating.chart.key for rating in exact.ratings()]
    assert "control_anticipation" in keys
    assert all(rating.text == "Level 1" for rating in exact.ratings())
    known = fid.lower_order(navion, "elevator", "q", kind="short_period", t_theta2_s=0.52)
    assert "inverse_T_theta2" not in known.names
    assert_close(known.value("T_theta2"), 0.52, rtol=1e-9, why="held")
    assert "control_anticipation" not in [rating.chart.key for rating in known.ratings()]
    with pytest.raises(KeyError):
        known.value("cap")


def test_what_the_structure_lacks_is_said() -> None:
    lateral = fid.load_model("fixed_wing_lateral")
    poor = fid.lower_order(lateral, "rudder", "r", kind="yaw")
    assert poor.mismatch_cost > 100.0
    codes = [finding.code for finding in poor.findings]
    assert "equivalent-system-mismatch" in codes
    assert poor.mismatch.findings[0].light.value == "red"
    better = fid.lower_order(lateral, "rudder", "r", kind="yaw_spiral", band_rad_s=(0.03, 10.0))
    assert better.mismatch_cost < 10.0
    spiral = fid.modes(lateral).mode("spiral").real.value
    assert_close(better.value("spiral"), spiral, rtol=0.01, why="the roll mode cancels")
    bound = fid.lower_order(fid.load_model("rate_integrator"), kind="roll")
    assert "equivalent-system-bound" in [finding.code for finding in bound.findings]
    assert "T_R" not in bound.names
    assert "not fitted" in str(bound.summary())


def noisy(
    kind: str, error: float, seed: int | None, n: int = 60, gamma2: float = 0.95
) -> fid.FrequencyResponse:
    omega = np.geomspace(0.1, 10.0, n)
    values = truth_of(kind).frequency_response(omega)[0, 0]
    if seed is not None:
        noise = np.random.default_rng(seed).standard_normal((2, n)) * error
        values = values * (1.0 + noise[0] + 1j * noise[1])
    return fid.FrequencyResponse.from_values(
        omega,
        values,
        inputs=["u"],
        outputs=["y"],
        units=UNITS,
        coherence=np.full((1, 1, n), gamma2),
        random_error=np.full((1, 1, n), error),
    )


def test_intervals_of_a_fit_follow_its_parameters() -> None:
    kind = "short_period"
    fit = fid.identify(truth_of(kind), noisy(kind, 0.03, 1))
    found = fid.lower_order(fit, kind=kind)
    # The vehicle is the equivalent system: its errors are those of the fit itself.
    assert fit.covariance is not None
    order = [fit.names.index(name) for name in found.names]
    expected = fit.covariance[np.ix_(order, order)]
    assert found.uncertain.covariance is not None
    scale = np.sqrt(np.diag(expected))
    assert_close(
        found.uncertain.covariance / np.outer(scale, scale),
        expected / np.outer(scale, scale),
        atol=0.01,
        why="central differences of the identity",
    )
    assert all(each.interval95 is not None for each in found.quantities)
    assert found.ratings()[0].probabilities is not None
    late = fid.lower_order(fit, kind=kind, fixed={"zeta": 0.69})
    assert "zeta" not in late.names
    assert late.uncertain.covariance is not None


def test_intervals_of_a_measured_response_are_those_of_its_fit() -> None:
    found = fid.lower_order(noisy("dutch_roll", 0.02, 3), kind="dutch_roll")
    assert found.uncertain.covariance is not None
    for name in found.names:
        parameter = found.fit.parameters[name]
        assert parameter.stderr is not None
        place = found.names.index(name)
        assert found.uncertain.stderr is not None
        assert_close(found.uncertain.stderr[place], parameter.stderr, rtol=1e-9, why="the same")
    part = noisy("dutch_roll", 0.02, 3).select(band_rad_s=(1.0, 6.0))
    cut = fid.lower_order(part, kind="dutch_roll")
    assert "equivalent-system-band" in [finding.code for finding in cut.findings]


def test_refusals() -> None:
    vehicle = truth_of("roll")
    with pytest.raises(OptionError, match="kind is not known"):
        fid.lower_order(vehicle, kind="pitch")
    with pytest.raises(OptionError, match="band_rad_s has no meaning"):
        fid.lower_order(vehicle, kind="roll", band_rad_s=(2.0, 1.0))
    with pytest.raises(OptionError, match="n_omega is too small"):
        fid.lower_order(vehicle, kind="roll", n_omega=3)
    with pytest.raises(OptionError, match="this kind has no T_θ2"):
        fid.lower_order(vehicle, kind="roll", t_theta2_s=1.0)
    with pytest.raises(OptionError, match="T_θ2 has no meaning"):
        fid.lower_order(truth_of("short_period"), kind="short_period", t_theta2_s=0.0)
    with pytest.raises(UnknownNameError, match="there is no such parameter"):
        fid.lower_order(vehicle, kind="roll", fixed={"zeta": 1.0})
    with pytest.raises(UnknownNameError, match="there is no such channel"):
        fid.lower_order(vehicle, "u", "q", kind="roll")
    with pytest.raises(OptionError, match="the source has several channels"):
        fid.lower_order(fid.load_model("short_period"), kind="short_period")
    with pytest.raises(DataError, match="too few points for an equivalent system"):
        fid.lower_order(noisy("roll", 0.02, 1, gamma2=0.3), kind="roll")
    silent = fid.LinearSystem([[-1.0]], [[0.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    with pytest.raises(DataError, match="is zero or infinite in the band"):
        fid.lower_order(silent, kind="roll")
