"""Ends of bars of output error where the cost is no parabola, against the cost itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import lfilter

import flightid as fid
from flightid.identification.prediction_error.curved_ends import ENDLESS, curve_findings

TRUTH = np.real(np.poly([0.9, 0.75 + 0.35j, 0.75 - 0.35j]))


def first_order(n: int, noise: float, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], n // 4 + 1), 4)[:n]
    x = lfilter([0.0, 0.5], [1.0, -0.8], u)
    return u, x + noise * x.std() * rng.standard_normal(n)


def fitted(u: np.ndarray, y: np.ndarray, *, nb: int = 1, nf: int = 1) -> fid.Fit:
    record = fid.Record.from_arrays(
        0.05 * np.arange(u.size),
        inputs={"u": u},
        outputs={"y": y},
        units={"u": "V", "y": "m"},
        hold="zero",
        loop="open",
    )
    return fid.identify(fid.PolynomialModel.oe("u", "y", nb=nb, nf=nf, nk=1), record)


def columns(u: np.ndarray, f1: float) -> np.ndarray:
    """What the output holds linearly with one f: gain, start and level."""
    impulse = np.eye(1, u.size)[0]
    driven = lfilter([0.0, 1.0], [1.0, f1], u - u.mean())
    return np.stack([driven, lfilter([1.0], [1.0, f1], impulse), np.ones(u.size)], axis=1)


def profile(u: np.ndarray, y: np.ndarray, f1: float) -> float:
    """Least sum of squares with one f."""
    known = columns(u, f1)
    rest = y - known @ np.linalg.lstsq(known, y, rcond=None)[0]
    return float(rest @ rest)


def test_ends_lie_where_the_cost_has_risen_as_to_first_order() -> None:
    u, y = first_order(60, 0.9)
    estimate = fitted(u, y).parameters["f1"]
    low, high = estimate.interval95
    sides = np.array([low, high]) - estimate.value
    shorter, longer = sorted(sides, key=abs)
    here = columns(u, estimate.value)
    weights = np.linalg.lstsq(here, y, rcond=None)[0]
    moved = (columns(u, estimate.value + 1e-6) - here) @ weights / 1e-6
    slope = moved - here @ np.linalg.lstsq(here, moved, rcond=None)[0]
    # The shorter side is that to first order; the longer one rises as high.
    rise = float(slope @ slope) * shorter**2
    least = profile(u, y, estimate.value)

    def above(share: float) -> float:
        return profile(u, y, estimate.value + share * longer) - least - rise

    assert abs(longer) > 1.1 * abs(shorter)
    assert brentq(above, 0.2, 3.0) == pytest.approx(1.0, rel=0.03)


def test_ends_of_a_long_record_are_those_to_first_order() -> None:
    fit = fitted(*first_order(1000, 0.2))
    assert all(each.ends is None for each in fit.parameters.values())
    assert not [each for each in fit.findings if each.code == "curved-cost"]


def third_order(seed: int, n: int = 200) -> fid.Fit:
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], n // 4 + 1), 4)[:n]
    x = lfilter([0.0, 0.3, 0.5], TRUTH, u)
    return fitted(u, x + 0.4 * x.std() * rng.standard_normal(n), nb=2, nf=3)


def test_a_cost_without_an_end_is_amber_and_its_bars_stop() -> None:
    fit = third_order(5026, 150)
    told = [each for each in fit.findings if each.code == "curved-cost"]
    assert [(each.message, each.light.value) for each in told] == [(ENDLESS, "amber")]
    assert all(each.interval95 is not None for each in fit.parameters.values())


def test_the_bend_is_told_from_half_a_bar_on() -> None:
    short, word, amber = (np.array([[1.0, most]]) for most in (1.4, 1.6, 2.1))
    assert not curve_findings(short)
    assert curve_findings(word)[0].light.value == "green"
    assert curve_findings(amber)[0].light.value == "amber"
    assert "2.1 times" in curve_findings(amber)[0].message


@pytest.mark.slow
def test_intervals_of_short_noisy_records_hold_the_truth() -> None:
    held, shown = 0, 0
    for seed in range(5000, 5200):
        fit = third_order(seed)
        for name, truth in zip(("b1", "b2", "f1", "f2", "f3"), [0.3, 0.5, *TRUTH[1:]], strict=True):
            ends = fit.parameters[name].interval95
            if ends is not None:
                shown += 1
                held += ends[0] <= truth <= ends[1]
    assert shown > 800
    # Five intervals of a fit miss together: chance moves the share by two percent.
    assert 0.92 < held / shown < 0.98
