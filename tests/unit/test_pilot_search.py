"""Least squares of pilots: transients eliminated record by record change nothing."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from flightid.responses.errors.pilot import Pilot, Pilots, fit_pilots
from flightid.responses.errors.pilot_errors import acting, basis_of, spent_in
from flightid.responses.errors.pilot_search import (
    SPARE,
    PilotBins,
    PilotInputs,
    made,
    settled,
    solve,
    started,
    turns,
)
from tests.closeness import assert_close


def written_out(data: PilotBins, order: int, target: NDArray[np.complex128]) -> np.ndarray:
    """Sensitivities times the denominator, all zeros in place: (n_coefficients, n_bins)."""
    own, n_in, n_records = order + 1 + SPARE, len(data.inputs[0]), len(data.omega)
    rows = []
    for place, (omega, u, y) in enumerate(
        zip(data.omega, data.inputs, data.by_record(target), strict=True)
    ):
        powers = turns(omega, data.given.scale_rad_s, order + SPARE)
        basis = powers[: order + 1]
        part = np.zeros(((order + 1) * n_in + own * n_records + order, len(omega)), complex)
        part[: (order + 1) * n_in] = np.concatenate([row * basis for row in u])
        begun = (order + 1) * n_in + own * place
        part[begun : begun + own] = powers
        part[-order:] = -y * basis[1:]
        rows.append(part)
    return np.concatenate(rows, axis=1)


def test_what_a_fit_takes_of_noise_is_that_of_all_columns() -> None:
    """The diagonal of the projection on all columns, and their covariance, record by record."""
    random = np.random.default_rng(5)
    inputs = [random.standard_normal((2, n)) for n in (90, 120)]
    data = PilotInputs.of(inputs, 0.02, 60.0).with_output([np.cumsum(u.sum(0)) for u in inputs])
    target, order = np.concatenate(data.output), 2
    weights = 1.0 / (1.0 + np.abs(target))
    columns = written_out(data, order, target)
    places = [acting(6, order + 1 + SPARE, 2, order, record) for record in range(2)]
    parts = [part[at] for part, at in zip(data.by_record(columns), places, strict=True)]
    basis = basis_of(parts, slice(6, 6 + order + 1 + SPARE), weights)
    spent, covariance = spent_in(basis), basis.covariance()
    both = np.concatenate([(columns * weights).real, (columns * weights).imag], axis=1)
    inverse = np.linalg.inv(both @ both.T)
    share = 0.5 * np.einsum("ib,ij,jb->b", both, inverse, both).reshape(2, -1).sum(axis=0)
    assert_close(spent, np.minimum(share, 0.95), rtol=1e-8, why="rounding")
    assert_close(covariance, inverse, atol=1e-8 * np.max(np.abs(inverse)), why="rounding")


def test_coefficients_that_all_but_cancel_take_what_their_columns_span() -> None:
    """A column beside another at 5e-8 of its size: products of columns would tell rounding."""
    random = np.random.default_rng(8)
    records = [random.standard_normal((2, 9, n)) for n in (60, 80)]
    beside = [re + 1j * im for re, im in records]
    for part in beside:
        part[8] = part[0] + 5e-8 * part[8]
    weights = np.ones(140)
    spent = spent_in(basis_of(beside, slice(4, 7), weights))
    columns = np.zeros((12, 140), dtype=complex)
    for record, span in enumerate((slice(0, 60), slice(60, 140))):
        columns[[0, 1, 2, 3, 10, 11], span] = beside[record][[0, 1, 2, 3, 7, 8]]
        columns[4 + 3 * record : 7 + 3 * record, span] = beside[record][4:7]
    basis = np.linalg.qr(np.concatenate([columns.real, columns.imag], axis=1).T)[0]
    share = 0.5 * np.sum(basis**2, axis=1).reshape(2, -1).sum(axis=0)
    assert_close(spent, share, rtol=1e-6, why="rounding over 5e-8")


def test_slopes_of_a_record_are_those_of_what_acts_in_it() -> None:
    """Eight records: a pilot keeps no rows of zeros for the transients of the others."""
    random = np.random.default_rng(6)
    inputs = [random.standard_normal((1, 200)) for _ in range(8)]
    outputs = [np.convolve(u[0], [0.0, 0.5, 0.3])[None, :200] for u in inputs]
    pilot = fit_pilots(inputs, outputs, 0.02, 60.0)[0]
    assert pilot is not None
    n_own = pilot.order + 1 + SPARE
    assert pilot.slopes[7].shape == (2 * pilot.order + 1 + n_own, 200)
    assert len(pilot.covariance) == 2 * pilot.order + 1 + 8 * n_own
    assert len(pilot.acting(7)) == len(pilot.slopes[7])


def test_eliminated_transients_solve_the_whole_problem() -> None:
    """Three records of unlike length, two inputs: as by one problem of all columns."""
    random = np.random.default_rng(3)
    inputs = [random.standard_normal((2, n)) for n in (300, 180, 240)]
    data = PilotInputs.of(inputs, 0.02, 60.0).with_output([np.cumsum(u.sum(0)) for u in inputs])
    order, target = 3, np.concatenate(data.output)
    weights = 1.0 / (1.0 + np.abs(target))
    made = data.given.columns(order)
    numerators, denominator, transients = solve(made, target, weights, target * weights)
    columns = written_out(data, order, target) * weights
    both = np.concatenate([columns.real, columns.imag], axis=1).T
    right = np.concatenate([(target * weights).real, (target * weights).imag])
    whole = np.linalg.lstsq(both, right, rcond=None)[0]
    found = [numerators.ravel(), *transients, denominator[1:]]
    assert_close(np.concatenate(found), whole, atol=1e-9 * np.max(np.abs(whole)), why="rounding")


def test_columns_that_are_alike_are_solved_by_triangles() -> None:
    """An output that is an input: numerator and denominator of order two share both roots."""
    random = np.random.default_rng(4)
    inputs = [random.standard_normal((1, n)) for n in (200, 160)]
    data = PilotInputs.of(inputs, 0.02, 60.0).with_output([u[0] for u in inputs])
    target, ones = np.concatenate(data.output), np.ones(data.size)
    made = data.given.columns(2)
    assert made.bins.solve(target, ones, target) is None
    numerators, denominator, transients = solve(made, target, ones, target)
    still = np.zeros(2)
    above = made.bins.numerator(np.concatenate([numerators.ravel(), still, *transients]))
    assert_close(above, target * (denominator @ made.whole), atol=1e-9, why="rounding")


def test_an_order_goes_on_from_where_it_was() -> None:
    """By other weights no worse than the known state, and at the minimum that nothing leads to."""
    random = np.random.default_rng(9)
    inputs = [random.standard_normal((1, n)) for n in (260, 240)]
    outputs = [np.convolve(u[0], [0.0, 0.9, 0.5, -0.2])[: u.shape[1]] for u in inputs]
    noisy = [y + 0.1 * random.standard_normal(len(y)) for y in outputs]
    data = PilotInputs.of(inputs, 0.02, 60.0).with_output(noisy)
    ones = np.ones(data.size)
    known = settled(data, ones, started(data, 3, ones))
    weights = 1.0 / (0.3 + np.abs(data.target))
    under_these = made(data, data.given.columns(3), weights, *known.coefficients)
    further = settled(data, weights, started(data, 3, weights, known))
    anew = settled(data, weights, started(data, 3, weights))
    assert further.cost < under_these.cost
    assert_close(further.cost, anew.cost, rtol=1e-4, why="steps end at shares of 1e-5")


def test_what_was_injected_is_fitted_once_to_each_input(monkeypatch: pytest.MonkeyPatch) -> None:
    random, asked = np.random.default_rng(5), []
    given = [random.standard_normal((2, 400)) for _ in range(2)]
    inputs = [lfilter([0.1, 0.05], [1.0, -0.8], each, axis=1) for each in given]
    outputs = [lfilter([0.2], [1.0, -0.9], each[:1], axis=1) for each in inputs]
    untouched = fit_pilots

    def spied(
        u: list[np.ndarray], y: list[np.ndarray], *limits: float, **excited: object
    ) -> object:
        asked.append((len(y[0]), bool(excited)))
        return untouched(u, y, *limits, **excited)

    monkeypatch.setattr("flightid.responses.errors.pilot.fit_pilots", spied)

    def found(order: list[int]) -> Pilot:
        own = tuple(each[order] for each in inputs)
        (pilot,) = Pilots(own, tuple(outputs), 0.05, 20.0, tuple(given)).found
        assert pilot is not None
        return pilot

    first, second = found([0, 1]), found([1, 0])
    assert asked == [(2, False), (1, True), (1, True)]
    assert_close(first.outputs[0], second.outputs[0], rtol=1e-6, why="order of the columns")
    given[0] = given[0] + 1e-9
    found([0, 1])
    assert asked[3:] == [(2, False), (1, True)]
