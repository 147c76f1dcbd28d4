"""Prediction errors that are not white, or that inputs foretell, take the intervals away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.identification.innovation_tests import InnovationTests, innovation_tests
from flightid.identification.multistart import End, best_first
from flightid.identification.prediction_error.own_past import with_own_past
from tests.strangers import black_boxes as flights
from tests.strangers import rig_gains

CODES = {"errors-not-white", "inputs-in-errors"}


def _codes(fit: fid.Fit) -> set[str]:
    return CODES & {finding.code for finding in fit.findings}


def _short(n: int, noise: Callable[[int], np.ndarray], seed: int = 0) -> fid.Record:
    """Steps of two levels through (q⁻² + 0.5 q⁻³) / (1 - 1.5 q⁻¹ + 0.7 q⁻²), and noise."""
    u = np.repeat(np.sign(np.random.default_rng(seed).standard_normal(n // 3 + 1)), 3)[:n]
    x = lfilter([0.0, 0.0, 1.0, 0.5], [1.0, -1.5, 0.7], u)
    return fid.Record.from_arrays(
        np.arange(n) * 0.1,
        inputs={"u": u},
        outputs={"y": x + noise(n)},
        units={"u": "1", "y": "1"},
        hold="zero",
        loop="open",
    )


def test_tests_tell_white_coloured_and_driven_errors_apart() -> None:
    e, u = np.random.default_rng(2).standard_normal((2, 1, 800))
    coloured, driven = e + np.roll(e, 1), e + np.roll(u, 3)
    good, colour, missing = (innovation_tests([x], [u], [e], (1, 1)) for x in (e, coloured, driven))
    assert good.is_white
    assert good.is_independent
    assert not good.why_biased
    assert not colour.is_white
    assert colour.is_independent
    assert not missing.is_independent
    assert "inputs still foretell" in missing.why_biased
    assert innovation_tests([0.0 * e], [u], [e], (1, 1)) == InnovationTests(None, None)
    assert innovation_tests([e[:, :20]], [u[:, :20]], [e[:, :20]], (1, 1)).white is None


def test_slight_colour_makes_bars_longer_and_missing_dynamics_leave_none() -> None:
    slight = InnovationTests(1e-3, 0.5, 0.0, 1.0, (24.0, 0.0))
    assert slight.widening(biased=True) == 5.0
    assert slight.widening(biased=False) == 1.0
    assert replace(slight, excess=(200.0, 0.0)).widening(biased=True) is None
    assert replace(slight, past_percent=12.0).widening(biased=True) is None
    chance = InnovationTests(0.5, 1e-5, 0.0, 0.0, (0.0, 35.0))
    assert chance.widening(biased=False) == 6.0
    assert "nothing that can be told from chance" in chance.why_biased
    assert replace(chance, worth_percent=0.5).widening(biased=False) is None


@pytest.mark.parametrize(("seed", "method"), [(135, "armax"), (311, "subspace")])
def test_gains_of_a_right_black_box_survive_slight_colour(seed: int, method: str) -> None:
    """A true structure that a whiteness test calls wrong, as it may, keeps (longer) bars."""
    rig = rig_gains.drawn(seed)
    assert rig.right
    assert rig.method == method
    fit = fid.identify(rig.structure, rig_gains.record(rig, seed))
    (said,) = [each.message for each in fit.findings if each.code == "errors-not-white"]
    assert "times as long" in said
    (steady,) = fit.details.gains.values()
    low, high = steady.interval95 or (None, None)
    truth = rig.b.sum() / rig.a.sum()
    assert low < truth < high
    assert high - low < abs(truth)


@pytest.mark.parametrize("structure", [flights.ARX, flights.SUBSPACE], ids=["arx", "subspace"])
def test_one_step_models_have_intervals_in_their_own_noise_alone(structure: object) -> None:
    random = np.random.default_rng
    good = fid.identify(structure, flights.in_equation(random(1), flights.WHITE))
    bad = fid.identify(structure, flights.in_output(random(1), flights.RESONANT))
    assert not _codes(good)
    assert good.covariance is not None
    assert _codes(bad)
    assert bad.covariance is None
    assert bad.evidence.light != "green"
    assert all(p.interval95 is None for p in bad.parameters.values())
    assert all(gain.interval95 is None for gain in bad.details.gains.values())


@pytest.mark.parametrize(
    "structure",
    [
        fid.PolynomialModel.arx("u", "y", na=2, nb=2, nk=2),
        fid.PolynomialModel.arx("u", "y", na=2, nb=2, nk=2, method="iv4"),
        fid.PolynomialModel.oe("u", "y", nb=2, nf=2, nk=2),
        fid.PolynomialModel.bj("u", "y", nb=2, nf=2, nc=1, nd=1, nk=2),
    ],
    ids=lambda structure: f"{structure.kind} {structure.method}",
)
def test_a_fit_without_noise_has_no_bars_and_says_so(structure: object) -> None:
    """Rounding made them: 5e-17 long, with the truth 7e-16 away, green."""
    fit = fid.identify(structure, _short(1000, lambda _: np.zeros(1000)))
    assert fit.covariance is None
    assert fit.evidence.light == "amber"
    assert "exact-fit" in {each.code for each in fit.findings}
    for each in (*fit.parameters.values(), *fit.details.gains.values()):
        assert each.interval95 is None
        assert each.stderr is None
        assert each.reason


def _coloured(pole: float, share: float, seed: int) -> Callable[[int], np.ndarray]:
    """Noise of one pole, so much of the answer's size (7)."""
    random = np.random.default_rng(1000 + seed)

    def drawn(n: int) -> np.ndarray:
        noise = lfilter([1.0], [1.0, -pole], random.standard_normal(n))
        return share * 7.0 * noise / noise.std()

    return drawn


@pytest.mark.parametrize(("pole", "samples", "missed"), [(0.9, 150, 1), (0.7, 200, 0)])
def test_short_regressions_in_noise_not_their_own_are_told(
    pole: float, samples: int, missed: int
) -> None:
    """Correlations at all lags told 3 and 6 of 12; 24 of 48 and 18 of 24 bars missed."""
    structure, truth = fid.PolynomialModel.arx("u", "y", na=2, nb=2, nk=2), (-1.5, 0.7, 1.0, 0.5)
    told, held, shown = 0, 0, 0
    for seed in range(12):
        fit = fid.identify(structure, _short(samples, _coloured(pole, 0.5, seed), seed))
        told += bool(_codes(fit))
        bars = [each.interval95 for each in fit.parameters.values()]
        shown += sum(each is not None for each in bars)
        held += sum(b[0] <= t <= b[1] for b, t in zip(bars, truth, strict=True) if b is not None)
    assert told >= 10
    assert shown - held <= missed


def test_short_regressions_in_their_own_noise_stay_untold() -> None:
    structure, told = fid.PolynomialModel.arx("u", "y", na=2, nb=2, nk=2), 0
    for seed in range(20):
        random = np.random.default_rng(2000 + seed)
        own = partial(lambda r, n: lfilter([1.0], [1.0, -1.5, 0.7], r.standard_normal(n)), random)
        fit = fid.identify(structure, _short(150, own, seed))
        assert fit.covariance is not None
        told += bool(_codes(fit))
    assert told <= 1


def test_few_samples_in_doubt_have_bars_that_hold_what_colour_would_bend() -> None:
    long = InnovationTests(0.05, 0.5, 0.0, 90.0, (8.0, 0.0))
    short = replace(long, is_short=True)
    assert (long.widening(biased=True), short.widening(biased=True)) == (1.0, 3.0)
    assert short.widening(biased=False) == 1.0
    assert replace(short, white=0.2).widening(biased=True) == 1.0
    (said,) = short.findings(biased=True, times=3.0)
    assert (said.code, said.light.value) == ("errors-in-doubt", "green")
    assert "may not be white (p = 0.05); intervals are 3 times as long" in said.message
    assert not short.findings(biased=False, times=1.0)
    assert not replace(short, white=0.2).findings(biased=True, times=1.0)


def test_bars_of_short_regressions_hold_where_colour_is_in_doubt() -> None:
    structure, truth = fid.PolynomialModel.arx("u", "y", na=2, nb=2, nk=2), (-1.5, 0.7, 1.0, 0.5)
    held = []
    for seed in (5, 11, 33):
        fit = fid.identify(structure, _short(150, _coloured(0.9, 0.5, seed), seed))
        assert "errors-in-doubt" in {each.code for each in fit.findings}
        bars = [each.interval95 or (np.inf, -np.inf) for each in fit.parameters.values()]
        held += [low <= value <= high for (low, high), value in zip(bars, truth, strict=True)]
    assert sum(held) >= 11


def test_past_errors_beside_regressors_tell_what_the_fit_hid() -> None:
    """Coefficients whiten what they can; errors of two records do not reach across their ends."""
    e = np.random.default_rng(7).standard_normal((2, 60))
    sound, lengths = InnovationTests(0.5, 0.5, 0.0, 0.0), [60, 60]
    slopes = np.random.default_rng(8).standard_normal((120, 2))
    assert with_own_past(sound, slopes, e.ravel(), lengths, 0.1).white == 1.0
    red = lfilter([1.0], [1.0, -0.6], e).ravel()
    told = with_own_past(sound, slopes, red, lengths, 0.1)
    assert not told.is_white
    assert told.excess[0] > 20.0
    assert told.past_percent > 2.0
    assert with_own_past(sound, slopes[:8], red[:8], [8], 0.1) is sound


def test_noise_of_a_millionth_keeps_its_bars() -> None:
    noise = partial(np.random.default_rng(5).normal, 0.0, 1e-6)
    structure = fid.PolynomialModel.oe("u", "y", nb=2, nf=2, nk=2)
    fit = fid.identify(structure, _short(1000, lambda n: noise(size=n)))
    assert "exact-fit" not in {each.code for each in fit.findings}
    assert all(1e-10 < each.stderr < 1e-6 for each in fit.parameters.values())


def test_box_jenkins_keeps_the_vehicle_and_not_its_noise_model() -> None:
    record = flights.in_output(np.random.default_rng(3), flights.RESONANT)
    fit = fid.identify(flights.BJ, record)
    assert fit.intervals_from == "coloured residuals"
    assert fit.names == ("b1", "b2", "f1", "f2")
    assert fit.parameters["d1"].interval95 is None
    assert "noise model" in fit.parameters["d1"].reason
    assert fit.covariance is not None
    assert fit.covariance.shape == (4, 4)


def test_narx_in_noise_of_the_sensor_is_not_green() -> None:
    fly = partial(flights.fly_narx, noise=flights.RED, at_sensor=True)
    trial = fly(0)
    assert trial.light != "green"
    assert all(r.interval95 is None for r in trial.readings)


def test_rounding_does_not_choose_between_twins() -> None:
    pairs = ((1, 2.0), (9, 2 - 1e-8), (5, 3.0))
    own, twin, worse = (End(np.array([x]), cost, 1, "step") for x, cost in pairs)
    assert best_first([own, worse, twin])[0] is own
    assert best_first([worse, own, twin])[:2] == [own, twin]


def test_pulse_responses_are_fitted_until_they_end_or_have_no_bars() -> None:
    outlasting = partial(flights.fly_impulse, decay=0.98, noise=flights.WHITE)
    assert outlasting(0, samples=3000).light == "green"
    short = outlasting(0, samples=600)
    ringing = flights.fly_impulse(7000, decay=0.997, noise=flights.WHITE)
    for trial in (short, ringing):
        assert trial.light == "amber"
        assert all(reading.interval95 is None for reading in trial.readings)


def test_a_state_that_is_not_there_takes_the_intervals_away() -> None:
    record = flights.in_equation(np.random.default_rng(1), flights.WHITE)
    fit = fid.identify(flights.HIGH, record)
    assert "order-too-high" in {finding.code for finding in fit.findings}
    assert fit.covariance is None
    assert fit.evidence.light != "green"
