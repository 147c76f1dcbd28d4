"""Outputs alone are those of the whole simulation, also of some samples only."""

import numpy as np
import pytest

from flightid import _native
from flightid.errors import DataError
from tests.closeness import assert_close


@pytest.mark.parametrize("first", [True, False])
def test_outputs_alone_are_those_of_the_simulation(first: bool) -> None:
    random = np.random.default_rng(1)
    for n in (0, 3, 17, 40):
        a, b = 0.2 * random.standard_normal((n, n)) - np.eye(n), random.standard_normal((n, 2))
        c, d = random.standard_normal((3, n)), random.standard_normal((3, 2))
        system = (a, b, c, d, np.array([0.013, 0.0]))
        inputs, start = random.standard_normal((3, 2, 401)), np.ones(n)
        whole = [_native.simulate_linear(*system, u, start, 0.02, first)[1] for u in inputs]
        known = np.array(whole)
        for every in (1, 4, 7, 1000):
            found = _native.linear_outputs(*system, inputs, start, 0.02, first, every)
            assert_close(found, known[:, :, ::every], atol=1e-12, why="rounding")


def test_a_run_without_bounds_is_an_error() -> None:
    one = np.ones((1, 1))
    run = (9.0 * one, one, one, one, np.zeros(1), np.ones((1, 1, 99)), np.ones(1))
    with pytest.raises(DataError, match="simulated output"):
        _native.linear_outputs(*run, 1.0, True, 1)
