"""Fits of responses whose truth is known: recovery, costs, bounds, calibrated intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.identification.frequency_domain.selection import coherence_weight
from flightid.responses.errors.random_error import StoredCovariance
from flightid.uncertainty import (
    correlation,
    cramer_rao,
    estimator_gain,
    gauss_newton_hessian,
    insensitivity,
)
from tests.closeness import assert_close

TRUTH = {
    "rate_first_order": {"Lp": -6.0, "Ltphi": 180.0, "tau": 0.013},
    "rate_motor_lag": {"Lp": -4.0, "Ltphi": 320.0, "T_m": 0.04, "tau": 0.008},
    "rate_second_order": {"K": 12.0, "zeta": 0.35, "omega_n": 14.0, "tau": 0.02},
    "rate_gain_lag": {"K": 55.0, "T": 0.6, "tau": 0.03},
    "rate_integrator_motor_lag": {"Ltphi": 90.0, "T_m": 0.07, "tau": 0.01},
}
OMEGA = np.geomspace(0.5, 60.0, 120)


def known_errors(matrix: np.ndarray) -> StoredCovariance:
    """Errors with a given covariance of the stacked real and imaginary parts."""
    return StoredCovariance(matrix[None], len(matrix) // 2)


def measured(
    model: fid.TransferFunctionModel,
    omega: np.ndarray = OMEGA,
    *,
    change: np.ndarray | float = 0.0,
    coherence: float = 1.0,
    errors: StoredCovariance | None = None,
    random_error: float = 0.0,
) -> fid.FrequencyResponse:
    values = model.frequency_response(omega) + change
    return fid.FrequencyResponse.from_values(
        omega,
        values,
        inputs=model.inputs,
        outputs=model.outputs,
        units=dict(model.units),
        coherence=np.full(values.shape, coherence),
        random_error=np.full(values.shape, random_error),
        errors=errors,
    )


@pytest.mark.parametrize("name", TRUTH)
@pytest.mark.parametrize(
    "cost", [pytest.param("coherence", marks=pytest.mark.nightly), "likelihood"]
)
def test_noise_free_recovery(name: str, cost: str) -> None:
    truth = fid.load_model(name).with_values(TRUTH[name])
    fit = fid.identify(
        fid.load_model(name), measured(truth, random_error=0.05), cost=cost, starts=4
    )
    for key, value in TRUTH[name].items():
        assert_close(fit.parameters[key].value, value, rtol=1e-9, why=f"{key}: no noise")
    assert fit.cost < 1e-15


def test_shared_and_tied_parameters_over_two_responses() -> None:
    parameters = fid.Parameters(
        [
            fid.Parameter("L", 100.0, "rad/s^2", minimum=1.0),
            fid.Parameter("M", unit="rad/s^2", tie="0.4*L"),
            fid.Parameter("T", 0.1, "s", minimum=0.01, maximum=1.0),
            fid.Parameter("tau", 0.01, "s", minimum=0.0, maximum=0.1),
        ]
    )
    model = fid.TransferFunctionModel(
        tuple(
            fid.TransferFunction(out, "u", gain, denominator=("s", "T*s + 1"), delay="tau")
            for out, gain in (("p", "L"), ("q", "M"))
        ),
        parameters,
        units={"p": "rad/s", "q": "rad/s"},
    )
    truth = model.with_values({"L": 60.0, "T": 0.2, "tau": 0.03})
    fit = fid.identify(model, measured(truth, random_error=0.03))
    assert_close(fit.parameters["M"].value, 24.0, rtol=1e-9, why="tied to 0.4 L")
    assert fit.parameters["M"].status == "tied"
    ratio = fit.parameters["M"].stderr / fit.parameters["L"].stderr
    assert_close(ratio, 0.4, rtol=1e-9, why="error follows the tie")
    assert list(fit.costs) == ["p/u", "q/u"]
    assert replace(fit, costs={"p/u": 2.0, "q/u": 1.0}).ranked == ("q/u", "p/u"), "best first"
    assert replace(fit, costs={"p/u": 1.0, "q/u": 2.0}).ranked == ("p/u", "q/u")


def test_coherence_weight_has_the_exponent_of_the_book() -> None:
    # Published constants: the weight at each γ². With γ⁴ in the exponent 0.6 would give 0.228.
    table = {0.2: 0.08203, 0.4: 0.27133, 0.5: 0.38649, 0.6: 0.50819, 0.7: 0.63265}
    table |= {0.8: 0.75700, 0.9: 0.87913, 0.95: 0.93886, 1.0: 0.99750}
    found = coherence_weight(list(table))
    assert_close(found, list(table.values()), atol=6e-6, why="five published digits")


@pytest.mark.parametrize("coherence", [1.0, 0.8])
def test_cost_of_known_mismatch(coherence: float) -> None:
    # 1 dB everywhere costs 20 W_γ; 10° everywhere costs 20 · 0.01745 · 100 W_γ. The mean over any
    # number of points is the same.
    model = fid.load_model("rate_integrator").with_fixed(tau=0.02, Ltphi=100.0).with_free("Ltphi")
    narrow = fid.Parameter("Ltphi", 100.0, "rad/s^2", minimum=100.0 - 1e-9, maximum=100.0 + 1e-9)
    held = fid.TransferFunctionModel(
        model.responses, model.parameters.with_parameter(narrow), model.units
    )
    weight = float(coherence_weight(coherence))
    for factor, expected in ((10 ** (1 / 20), 20.0), (np.exp(1j * np.pi / 18), 34.9)):
        values = model.frequency_response(OMEGA) * factor
        data = measured(model, change=values - model.frequency_response(OMEGA), coherence=coherence)
        for n_omega in (10, 20, 50):
            fit = fid.identify(held, data, n_omega=n_omega)
            assert_close(fit.cost, expected * weight, rtol=1e-6, why="closed form")
            assert_close(fit.average_cost, fit.cost, rtol=1e-12, why="one response")


def test_phase_differences_are_wrapped() -> None:
    # A response beyond −180° must cost nothing against itself: 360° is no error.
    model = fid.load_model("rate_motor_lag").with_values({"tau": 0.2})
    assert fid.identify(model, measured(model)).cost < 1e-18


def test_bounds_from_closed_hessians() -> None:
    # Two parameters, J = Σ (a + b x − y)²: ℋ = 2 [[n, Σx], [Σx, Σx²]].
    x = np.array([0.0, 1.0, 2.0, 3.0])
    jacobian = np.column_stack([np.ones(4), x])
    hessian = np.array([[8.0, 12.0], [12.0, 28.0]])
    assert_close(gauss_newton_hessian(jacobian), hessian, rtol=1e-14, why="by hand")
    inverse = np.array([[28.0, -12.0], [-12.0, 8.0]]) / 80.0
    assert_close(cramer_rao(jacobian), np.sqrt(np.diag(inverse)), rtol=1e-12, why="by hand")
    assert_close(insensitivity(jacobian), 1 / np.sqrt([8.0, 28.0]), rtol=1e-12, why="by hand")
    expected = -12.0 / np.sqrt(28.0 * 8.0)
    assert_close(correlation(inverse)[0, 1], expected, rtol=1e-12, why="by hand")
    gain = estimator_gain(jacobian, np.eye(4))
    assert_close(0.25 * gain @ gain.T, 0.25 * 2 * inverse, rtol=1e-12, why="σ² (XᵀX)⁻¹")


def test_percentages_of_an_integrator_in_closed_form() -> None:
    # One parameter, the gain: d dB/d ln K = 8.686 at each of 20 points with weight W_γ(1).
    model = fid.load_model("rate_integrator").with_fixed(tau=0.02)
    fit = fid.identify(model, measured(model))
    curvature = 2 * 20 * 0.99750 * (20 / np.log(10)) ** 2
    expected = 100 / np.sqrt(curvature)
    gain = fit.parameters["Ltphi"]
    assert_close(gain.insensitivity_percent, expected, rtol=1e-5, why="1/√ℋ by hand")
    assert_close(gain.cramer_rao_percent, expected, rtol=1e-5, why="one parameter: CR equals I")


def _correlated_errors(model: fid.TransferFunctionModel, sigma: float) -> np.ndarray:
    """Covariance with neighbours correlated and parts coupled, growing with frequency."""
    h = model.frequency_response(OMEGA)[0, 0]
    place = np.arange(len(OMEGA))
    shape = 0.9 ** np.abs(np.subtract.outer(place, place)) * np.outer(*(2 * [0.5 + place / 60]))
    turn = np.outer(h, h.conj()) * shape * sigma**2
    return np.block([[turn.real, -turn.imag], [turn.imag, turn.real]])


def _coverage(cost: str, flights: int, sigma: float) -> tuple[float, np.ndarray]:
    name = "rate_motor_lag"
    truth = fid.load_model(name).with_values(TRUTH[name])
    matrix = _correlated_errors(truth, sigma)
    root = np.linalg.cholesky(matrix + 1e-12 * np.trace(matrix) * np.eye(len(matrix)))
    generator = np.random.default_rng(5)
    inside, spread = [], []
    for _ in range(flights):
        noise = root @ generator.standard_normal(len(matrix))
        change = noise[: len(OMEGA)] + 1j * noise[len(OMEGA) :]
        data = measured(truth, change=change, errors=known_errors(matrix), coherence=0.9)
        fit = fid.identify(truth, data, cost=cost)
        assert fit.intervals_from == "response covariance"
        for key, value in TRUTH[name].items():
            found = fit.parameters[key]
            low, high = found.interval95
            inside.append(low <= value <= high)
            spread.append((found.value - value) / found.stderr)
    return float(np.mean(inside)), np.reshape(spread, (flights, -1))


@pytest.mark.parametrize("cost", ["coherence", "likelihood"])
def test_intervals_cover_the_truth(cost: str) -> None:
    covered, spread = _coverage(cost, 80, 0.03)
    # 320 intervals of 80 flights: one standard error is about 1.6 %, bounds at two and a half.
    assert 0.91 <= covered <= 0.99
    assert np.all(np.abs(np.std(spread, axis=0) - 1.0) < 0.22)


@pytest.mark.slow
@pytest.mark.parametrize("cost", ["coherence", "likelihood"])
@pytest.mark.parametrize("sigma", [0.01, 0.03])
def test_intervals_are_calibrated(cost: str, sigma: float) -> None:
    covered, spread = _coverage(cost, 2000, sigma)
    assert 0.93 <= covered <= 0.97
    assert np.all(np.abs(np.mean(spread, axis=0)) < 0.15)
    assert np.all(np.abs(np.std(spread, axis=0) - 1.0) < 0.06)


def test_likelihood_is_the_sharper_estimate() -> None:
    name = "rate_motor_lag"
    truth = fid.load_model(name).with_values(TRUTH[name])
    data = measured(truth, errors=known_errors(_correlated_errors(truth, 0.03)))
    coherence, likelihood = (
        fid.identify(truth, data, cost=cost) for cost in ("coherence", "likelihood")
    )
    for key in TRUTH[name]:
        assert likelihood.parameters[key].stderr <= coherence.parameters[key].stderr * (1 + 1e-9)
