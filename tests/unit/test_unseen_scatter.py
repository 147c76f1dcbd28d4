"""What records that agree cannot exclude, against simulated fleets and sums of squares."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.signal import lfilter

import flightid as fid
from flightid.conventions import Light
from flightid.evidence.part_checks import agreement_check
from flightid.models.polynomial.gain_and_speed import gain_and_speed
from flightid.uncertainty.agreement import Agreement, compare_parts
from flightid.uncertainty.parts import RecordParts
from flightid.uncertainty.unseen_scatter import (
    FLOWN_APART,
    UnseenScatter,
    chance_below,
    compared_records,
)
from tests.closeness import assert_close
from tests.strangers.output_error import TRUTH
from tests.strangers.parts import (
    arx_flown,
    by_arx,
    by_output_error,
    recorded,
    response,
    stepped,
)

Array = NDArray[np.float64]
VALUES = np.array([-3.0, 20.0])
INFORMATIONS = np.array([[[900.0, 20.0], [20.0, 4.0]], [[500.0, -30.0], [-30.0, 9.0]]])


def _records(means: Array, informations: Array = INFORMATIONS) -> list[RecordParts]:
    """Records that each know a vehicle of their own, with noise of unit variance."""
    common = np.linalg.solve(informations.sum(axis=0), np.einsum("kij,kj->i", informations, means))
    return [
        RecordParts((h @ (mean - common))[None], h[None], h[None, :, None])
        for mean, h in zip(means, informations, strict=True)
    ]


@pytest.mark.parametrize("scales", [[1.0, 1.0, 1.0], [1.0, 3.0, 150.0], [2.0, 40.0], [7.0]])
def test_chance_of_a_sum_of_squares_is_that_of_draws(scales: list[float]) -> None:
    drawn = np.random.default_rng(1).standard_normal((200_000, len(scales))) ** 2 @ scales
    for square in (0.5, 5.0, 60.0):
        expected = np.mean(drawn < square)
        error = 4.0 * np.sqrt(max(expected * (1.0 - expected), 1e-5) / drawn.size)
        assert_close(chance_below(square, np.array(scales)), expected, atol=error, why="draws")


def test_a_fleet_agrees_as_often_and_needs_bars_as_long_as_is_said() -> None:
    """Chances of flights that are so far apart are evenly spread, and their means as said."""
    random = np.random.default_rng(2)
    spread = np.linalg.inv(INFORMATIONS.sum(axis=0))
    chances, means, longer = [], [], 1.0
    for _ in range(150):
        vehicles = VALUES * (1.0 + FLOWN_APART * random.standard_normal((2, 2)))
        noises = [
            np.linalg.cholesky(np.linalg.inv(h)) @ random.standard_normal(2) for h in INFORMATIONS
        ]
        known = vehicles + noises
        found = compared_records(_records(known), spread, spread)
        assert found is not None
        unseen = found.unseen(np.diag(VALUES), np.sqrt(np.diag(spread)))
        chances.append(unseen.chance)
        longer = unseen.longer
        means.append(spread @ np.einsum("kij,kj->i", INFORMATIONS, known))
    assert stats.kstest(chances, "uniform").pvalue > 0.01
    ratio = np.std(means, axis=0) / np.sqrt(np.diag(spread))
    assert_close(np.max(ratio), longer, rtol=0.2, why="150 means know theirs to 6 %")


def test_units_and_order_of_records_change_nothing() -> None:
    spread = np.linalg.inv(INFORMATIONS.sum(axis=0))
    means = VALUES * np.array([[1.01, 1.0], [0.99, 1.02]])
    scale = np.array([57.3, 1e-3])
    turned = INFORMATIONS / np.outer(scale, scale)
    other = spread * np.outer(scale, scale)
    told = []
    for records, solve, values in (
        (_records(means), spread, VALUES),
        (_records(means)[::-1], spread, VALUES),
        (_records(means * scale, turned), other, VALUES * scale),
    ):
        found = compared_records(records, solve, solve)
        assert found is not None
        unseen = found.unseen(np.diag(values), np.sqrt(np.diag(solve)))
        told.append([unseen.chance, unseen.longer])
    assert_close(told[1], told[0], rtol=1e-9, why="rounding")
    assert_close(told[2], told[0], rtol=1e-6, why="rounding")


def test_what_one_record_tells_alone_asks_for_no_longer_bars() -> None:
    informations = np.array([np.diag([1e4, 1.0]), np.diag([1.0, 1.0])])
    spread = np.linalg.inv(informations.sum(axis=0))
    found = compared_records(_records(np.tile(VALUES, (2, 1)), informations), spread, spread)
    assert found is not None
    assert found.alone.tolist() == [True, False]
    assert_close(
        found.unseen(np.diag(VALUES), np.sqrt(np.diag(spread))).longer,
        np.sqrt(1.0 + (FLOWN_APART * 20.0) ** 2),
        rtol=1e-9,
        why="half of each variance over half of one",
    )


def test_records_are_compared_once_and_less_of_them_where_less_is_asked() -> None:
    spread = np.linalg.inv(INFORMATIONS.sum(axis=0))
    flights = [
        RecordParts(
            np.tile(0.5 * each.scores, (2, 1)),
            np.tile(0.5 * each.information, (2, 1, 1)),
            np.einsum("kl,ij->kilj", np.eye(2), 0.5 * each.information[0]),
        )
        for each in _records(np.tile(VALUES, (2, 1)))
    ]
    made = compare_parts(flights, spread, spread, np.full(2, np.inf)).agreement
    assert made.compared is not None
    fewer = made.of(1).compared
    assert fewer is not None
    assert fewer.slopes.shape == (2, 2, 1)
    assert fewer.unseen(np.diag(VALUES[:1]), made.by_noise[:1]).n_records == 2


@pytest.mark.parametrize(
    ("chance", "longer", "light", "said"),
    [
        (0.3, 2.5, Light.AMBER, "what"),
        (0.3, 1.5, Light.GREEN, "limit"),
        (0.3, 1.05, Light.GREEN, ""),
        (0.04, 9.0, Light.GREEN, ""),
    ],
)
def test_the_light_of_records_that_agree(
    chance: float, longer: float, light: Light, said: str
) -> None:
    found = Agreement(2, None, 0.4, np.ones(2))
    check = agreement_check(found, VALUES, UnseenScatter(2, chance, longer))
    words = "2 records agree, as 30 of 100 such sets of flights 3 % apart would: what is known"
    assert check.light is light
    assert (words in check.what) is (said == "what")
    assert (words in check.limit) is (said == "limit")
    assert bool(check.action) is (said == "what")
    differ = Agreement(2, None, 1e-4, np.ones(2))
    assert agreement_check(differ, VALUES, UnseenScatter(2, chance, longer)).light is Light.RED


def test_a_pair_that_could_not_show_vehicles_apart_says_so() -> None:
    random = np.random.default_rng(4)
    records = []
    for inputs in (stepped(random, 600), stepped(random, 600)):
        rate = response(inputs, *TRUTH.values(), 0.0)
        records.append(recorded(inputs, rate + 0.2 * rate.std() * random.standard_normal(600)))
    fit = by_output_error(records)
    check = next(c for c in fit.evidence.checks if c.name == "agreement of parts")
    assert fit.agreement is not None
    assert fit.agreement.agree
    assert "flights 3 % apart would: what is known is of these flights alone" in check.limit
    assert (
        check.light is Light.GREEN
    )  # Bars of 8 % would be 1.2 times as long: no more than a word.


def test_a_black_box_goes_with_gain_and_speed_of_its_vehicle() -> None:
    """Of an oscillator faster by a percent: poles of exp((-0.3 ± 2j) 0.1) to that power."""
    poles = np.exp(0.1 * np.array([-0.3 + 2.0j, -0.3 - 2.0j]))
    a, faster = (np.poly(poles**power)[1:].real for power in (1.0, 1.0 + 1e-4))
    values = np.concatenate([a, [0.5, 0.2, 3.0]])
    moves = gain_and_speed(["a1", "a2", "b1[u]", "b2[u]", "b1[v]"], values)
    assert moves.shape == (5, 3)
    assert moves[:, 0].tolist() == [0.0, 0.0, 0.5, 0.2, 0.0]
    assert moves[:, 1].tolist() == [0.0, 0.0, 0.0, 0.0, 3.0]
    assert_close(moves[:2, 2], (faster - a) / 1e-4, rtol=1e-3, why="a difference of 1e-4")


def test_a_pair_is_compared_in_the_terms_of_the_vehicle_alone() -> None:
    """A model of the noise has terms of its own: its evidence broke off where they had no bars."""

    def record(seed: int) -> fid.Record:
        random = np.random.default_rng(seed)
        u, e = np.sign(random.standard_normal(400)), 0.1 * random.standard_normal(400)
        y = lfilter([0.0, 0.5], [1.0, -0.9], u) + lfilter([1.0], [1.0, -1.5, 0.9], e)
        t = np.arange(400) * 0.1
        return fid.Record.from_arrays(t, inputs={"u": u}, outputs={"y": y}, hold="zero")

    structure = fid.PolynomialModel.bj("u", "y", nb=1, nc=1, nd=1, nf=1)
    fit = fid.identify(structure, [record(1), record(2)], loop="open")
    assert tuple(fit.names) == ("b1", "f1")
    check = next(c for c in fit.evidence.checks if c.name == "agreement of parts")
    assert check.what.startswith("2 records agree")


def test_a_pair_of_short_regressions_says_what_it_cannot_show() -> None:
    said = []
    for seed in range(4):
        random = np.random.default_rng(seed)
        fit = by_arx([arx_flown(random, 0.0)[0] for _ in range(2)])
        check = next(c for c in fit.evidence.checks if c.name == "agreement of parts")
        said.append("2 records agree, as" in check.what + check.limit)
    assert any(said)
