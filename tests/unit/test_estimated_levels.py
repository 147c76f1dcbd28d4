"""Noise that was estimated: errors longer than its weights promise, and Student's quantile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flightid as fid
from flightid.identification.frequency_domain.error_model import KNOWN, ErrorModel, Run
from flightid.responses.errors.covariance import WindowedErrors
from flightid.responses.errors.noise import NoiseSpectrum
from flightid.responses.errors.random_error import Points
from flightid.uncertainty.blocks import JointResiduals, RecordBlock
from flightid.uncertainty.coloured_residuals import residual_covariance
from flightid.uncertainty.estimated_levels import EstimatedLevels
from flightid.uncertainty.quantiles import half_width
from tests.closeness import assert_close
from tests.joint_flights import BAND, flight, lag, swept


@pytest.fixture(scope="module")
def response() -> fid.FrequencyResponse:
    return swept(lag(), 3, noise=0.3)


def _errors(response: fid.FrequencyResponse) -> tuple[WindowedErrors, Points, np.ndarray]:
    errors = response.errors
    assert isinstance(errors, WindowedErrors)
    points = Points(0, np.array([0]), np.arange(0, 30, 3))
    return errors, points, np.random.default_rng(0).standard_normal((2, 20))


def test_means_of_two_noises_are_as_meier_has_them() -> None:
    """Meier (1953), Biometrics 9(1), eq. 6: v (1 + 4 Σ w (1 - w) / f), w a mean's weight."""
    variances, freedom = np.array([1.0, 0.25]), np.array([8.0, 20.0])
    heard = (1.0 / variances).reshape(2, 1, 1)
    levels = EstimatedLevels(heard, heard, freedom)
    whole = 1.0 / np.sum(1.0 / variances)
    weights = whole / variances
    solve = np.array([[whole]])
    added = solve @ levels.added(solve) @ solve
    assert_close(
        added[0, 0],
        4.0 * whole * np.sum(weights * (1.0 - weights) / freedom),
        rtol=1e-12,
        why="rounding",
    )
    # Satterthwaite (1946), eq. 17, of a variance whose parts are the squares of the weights.
    parts = weights**2 * variances
    assert_close(levels.doubt(solve)[0], np.sum(parts**2 / freedom), rtol=1e-12, why="rounding")


def test_parts_of_the_levels_add_up_to_the_covariance(response: fid.FrequencyResponse) -> None:
    errors, points, gain = _errors(response)
    (found,) = errors.by_level([points], [gain])
    assert found is not None
    whole = errors.covariances([points])[0]
    assert_close(
        found.products.sum(axis=0),
        whole @ gain.T,
        rtol=1e-9,
        atol=1e-12 * whole.max(),
        why="rounding",
    )
    # 18 bins of 40 s, less three numbers each of the response and of the leakage: twelve complex.
    assert np.all(found.freedom == 24.0)


def test_a_part_is_what_its_level_moves(response: fid.FrequencyResponse) -> None:
    errors, points, gain = _errors(response)
    (found,) = errors.by_level([points], [gain])
    assert found is not None
    level, step = 4, 1e-5
    density = errors.noise.density.copy()
    density[:, level] *= 1.0 + step
    moved = replace(errors, known_noise=replace(errors.noise, density=density))
    change = (moved.covariances([points])[0] - errors.covariances([points])[0]) / step
    size = np.abs(change @ gain.T).max()
    assert_close(
        found.products[level], change @ gain.T, rtol=1e-4, atol=1e-4 * size, why="difference"
    )


def test_noise_without_levels_is_held_for_known(response: fid.FrequencyResponse) -> None:
    errors, points, gain = _errors(response)
    given = NoiseSpectrum(errors.noise.omega_rad_s, errors.noise.density)
    assert replace(errors, known_noise=given).by_level([points], [gain]) == [None]


def test_no_kernel_is_made_to_ask_whether_levels_are_known(
    response: fid.FrequencyResponse, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors, points, _ = _errors(response)
    model = ErrorModel(KNOWN, (Run(0, 1, points, np.arange(20)),), errors)

    def refused(*_: object) -> object:
        raise AssertionError("kernels are most of what a fit's errors take")

    monkeypatch.setattr(WindowedErrors, "_kernels", refused)
    assert not model.noise_taken_for_known


@pytest.mark.parametrize("cost", ["likelihood", "coherence"])
def test_a_fit_to_a_response_has_students_quantile(
    response: fid.FrequencyResponse, cost: str
) -> None:
    fit = fid.identify(lag(), response, band_rad_s=BAND, cost=cost)
    for each in fit.parameters.values():
        assert each.freedom is not None
        assert each.stderr is not None
        # Eight groups of bins lie in the band; no sum of them is worse known than one of them.
        assert 24.0 < each.freedom < 9 * 24.0
        low, high = each.interval95 or (0.0, 0.0)
        assert_close(
            high - low,
            2.0 * half_width(0.95, each.freedom) * each.stderr,
            rtol=1e-9,
            why="rounding",
        )


def test_a_joint_fit_is_as_sure_as_both_its_noises(response: fid.FrequencyResponse) -> None:
    record = flight(lag(), 4, noise=0.3)
    alone = fid.identify(lag(), response, band_rad_s=BAND, cost="likelihood")
    both = fid.identify(lag(), (response, record), band_rad_s=BAND)
    for name in both.names:
        least, most = alone.parameters[name].freedom, both.parameters[name].freedom
        assert least is not None
        assert most is not None
        assert least < most < 1000.0


@pytest.mark.parametrize("coloured", [False, True])
def test_a_record_beside_a_response_bears_the_errors_of_its_weights(*, coloured: bool) -> None:
    """Half of what is known is weighed by a level: Meier's 4 w (1 - w) / f of all of it."""
    residual = np.random.default_rng(1).standard_normal((1, 400))
    slopes, heard = np.ones((400, 1)), np.array([[[400.0]]])
    for freedom in (10.0, 40.0):
        plain, doubted = (
            residual_covariance(
                [RecordBlock.of(np.ones((1, 400, 1)), np.ones((1, 400, 0)), residual)],
                JointResiduals(slopes, slopes, levels=levels),
                coloured=coloured,
            )
            for levels in (None, EstimatedLevels(heard, heard, np.array([freedom])))
        )
        added = 800.0 * (doubted.covariance - plain.covariance)
        assert_close(added, np.array([[1.0 / freedom]]), rtol=1e-9, why="rounding")
        assert doubted.freedom < plain.freedom
