"""The verb identify: what it refuses, what it says, what it reports."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, FitError, OptionError, UnitError, UnknownNameError
from flightid.uncertainty import estimator_gain, null_combination
from flightid.uncertainty.cramer_rao import cramer_rao
from flightid.uncertainty.insensitivity import insensitivity
from tests.closeness import assert_close

OMEGA = np.geomspace(0.5, 60.0, 120)
MODEL = fid.load_model("rate_first_order")
TRUE = MODEL.with_values({"Lp": -6.0, "Ltphi": 180.0, "tau": 0.013})


def data_of(
    model: fid.TransferFunctionModel = TRUE,
    *,
    factor: complex | np.ndarray = 1.0,
    **options: object,
) -> fid.FrequencyResponse:
    given = {"units": dict(model.units), "random_error": np.full(len(OMEGA), 0.03)} | options
    return fid.FrequencyResponse.from_values(
        OMEGA,
        model.frequency_response(OMEGA) * factor,
        inputs=model.inputs,
        outputs=model.outputs,
        **given,  # type: ignore[arg-type]
    )


def codes(fit: fid.Fit) -> list[str]:
    return [finding.code for finding in fit.findings]


def test_result_says_everything() -> None:
    noise = np.random.default_rng(3).normal(size=(2, len(OMEGA))) * 0.05
    fit = fid.identify(MODEL, data_of(factor=np.exp(noise[0] + 1j * noise[1])), starts=5)
    assert repr(fit).startswith("Fit('Roll rate, first order', 3 free of 3 parameters, 1 response")
    text = fit.summary().to_text()
    assert "Cramér–Rao [%]" in text
    assert "p/tau_phi = Ltphi / (s - Lp)" in text
    plain = json.loads(json.dumps(fit.to_dict()))
    assert plain["schema"] == "flightid.fit/1"
    assert plain["provenance"]["options"]["starts"] == 5
    assert len(plain["provenance"]["data_sha256"]) == 64
    assert "<table>" in fit._repr_html_()
    lp = fit.parameters["Lp"]
    assert lp.interval95 is not None
    assert lp.interval95[0] < lp.value < lp.interval95[1]
    assert fit.names == ("Lp", "Ltphi", "tau") or set(fit.names) == {"Lp", "Ltphi", "tau"}
    assert fit.covariance is not None
    assert_close(
        np.sqrt(fit.covariance[fit.names.index("Lp")][fit.names.index("Lp")]),
        lp.stderr,
        rtol=1e-12,
        why="one covariance",
    )
    assert sum(each.count for each in fit.minima) == 5
    assert fit.model.parameters["Lp"].value == lp.value
    assert "intervals-approximate" in codes(fit)
    again = fid.identify(MODEL, data_of(factor=np.exp(noise[0] + 1j * noise[1])), starts=5)
    assert again.to_dict() == fit.to_dict()


def test_missing_errors_are_said() -> None:
    fit = fid.identify(MODEL, data_of(random_error=None))
    lp = fit.parameters["Lp"]
    assert (lp.stderr, lp.interval95) == (None, None)
    assert "nothing known" in lp.reason
    assert "intervals-missing" in codes(fit)
    with pytest.raises(FitError, match="likelihood needs the errors"):
        fid.identify(MODEL, data_of(random_error=None), cost="likelihood")
    half = np.where(np.arange(len(OMEGA)) < 60, 0.0, 0.1)
    with pytest.raises(FitError, match="some points have no random error"):
        fid.identify(MODEL, data_of(random_error=half), cost="likelihood")


def test_fixed_and_bounded_parameters() -> None:
    fit = fid.identify(MODEL.with_fixed(tau=0.013), data_of())
    assert fit.parameters["tau"].status == "fixed"
    assert fit.parameters["tau"].reason == "fixed"
    delay = fid.Parameter("tau", 0.002, "s", minimum=0.0, maximum=0.005)
    tight = fid.TransferFunctionModel(
        MODEL.responses, MODEL.parameters.with_parameter(delay), MODEL.units
    )
    fit = fid.identify(tight, data_of())
    tau = fit.parameters["tau"]
    assert (tau.value, tau.status, tau.stderr) == (0.005, "at bound", None)
    assert "at bound" in tau.reason
    assert "at-bound" in codes(fit)
    assert "tau" not in fit.names


def test_unidentifiable_parameters_are_named() -> None:
    parameters = fid.Parameters(
        [fid.Parameter("a", 2.0, "rad/s"), fid.Parameter("b", 3.0), fid.Parameter("c", 1.0)]
    )
    both = fid.TransferFunctionModel(
        (fid.TransferFunction("p", "tau_phi", "a*b"),), parameters, {"p": "rad/s"}
    )
    seen = fid.identify(both.with_fixed(b=3.0), data_of(both))
    assert (seen.names, seen.parameters["c"].status) == (("a",), "not seen")
    assert seen.parameters["c"].stderr is None
    assert "no influence" in seen.parameters["c"].reason
    assert "not-seen" in codes(seen)
    with pytest.raises(FitError, match="cannot tell these parameters apart: found a, b"):
        fid.identify(both.with_fixed(c=1.0), data_of(both))
    assert fid.identify(both.with_fixed(c=1.0, b=3.0), data_of(both)).cost < 1e-20
    with pytest.raises(FitError, match="no free parameter"):
        fid.identify(both.with_fixed(a=1.0, b=3.0, c=0.0), data_of(both))


def test_data_that_do_not_fit_the_model() -> None:
    with pytest.raises(UnitError, match="channel 'p' has another unit"):
        fid.identify(MODEL, data_of(units={"p": "deg/s"}))
    with pytest.raises(UnknownNameError, match="q"):
        fid.identify(fid.load_model("rate_first_order", axis="pitch"), data_of())
    with pytest.raises(DataError, match="not finite"):
        data_of(factor=np.nan)
    with pytest.raises(DataError, match="has no band to fit"):
        fid.identify(MODEL, data_of(coherence=np.full(len(OMEGA), 0.3)))
    with pytest.raises(DataError, match="too few points to fit"):
        fid.identify(MODEL, data_of(coherence=np.full(len(OMEGA), 0.3)), band_rad_s=(1.0, 9.0))
    with pytest.raises(DataError, match="too few points to fit"):
        fid.identify(MODEL, data_of(), band_rad_s=(100.0, 200.0))
    # Pairs of neighbours between gaps: what `coherent_pairs` keeps is fitted.
    broken = data_of(coherence=np.where(np.arange(len(OMEGA)) % 3 < 2, 0.9, 0.3))
    assert fid.coherent_pairs(broken).names
    assert_close(fid.identify(MODEL, broken).parameters["Lp"].value, -6.0, rtol=1e-8, why="exact")
    weak = fid.identify(
        MODEL,
        data_of(coherence=np.full(len(OMEGA), 0.3)),
        band_rad_s=(1.0, 9.0),
        minimum_coherence=None,
    )
    assert_close(weak.parameters["Lp"].value, -6.0, rtol=1e-8, why="no noise")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"cost": "beauty"}, "cost is not known"),
        ({"starts": 0}, "starts is too small"),
        ({"n_omega": 2}, "n_omega is too small"),
        ({"minimum_coherence": 1.5}, "minimum_coherence is too large"),
        ({"weight_gain": -1.0}, "weight_gain is too small"),
        ({"weight_gain": 0.0, "weight_phase": 0.0}, "both weights are zero"),
        ({"maximum_iterations": 0}, "maximum_iterations is too small"),
        ({"band_rad_s": (9.0, 1.0)}, "band of response p/tau_phi has no meaning"),
    ],
)
def test_options_without_meaning(options: dict[str, object], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        fid.identify(MODEL, data_of(), **options)  # type: ignore[arg-type]


def test_bands_by_name() -> None:
    fit = fid.identify(MODEL, data_of(), band_rad_s={"p/tau_phi": (2.0, 20.0)})
    low, high = fit.responses[0].band_rad_s
    assert 2.0 <= low < 2.2
    assert 19.0 < high <= 20.0
    with pytest.raises(UnknownNameError, match="a response that the model does not have"):
        fid.identify(MODEL, data_of(), band_rad_s={"q/u": (2.0, 20.0)})


def test_kinds_without_a_fit_are_refused() -> None:
    with pytest.raises(FitError, match="no fit for this model and these data: found int and str"):
        fid.identify(3, "x")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("factor", "code"),
    [
        (-1.0, "setup-sign"),
        (1.0 / (1j * OMEGA), "setup-integration"),
        (1j * OMEGA, "setup-integration"),
        (180.0 / np.pi, "setup-unit-factor"),
        (np.pi / 180.0, "setup-unit-factor"),
    ],
)
def test_setup_is_checked_before_the_fit(factor: complex, code: str) -> None:
    fit = fid.identify(TRUE.with_fixed(tau=0.013), data_of(factor=factor))
    assert code in codes(fit)
    assert not [c for c in codes(fid.identify(TRUE, data_of())) if c.startswith("setup")]


def test_guides_are_judged() -> None:
    wrong = fid.identify(fid.load_model("rate_integrator"), data_of())
    assert "cost" in codes(wrong)
    assert wrong.findings[-1].light.value in {"amber", "green", "red"}
    narrow = fid.identify(
        fid.load_model("rate_motor_lag"), data_of(), band_rad_s=(1.0, 4.0), n_omega=40
    )
    assert {"insensitive", "cramer-rao", "correlated", "at-bound"} & set(codes(narrow))


def test_divergence_and_unfinished_search() -> None:
    overflow = fid.TransferFunctionModel(
        (fid.TransferFunction("p", "tau_phi", "K*exp(x)"),),
        fid.Parameters([fid.Parameter("K", 1.0, "rad/s"), fid.Parameter("x", 800.0)]),
        {"p": "rad/s"},
    )
    with pytest.raises(FitError, match="diverged from every start"):
        fid.identify(overflow, data_of(overflow.with_values({"x": 1.0})))
    short = fid.identify(MODEL, data_of(), maximum_iterations=1)
    assert "not-converged" in codes(short)
    assert short.termination == "iterations"


def test_several_starts_escape_a_local_minimum() -> None:
    start = fid.load_model("rate_second_order").with_values({"omega_n": 250.0, "zeta": 4.9})
    truth = start.with_values({"K": 9.0, "zeta": 0.05, "omega_n": 6.0, "tau": 0.01})
    fit = fid.identify(start, data_of(truth), starts=30, seed=2)
    assert_close(fit.parameters["omega_n"].value, 6.0, rtol=1e-7, why="a start lay in its basin")
    assert sum(each.count for each in fit.minima) <= 30
    costs = [each.objective for each in fit.minima]
    assert costs == sorted(costs)


def test_values_of_inference_are_checked() -> None:
    zero = np.array([[1.0, 0.0], [1.0, 0.0]])
    same = np.array([[1.0, 1.0], [1.0, 1.0]])
    for call in (cramer_rao, insensitivity):
        with pytest.raises(ArithmeticError, match="no influence"):
            call(zero)
    with pytest.raises(ArithmeticError, match="singular"):
        cramer_rao(same)
    with pytest.raises(ArithmeticError, match="no influence"):
        estimator_gain(zero, np.eye(2))
    with pytest.raises(ArithmeticError, match="singular"):
        estimator_gain(same, np.eye(2))
    assert null_combination(np.eye(2)) is None


def test_errors_shared_by_neighbours_widen_intervals() -> None:
    # One window of 4 s resolves 1.6 rad/s: points closer than that count less.
    data = data_of()
    windowed = replace(data, window_s=(4.0,))
    alone, shared = (fid.identify(MODEL, d, band_rad_s=(1.0, 8.0)) for d in (data, windowed))
    assert shared.parameters["Lp"].stderr > 1.2 * alone.parameters["Lp"].stderr
