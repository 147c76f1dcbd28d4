"""Small rules of spans, scales, chirps and signs, each at both sides of what it decides."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.control.tuning.gain_search_result import GainSearchResult
from flightid.control.tuning.limits import limits
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.shortfalls import _short
from flightid.control.tuning.whole_gains import whole_gains
from flightid.control.tuning.worst_cases import WorstCase
from flightid.conventions import Light
from flightid.evidence.parameter_checks import declared_signs
from flightid.evidence.part_checks import agreement_check
from flightid.evidence.spans import Span, judge_coherence, judge_span
from flightid.inspection import rate_chirps
from flightid.inspection.excited_to import _power_end
from flightid.inspection.signals import Signal
from flightid.logs.scale_check import ScaleCheck, _edges, _turned
from flightid.uncertainty.agreement import Agreement
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.several_tests import holm_adjusted
from flightid.uncertainty.shown_bands import covered_band
from tests.closeness import assert_close


def test_the_widest_band_is_a_ratio_without_a_gap() -> None:
    for bands, widest in (
        ([(1.0, 5.0), (50.0, 100.0)], (1.0, 5.0)), ([(1.0, 2.0), (10.0, 30.0)], (10.0, 30.0)),
        ([(1.0, 2.0), (2.0, 3.0)], (1.0, 3.0)), ([(1.0, 2.0), (2.01, 3.0)], (1.0, 2.0)),
        ([(1.0, 9.0), (2.0, 3.0), (8.0, 10.0)], (1.0, 10.0)), ([(4.0, 8.0)], (4.0, 8.0)),
        ([(0.1, 0.3), (1.0, 2.0), (1.5, 2.5)], (0.1, 0.3)),
    ):  # fmt: skip
        assert covered_band(bands) == widest, bands
        assert covered_band(bands[::-1]) == widest
    assert covered_band([]) is None
    chances = np.array([0.04, 0.01, 0.9, 0.02])
    assert_close(holm_adjusted(chances), [0.08, 0.04, 0.9, 0.06], rtol=1e-12, why="Holm")
    assert holm_adjusted(np.array([0.6, 0.7])).tolist() == [1.0, 1.0]


def test_spans_are_told_by_their_parts_and_judged_by_their_width() -> None:
    told = {
        Span("p", None, 0.2): "p has no band with coherence",
        Span("p", (1.0, 20.0), 0.9): "p 1 to 20 rad/s",
        Span("p", (1.0, 9.0), 0.9, 0.5, ((1.0, 2.0), (9.0, 9.0))): "p 1 to 2 and 9 rad/s",
        Span("p", (1.0, 9.0), 0.9, 0.5, ((1.0, 2.0), (3.0, 4.0), (5.0, 6.0))): (
            "p 1 to 2 and 3 to 4 and 5 to 6 rad/s"
        ),
        Span("p", (1.0, 9.0), 0.9, 0.5, ((1.0, 2.0), (3.0, 4.0), (5.0, 6.0), (8.0, 9.0))): (
            "p 1 to 9 rad/s in 4 pieces, together 3.16 to 1"
        ),
    }
    assert [str(each) for each in told] == list(told.values())
    assert (Span("p", None, 0.2).ratio, Span("p", (2.0, 9.0), 0.2, 2.0).ratio) == (1.0, 100.0)
    for high, light, predicted in (
        (2.99, "amber", "amber"), (3.01, "amber", "green"), (9.99, "amber", "green"),
        (10.0, "green", "green"),
    ):  # fmt: skip
        spans = [
            Span("q", (1.0, 90.0), 0.9),
            Span("p", (1.0, high), 0.9),
            Span("r", None, 0.1, 3.0),
        ]
        found = judge_span(spans)
        assert found.light == light, high
        assert judge_span(spans, predicted=True).light == predicted
        assert ("less than a decade" in found.what) is (3.0 <= high < 10.0)
        assert found.band_rad_s == (1.0, high)
        assert found.by_response_rad_s == {"q": (1.0, 90.0), "p": (1.0, high)}
    for coherence, light in ((0.6, "green"), (0.599, "amber")):
        found = judge_coherence([Span("q", None, 0.9), Span("p", None, coherence)])
        assert (found.light, "mean coherence of p 0.60" in found.what) == (light, True)


def test_signs_that_were_declared_hold_where_the_interval_does_not_reach_over() -> None:
    for sign, value, interval, status, holds in (
        (1, 2.0, (0.1, 3.9), "free", True), (1, 2.0, (0.0, 4.0), "free", False),
        (1, 2.0, (-0.1, 4.1), "free", False), (-1, -2.0, (-3.9, -0.1), "free", True),
        (-1, -2.0, (-4.0, 0.0), "free", False), (-1, -2.0, (-4.1, 0.1), "free", False),
        (1, 2.0, None, "free", True), (1, -2.0, None, "free", False), (1, 0.0, None, "free", False),
        (1, 2.0, None, "at bound", True), (-1, 0.0, None, "at bound", False),
    ):  # fmt: skip
        found = declared_signs(
            {"Lp": (sign, value, interval, status), "Mq": (1, 1.0, None, "free")}
        )
        assert (found.light is Light.GREEN) is holds, (sign, value, interval)
        word = "positive" if sign > 0 else "negative"
        assert found.what.endswith("Lp, Mq" if holds else f"sign of Lp (declared {word})")


def test_parts_are_told_by_what_was_compared() -> None:
    noise = np.ones(2)
    longer = Agreement(3, 0.4, 0.06, noise, reach=np.array([[1.0, 1.0], [1.06, 1.0]]))
    assert "(p = 0.06): intervals are up to 1.1 times as long" in agreement_check(longer).limit
    shorter = Agreement(3, 0.4, 0.06, noise, reach=np.array([[1.0, 1.0], [1.04, 1.0]]))
    assert agreement_check(shorter).limit == ""
    assert agreement_check(Agreement(2, None, None, noise)).what.startswith("records are not comp")
    assert agreement_check(Agreement(1, None, None, noise)).what.startswith("flown once")
    alone = agreement_check(Agreement(3, 0.4, 0.3, noise, told_once=1))
    assert alone.limit.startswith("1 of 2 estimates are told by one")
    for count, whose in ((1, "the record"), (2, "a record")):
        apart = agreement_check(Agreement(count, 1e-4, None, noise))
        assert apart.what == f"halves of {whose} differ by more than noise (p = 0.0001)"


def test_units_of_estimates_that_are_missing_are_those_that_are_asked() -> None:
    none = Estimate("m", None, "dB", None, "no crossing")
    assert (none.scaled(2.0).unit, none.scaled(2.0, unit="1").unit) == ("dB", "1")
    known = Estimate("m", 2.0, "dB", 0.5)
    assert (known.scaled(2.0).unit, known.scaled(2.0, unit="1").unit) == ("dB", "1")
    case = WorstCase("rate loop", "phase margin", known, 1.0, None, None)
    assert (case.required, case.met, case.missed, case.n_missed, case.n_plants) == (
        "",
        True,
        None,
        0,
        1,
    )
    assert repr(case) == "WorstCase(rate loop: phase margin 2 dB, worst 1)"


def test_what_misses_a_requirement_is_told_by_plant_and_size() -> None:
    (margin, *_, peak) = limits(TuningRequirements(), ["rate loop"], None)
    slack = np.array([0.0, -0.2, -0.1])
    assert _short("phase margin", 36.04, " deg", margin, slack) == (
        "phase margin 36 deg, 9 deg short of ≥ 45 (2 of 3 plants)"
    )
    assert _short("phase margin", 36.04, " deg", margin, slack[1:2]) == (
        "phase margin 36 deg, 9 deg short of ≥ 45 (the model)"
    )
    assert _short("phase margin", 36.04, " deg", margin, slack[:2]).endswith("(1 of 2 plants)")
    assert _short("peak", 2.471, "", peak, slack) == "peak 2.48, 0.48 above ≤ 2 (2 of 3 plants)"


def test_a_sweep_ends_where_its_power_does() -> None:
    stamps = np.arange(0.0, 60.0, 0.01)
    swept = np.sin(2.0 * np.pi * (0.2 * stamps + 0.04 * stamps**2))
    whole = _power_end(stamps, 3.0 + swept, (0.0, 60.0))
    assert_close(whole / math.tau, 5.0, rtol=0.1, why="bins of an eighth of a minute")
    half = _power_end(stamps, 3.0 + swept, (0.0, 30.0))
    assert_close(half / math.tau, 2.6, rtol=0.15, why="0.2 to 2.6 Hz")
    slow = _power_end(2.0 * stamps, swept, (0.0, 120.0))
    assert_close(slow, 0.5 * whole, rtol=1e-9, why="twice as slow")
    for end, told in ((0.62, False), (0.63, True)):  # 64 samples
        assert math.isfinite(_power_end(stamps, swept, (0.0, end))) is told
    assert _power_end(stamps, np.ones(6000), (0.0, 60.0)) == math.inf
    assert _power_end(np.r_[stamps[:-1], stamps[-2]], swept, (0.0, 60.0)) == math.inf


def test_a_chirp_has_a_phase_within_a_turn_for_two_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    time_s = 0.01 * np.arange(1000)
    phase = np.zeros(1000)
    phase[100:301] = phase[600:800] = 1.0
    phase[150:170] = 0.0
    (found,) = rate_chirps._active(time_s, phase)
    assert (found[0], found[-1], found.size) == (100, 300, 201)
    phase[150:176] = 0.0
    assert rate_chirps._active(time_s, phase) == []
    assert rate_chirps._active(time_s, np.eye(1, 1000)[0]) == []
    angle = np.cumsum(np.linspace(0.05, 0.4, 1000))
    signal = 3.0 * np.cos(angle) + np.linspace(-1.0, 1.0, 1000)
    share, size = rate_chirps._moved(signal, angle)
    assert 0.97 < share < 1.0
    assert_close(size, 3.0, rtol=0.05, why="beside a line")
    assert rate_chirps._moved(np.ones(1000), angle)[0] == 0.0
    stick = Signal("p_ref", time_s, np.cos(angle) + np.linspace(0.0, 9.0, 1000), "rad/s", "x")
    assert rate_chirps._share_of(stick, time_s, 50.0 * np.cos(angle)) > 0.9
    assert rate_chirps._share_of(stick, time_s, np.sin(angle)) < 0.1
    still = Signal("p_ref", time_s, np.ones(1000), "rad/s", "x")
    assert rate_chirps._share_of(still, time_s, np.cos(angle)) == 0.0
    taken: list[float] = []
    monkeypatch.setattr(rate_chirps, "believable", lambda each: np.ones(each.size, np.bool_))
    monkeypatch.setattr(rate_chirps, "_active", lambda _t, told: taken.append(told.max()) or [])

    class Log(dict):
        kind, messages = "betaflight", {"main": SimpleNamespace(fields=("debug[0]",))}

        def table(self, _: str) -> Any:
            found = {"debug[0]": 5000.0 * np.array([self["low"], self["high"]])}
            return type("Table", (dict,), {"time_s": np.arange(2.0)})(found)

    for low, high, is_phase in (
        (-0.099, 6.38, True), (-0.101, 6.2, False), (0.0, 6.384, False), (0.0, 6.2832, True),
    ):  # fmt: skip
        taken.clear()
        assert rate_chirps.chirps(Log(main=1, low=low, high=high)) == ()  # type: ignore[arg-type]
        assert bool(taken) is is_phase, (low, high)


def test_streams_turn_alike_within_a_twentieth_and_their_noise() -> None:
    def said(factor: float, correlation: float = 1.0, count: int = 100) -> str | None:
        found = ScaleCheck("p", "a", "b", factor, correlation, count).finding
        return found and found.message

    for factor, known in ((1.049, True), (1.051, False), (0.951, True), (0.949, False)):
        assert (said(factor) is None) is known, factor
    for factor, hint in ((57.3, True), (1 / 57.3, True), (54.0, False), (61.0, False)):
        assert str(said(factor)).endswith(": degrees beside radians") is hint
    # By noise: (1 + 3 sqrt(1 - r^2)/sqrt(n)) / r beyond the twentieth.
    edge = 1.05 * (1.0 + 3.0 * math.sqrt(0.19 / 25)) / 0.9
    assert said(edge * 0.999, 0.9, 25) is None
    assert said(edge * 1.001, 0.9, 25) is not None
    time_s = 0.01 * np.arange(1001)
    slow = 0.1 * np.arange(101)
    edges = _edges([(time_s, time_s), (slow, slow)], None)
    assert edges is None  # Ten windows of ten slow samples.
    edges = _edges([(time_s, time_s)], None)
    assert edges is not None
    assert_close((edges[0], edges[1] - edges[0], edges.size), (0.0, 0.3, 34), rtol=1e-9, why="33")
    inside = _edges([(time_s, time_s)], (1.0, 8.55))
    assert inside is not None
    assert (inside[0], inside.size) == (1.0, 26)
    assert _edges([(time_s, time_s)], (1.0, 8.45)) is None
    assert _edges([(time_s, time_s)], (9.0, 1.0)) is None
    turned = _turned((time_s, 2.0 * time_s), edges)
    assert_close(turned, np.diff(edges**2), rtol=1e-9, why="trapezoids of a line")


def test_whole_gains_are_the_neighbours_of_what_was_found() -> None:
    judged: list[np.ndarray] = []

    class Problem:
        low, high = np.array([1.0, 0.0]), np.array([90.0, 200.0])

        def judge(self, candidates: np.ndarray) -> Any:
            judged.append(candidates)
            slack = np.where(candidates[:, 0] < 41.0, 0.1, -0.1)
            return SimpleNamespace(
                names=("margin",),
                slack=slack[None, :, None],
                objective=candidates.sum(axis=1)[:, None],
            )

    paths: Any = SimpleNamespace(
        roles=("p", "i"), loop=SimpleNamespace(unit_of={"p": 1.0, "i": 2.0}.__getitem__)
    )
    found = GainSearchResult(np.array([40.0, 100.6]), True, ("margin",), {}, ())
    made = whole_gains(Problem(), paths, found)  # type: ignore[arg-type]
    near = set()
    for share in (1.0, 0.97, 0.94, 0.9):
        p, i = 40.0 * share, 50.3 * share
        near |= {
            (a, 2.0 * b)
            for a in {math.floor(p + 1e-9), math.ceil(p - 1e-9)}
            for b in {math.floor(i), math.ceil(i)}
        }
    assert {tuple(each) for each in judged[0].tolist()} == near
    assert (made.gains.tolist(), made.exists, made.binding) == ([40.0, 102.0], True, ("margin",))
