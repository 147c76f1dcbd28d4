"""Covariances of several outputs at once are those of each by itself."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from flightid.responses.errors.random_error import Points, covariances
from flightid.responses.windows.kept_bases import bases_kept
from tests.closeness import assert_close


@pytest.mark.parametrize("method", ["composite", "local_polynomial"])
def test_shared_work_changes_nothing(method: str) -> None:
    generator = np.random.default_rng(2)
    u = generator.standard_normal((2, 3000))
    y = np.stack([np.convolve(u[0], [0.5, 0.5])[:3000], u[1] - 0.3 * u[0]])
    y += 0.2 * generator.standard_normal(y.shape)
    # Of two lengths, which their Fourier transforms do not tell apart.
    records = [
        fid.Record.from_arrays(
            np.arange(each.stop - each.start) / 50.0,
            inputs=dict(zip("ab", u[:, each], strict=True)),
            outputs=dict(zip("xy", y[:, each], strict=True)),
        )
        for each in (slice(0, 1500), slice(1501, 3000))
    ]
    response = fid.estimate_response(records, band_rad_s=(1.0, 40.0), n_omega=12, estimator=method)
    turned = response.select(outputs=["y", "x"], inputs=["b", "a"])
    assert turned.errors is not None
    wanted = [
        Points(0, np.array([1]), np.array([0, 3, 7])),
        Points(1, np.array([0, 1]), np.array([2, 3, 11])),
    ]
    for each, found in zip(wanted, covariances(turned.errors, wanted), strict=True):
        alone = turned.errors.covariance(np.array([each.output]), each.inputs, each.frequencies)[0]
        assert found.shape == alone.shape
        scale = float(np.max(np.abs(alone)))
        assert_close(found, alone, atol=1e-6 * scale, why="side lobes beyond the band")
    with bases_kept():
        covariances(turned.errors, wanted[1:])
        kept = [covariances(turned.errors, wanted) for _ in range(2)]
    for found in zip(covariances(turned.errors, wanted), *kept, strict=True):
        assert np.array_equal(found[0], found[1])
        assert np.array_equal(found[0], found[2])
