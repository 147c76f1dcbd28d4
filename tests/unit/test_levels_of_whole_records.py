"""From how much noise local polynomials and noise models know their errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.responses.errors.local_errors import LocalErrors
from flightid.responses.errors.prewhitened import PrewhitenedErrors
from flightid.responses.errors.random_error import LevelledErrors, Points
from flightid.responses.store import read_response, write_response
from flightid.uncertainty.quantiles import half_width
from tests.closeness import assert_close
from tests.joint_flights import BAND, lag, swept

Array = np.ndarray


def response(estimator: str, n_omega: int = 30) -> fid.FrequencyResponse:
    """A sweep of forty seconds in noise."""
    return swept(lag(), 3, noise=0.3, estimator=estimator, n_omega=n_omega)


@pytest.mark.parametrize("estimator", ["local_polynomial", "prewhitened"])
def test_parts_of_the_levels_add_up(estimator: str) -> None:
    errors = response(estimator).errors
    assert isinstance(errors, LevelledErrors)
    points = Points(0, np.array([0]), np.arange(0, 30, 3))
    gain = np.random.default_rng(0).standard_normal((2, 20))
    (found,) = errors.by_level([points], [gain])
    assert found is not None
    (whole,) = errors.covariances([points])
    size = np.abs(whole @ gain.T).max()
    assert_close(
        found.products.sum(axis=0), whole @ gain.T, rtol=1e-9, atol=1e-9 * size, why="rounding"
    )
    combined, (told,) = errors.combined_by_level([points], [gain], 2)
    parts = np.einsum("gpn,np->gn", found.products, gain)
    assert_close(told.variances, parts, rtol=1e-9, atol=1e-9 * size, why="rounding")
    assert_close(told.variances.sum(axis=0), np.diag(combined), rtol=1e-9, why="rounding")


def test_a_level_of_local_polynomials_is_what_its_density_moves() -> None:
    errors = response("local_polynomial").errors
    assert isinstance(errors, LocalErrors)
    points, gain = Points(0, np.array([0]), np.arange(30)), np.eye(60)
    (found,) = errors.by_level([points], [gain])
    assert found is not None
    level, step = 4, 1e-5
    density = errors.noise.density.copy()
    density[:, level] *= 1.0 + step
    moved = replace(errors, noise=replace(errors.noise, density=density))
    change = (moved.covariances([points])[0] - errors.covariances([points])[0]) / step
    assert_close(
        found.products[level], change, rtol=1e-3, atol=1e-4 * np.abs(change).max(), why="difference"
    )


def test_fits_on_the_same_bins_count_once() -> None:
    alone = _freedom(response("local_polynomial", 4).errors, [0, 3])
    assert np.all(alone == 24.0)  # 18 bins less three numbers each of response and leakage, twice
    errors = response("local_polynomial").errors
    both, once = _freedom(errors, [0, 1]), _freedom(errors, [0])
    assert np.all(both >= 0.5 * once)
    assert np.all(both < once)


def _freedom(errors: object, frequencies: list[int]) -> Array:
    assert isinstance(errors, LocalErrors)
    gain = np.ones((1, 2 * len(frequencies)))
    (found,) = errors.by_level([Points(0, np.array([0]), np.array(frequencies))], [gain])
    assert found is not None
    return found.freedom


def test_a_noise_model_knows_its_equations_less_its_numbers() -> None:
    errors = response("prewhitened").errors
    assert isinstance(errors, PrewhitenedErrors)
    model = errors.model
    (found,) = errors.by_level([Points(0, np.array([0]), np.arange(3))], [np.ones((1, 6))])
    assert found is not None
    equations = sum(map(len, model.regressors))
    assert found.freedom.tolist() == [equations - len(model.coefficients), np.inf]


@pytest.mark.parametrize("estimator", ["local_polynomial", "prewhitened"])
def test_a_fit_has_students_quantile(estimator: str) -> None:
    fit = fid.identify(lag(), response(estimator), band_rad_s=BAND)
    for each in fit.parameters.values():
        assert each.freedom is not None
        assert 24.0 < each.freedom < 2000.0
        low, high = each.interval95 or (0.0, 0.0)
        assert_close(
            high - low,
            2.0 * half_width(0.95, each.freedom) * (each.stderr or 0.0),
            rtol=1e-9,
            why="rounding",
        )


def test_a_fit_says_that_a_file_holds_no_levels(tmp_path: Path) -> None:
    measured = response("composite")
    read = read_response(write_response(measured, tmp_path / "p.nc"))
    said = []
    for each in (measured, read):
        fit = fid.identify(lag(), each, band_rad_s=BAND)
        said.append([one for one in fit.findings if one.code == "noise-taken-for-known"])
        freedom = [one.freedom for one in fit.parameters.values() if one.interval95]
        assert freedom
        assert all((one is None or np.isinf(one)) == bool(said[-1]) for one in freedom)
    assert not said[0]
    assert len(said[1]) == 1
    assert "take that noise for known" in said[1][0].message
