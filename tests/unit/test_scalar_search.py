"""Roots and minima of one number: the very ends of SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from flightid.errors import DataError
from flightid.scalar_search import minimum_between, root_between

FUNCTIONS = {
    "cubic": lambda x: (x - 0.3) * (x * x + 1.0),
    "steep": lambda x: np.tanh(40.0 * (x - 0.71)) + 0.01 * x,
    "sinh": lambda x: np.sinh(x - 0.4),
    "curved": lambda x: np.exp(3.0 * x) - 2.0,
    "wavy": lambda x: np.cos(3.0 * x) - 0.2 * x,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_root_has_the_bits_of_brentq(name: str) -> None:
    function = FUNCTIONS[name]
    for low, high in ((0.0, 1.0), (-0.5, 0.93), (0.1, 0.999)):
        expected = scipy.optimize.brentq(function, low, high, xtol=1e-12)
        assert root_between(function, low, high) == expected


def test_a_root_that_is_not_bracketed_is_refused() -> None:
    with pytest.raises(DataError, match=r"not bracketed.*unlike sign"):
        root_between(lambda x: x * x + 1.0, -1.0, 1.0)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_minimum_has_the_bits_of_minimize_scalar(name: str) -> None:
    def loss(x: float) -> float:
        return float(abs(FUNCTIONS[name](x)))

    for low, high in ((0.0, 1.0), (-0.5, 0.93), (0.3, 1.4), (-2.0, 4.0)):
        expected = scipy.optimize.minimize_scalar(loss, bounds=(low, high), method="bounded")
        assert minimum_between(loss, low, high) == float(expected.x)
