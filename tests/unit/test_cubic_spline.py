"""The native cubic spline: SciPy's, inside and beyond its points, and exact on a cubic."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from flightid._native import cubic_spline
from tests.closeness import assert_close

ROUNDING = "the same cubic pieces, summed in another order"


@pytest.mark.parametrize("count", [3, 4, 5, 2000])
def test_spline_is_that_of_scipy(count: int) -> None:
    random = np.random.default_rng(0)
    points, values = np.cumsum(random.uniform(0.5, 1.5, count)), random.standard_normal(count)
    at = np.linspace(points[0] - 0.3, points[-1] + 0.3, 501)
    assert_close(
        cubic_spline(points, values, at), CubicSpline(points, values)(at), why=ROUNDING, atol=1e-12
    )


def test_spline_is_exact_on_a_cubic() -> None:
    points, at = np.array([0.0, 0.5, 2.0, 2.5, 4.0]), np.linspace(-1.0, 5.0, 41)
    assert_close(cubic_spline(points, points**3 - points, at), at**3 - at, why=ROUNDING, atol=1e-11)
