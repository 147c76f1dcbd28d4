"""Nonlinear and unstable vehicles at their edges: exact data, poor starts, errors with a type."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, FitError
from flightid.models import Output, Parameter, Parameters, StateSpaceModel
from tests.closeness import assert_close
from tests.truth.test_equation_records_truth import flown, longitudinal, stepped, unstable_flight


def test_a_nonlinear_flight_without_any_noise_has_intervals() -> None:
    model = longitudinal()
    record = flown(model, stepped(), 0.0, 0)
    start = model.with_values({"Ma": -4.4, "Maa": -13.0, "Zaa": 1.6})
    fit = fid.identify(start, record, output_bias=False)
    for parameter in model.parameters.free:
        found = fit.parameters[parameter.name]
        assert_close(found.value, parameter.value, rtol=1e-9, why="no noise")
        assert found.interval95 is not None
        assert np.all(np.isfinite(found.interval95))


def test_an_unstable_vehicle_is_found_from_a_stable_start() -> None:
    model, record = unstable_flight(1)
    start = model.with_values({"Malpha": -4.0, "Mq": -2.0})
    assert start.eigenvalues().real.max() < -1.0
    fit, near = (fid.identify(each, record, output_bias=False) for each in (start, model))
    for name in fit.names:
        one, other = fit.parameters[name].value, near.parameters[name].value
        assert_close(one, other, rtol=1e-4, why="the same minimum")
    assert "unstable-model" in {finding.code for finding in fit.findings}


def _scalar(left: str, right: str, unit: str, **values: float) -> StateSpaceModel:
    """One state, with parameters of one unit."""
    return StateSpaceModel(
        states={"x": "1"},
        input_units={"u": "1"},
        measurements={"y": Output("x", "1")},
        equations={left: right},
        parameters=Parameters([Parameter(n, v, unit) for n, v in values.items()]),
        name="scalar",
    )


def _response(n: int = 400) -> fid.Record:
    time_s = np.arange(n) * 0.05
    u = np.sin(time_s) + np.sin(3.1 * time_s)
    return fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": 0.3 * u}, units={})


def test_a_run_that_explodes_from_every_start_is_a_fit_error() -> None:
    model = _scalar("x'", "a*x^3 + b*u", "1/s", a=50.0, b=5.0)
    with pytest.raises(FitError, match=r"diverged from every start.*run diverges at sample"):
        fid.identify(model, _response())


def test_a_formula_without_a_value_is_a_fit_error() -> None:
    model = _scalar("x'", "a*x + b*sqrt(u - 10)", "1/s", a=-1.0, b=1.0)
    with pytest.raises(FitError, match="diverged from every start"):
        fid.identify(model, _response())


def test_equations_that_lose_a_derivative_are_a_fit_error() -> None:
    model = _scalar("(a - b)*x'", "u - x + x^2", "s", a=1.0, b=1.0)
    with pytest.raises(FitError, match=r"diverged from every start.*singular"):
        fid.identify(model, _response())


def test_samples_without_power_or_beyond_all_powers_end_in_words() -> None:
    for step_s in (1e-300, 1e300):
        with pytest.raises(DataError, match="sample time"):
            fid.Record.from_arrays(step_s * np.arange(50), outputs={"y": np.arange(50.0)})
    time_s, u = 0.01 * np.arange(500), np.random.default_rng(0).standard_normal(500)
    arx = fid.PolynomialModel.arx(["u"], "y", na=1, nb=1)
    lag = fid.load_model("rate_first_order")
    for size, said in ((1e155, "too large"), (5e-324, "too small")):
        y = np.round(1e3 * u) * size if size < 1.0 else np.where(np.arange(500) == 300, size, u)
        record = fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y})
        rate = fid.Record.from_arrays(
            time_s, inputs={lag.inputs[0]: u}, outputs={lag.outputs[0]: y}, units=dict(lag.units)
        )
        for work in (
            lambda record=record: fid.estimate_response(record),
            lambda record=record: fid.identify(arx, record),
            lambda rate=rate: fid.identify(lag, rate),
        ):
            with pytest.raises(DataError, match=said):
                work()
    # Power at the Nyquist frequency alone: no harmonic to take, and none to divide by.
    u = np.resize([1.0, -1.0], 2000)
    record = fid.Record.from_arrays(0.01 * np.arange(2000), inputs={"u": u}, outputs={"y": u})
    assert "periodic" not in str(fid.estimate_response(record).history)
    with pytest.raises(DataError, match="no harmonic"):
        fid.estimate_response(record.declare(period_s=0.02), estimator="periodic")
