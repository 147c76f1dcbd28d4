"""Filters: the samples of SciPy's, with poles the very bits, whatever axis, rows and orders."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from flightid.recursive_filter import filtered, filtered_from, state_after

RANDOM = np.random.default_rng(3)
FILTERS = {
    "one pole": ([0.4], [1.0, -0.6]),
    "more above than below": ([1.0, 0.3, -0.2, 0.1], [2.0, -0.8]),
    "more below than above": ([0.5, 0.1], [1.0, -1.2, 0.5, -0.1]),
    "no pole": ([0.5, -0.25, 0.125], [2.0]),
    "a gain": ([3.0], [1.5]),
    "as long as it goes": (RANDOM.standard_normal(20), np.poly(RANDOM.uniform(-0.9, 0.9, 19))),
}


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("shape", [(50,), (3, 50), (50, 9), (2, 5, 40)])
def test_samples_are_those_of_scipy(name: str, shape: tuple[int, ...]) -> None:
    b, a = FILTERS[name]
    x = RANDOM.standard_normal(shape)
    for axis in range(len(shape)):
        expected = scipy.signal.lfilter(b, a, x, axis=axis)
        # Sums without poles have an order of their own.
        room = 0.0 if len(a) > 1 else 1e-15 * np.abs(b).sum() * np.abs(x).max()
        np.testing.assert_allclose(filtered(b, a, x, axis=axis), expected, rtol=0.0, atol=room)


@pytest.mark.parametrize("n_rows", [1, 4, 7])
def test_a_run_in_two_parts_is_the_whole_run(n_rows: int) -> None:
    b, a = FILTERS["more below than above"]
    x = RANDOM.standard_normal((n_rows, 60))
    first, state = filtered_from(b, a, x[:, :25], np.zeros((n_rows, 3)))
    second, left = filtered_from(b, a, x[:, 25:], state)
    expected, end = scipy.signal.lfilter(b, a, x, zi=np.zeros((n_rows, 3)))
    np.testing.assert_array_equal(np.concatenate([first, second], axis=1), expected)
    np.testing.assert_array_equal(left, end)


def test_a_state_from_past_outputs_is_that_of_scipy() -> None:
    a, y = [2.0, -1.0, 0.3, 0.1], np.array([0.4, -0.2, 1.0])
    np.testing.assert_allclose(state_after(a, y), scipy.signal.lfiltic([1.0], a, y=y), rtol=1e-14)


def test_an_empty_signal_stays_empty() -> None:
    assert filtered([1.0], [1.0, -0.5], np.zeros((2, 0))).shape == (2, 0)
    assert filtered([1.0, 0.5], [1.0], np.zeros((2, 0))).shape == (2, 0)
