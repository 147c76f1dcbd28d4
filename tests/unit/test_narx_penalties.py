"""NARX fits with penalties, with samples held back, and their residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.errors import DataError, OptionError
from flightid.identification.narx.candidates import candidate_terms, product_columns
from flightid.identification.narx.fit import _select
from flightid.identification.narx.regressors import regressors_of
from tests.closeness import assert_close
from tests.narx_records import quadratic

MODEL = fid.NarxStructure(("u",), "y", 2, 2, kernel=None, degree=2, stop="aic")


def _problem(fit: fid.Fit, record: fid.Record) -> tuple[np.ndarray, np.ndarray]:
    """Columns (n_samples, n_terms) of the chosen products and the target of the weights."""
    _, data = regressors_of(fit.structure, fit.model.scaling, [record])
    terms = [item.term for item in fit.details.chosen]
    return product_columns(terms, fit.structure, data.vectors).T, data.target


def test_local_penalties_are_ridge_along_orthogonal_parts_with_bayesian_errors() -> None:
    record = quadratic(noise=0.2)
    fit = fid.identify(replace(MODEL, regularisation="local"), record)
    columns, target = _problem(fit, record)
    q, r = np.linalg.qr(columns)
    lengths = np.diag(r) ** 2
    penalties = np.array([item.penalty for item in fit.details.chosen])
    share = lengths / (lengths + penalties)
    inverse = np.linalg.inv(r)
    weights = inverse @ (share * (q.T @ target))
    assert_close(
        [item.weight for item in fit.details.chosen], weights, rtol=1e-8, why="same problem"
    )
    noise = np.sum((target - columns @ weights) ** 2) / (target.size - share.sum())
    errors = np.sqrt(np.diag(noise * inverse @ np.diag(share) @ inverse.T))
    assert_close([item.stderr for item in fit.details.chosen], errors, rtol=1e-8, why="posterior")
    # Chen's update leaves the penalties where they are.
    g = share * (q.T @ target) / np.diag(r)
    update = share[5:] * noise / g[5:] ** 2
    assert_close(update, penalties[5:], rtol=1e-8, why="fixed point of the evidence")
    assert np.all(penalties[:5] == 0)
    assert "penalty λ" in fit.details.terms_table().to_text()
    radial = any(item.term.centre for item in fit.details.chosen)
    assert radial == any("centre" in note for note in fit.details.terms_table().notes)
    text = fit.summary().to_text()
    assert "posterior" in text


def test_local_penalties_never_add_terms_and_keep_the_true_one() -> None:
    for seed in range(5):
        record = quadratic(seed=seed, noise=0.2)
        plain = fid.identify(MODEL, record)
        local = fid.identify(replace(MODEL, regularisation="local"), record)
        names = {item.term.name for item in local.details.chosen}
        assert "u(t-2)^2" in names
        assert names <= {item.term.name for item in plain.details.chosen}


def test_a_uniform_penalty_shrinks() -> None:
    record = quadratic(noise=0.2)
    radial = replace(MODEL, kernel="gaussian", degree=1, stop="terms", maximum_terms=12)
    plain = fid.identify(radial, record)
    ridge = fid.identify(replace(radial, regularisation="uniform", penalty=5.0), record)
    size = [np.linalg.norm([i.weight for i in fit.details.chosen[5:]]) for fit in (plain, ridge)]
    assert size[1] < 0.5 * size[0]
    assert ridge.details.chosen[-1].sum_of_squares > plain.details.chosen[-1].sum_of_squares
    assert {item.penalty for item in ridge.details.chosen[5:]} == {5.0}


@pytest.mark.parametrize("kernel", [None, "gaussian"])
def test_held_back_samples_alone_make_weights_and_errors(kernel: str | None) -> None:
    record = quadratic(noise=0.1)
    degree = 1 if kernel else 2
    model = replace(MODEL, held_back=0.4, kernel=kernel, degree=degree, maximum_terms=9)
    fit = fid.identify(model, record)
    assert fit.details.n_samples == round(0.4 * 398)
    first, _ = regressors_of(model, fit.model.scaling, [record])
    assert first.target.size == 398 - fit.details.n_samples
    choice = _select(model, candidate_terms(model, first.vectors), first).chosen
    assert {item.term for item in choice} == {item.term for item in fit.details.chosen}
    assert "took no part in the choice" in fit.summary().to_text()
    if kernel is None:
        columns, target = _problem(fit, record)
        weights, squares, *_ = np.linalg.lstsq(columns, target, rcond=None)
        assert_close(
            [i.weight for i in fit.details.chosen], weights, rtol=1e-8, why="least squares"
        )
        covariance = np.linalg.inv(columns.T @ columns) * squares[0]
        errors = np.sqrt(np.diag(covariance) / (target.size - len(weights)))
        assert_close([i.stderr for i in fit.details.chosen], errors, rtol=1e-8, why="least squares")
    else:
        assert {item.term.kind for item in fit.details.chosen} >= {"linear", "radial"}
        assert (
            fid.predict(fit.model, quadratic(seed=4)).rms_error["y"]
            < fit.details.baseline_free_run_rms
        )


def test_residuals_go_into_the_residual_tests() -> None:
    records = [quadratic(noise=0.1), quadratic(seed=1, noise=0.1, n=300)]
    good = fid.identify(replace(MODEL, stop="bic"), records)
    left = good.residuals
    assert [record.n_samples for record in left] == [398, 298]
    run = fid.predict(good.model, records[0], 1)
    assert_close(left[0]["y"], run.residual("y")[2:], atol=1e-14, why="definition")
    assert left[0].unit("y") == "rad"
    tests = fid.residual_tests(good)
    assert {test.verdict for test in tests.tests} == {"pass"}
    poor = fid.identify(replace(MODEL, degree=1), records)
    tests = fid.residual_tests(poor)
    assert tests.test("u²ε", "y", "u").verdict == "fail"
    alone = good.records[0].residual_record()
    assert_close(
        alone["y"][2:],
        fid.predict(good.model, records[0]).residual("y")[2:],
        atol=1e-12,
        why="the free run's errors",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"regularisation": "lasso"}, "regularisation is not known"),
        ({"penalty": -1.0}, "penalty is too small"),
        ({"penalty": 1.0}, "penalty and regularisation disagree"),
        ({"regularisation": "uniform"}, "penalty and regularisation disagree"),
        ({"held_back": 1.0}, "held_back is too large"),
        ({"held_back": 0.5, "regularisation": "local"}, "no standard errors to hold samples"),
    ],
)
def test_options_outside_their_range(change: dict[str, object], match: str) -> None:
    with pytest.raises(OptionError, match=match):
        replace(MODEL, **change)  # type: ignore[arg-type]


def test_too_few_samples_held_back() -> None:
    with pytest.raises(DataError, match="too few samples for the lags"):
        fid.identify(replace(MODEL, held_back=0.01), quadratic())
    many = replace(MODEL, held_back=0.025, degree=3, stop="terms", maximum_terms=20)
    with pytest.raises(DataError, match="too few samples are held back"):
        fid.identify(many, quadratic(noise=0.1))


@pytest.mark.slow
def test_errors_of_terms_that_are_not_there_over_300_runs() -> None:
    """Chosen products beside the true one have weight zero: how often does the interval miss it?"""
    model = replace(MODEL, output_lags=3, input_lags=3, degree=3, maximum_terms=20)
    missed: dict[float, list[bool]] = {0.0: [], 0.5: []}
    for share, found in missed.items():
        for seed in range(300):
            record = quadratic(600, seed=seed, noise=0.2)
            fit = fid.identify(replace(model, held_back=share), record)
            found.extend(
                abs(item.weight) > 1.96 * item.stderr
                for item in fit.details.chosen[7:]
                if item.term.name != "u(t-2)^2"
            )
    rates = {share: float(np.mean(found)) for share, found in missed.items()}
    assert 0.03 < rates[0.5] < 0.07, rates
    assert rates[0.0] > 0.3, rates


def test_many_samples_are_clustered_before_terms_are_chosen() -> None:
    vectors = np.random.default_rng(0).standard_normal((60_000, 2))
    model = fid.NarxStructure(("u",), "y", 1, 1)
    assert len(candidate_terms(model, vectors).radial) <= 334
    assert len(candidate_terms(model, vectors[:300]).radial) == 300
