"""The estimator's bias is computed and taken out: recovery without noise, coverage with little."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import cont2discrete
from scipy.stats import binom

import flightid as fid
from flightid import excitation as ex
from flightid.errors import DataError, ModelError, OptionError, ShapeError
from flightid.identification.frequency_domain import bias_search, without_bias
from flightid.identification.frequency_domain.estimator_bias import Correction
from flightid.responses.arithmetic import add_delay
from flightid.responses.store import read_response, write_response
from flightid.simulation.model_outputs import systems_of
from tests.closeness import assert_close
from tests.strangers import gains
from tests.strangers.responses import fly_feedthrough

RATE_HZ = 100.0
BAND = (1.5, 35.0)
MODEL = fid.load_model("rate_motor_lag")
TRUTH = {name: float(p.value or 0.0) for name, p in MODEL.parameters.items()}
START = MODEL.with_values({"Ltphi": 140.0, "Lp": -5.0, "T_m": 0.03, "tau": 0.01})
WINDOWS = {
    "composite": {},
    "single window": {"window_s": 10.0},
    "local polynomial": {"estimator": "local_polynomial"},
}
# How far the uncorrected gain is off at least: the effect that the correction takes out.
LEAST_BIAS = {"composite": 0.02, "single window": 0.02, "local polynomial": 2e-4}


def sweep(rate_hz: float = RATE_HZ, amplitude: float = 0.1) -> fid.Record:
    made = ex.sweep(
        band_rad_s=(1.0, 40.0),
        amplitude=amplitude,
        duration_s=60.0,
        sample_rate_hz=rate_hz,
        name=MODEL.inputs[0],
    )
    return fid.Record.from_arrays(made.time_s, inputs=made.by_name)


def flown(noise: float = 0.0, seed: int = 0) -> fid.Record:
    record = fid.simulate(MODEL, sweep(), units={"p": "rad/s"})
    random = np.random.default_rng(seed).standard_normal(record.n_samples)
    return record.replace({"p": record["p"] + noise * random})


def estimated(record: fid.Record, way: str = "composite") -> fid.FrequencyResponse:
    return fid.estimate_response(record, band_rad_s=BAND, n_omega=60, **WINDOWS[way])


def assert_recovered(fit: fid.Fit, truth: dict[str, float], rtol: float, why: str) -> None:
    for name, value in truth.items():
        assert_close(fit.parameters[name].value, value, rtol=rtol, why=f"{name}: {why}")


@pytest.mark.parametrize("way", WINDOWS)
def test_truth_is_recovered_without_noise(way: str) -> None:
    response = estimated(flown(), way)
    plain = fid.identify(START, response, correct_bias=False)
    assert abs(plain.parameters["Ltphi"].value / TRUTH["Ltphi"] - 1) > LEAST_BIAS[way]
    fit = fid.identify(START, response, hold="first")
    assert_recovered(fit, TRUTH, 1e-5, "the bias is exact where the model is")
    done = fit.provenance["estimator_bias"]
    assert isinstance(done, dict)
    assert done["applied"]
    assert done["converged"]
    assert [f.light.value for f in fit.findings if f.code == "estimator-bias"] == ["green"]


@pytest.mark.nightly
def test_inputs_that_are_smooth_between_samples() -> None:
    fine = fid.simulate(MODEL, sweep(32 * RATE_HZ), units={"p": "rad/s"})
    step = slice(None, None, 16)
    record = fid.Record.from_arrays(
        fine.time_s[step],
        inputs={MODEL.inputs[0]: fine[MODEL.inputs[0]][step]},
        outputs={"p": fine["p"][step]},
        units={"p": "rad/s"},
    )
    fit = fid.identify(START, estimated(record))
    assert_recovered(fit, TRUTH, 2e-5, "a spline follows the sweep between samples")
    wrong = fid.identify(START, estimated(record), hold="first")
    assert abs(wrong.parameters["T_m"].value / TRUTH["T_m"] - 1) > 1e-3


def loop_flight(noise: float, seed: int = 0) -> fid.Record:
    """A sampled loop: steps between samples, delay of four of them, noise on the fed-back rate."""
    excitation = sweep(amplitude=0.3)[MODEL.inputs[0]]
    a, b, c, _, delay = MODEL.state_space()
    ad, bd, *_ = cont2discrete((a, b, c, np.zeros((1, 1))), 1.0 / RATE_HZ)
    late = round(delay[0] * RATE_HZ)
    random = noise * np.random.default_rng(seed).standard_normal(len(excitation))
    state, u, y = np.zeros(len(a)), np.zeros(len(excitation)), np.zeros(len(excitation))
    for k, injected in enumerate(excitation):
        y[k] = c[0] @ state + random[k]
        u[k] = injected - 0.05 * y[k]
        state = ad @ state + bd[:, 0] * (u[k - late] if k >= late else 0.0)
    return fid.Record.from_arrays(
        np.arange(len(u)) / RATE_HZ,
        inputs={MODEL.inputs[0]: u},
        outputs={"p": y},
        excitations={"injected": excitation},
        units={"p": "rad/s"},
    )


def loop_response(record: fid.Record) -> fid.FrequencyResponse:
    return fid.estimate_response(record, band_rad_s=BAND, n_omega=60, estimator="instrument")


def test_closed_loop_by_instrument() -> None:
    response = loop_response(loop_flight(0.0))
    plain = fid.identify(START, response, correct_bias=False)
    assert abs(plain.parameters["Ltphi"].value / TRUTH["Ltphi"] - 1) > 0.01
    fit = fid.identify(START, response, hold="zero")
    assert_recovered(fit, TRUTH, 1e-5, "steps between samples, delay without their half sample")


@pytest.mark.nightly
def test_closed_loop_with_little_noise_lies_in_its_errors() -> None:
    for seed in range(3):
        fit = fid.identify(START, loop_response(loop_flight(0.002, seed)), hold="zero")
        for name, value in TRUTH.items():
            error = fit.parameters[name].stderr
            assert error is not None
            assert abs(fit.parameters[name].value - value) < 3.5 * error


def test_a_record_may_begin_in_motion_and_out_of_trim() -> None:
    whole = flown()
    name = MODEL.inputs[0]
    part = slice(1000, 8000)
    record = fid.Record.from_arrays(
        whole.time_s[part],
        inputs={name: whole[name][part] + 0.02},
        outputs={"p": whole["p"][part] - 0.3},
        units={"p": "rad/s"},
    )
    response = fid.estimate_response(record, band_rad_s=(2.0, 8.0), n_omega=40)
    fit = fid.identify(START, response, hold="first")
    # Of the inputs before the first sample, four delayed ones are not known.
    assert_recovered(fit, TRUTH, 2e-3, "initial state and trims are fitted")
    plain = fid.identify(START, response, correct_bias=False)
    assert abs(plain.parameters["Ltphi"].value / TRUTH["Ltphi"] - 1) > 0.02


def two_by_two() -> fid.TransferFunctionModel:
    values = {"K1": 3.0, "K2": -1.0, "K3": 0.5, "K4": 4.0}
    parameters = [fid.Parameter(name, value) for name, value in values.items()]
    parameters += [fid.Parameter("T", 0.3, "s", minimum=0.01, maximum=3.0)]
    pairs = [("x", "u", "K1"), ("x", "w", "K2"), ("y", "u", "K3"), ("y", "w", "K4")]
    return fid.TransferFunctionModel(
        tuple(fid.TransferFunction(o, i, k, denominator=("T*s + 1",)) for o, i, k in pairs),
        fid.Parameters(parameters),
    )


def test_two_inputs_two_outputs_two_records_and_selections() -> None:
    truth, random = two_by_two(), np.random.default_rng(1)
    records = []
    for n in (2000, 2600):
        shaped = np.cumsum(random.standard_normal((2, n)), axis=1)
        shaped -= np.linspace(0, 1, n) * shaped[:, -1:]
        given = fid.Record.from_arrays(np.arange(n) / 50.0, inputs={"u": shaped[0], "w": shaped[1]})
        records.append(fid.simulate(truth, given))
    response = fid.estimate_response(records, band_rad_s=(1.0, 20.0), n_omega=60, window_s=8.0)
    start = truth.with_values({"K1": 2.5, "K4": 3.0, "T": 0.2})
    values = {name: float(p.value or 0.0) for name, p in truth.parameters.items()}
    plain = fid.identify(start, response, correct_bias=False, minimum_coherence=None)
    assert abs(plain.parameters["K2"].value / values["K2"] - 1) > 1e-3
    turned = response.select(outputs=["y", "x"], inputs=["w", "u"], band_rad_s=(2.0, 15.0))
    for data in (response, turned):
        fit = fid.identify(start, data, hold="first", minimum_coherence=None)
        assert_recovered(fit, values, 1e-6, "all pairs of two records")


def test_the_functional_is_the_derivative_of_a_single_window_estimate() -> None:
    record = flown(0.02)
    response = fid.estimate_response(record, band_rad_s=BAND, n_omega=20, window_s=10.0)
    change = np.cumsum(np.random.default_rng(3).standard_normal(record.n_samples))
    moved = record.replace({"p": record["p"] + change})
    again = fid.estimate_response(moved, band_rad_s=BAND, n_omega=20, window_s=10.0)
    assert response.linear is not None
    found = response.linear.apply([change[None]])
    difference = again.response - response.response
    assert_close(found, difference, rtol=1e-9, atol=1e-9, why="one window length is linear")
    with pytest.raises(ShapeError, match="changes do not fit the records"):
        response.linear.apply([change])


def test_where_nothing_is_known_the_fit_says_why(tmp_path: Path) -> None:
    response = estimated(flown(0.001))
    cases = {
        "result of arithmetic": add_delay(response, 0.0),
        "read from a file": read_response(write_response(response, tmp_path / "r.nc")),
        "covariance=False": fid.estimate_response(
            flown(0.001), band_rad_s=BAND, n_omega=60, covariance=False
        ),
    }
    for words, data in cases.items():
        fit = fid.identify(START, data)
        found = [f for f in fit.findings if f.code == "estimator-bias-not-corrected"]
        assert len(found) == 1
        assert words in found[0].message
        plain = fid.identify(START, data, correct_bias=False)
        assert fit.parameters["Ltphi"].value == plain.parameters["Ltphi"].value
    with pytest.raises(DataError, match="weights are not known"):
        Correction(cases["result of arithmetic"], "first").apply(START)


def test_a_model_that_diverges_leaves_the_fit_as_it_was() -> None:
    response = estimated(flown(0.001))
    quiet = replace(
        response,
        linear=replace(
            response.linear, output_records=tuple(1e-3 * r for r in response.linear.output_records)
        ),
    )
    with pytest.raises(DataError, match=r"a residual .* times the measured output"):
        Correction(quiet, "first").apply(MODEL)
    fit = fid.identify(MODEL, quiet)
    assert any(f.code == "estimator-bias-not-corrected" for f in fit.findings)


def test_refusals() -> None:
    parameters = MODEL.parameters.with_parameter(
        replace(MODEL.parameters["tau"], value=-0.01, minimum=-0.1)
    )
    with pytest.raises(ModelError, match="a negative delay cannot be simulated"):
        systems_of(replace(MODEL, parameters=parameters))
    with pytest.raises(OptionError, match="hold is not known"):
        fid.identify(MODEL, estimated(flown()), hold="cubic")


def test_a_correction_that_does_not_settle_leaves_no_intervals(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    response = estimated(flown(0.0002))
    monkeypatch.setattr(bias_search, "MOST_STEPS", 1)
    fit = fid.identify(START, response)
    said = [f for f in fit.findings if f.code == "estimator-bias-not-corrected"]
    assert [f.light.value for f in said] == ["red"]
    assert "the search stopped" in said[0].message
    assert fit.covariance is None
    assert all(p.stderr is None for p in fit.parameters.values())
    assert "leakage of the estimate is not corrected" in fit.parameters["Lp"].reason
    assert fit.evidence.light.value == "red"
    monkeypatch.setattr(without_bias, "TOLERABLE", 1e9)
    kept = fid.identify(START, response)
    assert [f.light.value for f in kept.findings if f.code == "estimator-bias"] == ["amber"]


def _oscillator(u: NDArray[np.float64], wn2: float, zeta: float) -> fid.Record:
    """Exact steps of a lightly damped vehicle, noise of a twentieth beside."""
    a = np.array([[0.0, 1.0], [-wn2, -2.0 * zeta * np.sqrt(wn2)]])
    b, c = np.array([[0.0], [8.0]]), np.array([[1.0, 0.0]])
    ad, bd, *_ = cont2discrete((a, b, c, np.zeros((1, 1))), 0.02)
    state, y = np.zeros(2), np.zeros(len(u))
    for k, value in enumerate(u):
        y[k] = state[0]
        state = ad @ state + bd[:, 0] * value
    noise = 0.05 * y.std() * np.random.default_rng(1).standard_normal(len(u))
    return fid.Record.from_arrays(
        0.02 * np.arange(len(u)), inputs={"u": u}, outputs={"y": y + noise}, hold="zero"
    )


@pytest.mark.parametrize("zeta", [0.02, pytest.param(0.05, marks=pytest.mark.nightly)])
def test_light_damping_in_a_short_record_is_found_at_no_higher_cost(zeta: float) -> None:
    t = 0.02 * np.arange(1000)
    record = _oscillator(0.1 * np.sin(0.5 * t + 0.28 * t**2), 4.09, zeta)
    response = fid.estimate_response(record)
    parameters = [
        fid.Parameter("K", 6.0, "1/s^2"),
        fid.Parameter("d", 0.3, "1/s", minimum=1e-4, maximum=20.0),
        fid.Parameter("w2", 3.5, "1/s^2", minimum=0.1, maximum=100.0),
    ]
    path = fid.TransferFunction("y", "u", "K", denominator=("s^2 + d*s + w2",))
    model = fid.TransferFunctionModel((path,), fid.Parameters(parameters))
    plain = fid.identify(model, response, correct_bias=False)
    fit = fid.identify(model, response)
    assert fit.objective < plain.objective
    truth = {"K": 8.0, "d": 2.0 * zeta * np.sqrt(4.09), "w2": 4.09}
    assert abs(fit.parameters["K"].value / 8.0 - 1.0) < 0.05
    assert abs(plain.parameters["w2"].value - 4.09) > 1.0
    for name, value in truth.items():
        error = fit.parameters[name].stderr
        assert error is not None
        assert abs(fit.parameters[name].value - value) < 3.5 * error


@pytest.mark.parametrize("delay_s", [pytest.param(0.1, marks=pytest.mark.nightly), 0.1137])
def test_a_held_input_that_feeds_through_late(delay_s: float) -> None:
    trial = fly_feedthrough(0, delay_s=delay_s)
    assert not trial.refusal
    for each in trial.readings:
        assert each.stderr is not None, each.name
        assert abs(each.value - each.truth) < 3.5 * each.stderr, each


def _standard_scores(noise: float, seed: int) -> NDArray[np.float64]:
    fit = fid.identify(START, estimated(flown(noise, seed)), hold="first")
    pairs = [(fit.parameters[name], value) for name, value in TRUTH.items()]
    return np.array([(p.value - value) / (p.stderr or np.nan) for p, value in pairs])


@pytest.mark.parametrize("noise", [0.02, pytest.param(0.0002, marks=pytest.mark.nightly)])
def test_one_sweep_lies_in_its_errors(noise: float) -> None:
    scores = np.array([_standard_scores(noise, seed) for seed in range(2)])
    assert np.all(np.abs(scores) < 3.5), scores


@pytest.mark.slow
def test_intervals_of_one_clean_sweep_cover_the_truth() -> None:
    n_flights = 250
    scores = np.array([_standard_scores(0.002, 1000 + seed) for seed in range(n_flights)])
    covered = np.mean(np.abs(scores) < 1.96, axis=0)
    low, high = binom.ppf([0.0005, 0.9995], n_flights, 0.95) / n_flights
    assert np.all((covered >= low) & (covered <= high)), covered
    assert 0.93 <= covered.mean() <= 0.97, covered


@pytest.mark.nightly
def test_a_cost_that_rises_by_chance_does_not_cost_the_intervals():
    # A loop with gusts, of another simulator: the corrected fit costs 60 % more, all of it noise.
    seed, flight = 5001, gains.drawn(5001)
    data = [gains.record(flight, seed + gains.OTHER * k) for k in range(flight.sweeps)]
    response = fid.estimate_response(data, inputs="tau_phi", outputs="p", estimator="instrument")
    fit = fid.identify(gains.structure_of(flight.structure), response)
    damping = fit.parameters["Lp"]
    assert damping.stderr is not None
    assert abs(damping.value - flight.craft.about["damping"]) < 2.0 * damping.stderr
