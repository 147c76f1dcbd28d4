"""NARX models: terms, widths, scaling, prediction, selection, baseline, errors."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid import _native
from flightid.errors import (
    DataError,
    FitError,
    ModelError,
    OptionError,
    UnitError,
    UnknownNameError,
)
from flightid.identification.narx.findings import free_run_findings
from flightid.identification.narx.simulation_error import SimulationError
from flightid.models import Lag, NarxModel, Term
from flightid.models.narx.scaling import Scaling
from flightid.models.narx.terms import product_term
from tests.closeness import assert_close
from tests.narx_records import quadratic

MODEL = fid.NarxStructure(("u",), "y", 1, 2, kernel=None, degree=2, stop="bic")


def test_recovers_a_polynomial_system_exactly_and_runs_freely_on_new_data() -> None:
    fit = fid.identify(MODEL, [quadratic(), quadratic(seed=1)])
    names = [item.term.name for item in fit.details.chosen]
    assert names == ["constant", "y(t-1)", "u(t-1)", "u(t-2)", "u(t-2)^2"]
    run = fid.predict(fit.model, quadratic(seed=2))
    assert run.start == 2
    assert run.diverged_at is None
    assert_close(run.predicted["y"], run.measured["y"], atol=1e-11, why="no noise, true structure")
    assert fit.findings == ()
    assert fit.details.baseline_free_run_rms > 0.1


def test_weights_and_standard_errors_are_those_of_least_squares() -> None:
    record = quadratic(noise=0.05)
    fit = fid.identify(MODEL, record)
    scaling = fit.model.scaling
    y, u = scaling.scaled(record, "y"), scaling.scaled(record, "u")
    data = {"y": y, "u": u}
    columns = [
        np.prod(
            [np.ones(398)] + [data[lag.channel][2 - lag.lag : 400 - lag.lag] ** p for lag, p in t],
            axis=0,
        )
        for t in (item.term.factors for item in fit.details.chosen)
    ]
    p = np.array(columns).T
    weights, squares, *_ = np.linalg.lstsq(p, y[2:], rcond=None)
    covariance = np.linalg.inv(p.T @ p) * squares[0] / (398 - len(weights))
    assert_close(
        [item.weight for item in fit.details.chosen], weights, rtol=1e-9, why="same problem"
    )
    stderr = np.sqrt(np.diag(covariance))
    assert_close(
        [item.stderr for item in fit.details.chosen], stderr, rtol=1e-9, why="same problem"
    )
    assert_close(fit.details.chosen[-1].sum_of_squares, squares[0], rtol=1e-9, why="same problem")


def test_scaling_is_by_training_mean_and_n_minus_1_deviation() -> None:
    record = quadratic()
    scaling = fid.identify(MODEL, record).model.scaling
    assert_close(scaling.mean["u"], np.mean(record["u"]), rtol=1e-14, why="definition")
    assert_close(scaling.deviation["y"], np.std(record["y"], ddof=1), rtol=1e-14, why="definition")
    assert scaling.units == {"y": "rad", "u": "V"}


def test_horizons_one_k_and_free_run() -> None:
    record = quadratic(noise=0.1)
    fit = fid.identify(MODEL, record)
    one, five, free = (fid.predict(fit.model, record, h) for h in (1, 5, "free_run"))
    assert one.rms_error["y"] < five.rms_error["y"] <= 1.05 * free.rms_error["y"]
    assert_close(fit.details.one_step_rms, one.rms_error["y"], rtol=1e-12, why="same prediction")
    everything = fid.predict(fit.model, record, 400)
    assert_close(
        everything.predicted["y"], free.predicted["y"], rtol=1e-12, why="all steps from the start"
    )
    measured, predicted = free.scored("y")
    assert fid.validation.theil(measured, predicted) < 0.3
    assert "free run" in repr(free)
    assert "5 ahead" in repr(five)
    assert one.measured.n_samples == one.predicted.n_samples == 400


@pytest.mark.parametrize(
    ("convention", "width", "beta"),
    [("beta", 2.0, 2.0), ("matlab_spread", 2.0, 2.0 / 0.8326), ("sigma", 2.0, 2.0 * math.sqrt(2))],
)
def test_width_conventions(convention: str, width: float, beta: float) -> None:
    model = fid.NarxStructure(("u",), "y", 2, 2, width=width, width_convention=convention)
    assert_close(model.beta, beta, rtol=1e-15, why="definition")
    assert f"β = {beta:.4g} ({convention} 2)" in repr(model)


@pytest.mark.parametrize(
    "kernel", ["gaussian", "multiquadric", "inverse_multiquadric", "thin_plate"]
)
@pytest.mark.parametrize("candidates", ["data", "kmeans", "grid"])
def test_radial_models_beat_the_linear_one(kernel: str, candidates: str) -> None:
    model = fid.NarxStructure(
        ("u",), "y", 1, 2, kernel=kernel, width=3.0, candidates=candidates,
        n_candidates=4 if candidates == "grid" else 40, maximum_terms=14,
    )  # fmt: skip
    fit = fid.identify(model, quadratic(noise=0.01))
    assert {item.term.kind for item in fit.details.chosen} == {"constant", "linear", "radial"}
    new = quadratic(seed=5)
    free, linear = (
        fid.predict(fit.model, new).rms_error["y"],
        fid.predict(fit.details.baseline, new).rms_error["y"],
    )
    assert free < 0.5 * linear
    again = fid.identify(model, quadratic(noise=0.01))
    assert again.model.weights == fit.model.weights


def test_centres_computed_on_the_fly_give_the_same_model(monkeypatch: pytest.MonkeyPatch) -> None:
    model = fid.NarxStructure(("u",), "y", 1, 2, width=3.0, maximum_terms=10)
    kept = fid.identify(model, quadratic(150, noise=0.01))
    monkeypatch.setattr("flightid.identification.narx.fit.MAXIMUM_BYTES", 0)
    lazy = fid.identify(model, quadratic(150, noise=0.01))
    assert lazy.model.weights == kept.model.weights
    assert lazy.model.terms == kept.model.terms


def test_stops() -> None:
    record = quadratic(noise=0.05)
    radial = replace(MODEL, kernel="gaussian", degree=1)
    few = fid.identify(replace(radial, stop="terms", maximum_terms=6), record)
    assert len(few.details.chosen) == 6
    goal = few.details.chosen[-2].sum_of_squares
    assert (
        len(fid.identify(replace(radial, stop="sse", goal=goal * 1.0001), record).details.chosen)
        == 5
    )
    least = few.details.chosen[-1].error_reduction * 0.999
    by_ratio = fid.identify(replace(radial, stop="err", goal=least, maximum_terms=6), record)
    assert len(by_ratio.details.chosen) == 6
    assert all(item.error_reduction >= least for item in by_ratio.details.chosen[4:])
    kept = [
        len(fid.identify(replace(MODEL, stop=s), record).details.chosen)
        for s in ("bic", "aicc", "aic")
    ]
    assert kept == sorted(kept)


def test_views() -> None:
    fit = fid.identify(MODEL, quadratic(noise=0.05))
    text = fit.summary().to_text()
    assert "u(t-2)^2" in text
    assert "polynomial" in fit.details.terms_table().to_text()
    assert not fit.details.terms_table().notes, "no radial term, no centre"
    assert "free run of the linear model" in text
    assert fit.to_dict()["schema"] == "flightid.fit/1"
    assert fit.details.n_samples == 398
    assert fit.details.words in repr(fit)
    assert "<table>" in fit._repr_html_()
    assert fit.structure is MODEL


def test_terms_are_typed() -> None:
    term = product_term([Lag("y", 1), Lag("u", 3)])
    assert (term.kind, term.degree, term.lag, term.name) == ("polynomial", 2, 3, "y(t-1) u(t-3)")
    radial = Term("gaussian 1", centre=(0.0, 1.0))
    assert (radial.kind, radial.degree, radial.lag) == ("radial", None, None)
    assert str(Lag("u", 0)) == "u(t)"


def test_an_unstable_model_is_held_flagged_and_never_nan() -> None:
    fit = fid.identify(MODEL, quadratic())
    weights = tuple(
        2.0 if term.name == "y(t-1)" else weight
        for term, weight in zip(fit.model.terms, fit.model.weights, strict=True)
    )
    run = fid.predict(replace(fit.model, weights=weights), quadratic(seed=3))
    assert run.diverged_at is not None
    assert np.all(np.isfinite(run.predicted["y"]))
    low, high = np.min(quadratic()["y"]), np.max(quadratic()["y"])
    assert np.all(np.abs(run.predicted["y"] - (low + high) / 2) <= 1.5 * (high - low) * (1 + 1e-12))
    assert "held from sample" in repr(run)


def test_findings_of_a_model_that_runs_away() -> None:
    # A double integrator of noise: products of outputs fit one step and run away freely.
    rng = np.random.default_rng(4)
    u = rng.standard_normal(60)
    y = np.cumsum(u + 0.5 * rng.standard_normal(60))
    record = fid.Record.from_arrays(np.arange(60) / 5, inputs={"u": u}, outputs={"y": y})
    model = fid.NarxStructure(
        ("u",), "y", 3, 3, kernel=None, degree=3, stop="terms", maximum_terms=40, guard=1.5
    )
    codes = {finding.code for finding in fid.identify(model, record).findings}
    assert codes == {"free-run-unstable", "loses-to-linear"}


def test_collinear_candidates_are_counted() -> None:
    model = fid.NarxStructure(("u",), "y", 1, 1, width=100.0, stop="terms", maximum_terms=8)
    fit = fid.identify(model, quadratic(noise=0.01))
    finding = next(item for item in fit.findings if item.code == "collinear-candidates")
    assert "reduce the width" in finding.action


def search() -> fid.validation.NarxSearch:
    return fid.validation.search_narx(
        replace(MODEL, kernel="gaussian", degree=1, maximum_terms=12),
        quadratic(noise=0.02),
        [quadratic(seed=8), quadratic(seed=9)],
        lags=[(1, 1), (1, 2)],
        widths=[1.0, 4.0],
    )


def test_search_ranks_by_free_run_beside_the_linear_model() -> None:
    found = search()
    errors = [trial.score.rms for trial in found.trials if trial.score is not None]
    assert errors == sorted(errors)
    assert len(errors) == 4
    assert found.best.structure.input_lags == 2
    first = found.trials[0]
    assert first.score is not None
    assert first.baseline is not None
    assert first.score.rms < first.baseline.rms
    assert [each.code for each in found.findings] == ["at-edge-of-scan"]
    assert "input lags" in found.findings[0].message
    assert "linear free-run rms" in found.summary().to_text()
    assert "4 structures" in repr(found)
    assert found.to_dict()["schema"] == "flightid.narx_search/1"
    assert "<table>" in found._repr_html_()


def test_search_says_when_the_best_loses_to_the_linear_model() -> None:
    rng = np.random.default_rng(2)

    def linear(seed: int) -> fid.Record:
        u = np.random.default_rng(seed).standard_normal(80)
        y = np.zeros(80)
        for t in range(1, 80):
            y[t] = 0.9 * y[t - 1] + u[t - 1] + rng.standard_normal()
        return fid.Record.from_arrays(np.arange(80) / 5, inputs={"u": u}, outputs={"y": y})

    model = fid.NarxStructure(("u",), "y", 2, 2, width=1.0, stop="terms", maximum_terms=40)
    found = fid.validation.search_narx(model, linear(0), linear(1))
    assert "loses-to-linear" in {finding.code for finding in found.findings}


def test_search_keeps_structures_that_cannot_be_fitted_with_the_reason() -> None:
    u = np.sin(0.3 * np.arange(200))
    y = np.concatenate([[0.0], u[:-1]]) ** 2
    record = fid.Record.from_arrays(np.arange(200) / 5, inputs={"u": u}, outputs={"y": y})
    model = fid.NarxStructure(("u",), "y", 1, 1, maximum_terms=8)
    found = fid.validation.search_narx(model, record, record, lags=[(1, 4), (1, 1)])
    assert found.trials[1].fit is None
    assert "cannot be told apart" in found.summary().to_text()
    with pytest.raises(FitError, match="no structure of the search"):
        fid.validation.search_narx(model, record, record, lags=[(1, 4)])
    broken = replace(found, trials=found.trials[1:])
    with pytest.raises(FitError, match="no structure of the search"):
        _ = broken.best
    with pytest.raises(OptionError, match="no validation record"):
        fid.validation.search_narx(model, record, [])


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"output_lags": -1}, "output_lags is too small"),
        ({"stop": "never"}, "stop is not known"),
        ({"kernel": "cubic"}, "kernel is not known"),
        ({"candidates": "all"}, "candidates is not known"),
        ({"output_lags": 0, "input_lags": 0}, "has no lags"),
        ({"inputs": ("y",)}, "named twice"),
        ({"guard": 0.5}, "guard is too small"),
        ({"stop": "sse"}, "has no goal"),
        ({"width": 0.0}, "radial width"),
        ({"width_convention": "fwhm"}, "width_convention is not known"),
    ],
)
def test_options_outside_their_range(change: dict[str, object], match: str) -> None:
    with pytest.raises(OptionError, match=match):
        replace(MODEL, **change)  # type: ignore[arg-type]


def _constant() -> fid.Fit:
    record = quadratic()
    return fid.identify(MODEL, record.replace({"u": np.full(400, 3.3)}))


def _sine() -> fid.Fit:
    record = quadratic()
    return fid.identify(replace(MODEL, input_lags=4), record.replace({"u": np.sin(record.time_s)}))


REFUSED: list[tuple[type[Exception], str, Callable[[], object]]] = [
    (DataError, r"channel 'u' is constant: found 3\.3 from 0 to [\d.]+ s", _constant),
    (DataError, "too few samples", lambda: fid.identify(MODEL, quadratic(7))),
    (FitError, "cannot be told apart", _sine),
    (DataError, "not finite", lambda: quadratic().replace({"u": np.full(400, np.nan)})),
    (UnknownNameError, "w", lambda: fid.identify(replace(MODEL, inputs=("w",)), quadratic())),
    (
        OptionError,
        "no such option",
        lambda: fid.identify(MODEL, quadratic(), n_omega=5),  # type: ignore[call-overload]
    ),
    (
        OptionError,
        "too many products",
        lambda: fid.identify(replace(MODEL, output_lags=20, input_lags=20, degree=5), quadratic()),
    ),
    (
        OptionError,
        "too many grid centres",
        lambda: fid.identify(
            replace(MODEL, kernel="gaussian", candidates="grid", n_candidates=100), quadratic()
        ),
    ),
    (
        FitError,
        "no candidate terms",
        lambda: fid.identify(replace(MODEL, degree=1, linear=False, constant=False), quadratic()),
    ),
    (
        FitError,
        "no term explains",
        lambda: fid.identify(
            replace(MODEL, linear=False, constant=False, stop="err", goal=0.999), quadratic()
        ),
    ),
    (FitError, "no fit for this model", lambda: fid.identify(MODEL, [])),
]


@pytest.mark.parametrize(("kind", "match", "call"), REFUSED, ids=[row[1] for row in REFUSED])
def test_refusals(kind: type[Exception], match: str, call: Callable[[], object]) -> None:
    with pytest.raises(kind, match=match):
        call()


def test_refusals_of_a_prediction() -> None:
    fit = fid.identify(MODEL, quadratic())
    record = quadratic()
    with pytest.raises(OptionError, match="horizon is"):
        fid.predict(fit.model, record, "all")
    with pytest.raises(OptionError, match="horizon is"):
        fid.predict(fit.model, record, 0)
    with pytest.raises(UnitError, match="another unit"):
        fid.predict(fit.model, record.to_units(y="deg"))
    slow = record.replace({"u": record["u"], "y": record["y"]}, time_s=record.time_s * 2)
    with pytest.raises(DataError, match="another sample time"):
        fid.predict(fit.model, slow)
    with pytest.raises(DataError, match="beyond the longest lag"):
        fid.predict(fit.model, record.segment(0.0, 0.4))
    odd = replace(fit.model, terms=(product_term([Lag("y", 9)]),), weights=(1.0,))
    assert isinstance(odd, NarxModel)
    with pytest.raises(ModelError, match="outside the model"):
        fid.predict(odd, record)


def test_names_that_the_native_half_does_not_know() -> None:
    one = np.ones((2, 1))
    given = (one[:, 0], one.T.copy(), one)
    with pytest.raises(ModelError, match="not defined"):
        _native.select_terms(*given, one[:0], "gaussian", 1.0, True, 0, "x", 0.0, 1)
    with pytest.raises(ModelError, match="not defined"):
        _native.select_terms(*given, one, "cubic", 1.0, True, 0, "terms", 0.0, 1)
    with pytest.raises(ModelError, match="not defined"):
        _native.select_terms(*given, one, "gaussian", 1.0, True, 0, "terms", 0.0, 1, "lasso", 0.0)


def test_a_true_linear_vehicle_does_not_lose_to_the_linear_model_by_chance() -> None:
    for seed in range(4):
        u, e = np.random.default_rng(seed).standard_normal((2, 600))
        y = lfilter([0.0, 0.5, 0.2], [1.0, -1.2, 0.5], u) + lfilter([0.2], [1.0, -1.2, 0.5], e)
        record = fid.Record.from_arrays(np.arange(600) / 20, inputs={"u": u}, outputs={"y": y})
        asked = fid.NarxStructure(("u",), "y", 2, 2, kernel=None, held_back=0.5)
        fit = fid.identify(asked, record)
        assert "loses-to-linear" not in {finding.code for finding in fit.findings}
    right, wrong = np.full(100, 0.1), np.linspace(0.5, 0.6, 100)
    assert free_run_findings([wrong], [right], None)[0].code == "loses-to-linear"
    assert free_run_findings([1.01 * e[:100]], [np.roll(e[:100], 1)], None) == ()


def _saturating(seed: int, noise: float) -> fid.Record:
    random = np.random.default_rng(seed)
    u, y = np.repeat(random.uniform(-1.0, 1.0, 100), 3), np.zeros(300)
    for t in range(2, 300):
        push = 0.5 * u[t - 1] - 0.3 * u[t - 1] ** 2
        y[t] = 1.4 * np.tanh(y[t - 1]) - 0.6 * y[t - 2] + push
    y = y + noise * random.standard_normal(300)
    return fid.Record.from_arrays(np.arange(300) / 10, inputs={"u": u}, outputs={"y": y})


@pytest.mark.parametrize(
    "kernel", ["gaussian", "multiquadric", "inverse_multiquadric", "thin_plate"]
)
def test_the_gradient_of_free_runs_is_that_of_differences(kernel: str) -> None:
    random = np.random.default_rng(0)
    scaling = Scaling(
        {"y": 0.0, "u": 0.0}, {"y": 1.0, "u": 1.0}, {"y": "1", "u": "1"}, 0.1, (-3.0, 3.0)
    )
    structure = fid.NarxStructure(("u",), "y", 2, 2, kernel=kernel, width=2.0)
    terms = (
        *(product_term([lag]) for lag in structure.lags),
        product_term([Lag("y", 1), Lag("y", 2), Lag("u", 1), Lag("y", 2)]),
        Term("1", centre=(0.1, 0.2, 0.3, 0.4)),
        Term("2", centre=(-0.5, 0.2, -0.3, 0.1)),
    )
    model = NarxModel(structure, terms, (0.9, -0.3, 0.4, 0.1, 0.05, 0.02, -0.03), scaling)
    runs = [
        (0.1 * random.standard_normal(60), random.uniform(-1.0, 1.0, (1, 60))) for _ in range(2)
    ]
    error = SimulationError(model, runs, centres=True)
    values, found = error.start, error.jacobian(error.start)
    assert values.size == 7 + (kernel != "thin_plate") + 8
    for place, column in enumerate(found.T):
        step = np.zeros(values.size)
        step[place] = 1e-6
        slope = (error.residuals(values + step) - error.residuals(values - step)) / 2e-6
        assert_close(column, slope, rtol=0.0, atol=1e-7, why="central differences")


def test_weights_of_free_runs_beat_those_one_step_ahead_and_linear_wins_where_it_should() -> None:
    asked = fid.NarxStructure(("u",), "y", 2, 2, kernel=None, degree=3)
    noisy, clean = _saturating(0, 0.1), _saturating(1, 0.0)
    ahead, free = (
        fid.identify(replace(asked, focus=focus), noisy) for focus in ("prediction", "simulation")
    )
    one, other = (fid.predict(fit, clean).rms_error["y"] for fit in (ahead, free))
    assert other < 0.6 * one
    assert "terms-by-free-run" in {finding.code for finding in free.findings}
    assert all(each.stderr is None for each in free.parameters.values())
    truth = fid.PolynomialModel(("u",), "y", 0.1, a=[1, -1.4, 0.7], b=[[0.3]], nk=(1,))
    record = noisy.replace({"y": truth.simulate(noisy)})
    noise = 0.1 * np.random.default_rng(2).standard_normal(300)
    record = record.replace({"y": record["y"] + noise})
    linear = fid.identify(replace(asked, focus="simulation"), record)
    assert "linear-delivered" in {finding.code for finding in linear.findings}
    assert {term.degree for term in linear.model.terms} <= {0, 1}
    unseen = clean.replace({"y": truth.simulate(clean)})
    assert fid.predict(linear, unseen).fit_percent["y"] > 95.0
    with pytest.raises(OptionError, match="neither penalised nor held back"):
        replace(asked, focus="simulation", held_back=0.5)
