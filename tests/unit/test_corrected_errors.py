"""Errors of a corrected response where bins tell nothing and the output runs away."""

from types import SimpleNamespace

import numpy as np

from flightid.responses.corrected import MOST_RELATIVE, _least_variances, _longer
from tests.closeness import assert_close


def test_an_output_that_runs_away_overflows_nothing() -> None:
    """A diverging record leaked a warning of NumPy: nothing told, times its noise of 1e12."""
    omega, spread = np.array([1.0, 2.0]), np.eye(2)
    linear = SimpleNamespace(local_spread=lambda: np.array([[[2.0, np.inf]]]))
    noise = SimpleNamespace(at=lambda _: np.array([[3.0, 1e12]]))
    with np.errstate(all="raise"):
        least = _least_variances(linear, noise, omega, spread)  # type: ignore[arg-type]
        assert least is not None
        longer = _longer(least[0, 0], np.array([1.0, 1e-9]))
    assert_close(least[0, 0, 0], 0.5 * 3.0 * 2.0 / 1.5**2, rtol=1e-12, why="by hand")
    assert_close(longer, [np.sqrt(3.0 / 2.25), MOST_RELATIVE], rtol=1e-12, why="by hand")
    assert_close(
        _longer(np.array([2.0]), np.array([0.0])), [1.0], rtol=1e-12, why="no error at all"
    )
