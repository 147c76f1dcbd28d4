"""Standard errors under coloured residuals: whatever is left over, they are positive and finite."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from flightid.uncertainty.blocks import RecordBlock
from flightid.uncertainty.coloured_residuals import (
    ResidualCovariance,
    _lifted,
    residual_covariance,
)
from flightid.uncertainty.residual_colour import colour_findings
from tests.closeness import assert_close

Array = np.ndarray


def _noise(random: np.random.Generator, kind: int, shape: tuple[int, int]) -> Array:
    """Nine kinds of residuals, from white to what no one should fit."""
    white = random.standard_normal(shape)
    time = np.arange(shape[1])
    match kind:
        case 1:
            return signal.lfilter([1.0], [1.0, -random.uniform(0.9, 1.0)], white)
        case 2:
            return np.cumsum(white, axis=1)
        case 3:
            return np.cumsum(np.cumsum(white, axis=1), axis=1)
        case 4:
            return np.ones(shape) * white[:, :1]
        case 5:
            return 1e-14 * white
        case 6:
            return np.sin(random.uniform(0.01, 3.0) * time + random.uniform(0, 6, (shape[0], 1)))
        case 7:
            return signal.lfilter([1.0], [1.0, -1.998 * np.cos(0.2), 0.998], white)
        case 8:
            return white * (random.uniform(size=shape) < 0.02)
    return white


def _fitted(random: np.random.Generator, kind: int, longest: int) -> list[RecordBlock]:
    """What least squares leaves of noise on one or two records, whitened."""
    n_outputs, n_shared = int(random.choice([1, 1, 2, 5])), int(random.integers(1, 4))
    scale = 10.0 ** random.uniform(-3, 3, n_shared)
    parts, noises = [], []
    for _ in range(int(random.choice([1, 1, 1, 2]))):
        n, n_own = int(random.integers(20, longest)), int(random.integers(0, 3))
        steps = random.standard_normal((n_outputs, n, n_shared))
        shared = scale * signal.lfilter([1.0], [1.0, -random.uniform(0.5, 0.999)], steps, axis=1)
        own = np.zeros((n_outputs, n, min(n_own, n_outputs)))
        for place in range(own.shape[2]):
            own[place, :, place] = 1.0
        parts.append((shared, own))
        noises.append(_noise(random, kind, (n_outputs, n)))
    columns = n_shared + sum(own.shape[2] for _, own in parts)
    jacobian = np.zeros((sum(noise.size for noise in noises), columns))
    row, column = 0, n_shared
    for shared, own in parts:
        span = slice(row, row + shared[..., 0].size)
        jacobian[span, :n_shared] = shared.reshape(-1, n_shared)
        jacobian[span, column : column + own.shape[2]] = own.reshape(shared[..., 0].size, -1)
        row, column = span.stop, column + own.shape[2]
    size = np.linalg.norm(jacobian, axis=0)
    measured = np.concatenate([noise.ravel() for noise in noises])
    left = measured - jacobian / size @ np.linalg.lstsq(jacobian / size, measured, rcond=None)[0]
    ends = np.cumsum([noise.size for noise in noises])[:-1]
    residuals = [
        each.reshape(noise.shape) for each, noise in zip(np.split(left, ends), noises, strict=True)
    ]
    deviation = np.sqrt(np.mean(np.concatenate(residuals, axis=1) ** 2, axis=1, keepdims=True))
    deviation = np.maximum(deviation, 1e-150)
    return [
        RecordBlock.of(
            shared / deviation[..., None], own / deviation[..., None], residual / deviation
        )
        for (shared, own), residual in zip(parts, residuals, strict=True)
    ]


def _is_sound(found: ResidualCovariance) -> bool:
    variances = [np.diag(each) for each in (found.covariance, *found.own)]
    positive = all(np.all(np.isfinite(each)) and np.all(each > 0.0) for each in variances)
    return positive and bool(np.all(found.freedom >= 1.0))


def _unsound(count: int, longest: int) -> list[int]:
    random = np.random.default_rng(0)
    offenders = []
    for place in range(count):
        found = residual_covariance(_fitted(random, place % 9, longest))
        absurd = found.colour[1] > 1000.0
        if absurd or not _is_sound(found):
            offenders.append(place)
    return offenders


@pytest.mark.nightly
def test_no_residual_makes_a_standard_error_zero_or_endless() -> None:
    assert _unsound(180, 45) == []


@pytest.mark.slow
def test_no_residual_of_longer_records_or_more_draws_either() -> None:
    assert _unsound(2000, 45) == []
    assert _unsound(5000, 400) == []


def test_white_residuals_keep_the_inverse_information() -> None:
    random = np.random.default_rng(1)
    slopes = random.standard_normal((2, 4000, 3))
    found = residual_covariance(
        [RecordBlock.of(slopes, np.zeros((2, 4000, 0)), random.standard_normal((2, 4000)))]
    )
    assert_close(found.white, np.linalg.inv(np.einsum("onp,onq->pq", slopes, slopes)), rtol=1e-9,
                 atol=1e-12, why="the same matrix")  # fmt: skip
    assert_close(found.colour, (1.0, 1.0, 1.0), rtol=0.05, why="8000 samples")
    assert "order 0, 0" in found.assumed


def test_colour_is_that_of_the_known_answer() -> None:
    """A constant in AR(1) noise: the variance grows by (1 + a) / (1 - a)."""
    a, n = 0.9, 6000
    noise = signal.lfilter([1.0], [1.0, -a], np.random.default_rng(2).standard_normal((1, n)))
    noise = (noise - noise.mean()) / noise.std()
    found = residual_covariance([RecordBlock.of(np.ones((1, n, 1)), np.zeros((1, n, 0)), noise)])
    assert_close(found.colour[1], np.sqrt((1 + a) / (1 - a)), rtol=0.08, why="6000 samples")


def test_absurd_ratios_are_red() -> None:
    assert colour_findings(0.5, 1.4) == []
    (finding,) = colour_findings(0.5, 8.0)
    assert (finding.code, finding.light.value) == ("residuals-coloured", "amber")
    for ratios in ((1e-4, 1.0), (1.0, 1e4)):
        (finding,) = colour_findings(*ratios)
        assert (finding.code, finding.light.value) == ("colour-absurd", "red")


def test_parameters_that_are_hardly_told_apart_have_a_symmetric_covariance() -> None:
    random = np.random.default_rng(4)
    slow = signal.lfilter([1.0], np.poly([0.99, 0.98, 0.97, 0.96]), random.standard_normal(3000))
    late = np.stack([np.roll(slow, lag) for lag in range(6)], axis=1)[10:]
    residual = signal.lfilter([1.0], [1.0, -0.9], random.standard_normal((1, 2990)))
    found = residual_covariance([RecordBlock.of(late[None], np.ones((1, 2990, 1)), residual)])
    assert np.array_equal(found.covariance, found.covariance.T)


def test_a_covariance_of_nearly_equal_sensitivities_has_no_negative_direction():
    """Alike to ten digits: their squares alone hold none of what tells them apart."""
    random = np.random.default_rng(0)
    noise = signal.lfilter([1.0], [1.0, -0.9], random.standard_normal(500))
    common, apart = random.standard_normal((2, 500))
    slopes = np.stack([common, common + 1e-10 * apart, common + 1e-5 * np.roll(apart, 7)], axis=1)
    block = RecordBlock.of(slopes[None], np.zeros((1, 500, 0)), noise[None])
    found = residual_covariance([block]).covariance
    size = np.sqrt(np.diag(found))
    assert np.linalg.eigvalsh(found / np.outer(size, size))[0] > 0.0


def test_a_covariance_that_rounding_bent_is_one_again() -> None:
    """Three errors of which two are one, with triangles that differ and a power below nothing."""
    root = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1e-3]])
    plain = root @ root.T
    bent = plain + 1e-13 * np.array([[0.0, 9.0, 0.0], [7.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert np.linalg.eigvalsh(0.5 * (bent + bent.T))[0] < 0.0
    whole = _lifted(bent, plain)
    size = np.sqrt(np.diag(whole))
    assert np.linalg.eigvalsh(whole / np.outer(size, size))[0] > 0.0
    assert_close(whole, plain, rtol=1e-9, atol=1e-15, why="moved by roundings alone")
    assert np.array_equal(_lifted(plain + np.eye(3), plain), plain + np.eye(3))
