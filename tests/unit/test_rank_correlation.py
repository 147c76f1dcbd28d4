"""What the review took from SciPy's larger packages: the same numbers without loading them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from flightid.record.outlying import _largest_near
from flightid.review.rank_correlation import rank_correlation
from flightid.uncertainty.quantiles import chi_squared_quantile

RANDOM = np.random.default_rng(4)


@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize("slope", [0.0, 0.3, -2.0])
def test_ranks_go_together_as_scipy_says(slope: float, *, ties: bool) -> None:
    first = RANDOM.standard_normal(40)
    second = slope * first + RANDOM.standard_normal(40)
    if ties:
        first, second = np.round(first), np.round(second)
    expected = scipy.stats.spearmanr(first, second)
    found = rank_correlation(first, second)
    np.testing.assert_allclose(found, (expected.statistic, expected.pvalue), rtol=1e-9)


def test_a_line_is_certain_and_rest_tells_nothing() -> None:
    rising = np.arange(5.0)
    rank, chance = rank_correlation(rising, rising**3)
    assert rank == pytest.approx(1.0)
    assert chance == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(rank_correlation(rising, np.ones(5))).all()


@pytest.mark.parametrize("freedom", [2.0, 17.3, 400.0])
def test_quantiles_of_chi_squared_are_those_of_scipy(freedom: float) -> None:
    for share in (0.025, 0.5, 0.9999):
        expected = scipy.stats.chi2.ppf(share, freedom)
        assert chi_squared_quantile(share, freedom) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("half", [0, 1, 5, 8])
def test_the_largest_near_a_sample_is_that_of_scipy(half: int) -> None:
    for count in (1, 4, 300):
        values = RANDOM.standard_normal(count)
        expected = scipy.ndimage.maximum_filter1d(values, 2 * half + 1, mode="nearest")
        np.testing.assert_array_equal(_largest_near(values, half), expected)
