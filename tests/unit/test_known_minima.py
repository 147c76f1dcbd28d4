"""Minima by which a search from elsewhere is known to come to the same."""

import numpy as np

from flightid.identification.frequency_domain.known_minimum import KnownMinimum
from flightid.identification.multistart import DenseEnd


def ended(jacobian: np.ndarray, termination: str = "cost") -> DenseEnd:
    residuals = np.ones(len(jacobian))
    return DenseEnd(np.zeros(2), float(len(jacobian)), 5, termination, residuals, jacobian)


def test_a_minimum_holds_what_is_half_a_standard_error_away_and_no_more() -> None:
    """Ten unit residuals and two columns of length 2: standard errors of sqrt(10/8)/2 each."""
    jacobian = np.zeros((10, 2))
    jacobian[0, 0] = jacobian[1, 1] = 2.0
    minimum = KnownMinimum.of(ended(jacobian))
    assert minimum is not None
    half = 0.5 * np.sqrt(10.0 / 8.0) / 2.0
    assert minimum.holds(np.array([0.99 * half, 0.0]))
    assert not minimum.holds(np.array([1.01 * half, 0.0]))
    assert not minimum.holds(np.array([0.8 * half, 0.8 * half]))


def test_what_is_no_minimum_or_leaves_combinations_open_holds_nothing() -> None:
    """Along a combination that data do not tell a search may be far from where another ended."""
    alike = np.random.default_rng(0).standard_normal((10, 1)) @ np.array([[1.0, 2.0]])
    assert KnownMinimum.of(ended(alike)) is None
    assert KnownMinimum.of(ended(np.eye(10)[:, :2], "iterations")) is None
    assert KnownMinimum.of(ended(np.eye(10)[:, [0, 0]] * [1.0, 0.0])) is None
