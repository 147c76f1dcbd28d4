"""Weights that change beside plain regressions, sample by sample, and noise of inputs likewise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy

from flightid.uncertainty import moving_past, noisy_input
from flightid.uncertainty.noisy_input import (
    _Directions,
    _long_run,
    _NoisyPast,
    _smallest,
    _whitened,
)

Array = np.ndarray
Pairs = list[tuple[Array, Array]]


def records(*lengths: int, order: int, fed: float = 0.1) -> tuple[Pairs, list[Array]]:
    """Two inputs, of which past noise of two outputs moves the second a little, and that noise."""
    rng = np.random.default_rng(4)
    pairs, noise = [], []
    for n in lengths:
        e = rng.standard_normal((2, n))
        u = np.cumsum(rng.standard_normal((2, n)), axis=1) * 0.1 + rng.standard_normal((2, n))
        u[1, 2:] += fed * (e[0, 1:-1] - e[1, :-2])
        pairs.append((u, e + 1.0))
        noise.append(e[:, order:])
    return pairs, noise


def plain(pairs: Pairs, noise: list[Array], place: int, order: int, lags: range) -> float | None:
    """The F test by one regression of each record, every column written down."""
    rest, rows_free, used = [], 0, 0
    for (u, _), left in zip(pairs, noise, strict=True):
        n = u.shape[1]
        e = np.hstack([np.zeros((2, n - left.shape[1])), left])
        times = range(order + lags[-1], n)
        moving = min(8, order)
        if len(times) < 5 * (2 * order + 4 * moving):
            continue
        known, past = [], []
        for t in times:
            x = -1.0 + 2.0 * (t - times[0]) / (len(times) - 1)
            powers = (
                x,
                (3 * x**2 - 1) / 2,
                (5 * x**3 - 3 * x) / 2,
                (35 * x**4 - 30 * x**2 + 3) / 8,
            )
            known.append(
                [u[i, t - k] for i in (0, 1) for k in range(1, order + 1)]
                + [u[place, t - k] * p for p in powers for k in range(1, moving + 1)]
            )
            past.append([e[o, t - k] for o in (0, 1) for k in lags] + [u[place, t]])
        table, both = np.array(known), np.array(past)
        rest.append(both - table @ np.linalg.lstsq(table, both, rcond=None)[0])
        rows_free += len(times) - table.shape[1]
        used += n
    width = 2 * len(lags)
    if 2 * used < sum(u.shape[1] for u, _ in pairs) or rows_free <= width:
        return None
    left = np.vstack(rest)
    ways, aim = left[:, :-1], left[:, -1]
    unknown = aim - ways @ np.linalg.lstsq(ways, aim, rcond=None)[0]
    share = 1.0 - unknown @ unknown / (aim @ aim)
    # The F distribution's tail as a beta function of the share that is not explained.
    return float(scipy.special.betainc(0.5 * (rows_free - width), 0.5 * width, 1.0 - share))


def test_weights_that_change_are_those_of_a_plain_regression() -> None:
    for lengths, order, lags, place in (
        ((400,), 3, range(1, 4), 1),
        ((300, 250), 2, range(1, 4), 1),
        ((300, 30), 2, range(1), 0),
        ((600,), 10, range(2, 5), 1),
    ):
        pairs, noise = records(*lengths, order=order)
        known = plain(pairs, noise, place, order, lags)
        found = moving_past._chance(pairs, noise, place, order, lags)
        assert known is not None
        assert found == pytest.approx(known, rel=1e-6)
        assert moving_past.moving_chance(pairs, noise, place, order, lags, 0.01) == found


def test_where_a_record_is_too_short_for_weights_that_change() -> None:
    """Two inputs of two past samples, and two of them by four polynomials: twelve columns."""
    for n, is_known in ((62, True), (61, False)):
        pairs, _ = records(n, order=2)
        assert (moving_past._known(pairs[0][0], 1, 2, 0) is not None) is is_known
    # Half of all samples, or more, lie in records that are long enough.
    for short, is_known in ((1, True), (2, False)):
        lengths = (80, *[40] * (2 * short))
        pairs, noise = records(*lengths, order=2)
        found = moving_past._chance(pairs, noise, 1, 2, range(1, 2))
        assert (found is not None) is is_known
    pairs, noise = records(62, order=2)
    for lags, is_known in ((range(1, 24), True), (range(1, 25), False)):
        # Rows beyond the past, less its columns, must be more than the noise's.
        longer = [(np.hstack([u, u[:, : lags[-1]]]), y) for u, y in pairs]
        heard = [np.hstack([e, e[:, : lags[-1]]]) for e in noise]
        found = moving_past._chance(longer, heard, 1, 2, lags)
        assert (found is not None) is is_known
    still = [(0.0 * u, y) for u, y in pairs]
    assert moving_past._chance(still, noise, 1, 2, range(1, 2)) is None


def test_the_first_samples_are_asked_first(monkeypatch: pytest.MonkeyPatch) -> None:
    lengths = (3000, 2000, 500)
    u = [np.zeros((2, n)) for n in lengths]
    pairs = [(each, each[:1]) for each in u]
    noise = [each[:, 5:] for each in u]
    kept, heard = moving_past._begun(pairs, noise)
    assert [each.shape for pair in kept for each in pair] == [
        *((2, 3000), (1, 3000)),
        *((2, 1000), (1, 1000)),
    ]
    assert [each.shape for each in heard] == [(2, 2995), (2, 995)]
    assert moving_past._begun(pairs[:1], [u[0][:, :0]])[1][0].shape == (2, 0)
    full = [(np.zeros((1, 4000)),) * 2, (np.zeros((1, 9)),) * 2]
    assert len(moving_past._begun(full, [each[0] for each in full])[0]) == 1
    asked: list[int] = []
    begun: list[float | None] = []

    def chance(some: Pairs, *_: Any) -> float | None:
        asked.append(sum(u.shape[1] for u, _ in some))
        return begun[-1] if asked[-1] < 5500 else 0.5

    monkeypatch.setattr(moving_past, "_chance", chance)
    for first, answer, sizes in (
        (0.009, 0.009, [4000]),
        (0.01, 0.5, [4000, 5500]),
        (None, 0.5, [4000, 5500]),
    ):
        asked.clear()
        begun.append(first)
        assert moving_past.moving_chance(pairs, noise, 0, 5, range(1, 2), 0.01) == answer
        assert asked == sizes
    short = (pairs[2:], noise[2:])
    for some, sizes in ((short, [500]), ((pairs[:1] * 2, noise[:1] * 2), [4000, 6000])):
        asked.clear()
        begun.append(0.01)
        moving_past.moving_chance(*some, 0, 5, range(1, 2), 0.01)
        assert asked == sizes


def test_directions_are_weighed_as_a_wiener_filter_does() -> None:
    """Columns that are orthogonal: their powers are 4, 1 and a tenth."""
    n, power = 300, np.array([0.1, 1.0, 4.0])
    turned = np.linalg.qr(np.random.default_rng(1).standard_normal((n, 3)))[0] * np.sqrt(n * power)
    found = _Directions.of(turned)
    assert found.power == pytest.approx(power)
    targets = turned @ np.array([[1.0], [2.0], [3.0]])
    assert found.weights(targets, 0.0)[:, 0] == pytest.approx([1.0, 2.0, 3.0])
    for variance in (0.05, 0.5):
        left = np.maximum(power - variance, 0.0)
        error = 3.0 * power * np.sqrt(2.0 / n)
        shrunk = left * power / (left**2 + error**2)
        assert found.weights(targets, variance)[:, 0] == pytest.approx(shrunk * [1.0, 2.0, 3.0])
    # A direction of rounding counts for nothing: less than 1e-10 of the strongest.
    weak = turned * np.array([1e-7, 1.0, 1.0])
    lost = _Directions.of(weak).weights(weak[:, :1], 0.0)
    assert 0.0 < lost[0, 0] < 1e-2


def test_the_scatter_of_sums_has_bartletts_weights() -> None:
    rows = np.random.default_rng(2).standard_normal((40, 2)) + 5.0
    for span in (1, 4):
        for lengths in ([40], [25, 12, 3]):
            centred, of = rows - rows.mean(axis=0), np.repeat(np.arange(len(lengths)), lengths)
            known = np.zeros((2, 2))
            for s in range(40):
                for t in range(40):
                    weight = max(1.0 - abs(s - t) / span, 0.0) * (of[s] == of[t])
                    known += weight * np.outer(centred[s], centred[t])
            assert _long_run(rows, span, lengths) == pytest.approx(known, abs=1e-9)


def test_the_past_of_an_input_beside_a_noisy_one_is_a_plain_regression() -> None:
    order, lags = 3, 2
    pairs, _ = records(70, 5, 60, order=order)
    asked = _NoisyPast.of(pairs, 1, order, lags)
    kept = [pairs[0], pairs[2]]
    rows: dict[str, list[Any]] = {"mine": [], "other": [], "y": [], "held": [], "own": []}
    for u, y in kept:
        for t in range(order, u.shape[1]):
            rows["mine"].append([u[1, t - k] for k in range(order + 1)])
            rows["other"].append([u[0, t - k] for k in range(order + 1)])
            rows["y"].append(y[:, t])
            rows["own"].append([y[o, t - k] for o in (0, 1) for k in range(1, order + 1)])
            rows["held"].append(t >= order + lags)
    table = {name: np.array(each) for name, each in rows.items()}

    def left(target: str, by: str) -> Array:
        ways = np.linalg.lstsq(table[by], table[target], rcond=None)[0]
        return np.asarray(table[target] - table[by] @ ways)

    white = left("y", "own")
    assert np.concatenate(_whitened([y for _, y in kept], order)) == pytest.approx(white)
    table["y"] = white
    mine, outputs = left("mine", "other"), left("y", "other")
    assert asked.now == pytest.approx(mine[table["held"], 0])
    assert asked.own.columns == pytest.approx(mine[table["held"], 1:])
    assert asked.with_now.columns == pytest.approx(mine)
    assert asked.outputs == pytest.approx(outputs)
    assert (asked.lengths, asked.lags, asked.numbers) == ((67, 57), 2, 4)
    assert asked.power == pytest.approx(np.mean(mine[table["held"], 0] ** 2))
    for variance in (0.0, 0.05):
        weights = asked.own.weights(asked.now, variance)
        ways = asked.with_now.weights(outputs, variance)
        news = outputs - mine @ ways
        error = asked.now - asked.own.columns @ weights
        heard, at = [], 0
        for length in asked.lengths:
            part = news[at : at + length]
            heard += [[part[t - k, o] for o in (0, 1) for k in (1, 2)] for t in range(lags, length)]
            at += length
        past = np.array(heard)
        # The noise n(t - j) stands in the input by its weights and in outputs by theirs.
        in_input = np.concatenate([[-1.0], weights])
        shared = [
            sum(in_input[j + k] * ways[j, o] for j in range(order + 1) if j + k <= order)
            for o in (0, 1)
            for k in (1, 2)
        ]
        found = error @ past - variance * len(error) * np.array(shared)
        beside = past - asked.own.columns @ asked.own.weights(past, variance)
        counts = [length - lags for length in asked.lengths]
        scatter = _long_run(error[:, None] * beside, order + 1, counts)
        known = found @ np.linalg.solve(scatter, found)
        assert asked.chi_square(variance) == pytest.approx(known, rel=1e-6)


class Told:
    """What is asked of noises, told by a function of their variance."""

    def __init__(self, chi: Any, least: float = 1.0, numbers: int = 24) -> None:
        self.chi, self.numbers, self.power, self.tried = chi, numbers, 100.0, []
        self.own = type("Own", (), {"power": [least, 9.0]})

    def chi_square(self, variance: float) -> float:
        """Of one that is tried."""
        self.tried.append(variance)
        return float(self.chi(variance))


def test_the_smallest_chi_square_is_found_between_those_tried() -> None:
    tried = np.geomspace(0.01, 1.0, 14)
    for best in (0.013, 0.2, 0.99):
        asked: Any = Told(lambda v, best=best: 5.0 + np.log(v / best) ** 2)
        variance, least = _smallest(asked, tried)
        assert len(asked.tried) == 14 + 2 * 5
        # A golden section's five steps leave a fourteenth of two intervals between those tried.
        assert abs(np.log(variance / best)) < 2.0 * np.log(100.0) / 13.0 * noisy_input.GOLDEN**5
        assert least == 5.0 + np.log(variance / best) ** 2
        place = int(np.argmin(np.abs(np.log(tried / best))))
        low, high = np.log(tried[max(place - 1, 0)]), np.log(tried[min(place + 1, 13)])
        for inner in np.log(np.reshape(asked.tried[14:], (5, 2))):
            golden = 0.6180339887498949 * (high - low)
            assert inner == pytest.approx([high - golden, low + golden])
            nearer = abs(inner[0] - np.log(best)) < abs(inner[1] - np.log(best))
            low, high = (low, inner[1]) if nearer else (inner[0], high)
    for edge in (0, -1):
        asked = Told(lambda v, edge=edge: np.log(v / tried[edge]) ** 2)
        assert _smallest(asked, tried) == (tried[edge], 0.0)


def test_noise_explains_where_little_is_left_and_much_was(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs: Any = [(np.zeros((1, 900)), np.zeros((1, 900)))]
    limit = 2.0 * float(scipy.special.gammainccinv(11.5, 1e-4))

    def share(without: float, left: float, least: float = 1.0, order: int = 5) -> float | None:
        """Of a noise of half of the weakest direction's power; the chi-square without any."""
        made: list[Any] = []
        told = Told(lambda v: without if v == 0.0 else left + np.log(v / (0.5 * least)) ** 2, least)
        monkeypatch.setattr(_NoisyPast, "of", lambda *words: made.append(words) or told)
        found = noisy_input.explaining_noise(pairs, 0, order, 24)
        assert made[0][2:] == (max(order, 36), 24)
        largest = min(3.0 * least, 4.0)
        if largest > 0.0:
            assert told.tried[:2] == [0.0, pytest.approx(0.01 * largest)]
            assert told.tried[14] == pytest.approx(largest)
        return found

    assert share(900.0, 1.0) == pytest.approx(0.005, rel=0.05)
    assert share(900.0, 1.0, order=40) is not None
    assert share(900.0, 1.0, least=2.0) == pytest.approx(0.01, rel=0.05)
    assert share(900.0, 1.0, least=0.0) is None
    for without, left, is_told in (
        (100.0, limit - 0.1, True),
        (100.0, limit + 0.1, False),
        (900.0, 149.0, True),
        (900.0, 151.0, False),
        (11.7, 5.0, True),
        (11.6, 5.0, False),
    ):
        assert (share(without, left) is not None) is is_told
    pairs = [(np.zeros((2, 800)), np.zeros((1, 800)))] * 2
    made: list[Any] = []
    monkeypatch.setattr(_NoisyPast, "of", lambda *words: made.append(words) or Told(abs, 0.0))
    for count, order in ((1, 20), (2, 36)):
        noisy_input.explaining_noise(pairs[:count], 0, 5, 24)
        assert made[-1][2] == order
