"""Derivatives of eigenvalues, vectors and participations against differences, for any matrix."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from flightid.dynamics.modes.participation import Eigenpair, eigenpairs
from tests.closeness import assert_close
from tests.examples import examples


def _nearest(a: np.ndarray, pair: Eigenpair) -> Eigenpair:
    return min(eigenpairs(a), key=lambda each: abs(each.value - pair.value))


@examples(40)
@given(seed=st.integers(0, 2**31), n=st.integers(2, 6), spread=st.floats(-3.0, 3.0))
def test_moves_are_the_slopes(seed: int, n: int, spread: float) -> None:
    """Whatever the scaling of the states; step and tolerance follow the distance of neighbours."""
    random = np.random.default_rng(seed)
    scale = 10.0 ** random.uniform(-abs(spread), abs(spread), n)
    a = random.standard_normal((n, n)) * scale[:, None] / scale
    direction = random.standard_normal((1, n, n)) * scale[:, None] / scale
    small = 1e-3 * direction
    values = np.linalg.eigvals(a)
    apart = np.abs(values[:, None] - values) + 1e9 * np.eye(n)
    if apart.min() < 0.3 or np.any((values.imag != 0.0) & (np.abs(values.imag) < 0.15)):
        return
    for pair in eigenpairs(a, small):
        assert pair.factors is not None
        assert_close(np.sum(pair.factors), 1.0, rtol=1e-9, why="wᵀv = 1")
        assert_close(np.sum(pair.shares), 1.0, rtol=1e-12, why="shares")
        if pair.value_moves is None:
            assert pair.reason
            continue
        assert pair.factor_moves is not None
        lead = int(np.argmax(pair.shares))
        step = 1e-3
        ends = [_nearest(a + sign * step * small[0], pair) for sign in (1.0, -1.0)]
        slope = (ends[0].value - ends[1].value) / (2 * step)
        size = abs(slope) + 1e-3
        assert_close(pair.value_moves[0], slope, rtol=1e-3, atol=1e-4 * size, why="differences")
        assert ends[0].factors is not None
        assert ends[1].factors is not None
        factors = (ends[0].factors - ends[1].factors) / (2 * step)
        bound = 1e-4 * (np.abs(factors).max() + 1e-3)
        assert_close(pair.factor_moves[0], factors, rtol=1e-3, atol=bound, why="differences")
        sizes = [np.abs(each.shape(lead)) for each in ends]
        grown = np.abs(sizes[0] - sizes[1]) / (2 * step)
        errors = pair.shape_errors(lead)
        assert errors is not None
        bound = 1e-3 * np.abs(pair.shape(lead)) * (np.abs(grown / np.abs(pair.shape(lead))).max())
        assert np.all(np.abs(errors - grown) <= 2e-3 * grown + bound + 1e-7 * sizes[0])
