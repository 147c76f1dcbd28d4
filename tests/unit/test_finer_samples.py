"""Finer samples: those of SciPy's interpolating quintic, from one sample on."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from flightid.simulation.finer_samples import finer_samples


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6, 7, 8, 11, 40, 2000])
def test_samples_between_samples_are_those_of_scipy(n: int) -> None:
    values = np.random.default_rng(n).standard_normal((3, n))
    spline = scipy.interpolate.make_interp_spline(np.arange(n), values, k=min(5, n - 1), axis=1)
    expected = spline(np.arange(4 * (n - 1) + 1) / 4)
    found = finer_samples(values, 4)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(found[:, ::4], values, rtol=0.0, atol=1e-12)
