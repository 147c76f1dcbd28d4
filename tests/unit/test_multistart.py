"""Starts of a search: where bounds are known, and where only values are."""

from __future__ import annotations

import numpy as np

from flightid.identification.multistart import DenseEnd, draw_starts
from flightid.models import Parameter
from tests.closeness import assert_close


def test_starts_keep_sign_and_scale_where_bounds_are_open() -> None:
    free = [
        Parameter("Lp", -40.0),
        Parameter("tau", 0.02, minimum=0.0),
        Parameter("bounded", 1.0, minimum=0.1, maximum=10.0),
        Parameter("unknown", 0.0),
    ]
    drawn = draw_starts(free, 41, seed=3)
    assert drawn[0].tolist() == [-40.0, 0.02, 1.0, 0.0]
    near, wide = drawn[1:8], drawn[8:]
    for column, value in ((0, -40.0), (1, 0.02)):
        assert np.all(np.abs(near[:, column] / value - 1.0) <= 0.3)
        assert 0.3 < np.max(np.abs(wide[:, column] / value - 1.0)) <= 0.6
    assert 0.1 <= drawn[:, 2].min() < 0.3 < 4.0 < drawn[:, 2].max() <= 10.0
    assert np.max(np.abs(drawn[:, 3])) <= 1.0


def test_a_search_takes_its_jacobian_in_any_order_of_memory() -> None:
    slopes = np.array([[1.0, 2.0], [0.0, 1.0], [3.0, 0.0]])
    truth, open_ = np.array([0.5, -2.0]), np.full(2, np.inf)
    by_columns = DenseEnd.searched(
        lambda x: slopes @ (x - truth),
        lambda _: np.asfortranarray(slopes),
        *(np.zeros(2), -open_, open_, 3, 50),
    )
    assert_close(by_columns.x, truth, rtol=1e-9, why="a linear problem")
    assert_close(by_columns.jacobian, slopes, rtol=1e-12, why="a copy")
