"""Columns of a predictor's errors by its free numbers, beside its definition."""

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.identification.subspace import predictor_columns
from flightid.identification.subspace.data import gather
from flightid.identification.subspace.estimate import decompose, realised
from flightid.identification.subspace.order import predictor_of
from tests.closeness import assert_close


def _errors_of_predictor(numbers, system, y, u):
    """e = y - level - C x - D u with x+ = A x + B u + K e, sample by sample: the definition."""
    closed, c, k = system
    (n, p), m = k.shape, len(u)
    b, rest = numbers[: n * m].reshape(n, m), numbers[n * m :]
    d, rest = rest[: p * m].reshape(p, m), rest[p * m :]
    state, level = rest[:n], rest[n:]
    errors = np.empty_like(y)
    for t in range(y.shape[1]):
        errors[:, t] = y[:, t] - level - c @ state - d @ u[:, t]
        state = (closed + k @ c) @ state + b @ u[:, t] + k @ errors[:, t]
    return errors


@pytest.mark.parametrize("n_samples", [60, 700])
def test_columns_of_a_predictor_are_what_each_number_adds(n_samples, monkeypatch):
    monkeypatch.setattr(predictor_columns, "AT_ONCE", 64)
    random, (n, p, m) = np.random.default_rng(0), (3, 2, 2)
    closed = np.array([[0.6, 0.3, 0.0], [-0.2, 0.5, 0.1], [0.0, 0.2, -0.4]])
    c, k = random.standard_normal((p, n)), 0.3 * random.standard_normal((n, p))
    y, u = random.standard_normal((2, p, n_samples))
    none = np.zeros(n * m + p * m + n + p)
    base = _errors_of_predictor(none, (closed, c, k), y, u)
    units = np.eye(len(none))
    by = [base - _errors_of_predictor(unit, (closed, c, k), y, u) for unit in units]
    whole = np.array([each.ravel() for each in (*by, base)])
    columns = predictor_columns.InputColumns(closed, c, k, True, True)
    triangle = columns.triangle(y, u)
    assert_close(triangle.T @ triangle, whole @ whole.T, why="same products", rtol=1e-10, atol=1e-9)
    some = predictor_columns.InputColumns(closed, c, k, False, False).triangle(y, u)
    kept = whole[[*range(n * m), *range(n * m + p * m, n * m + p * m + n), -1]]
    assert_close(some.T @ some, kept @ kept.T, why="same products", rtol=1e-10, atol=1e-9)
    own = predictor_columns.OwnColumns(closed, c, k, np.eye(p), True, True)
    found = own.columns(n_samples)
    expected = np.moveaxis(np.array(by[-own.count :]), 0, 2)
    assert_close(found, expected, why="the same numbers", rtol=1e-10, atol=1e-12)
    assert not found[:, 600:, :n].any()


def test_a_predictor_that_runs_away_is_refused():
    run = np.full((1, 4000), 1.0)
    columns = predictor_columns.InputColumns(2.0 * np.eye(1), np.eye(1), np.eye(1), False, False)
    with np.errstate(over="ignore", invalid="ignore"), pytest.raises(fid.errors.DataError):
        columns.triangle(run, run)


@pytest.mark.parametrize("offsets", ["none", "mean"])
def test_squares_of_least_squares_are_those_of_the_predictions(offsets):
    random = np.random.default_rng(3)
    records = []
    for n_samples in (500, 800):
        u, e = random.standard_normal((2, n_samples))
        y = lfilter([0.0, 1.0, 0.5], [1.0, -1.2, 0.5], u) + lfilter([1.0], [1.0, -0.6], e) + 3.0
        time_s = np.arange(n_samples) * 0.1
        records.append(fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y}))
    structure = fid.InnovationsModel.subspace("u", "y", method="cva", direct=True, offsets=offsets)
    data = gather(structure, records)
    for order in (1, 3):
        matrices, squares = realised(structure, data, decompose(structure, data), order)
        predictor, scaled = predictor_of(structure, data, matrices)
        errors = predictor.fitted_errors(scaled, np.eye(1))
        expected = sum(float(np.sum(each**2)) for each in errors)
        assert_close(squares, expected, rtol=1e-10, why="B, D, starts and levels are the best")
