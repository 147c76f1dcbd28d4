"""Covariances, chances and loops know neither units nor order, and turn as parameters do.

Factors are powers of two, which no product rounds; records are of unequal lengths, so that none
stands for another.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from flightid.uncertainty.blocks import RecordBlock, levels
from flightid.uncertainty.coloured_residuals import ResidualCovariance, residual_covariance
from flightid.uncertainty.fed_noise import fed_noise_spectrum
from flightid.uncertainty.feedback import find_feedback
from flightid.uncertainty.feedback_power import _whitened_power, unseen_feedback
from flightid.uncertainty.moving_past import moving_chance
from flightid.uncertainty.noisy_input import explaining_noise
from flightid.uncertainty.paired_errors import excess_score
from flightid.uncertainty.transformed_columns import AT_ONCE, powers_of
from tests.closeness import assert_close

Array = NDArray[np.float64]
LENGTHS = (420, 300, 360)
SHARED = np.array([4.0, 0.125, 32.0])
OWN = np.array([[2.0, 0.0], [0.5, 8.0]])
OF_INPUTS = np.array([0.25, 16.0])


def _blocks(
    turn: Array, own_turn: Array, outputs: list[int], records: list[int], size: float
) -> tuple[list[RecordBlock], list[Array]]:
    """Three records of two outputs, one of coloured noise; a vehicle that differs by record."""
    random = np.random.default_rng(5)
    made, inputs = [], []
    for k, n in enumerate(LENGTHS):
        shared = lfilter([1.0], [1.0, -0.9], random.standard_normal((2, n, 3)), axis=1)
        own = np.stack([np.ones((2, n)), np.array([[1.0], [-0.5]]) * np.linspace(-1, 1, n)], -1)
        noise = random.standard_normal((2, n))
        noise[1] = lfilter([2.0], [1.0, -0.7], noise[1])
        moved = random.standard_normal((2, n))
        noise[0, 5:] += 0.25 * moved[1, :-5]
        rows = noise + shared @ (0.06 * (k - 1) * np.array([1.0, -2.0, 0.5]))
        block = RecordBlock.of(
            size * (shared @ np.linalg.inv(turn))[outputs],
            (own @ np.linalg.inv(own_turn))[outputs],
            size * rows[outputs],
        )
        made.append(block)
        inputs.append(moved)
    return [made[k] for k in records], [inputs[k] for k in records]


def _found(
    turn: Array | None = None,
    own_turn: Array | None = None,
    outputs: tuple[int, int] = (0, 1),
    records: tuple[int, int, int] = (0, 1, 2),
    size: float = 1.0,
    of_inputs: Array | None = None,
) -> ResidualCovariance:
    blocks, inputs = _blocks(
        np.eye(3) if turn is None else turn,
        np.eye(2) if own_turn is None else own_turn,
        list(outputs),
        list(records),
        size,
    )
    factors = np.ones(2) if of_inputs is None else of_inputs
    return residual_covariance(blocks, inputs=[factors[:, None] * u for u in inputs])


PLAIN = _found()


def _alike(found: ResidualCovariance, why: str, near: float = 1e-6, **but: Any) -> None:
    """All that a change of names and units leaves as it is."""
    for name in ("halves", "records"):
        assert_close(
            getattr(found.agreement, name), getattr(PLAIN.agreement, name), rtol=near, why=why
        )
    assert found.agreement.told_once == PLAIN.agreement.told_once
    assert found.orders == but.get("orders", PLAIN.orders)
    one = sorted(
        found.correlations, key=lambda e: (but.get("place", {}).get(e.output, e.output), e.input)
    )
    assert len(one) == len(PLAIN.correlations) == 4
    for each, plain in zip(one, PLAIN.correlations, strict=True):
        for field in dataclasses.fields(plain):
            if field.name not in ("output", "input", "lags"):
                assert_close(
                    np.asarray(getattr(each, field.name)),
                    np.asarray(getattr(plain, field.name)),
                    rtol=1e-5,
                    atol=1e-9,
                    why=f"{why}: {field.name}",
                )


def test_the_case_tells_something() -> None:
    assert PLAIN.agreement.records is not None
    assert 1e-12 < PLAIN.agreement.records < 0.5
    assert PLAIN.agreement.halves is not None
    assert PLAIN.orders[0] != PLAIN.orders[1]
    assert max(each.share for each in PLAIN.correlations) > 0.01
    assert min(each.p_value for each in PLAIN.correlations) < 0.01
    assert max(each.p_value for each in PLAIN.correlations) > 0.05


@pytest.mark.parametrize("mixed", [False, True])
def test_a_covariance_turns_with_its_parameters(*, mixed: bool) -> None:
    turn = np.diag(SHARED)
    if mixed:
        turn = turn @ np.array([[1.0, 0.5, -0.25], [0.0, 1.0, 2.0], [0.5, 0.0, 1.0]])
    found = _found(turn)
    for name in ("covariance", "white"):
        plain = getattr(PLAIN, name)
        size = np.sqrt(np.diag(turn @ plain @ turn.T))
        assert_close(
            getattr(found, name) / np.outer(size, size),
            turn @ plain @ turn.T / np.outer(size, size),
            atol=1e-8,
            why="rounding of two inverses",
        )
    for k in range(3):
        assert_close(found.own[k], PLAIN.own[k], rtol=1e-6, atol=1e-12, why="not turned")
        assert_close(found.crossed[k], PLAIN.crossed[k] @ turn.T, rtol=1e-5, atol=1e-9, why="once")
    if not mixed:
        assert_close(found.freedom, PLAIN.freedom, rtol=1e-6, why="of the same directions")
        assert_close(found.ratios, PLAIN.ratios, rtol=1e-6, why="of the same directions")
    _alike(found, "turned", 1e-3 if mixed else 1e-6)


def test_own_numbers_of_a_record_turn_apart() -> None:
    found = _found(own_turn=OWN)
    assert_close(found.covariance, PLAIN.covariance, rtol=1e-6, why="no shared number turned")
    for k in range(3):
        assert_close(found.own[k], OWN @ PLAIN.own[k] @ OWN.T, rtol=1e-6, why="twice")
        assert_close(found.crossed[k], OWN @ PLAIN.crossed[k], rtol=1e-5, atol=1e-9, why="once")
    _alike(found, "own numbers turned")


def test_records_and_outputs_in_another_order_tell_the_same() -> None:
    found = _found(records=(2, 0, 1))
    assert_close(found.covariance, PLAIN.covariance, rtol=1e-6, why="a sum of records")
    assert_close(found.own[0], PLAIN.own[2], rtol=1e-6, why="with its record")
    _alike(found, "records in another order")
    found = _found(outputs=(1, 0))
    assert_close(found.covariance, PLAIN.covariance, rtol=1e-6, why="a sum of outputs")
    _alike(found, "outputs in another order", orders=PLAIN.orders[::-1], place={0: 1, 1: 0})


def test_the_size_of_residuals_and_the_units_of_inputs_are_no_evidence() -> None:
    for found in (_found(size=64.0), _found(of_inputs=OF_INPUTS)):
        assert_close(found.covariance, PLAIN.covariance, rtol=1e-6, why="slopes have it too")
        _alike(found, "other units")


def test_levels_are_variances_over_those_of_all_records() -> None:
    random = np.random.default_rng(1)
    blocks, _ = _blocks(np.eye(3), np.eye(2), [0, 1], [0, 1, 2], 0.01)
    blocks = [
        dataclasses.replace(each, residual=0.01 * random.standard_normal((2, n)) * [[k], [0.0]])
        for each, n, k in zip(blocks, LENGTHS, (1.0, 2.0, 3.0), strict=True)
    ]
    squares = np.array([np.sum(each.residual[0] ** 2) for each in blocks])
    wanted = squares / LENGTHS * sum(LENGTHS) / squares.sum()
    assert_close(levels(blocks)[:, 0], wanted, rtol=1e-12, why="rounding")
    assert levels(blocks)[:, 1].tolist() == [1.0] * 3  # A residual that vanishes has no level.


def _flights(closed: float) -> tuple[list[Array], list[Array]]:
    """Two inputs and outputs; the first output's noise is fed back to the second input."""
    random = np.random.default_rng(11)
    inputs, outputs = [], []
    for n in (1500, 1100):
        u, e = random.standard_normal((2, n)), random.standard_normal((2, n))
        u[0] = lfilter([1.0], [1.0, -0.8], u[0])
        e[0] = lfilter([1.0], [1.0, -0.9], e[0])
        u[1, 1:] -= closed * e[0, :-1]
        y = np.array(
            [
                lfilter([0.0, 0.5], [1.0, -0.7], u[0]) + lfilter([0.0, 0.2], [1.0], u[1]),
                lfilter([0.0, 0.3], [1.0, -0.5], u[1]),
            ]
        )
        inputs.append(u - u.mean(axis=1, keepdims=True))
        outputs.append(y + e - (y + e).mean(axis=1, keepdims=True))
    return inputs, outputs


@pytest.mark.parametrize("closed", [0.0, 0.06, 0.5])
def test_a_loop_is_seen_in_any_units_and_order(closed: float) -> None:
    u, y = _flights(closed)
    plain = find_feedback(u, y, ["a", "b"])
    other = find_feedback(
        [np.array([[8.0], [0.25]]) * each for each in u],
        [np.array([[0.5], [128.0]]) * each for each in y],
        ["a", "b"],
    )
    turned = find_feedback([e[::-1] for e in u[::-1]], [e[::-1] for e in y[::-1]], ["b", "a"])
    assert plain.loop == ("closed" if closed > 0.1 else plain.loop)
    assert (plain.input == "b") or not plain.is_closed
    for found in (other, turned):
        for field in dataclasses.fields(plain):
            one, two = (getattr(each, field.name) for each in (plain, found))
            if isinstance(one, float):
                assert_close(two, one, rtol=1e-5, why=f"{field.name}: a ridge of 1e-11")
            else:
                assert one == two, field.name


def test_what_noise_feeds_back_has_the_units_of_both_ends() -> None:
    u, y = _flights(0.5)
    omega = np.array([0.05, 0.3, 1.0, 2.5])
    at_once = np.array([[0.0, 0.1], [0.2, 0.0]])
    of_u, of_y = np.array([8.0, 0.25]), np.array([0.5, 128.0])
    plain = fed_noise_spectrum(u, y, 1.0, omega, at_once)
    other = fed_noise_spectrum(
        [of_u[:, None] * e for e in u],
        [of_y[:, None] * e for e in y],
        1.0,
        omega,
        at_once * of_y[:, None] / of_u,
    )
    assert plain is not None
    assert other is not None
    size = np.max(np.abs(plain))
    assert size > 0.1
    assert_close(other / np.outer(of_u, of_y), plain, atol=1e-6 * size, why="ridge")
    turned = fed_noise_spectrum(
        [e[::-1] for e in u[::-1]], [e[::-1] for e in y[::-1]], 1.0, omega, at_once[::-1, ::-1]
    )
    assert turned is not None
    assert_close(turned[:, ::-1, ::-1], plain, atol=1e-6 * size, why="ridge")
    slow = fed_noise_spectrum(u, y, 0.5, 2.0 * omega, at_once)
    assert slow is not None
    assert_close(slow, 0.5 * plain, atol=1e-9 * size, why="power per hertz of a wider band")


def test_scores_of_errors_and_of_a_moving_past_know_no_units() -> None:
    u, y = _flights(0.06)
    random = np.random.default_rng(3)
    errors = [e[0] for e in y]
    others = [e + 0.4 * random.standard_normal(e.size) for e in errors]
    plain = excess_score(others, errors)
    assert plain > 2.0
    assert_close(excess_score(errors, others), -plain, rtol=1e-9, why="the other way round")
    scaled = excess_score([4.0 * e for e in others[::-1]], [4.0 * e for e in errors[::-1]])
    assert_close(scaled, plain, rtol=1e-9, why="units, and order")
    longer = excess_score([np.r_[9.0, e] for e in others], errors)
    assert_close(longer, plain, rtol=1e-9, why="the last samples count")
    pairs, noise = list(zip(u, y, strict=True)), [e[:, 20:] for e in y]
    chances = [
        moving_chance(
            [(np.array([[f], [g]]) * a, b) for a, b in pairs],
            [h * e for e in noise],
            1,
            20,
            range(1, 9),
            1e-12,
        )
        for f, g, h in ((1.0, 1.0, 1.0), (8.0, 0.25, 64.0))
    ]
    assert chances[0] is not None
    assert_close(chances[1], chances[0], rtol=1e-5, why="directions to 1e-10")


def test_a_noisy_sensor_explains_a_loop_in_any_units() -> None:
    random = np.random.default_rng(0)
    shares = []
    e, n, v = random.standard_normal((3, 2400))
    u = lfilter([1.0], [1.0, -1.6, 0.7], e)
    seen, y = u + 0.1 * np.std(u) * n, np.append(0.0, u[:-1]) + 0.1 * v
    for of_u, of_y in ((1.0, 1.0), (0.25, 64.0)):
        cut = [(of_u * seen[None, a:b], of_y * y[None, a:b]) for a, b in ((0, 1400), (1400, 2400))]
        shares.append(explaining_noise(cut, 0, 10, 12))
        shares.append(explaining_noise(cut[::-1], 0, 10, 12))
    assert shares[0] is not None
    assert_close(shares[0], 0.01, rtol=0.4, why="chance of 2,400 samples")
    found = np.array(shares, dtype=float)
    assert_close(found[2:], found[:2], rtol=1e-9, why="units")
    assert_close(found[1], found[0], rtol=1e-9, why="long runs of noise cross no record's end")


def test_feedback_that_no_test_sees_bends_an_estimate_alike_in_any_units() -> None:
    random = np.random.default_rng(2)
    n, size = (900, 700), np.array([4.0, 0.5])
    noise = [random.standard_normal((2, k)) for k in n]
    inputs = [random.standard_normal((2, k)) for k in n]
    fresh = [0.8 * each for each in inputs]
    echo = np.array([[[0.9, 0.1], [0.0, 0.5]], [[0.05, 0.0], [0.1, -0.3]]])
    own = np.array([[[0.4, 0.0], [0.0, -0.2]]])
    plain = unseen_feedback(noise, echo, inputs, own, fresh)
    assert plain is not None
    other = unseen_feedback(
        [size[:, None] * each for each in noise],
        echo * size[:, None] / size,
        [8.0 * each for each in inputs],
        own,
        [8.0 * each for each in fresh],
    )
    assert other is not None
    assert_close((other.share, other.bias), (plain.share, plain.bias), rtol=1e-6, why="units")
    turned = unseen_feedback(
        [each[::-1] for each in noise[::-1]],
        echo[:, ::-1, ::-1],
        [each[::-1] for each in inputs[::-1]],
        own[:, ::-1, ::-1],
        [each[::-1] for each in fresh[::-1]],
    )
    assert turned is not None
    assert turned.input == 1 - plain.input
    assert_close((turned.share, turned.bias), (plain.share, plain.bias), rtol=1e-6, why="order")


def test_power_of_answers_is_of_what_an_inputs_past_does_not_foretell() -> None:
    """By output: all lags and all noises, filtered by one less the weights of the past."""
    fed = np.random.default_rng(4).standard_normal((40, 2, 3))
    past = np.array([0.5, -0.25])
    whole = lfilter(np.r_[1.0, -past], [1.0], fed, axis=0)
    found = _whitened_power(past, fed)
    count = next(k for k in range(1, 41) if np.allclose(found, np.sum(whole[:k] ** 2, axis=(0, 2))))
    assert count > 5
    assert_close(
        _whitened_power(np.zeros(0), fed),
        np.sum(fed[:count] ** 2, axis=(0, 2)),
        rtol=1e-12,
        why="none",
    )


def test_powers_of_bins_are_of_both_parts_in_every_span() -> None:
    random = np.random.default_rng(6)
    part = random.standard_normal((3, 2 * AT_ONCE + 6))
    form = random.standard_normal((3, 3))
    whole = np.einsum("kb,kl,lb->b", part, form, part)
    assert_close(powers_of(form, part), whole[::2] + whole[1::2], rtol=1e-9, atol=1e-9, why="sum")
