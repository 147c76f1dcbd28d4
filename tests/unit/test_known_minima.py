"""Minima by which a search from elsewhere is known to come to the same."""

import numpy as np
import pytest

from flightid.identification.frequency_domain import search
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


def test_starts_that_one_step_takes_to_a_known_minimum_go_no_further(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One lands at once, one after three steps; the last leads to a minimum of its own."""
    one, three, other = np.array([1.0, 0.0]), np.array([3.0, 0.0]), np.array([9.0, 9.0])
    jacobian = np.vstack([2.0 * np.eye(2), np.zeros((8, 2))])
    followed: list[tuple[int, bool, list[float]]] = []

    def follow(
        _: object, begin: np.ndarray, steps: int, light: float = 1.0, *, slopes: bool = True
    ) -> list[DenseEnd]:
        if len(begin):
            followed.append((steps, slopes, [float(start[0]) for start in begin]))
        ends = []
        for start in begin:
            lands = steps >= start[0] and start[0] < other[0]
            x = np.zeros(2) if lands else start
            why = "cost" if steps > search.FIRST_STEPS else "iterations"
            ends.append(DenseEnd(x, 10.0, steps, why, np.ones(10), jacobian))
        return ends

    monkeypatch.setattr(search._Descent, "follow", follow)
    descent = search._Descent(None, [], [])
    found = descent._apart(np.array([one, three, other]), [ended(jacobian)], 50)
    # Where one step leads is asked, not the slopes there.
    looks = [(1, False, [1.0]), (1, False, [3.0, 9.0])]
    assert followed == [*looks, (3, True, [3.0, 9.0]), (47, True, [9.0])]
    assert [end.x.tolist() for end in found] == [[9.0, 9.0]]
