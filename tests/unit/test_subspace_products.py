"""Products in place of long matrices: rows of Hankel matrices, slopes of predictors."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.identification.subspace import data as subspace_data
from flightid.identification.subspace.data import gather
from flightid.identification.subspace.hankel_products import hankel_products
from flightid.identification.subspace.prediction_errors import Predictor
from flightid.identification.subspace.slopes import triangle_of_products
from tests.closeness import assert_close
from tests.innovations_records import PAIR, flown


def _hankel(joint: np.ndarray, blocks: int) -> np.ndarray:
    columns = joint.shape[1] - blocks + 1
    return np.vstack([joint[:, row : row + columns] for row in range(blocks)])


@pytest.mark.parametrize("levels", [False, True])
@pytest.mark.parametrize(("k", "n_samples", "blocks"), [(2, 700, 9), (3, 40_000, 4), (1, 12, 12)])
def test_products_of_hankel_rows_are_those_of_the_matrix(k, n_samples, blocks, levels):
    joint = np.random.default_rng(k).standard_normal((k, n_samples)) + 0.5
    rows = _hankel(joint, blocks)
    rows = rows - rows.mean(axis=1, keepdims=True) * levels
    found = hankel_products(joint, blocks, levels=levels)
    assert_close(found, rows @ rows.T, why="the same sums", rtol=1e-11, atol=1e-9)


def test_a_signal_that_fades_within_the_blocks_is_left_to_the_matrix():
    fading = 0.1 ** np.arange(400.0)[None]
    assert hankel_products(fading, 2, levels=False) is not None
    assert hankel_products(fading, 6, levels=False) is None


def test_factors_by_products_are_those_of_the_matrix(monkeypatch):
    structure = fid.InnovationsModel.subspace(("u", "v"), ("y", "z"))
    data = gather(structure, [flown(PAIR, 1, n=900, noise=0.5), flown(PAIR, 2, n=800, noise=0.5)])
    rows = np.arange(40)
    found = data.hankel_factor(10, rows)
    monkeypatch.setattr(subspace_data, "LONG", 1e9)
    whole = data.hankel_factor(10, rows)
    assert_close(found.T @ found, whole.T @ whole, why="the same rows", rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize("offsets", ["none", "mean"])
@pytest.mark.parametrize("initial_state", ["zero", "estimate"])
def test_a_triangle_without_its_slopes_is_theirs(offsets, initial_state):
    """Both outputs, two records, levels and starts eliminated: R of [slopes, errors]."""
    structure = fid.InnovationsModel.subspace(("u", "v"), ("y", "z"), offsets=offsets)
    data = gather(structure, [flown(PAIR, 1, n=300, noise=0.5), flown(PAIR, 2, n=200, noise=0.5)])
    a, b, c, d, k = PAIR.matrices
    size = data.scales
    matrices = a, b, c / size[:, None], d / size[:, None], k * size
    predictor = Predictor.of(data, matrices, direct=True, initial_state=initial_state)
    whiten = np.array([[2.0, 0.0], [-0.4, 1.5]])
    basis = np.linalg.qr(
        np.random.default_rng(4).standard_normal((len(predictor.pack(matrices)), 7))
    )[0]
    left, own = predictor.residuals(matrices, whiten)
    found = predictor.triangle(matrices, whiten, basis, left, own)
    assert found is not None
    slopes = predictor.jacobian(matrices, whiten, basis, own)
    errors = np.concatenate([each.ravel() for each in left])
    triangle = np.linalg.qr(slopes, mode="r")
    triangle *= np.sign(np.diag(triangle))[:, None]
    assert_close(found[:7, :7].T, triangle, why="Cholesky of products", rtol=1e-9, atol=1e-9)
    gradient = found[:7, :7] @ found[7, :7]
    assert_close(gradient, slopes.T @ errors, why="Qᵀr", rtol=1e-8, atol=1e-8)


def test_products_that_lost_digits_make_no_triangle():
    """Alike slopes, slopes that own numbers explain, and such as have no number."""
    alike = np.array([[1.0, 1.0, 1.0], [1.0, 1.0 + 1e-8, 1.0], [1.0, 1.0, 2.0]])
    assert triangle_of_products([alike], 2) is None
    explained = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0 + 1e-6]])
    assert triangle_of_products([explained], 1) is None
    assert triangle_of_products([np.full((2, 2), np.nan)], 1) is None
    assert triangle_of_products([np.eye(3)], 1) is not None
