"""Products with lagged inputs, and triangles of many rows, against those of whole columns."""

from __future__ import annotations

import numpy as np
import pytest

from flightid.uncertainty import triangle
from flightid.uncertainty.lagged_inputs import LaggedInputs
from flightid.uncertainty.lagged_products import explained
from flightid.uncertainty.triangle import ROWS, orthonormal, triangle_of_parts, triangle_of_rows
from tests.closeness import assert_close


def test_products_are_those_of_the_columns() -> None:
    random = np.random.default_rng(0)
    inputs = np.cumsum(random.standard_normal((2, 300)), axis=1)
    inputs[1, :290] = 0.0
    heard = 1.0 + random.standard_normal((300, 3))
    lagged = LaggedInputs(inputs - inputs.mean(axis=1, keepdims=True), 9)
    columns, size = lagged.columns, np.linalg.norm(lagged.columns, axis=0)
    squares = lagged.squares / np.outer(size, size)
    expected = (columns / size).T @ (columns / size)
    assert_close(squares, expected, atol=1e-13, why="sums of 300 products")
    expected = heard.T @ columns / size
    for parts in ([heard], [heard[:, :1], heard[:, 1:]]):
        found = np.concatenate(lagged.products(parts))
        assert_close(found / size, expected, atol=1e-12, why="sums of 300 products")


def test_products_that_lost_their_last_digits_still_explain() -> None:
    """Three columns that are one, and products off by 1e-9: indefinite, so no Cholesky factor."""
    column = np.random.default_rng(0).standard_normal(200)
    products = np.full((3, 3), column @ column)
    products[0, 1] = products[1, 0] = (1.0 + 1e-9) * products[0, 0]
    target = 2.0 * column
    found = explained(products, np.full((3, 1), column @ target))
    assert_close(found, target @ target, rtol=1e-6, why="all of it is explained")


def test_a_triangle_holds_all_rows() -> None:
    columns = np.random.default_rng(0).standard_normal((5 * ROWS + 7, 3)) * [1.0, 1e6, 1e-6]
    columns[:, 2] += 1e-6 * columns[:, 0]
    size = np.linalg.norm(columns, axis=0)
    found, known = triangle_of_rows(columns), np.linalg.qr(columns, mode="r")
    assert_close(np.abs(found) / size, np.abs(known) / size, atol=1e-14, why="rounding")
    assert triangle_of_rows(np.zeros((2 * ROWS, 0))).shape == (0, 0)
    # Products know nothing of what one column adds to another at the twelfth digit of a square.
    alike = columns.copy()
    alike[:, 1] = columns[:, 0] + 1e-12 * columns[:, 1]
    known = np.abs(np.linalg.qr(alike, mode="r"))
    parts = triangle_of_parts(lambda: np.array_split(alike, 3))
    for found in (triangle_of_rows(alike), parts):
        assert_close(np.abs(found[1, 1]), known[1, 1], rtol=1e-8, why="digits of one column")
    for scale in (1e200, 1e-200):
        known = np.abs(np.linalg.qr(scale * columns, mode="r"))
        found = np.abs(triangle_of_rows(scale * columns))
        assert_close(found / scale, known / scale, atol=1e-6, why="squares over- and underflow")
    blank = columns * [1.0, 0.0, 1.0]
    found = triangle_of_rows(blank)
    assert_close(found.T @ found, blank.T @ blank, rtol=1e-12, why="a column of zeros stays one")


def test_two_rounds_of_products_bring_the_digits_of_like_columns_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    columns = np.random.default_rng(1).standard_normal((3 * ROWS, 4))
    columns[:, 2] = columns[:, 0] + 1e-4 * columns[:, 2]
    known = np.abs(np.linalg.qr(columns, mode="r"))
    monkeypatch.delattr(triangle, "_row_by_row")  # which takes longer
    found = np.abs(triangle_of_rows(columns))
    assert_close(found, known, atol=1e-11, why="rounding of two ways")
    assert_close(found[2, 2], known[2, 2], rtol=1e-10, why="ten digits of what is left")


def test_columns_that_repeat_another_leave_the_triangle_of_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # A bias of an output that is a state has the effect of that state's start, number by number.
    columns = np.random.default_rng(3).standard_normal((2 * ROWS, 6))
    columns[:, 4], columns[:, 5] = columns[:, 1], columns[:, 1]

    def refused(_: object) -> None:
        raise AssertionError("row by row")

    monkeypatch.setattr(triangle, "_row_by_row", refused)
    for found in (
        triangle_of_rows(columns),
        triangle_of_parts(lambda: np.array_split(columns, 3)),
        # Where products are known, columns that look alike are all that is asked for.
        triangle_of_parts(lambda: refused(None), columns.T @ columns, lambda k: [columns[:, k]]),
    ):
        assert np.allclose(found.T @ found, columns.T @ columns, rtol=0.0, atol=1e-10)
        assert np.array_equal(found, np.triu(found))
        assert np.array_equal(np.diag(found) == 0.0, [False] * 4 + [True] * 2)


@pytest.mark.parametrize("apart", [1.0, 1e-4, 1e-9])
def test_orthonormal_columns_are_so_however_alike_the_columns_are(apart: float) -> None:
    columns = np.random.default_rng(4).standard_normal((3 * ROWS, 4)) * [1.0, 1e5, 1e-5, 1.0]
    columns[:, 3] = columns[:, 0] + apart * columns[:, 3]
    basis, found = orthonormal(columns)
    assert_close(basis.T @ basis, np.eye(4), atol=1e-14, why="rounding")
    assert np.array_equal(found, np.triu(found))
    left = (basis @ found - columns) / np.linalg.norm(columns, axis=0)
    assert_close(left, np.zeros_like(left), atol=1e-14, why="rounding")
