"""Blocks and parts of records beside the matrices that they stand for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from flightid.uncertainty import blocks
from flightid.uncertainty.blocks import RecordBlock, flights_of
from flightid.uncertainty.coloured_residuals import residual_covariance
from flightid.uncertainty.parts import RecordParts, chance_alike, chance_where_seen, larger
from flightid.uncertainty.residual_noise import Autoregression

Array = np.ndarray


def block(n: int = 30, size: float = 1.0, seed: int = 0) -> tuple[RecordBlock, Array, Array]:
    """Two outputs, three parameters, one number of its own; and the sensitivities."""
    rng = np.random.default_rng(seed)
    shared, own = rng.standard_normal((2, n, 3)), rng.standard_normal((2, n, 1))
    return RecordBlock.of(shared, own, size * rng.standard_normal((2, n))), shared, own


def test_own_numbers_are_projected_out_and_rows_are_those_of_outputs() -> None:
    made, shared, own = block()
    flat, single = shared.reshape(60, 3), own.reshape(60, 1)
    left = flat - single @ np.linalg.lstsq(single, flat, rcond=None)[0]
    assert made.projected == pytest.approx(left)
    assert made.basis @ made.triangle == pytest.approx(single)
    assert made.basis @ made.shared_on_own + made.projected == pytest.approx(flat)
    for output in (0, 1):
        basis, projected = made.of_output(output)
        assert projected.tolist() == made.projected[30 * output : 30 * output + 30].tolist()
        assert basis.tolist() == made.basis[30 * output : 30 * output + 30].tolist()
    none = RecordBlock.of(shared, own[:, :, :0], made.residual)
    assert none.projected.tolist() == flat.tolist()
    # Leverages are the diagonal of the projection on the columns.
    hat = left @ np.linalg.pinv(left)
    assert blocks._information(left) == pytest.approx(np.diag(hat))
    unseen = np.column_stack([left, np.zeros(60), left[:, 0] * 1e9])
    assert blocks._information(unseen) == pytest.approx(np.diag(hat))
    held = np.cumsum(np.diag(hat).reshape(2, 30).sum(axis=0))
    assert made.middle == int(np.argmax(held >= 0.5 * held[-1])) + 1
    turned = made.along(np.eye(3)[:, ::-1])
    assert turned.projected.tolist() == made.projected[:, ::-1].tolist()
    assert (turned.half, turned.middle) == (made.middle,) * 2


def test_own_numbers_that_move_some_outputs_count_as_all_of_them_mixed() -> None:
    """A basis with zeros beside the same space in mixed directions, in noise of every kind."""
    rng = np.random.default_rng(5)
    n = 400
    time = np.linspace(0.0, 1.0, n)
    shared, own = rng.standard_normal((4, n, 2)), np.zeros((4, n, 6))
    shared[:, :, 1] = np.exp(-2.0 * time)
    own[:2, :, 0] = np.exp(-3.0 * time)
    own[range(4), :, range(1, 5)] = 1.0
    own[0, -1, 5] = 1.0  # between all samples that are looked at first
    noise = rng.standard_normal((4, n))
    noise[1] = lfilter([1.0], [1.0, -0.8], noise[1])
    noise[2] *= 0.05 + np.abs(shared[2, :, 0])
    noise[3] += 0.3 * np.cumsum(rng.standard_normal(n))
    made = RecordBlock.of(shared, own, noise)
    assert made.basis @ made.triangle == pytest.approx(own.reshape(-1, 6), abs=1e-12)
    assert [each.tolist() for each in made.own.places] == [[0, 1, 5], [2, 5], [3], [4]]
    assert [each.shape[1] for each in made.own.columns] == [3, 2, 1, 1]
    turn = np.linalg.qr(rng.standard_normal((6, 6)))[0]
    mixed = replace(
        made,
        basis=made.basis @ turn,
        triangle=turn.T @ made.triangle,
        shared_on_own=turn.T @ made.shared_on_own,
    )
    assert all(each.size == 6 for each in mixed.own.places)
    inputs = [rng.standard_normal((1, n))]
    known, other = (residual_covariance([each], inputs=inputs) for each in (made, mixed))
    assert known.growth is not None
    assert known.orders == other.orders
    assert sum(known.orders) > 1
    white = [Autoregression(np.ones(1), np.empty(0), n, 2 * n)] * 4
    parts = [flights_of(blocks.noise_heard(white, [each]), [each])[0] for each in (made, mixed)]
    for mine, theirs in (
        (parts[0].noise, parts[1].noise),
        (known.covariance, other.covariance),
        (known.freedom, other.freedom),
        (known.own[0], other.own[0]),
        (known.crossed[0], other.crossed[0]),
        *(
            (a.values, b.values)
            for a, b in zip(known.correlations, other.correlations, strict=True)
        ),
        *(
            (a.errors, b.errors)
            for a, b in zip(known.correlations, other.correlations, strict=True)
        ),
        ([a.p_value for a in known.correlations], [b.p_value for b in other.correlations]),
    ):
        assert mine == pytest.approx(theirs, rel=1e-9, abs=1e-12)


def test_second_halves_begin_where_half_is_told() -> None:
    for shares, known in (
        ([3.0, 1.0, 1.0, 1.0], 1),
        ([1.0, 1.0, 1.0, 1.0], 2),
        ([1.0, 1.0, 1.0, 1.01], 3),
        ([0.0, 0.0, 0.0, 1.0], 3),
        ([0.0] * 5, 2),
        ([1.0, 1.0], 1),
    ):
        assert blocks.middle_of(np.array(shares)) == known


def test_levels_are_variances_over_that_of_all() -> None:
    loud, quiet = block(40, 3e-2, 1)[0], block(20, 1e-2, 2)[0]
    squares = [np.sum(each.residual**2, axis=1) for each in (loud, quiet)]
    common = (squares[0] + squares[1]) / 60.0
    found = blocks.levels([loud, quiet])
    assert found == pytest.approx(np.array([squares[0] / 40.0, squares[1] / 20.0]) / common)
    still = RecordBlock.of(np.ones((1, 9, 1)), np.zeros((1, 9, 0)), np.zeros((1, 9)))
    assert blocks.levels([still]).tolist() == [[1.0]]


def test_noise_of_halves_joins_to_that_of_the_whole() -> None:
    made, _, _ = block()
    for weights in (np.zeros(0), np.array([0.6])):
        noise = Autoregression(np.array([2.0, 1.2]), weights, 30, 64)
        for output in (0, 1):
            own, shared = made.of_output(output)
            both = np.hstack([own, shared])
            among = noise.autocovariance(30)[np.abs(np.subtract.outer(range(30), range(30)))]
            heard = blocks._heard(noise, made, output)
            assert heard.shape == (7, 7)
            assert blocks.joined(heard, made) == pytest.approx(both.T @ among @ both)
            half = made.middle
            first, second = shared.copy(), shared.copy()
            first[half:], second[:half] = 0.0, 0.0
            wide = np.hstack([own, first, second])
            assert heard == pytest.approx(wide.T @ among @ wide)


@pytest.mark.parametrize("size", [0.0, np.inf])
def test_parts_that_tell_nothing_finite_are_not_compared(size: float) -> None:
    """Nothing of two is seen: it had been an index beyond none."""
    with np.errstate(invalid="ignore"):
        flat = RecordParts(np.ones((1, 2)), np.full((1, 2, 2), size), np.ones((1, 2, 1, 2)))
        assert chance_where_seen([flat, flat], np.inf) is None


def test_chances_do_not_depend_on_units() -> None:
    rng = np.random.default_rng(3)
    roots = rng.standard_normal((4, 3, 3))
    parts = []
    for root, score in zip(roots, rng.standard_normal((4, 3)), strict=True):
        square = root @ root.T + np.eye(3)
        scored = np.linalg.cholesky(square) @ score
        parts.append(RecordParts(scored[None], square[None], square[None, :, None]))
    scaled = np.diag([1e-4, 1.0, 1e5])
    for chance in (chance_alike, chance_where_seen):
        for freedom in (np.inf, 20.0):
            known = chance(parts, freedom)
            assert known is not None
            assert 0.0 < known < 1.0
            assert chance([each.along(scaled) for each in parts], freedom) == pytest.approx(known)
    # Scores of exactly one set of numbers leave a square of rounding, of either sign.
    for true in rng.standard_normal((20, 3)):
        exact = [
            RecordParts(scored[None], square[None], square[None, :, None])
            for square in (root @ root.T + np.eye(3) for root in roots)
            for scored in [square @ true]
        ]
        for freedom in (np.inf, 20.0):
            assert chance_alike(exact, freedom) == pytest.approx(1.0, abs=1e-6)
    one = np.array([[2.0, 0.3], [0.3, 1.0]])
    other = np.array([[1.0, 0.0], [0.0, 3.0]])
    both = larger(one, other)
    for least in (one, other):
        assert np.linalg.eigvalsh(both - least).min() > -1e-12
    assert larger(one, 0.1 * one) == pytest.approx(one)
    assert larger(one, 7.0 * one) == pytest.approx(7.0 * one)


def test_halves_of_a_record_have_scores_information_and_noise() -> None:
    made, _, _ = block()
    heard = np.array([blocks._squares_of_halves(made, output) for output in (0, 1)])
    (found,) = blocks.flights_of([heard], [made])
    own, residual = made.basis, made.residual.ravel()
    inside = np.tile(np.arange(30) < made.middle, 2)
    apart = []
    for half, rows in enumerate((inside, ~inside)):
        part = np.where(rows[:, None], made.projected, 0.0)
        assert found.scores[half] == pytest.approx(residual @ part)
        assert found.information[half] == pytest.approx(part.T @ part)
        apart.append(part - own @ (own.T @ part))
    wide = np.hstack(apart)
    assert found.noise.reshape(6, 6) == pytest.approx(wide.T @ wide)
    beside = blocks.JointResiduals(np.full((4, 3), 2.0), np.full((4, 3), 3.0))
    rest = blocks.rest_of([found, found], beside)
    assert rest is not None
    assert rest.scores[0] == pytest.approx(-2.0 * residual @ made.projected)
    assert rest.information[0] == pytest.approx(np.full((3, 3), 24.0))
    assert rest.noise[0, :, 0] == pytest.approx(np.full((3, 3), 16.0))
    assert blocks.rest_of([found], None) is None
    unmeasured = blocks.JointResiduals(beside.slopes, beside.total, measured=False)
    assert blocks.rest_of([found], unmeasured) is None
    chosen = beside.of(np.array([True, False, True]))
    assert (chosen.slopes.shape, chosen.total.shape) == ((4, 2), (4, 2))


def test_freedom_is_that_of_the_outputs_that_an_estimate_hears() -> None:
    models = [Autoregression(np.array([1.0]), np.zeros(0), n, 64) for n in (500, 300)]
    variances = np.array([np.diag([1.0, 2.0, 0.0]), np.diag([3.0, 0.5, 0.0])])
    shared = variances.sum(axis=0)
    found = blocks.freedom_of(shared, variances, models, [block()[0]], np.eye(3))
    known = [16.0 / (1.0 / 500.0 + 9.0 / 300.0), 6.25 / (4.0 / 500.0 + 0.25 / 300.0), np.inf]
    assert found == pytest.approx(known)


def test_a_record_that_tells_no_parameter_has_parts_of_no_size() -> None:
    """Every parameter of a joint fit stood at a bound: a `ValueError` of an ambiguous shape."""
    made, shared, own = block()
    bare = RecordBlock.of(shared[:, :, :0], own, made.residual)
    own_count = bare.basis.shape[1]
    (flight,) = flights_of([np.eye(own_count)[None]], [bare])
    assert flight.scores.shape == (2, 0)
    assert flight.noise.shape == (2, 0, 2, 0)
