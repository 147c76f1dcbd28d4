"""Least squares of pilots: transients eliminated record by record change nothing."""

import numpy as np

from flightid.responses.errors.pilot_search import (
    SPARE,
    PilotColumns,
    columns_of,
    joined,
    solve,
    spectra_of,
    turns,
)
from tests.closeness import assert_close


def test_eliminated_transients_solve_the_whole_problem() -> None:
    """Three records of unlike length, two inputs: as by one problem of all columns."""
    random = np.random.default_rng(3)
    inputs = [random.standard_normal((2, n)) for n in (300, 180, 240)]
    data = spectra_of(inputs, [np.cumsum(u.sum(0)) for u in inputs], 0.02, 60.0)
    order, target = 3, np.concatenate(data.output)
    basis = [turns(omega, 10.0, order) for omega in data.omega]
    ends = [turns(omega, 10.0, order + SPARE) for omega in data.omega]
    weights = 1.0 / (1.0 + np.abs(target))
    made = PilotColumns.of(data, order, 10.0)
    numerators, denominator, transients = solve(made, target, weights, target * weights)
    columns = joined(columns_of(data, basis, ends, target)) * weights
    both = np.concatenate([columns.real, columns.imag], axis=1).T
    right = np.concatenate([(target * weights).real, (target * weights).imag])
    whole = np.linalg.lstsq(both, right, rcond=None)[0]
    found = [numerators.ravel(), *transients, denominator[1:]]
    assert_close(np.concatenate(found), whole, atol=1e-9 * np.max(np.abs(whole)), why="rounding")


def test_columns_that_are_alike_are_solved_by_triangles() -> None:
    """An output that is an input: numerator and denominator of order two share both roots."""
    random = np.random.default_rng(4)
    inputs = [random.standard_normal((1, n)) for n in (200, 160)]
    data = spectra_of(inputs, [u[0] for u in inputs], 0.02, 60.0)
    target, ones = np.concatenate(data.output), np.ones(data.size)
    made = PilotColumns.of(data, 2, 10.0)
    assert made.bins.solve(target, ones, target) is None
    numerators, denominator, transients = solve(made, target, ones, target)
    still = np.zeros(2)
    above = made.bins.numerator(np.concatenate([numerators.ravel(), still, *transients]))
    assert_close(above, target * (denominator @ made.whole), atol=1e-9, why="rounding")
