"""Every method takes inputs between samples as they are: exact on exact data, at any delay."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

import flightid as fid
from flightid.identification.records.delayed_inputs import DelayedInputs
from flightid.identification.records.held_model import HeldModel, LinearPoint
from tests.closeness import assert_close

STEP_S = 0.05
TRUTH = {"Lp": -3.0, "Lda": 8.0, "tau": 0.073}


def _roll() -> fid.StateSpaceModel:
    parameters = [
        fid.Parameter("Lp", -3.0, "1/s"),
        fid.Parameter("Lda", 8.0, "1/s^2"),
        fid.Parameter("tau", 0.073, "s", minimum=0.0),
    ]
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"da": "rad"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Lda*da"},
        parameters=fid.Parameters(parameters),
        delays={"da": "tau"},
    )


def _flight(hold: str) -> fid.Record:
    """Simulated in steps of a hundredth of a sample, on which the delay is whole."""
    n, fine = 400, 100
    samples = np.repeat(np.random.default_rng(3).choice([-1.0, 0.0, 1.0], n // 4), 4)
    at = np.maximum((np.arange((n - 1) * fine) + 0.5) / fine - TRUTH["tau"] / STEP_S, 0.0)
    held = samples[np.floor(at).astype(int)] if hold == "zero" else np.interp(at, range(n), samples)
    decay = np.exp(TRUTH["Lp"] * STEP_S / fine)
    gain = TRUTH["Lda"] * (decay - 1.0) / TRUTH["Lp"]
    p = np.zeros(n)
    rate = 0.0
    for k, push in enumerate(held, start=1):
        rate = decay * rate + gain * push
        if k % fine == 0:
            p[k // fine] = rate
    return fid.Record.from_arrays(
        np.arange(n) * STEP_S,
        inputs={"da": samples},
        outputs={"p": p},
        units={"da": "rad", "p": "rad/s"},
        hold=hold,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize(
    ("method", "rtol", "hold"),
    [
        ("output_error", 1e-5, "zero"),
        ("output_error", 1e-5, "first"),
        ("filter_error", 1e-5, "zero"),
        pytest.param("filter_error", 1e-5, "first", marks=pytest.mark.nightly),
        pytest.param("fourier_output_error", 1e-5, "zero", marks=pytest.mark.nightly),
        ("fourier_output_error", 1e-5, "first"),
        ("equation_error", 2e-3, "zero"),
        pytest.param("equation_error", 2e-3, "first", marks=pytest.mark.nightly),
        pytest.param("fourier_regression", 2e-3, "zero", marks=pytest.mark.nightly),
        ("fourier_regression", 2e-3, "first"),
    ],
)
def test_held_inputs_are_exact_in_every_method(method: str, rtol: float, hold: str) -> None:
    start = _roll().with_values({"Lp": -2.5, "Lda": 7.0, "tau": 0.06})
    fit = fid.identify(start, _flight(hold), method=method)
    for name, value in TRUTH.items():
        assert_close(fit.parameters[name].value, value, rtol=rtol, why=f"{method}, {hold}")


@pytest.mark.parametrize("hold", ["zero", "first", "band_limited"])
@pytest.mark.parametrize("tau", [0.0, 0.013, 0.05, 0.073])
def test_a_step_of_the_held_model_is_the_integral_over_its_inputs(hold: str, tau: float) -> None:
    model = _roll().with_values({"tau": tau})
    samples = np.sin(0.4 * np.arange(40.0))[None] + 1.0
    late = DelayedInputs(samples, STEP_S, hold, np.array([tau]), np.zeros((1, 0)))
    point = LinearPoint.of(model, model.parameters.independent_values())
    pushes, _ = HeldModel.of(point, STEP_S, hold).driven(samples)
    for k in (10, 20):

        def weighed(place: float, k: int = k) -> float:
            value = float(late.at(place)[0][0, k])
            return STEP_S * np.exp(TRUTH["Lp"] * STEP_S * (1.0 - place)) * TRUTH["Lda"] * value

        whole = quad(weighed, 0.0, 1.0, points=list(late.corners), epsabs=1e-12)[0]
        atol = 1e-6 if hold == "band_limited" else 1e-11
        assert_close(pushes[0, 0, k], whole, atol=atol, why="quadrature of the same input")


@pytest.mark.parametrize("hold", ["first", "band_limited"])
def test_rates_of_delayed_inputs_match_differences(hold: str) -> None:
    samples = np.random.default_rng(0).standard_normal((1, 30))
    late = DelayedInputs(samples, STEP_S, hold, np.array([0.073]), np.zeros((1, 0)))
    for place in (0.1, 0.9):
        up, down = late.at(place + 1e-6)[0], late.at(place - 1e-6)[0]
        wanted = (up - down) / (2e-6 * STEP_S)
        assert_close(late.at(place)[1], wanted, atol=1e-5, why="central differences")
