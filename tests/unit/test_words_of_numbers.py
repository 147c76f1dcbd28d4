"""Numbers in words: estimates, eigenvalues, loops, spans and sticks, each with its edges."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.conventions import Light
from flightid.evidence import Check
from flightid.evidence.explained import (
    BAND,
    COHERENCE,
    NOTHING,
    ExplainedRun,
    _powers,
    by_free_runs,
    explained_spans,
    unless_hidden,
)
from flightid.inspection import usable_band
from flightid.logs.blackbox.stick_rates import _explained, _told
from flightid.uncertainty.estimate import Estimate, ScaledEnds, estimate_table, first_order
from flightid.uncertainty.roots import UNSIGNED, UncertainRoot
from tests.closeness import assert_close


def test_an_estimate_says_its_status_interval_and_reason() -> None:
    plain = Estimate("Lp", -4.0, "1/s", 0.1)
    assert repr(plain) == "Estimate(Lp = -4 (-4.196 to -3.804) 1/s)"
    fixed = Estimate("M", 1.5, status="fixed")
    assert repr(fixed) == "Estimate(M = 1.5, fixed)"
    assert plain.range_words() == "-4.196 to -3.804"
    assert plain.range_words(digits=2) == "-4.2 to -3.8"
    assert fixed.range_words() == ""
    assert (fixed.half(), fixed.half_width95) == (None, None)
    assert_close(plain.half(), 0.1959963984540054, rtol=1e-12, why="normal table")
    assert Estimate("m", None, "dB", None, "no crossing").text == "none (no crossing)"
    assert Estimate("m", None).text == "none"
    assert plain.to_dict()["freedom"] is None
    assert Estimate("a", 1.0, "1", 0.1, freedom=7.0).to_dict()["freedom"] == 7.0
    assert Estimate("a", 1.0, "1", 0.1, freedom=math.inf).to_dict()["freedom"] is None
    for value, told in ((0.19, False), (0.2, True), (-0.19, False), (-0.2, True)):
        assert Estimate("a", value, "1", 0.1).is_significant is told
    assert ScaledEnds(lambda _: None, 2.0)(0.95) is None
    for variance, told in ((0.0, False), (math.inf, False), (math.nan, False), (0.25, True)):
        assert (first_order("a", 1.0, "1", variance).stderr == 0.5) is told
    rows = estimate_table("t", [Estimate("w", math.tau, "rad/s", 0.1), plain, fixed]).rows
    assert [row[3] for row in rows] == [1.0, None, None]
    assert [row[2] for row in rows] == ["rad/s", "1/s", ""]


def test_eigenvalues_at_the_edges_of_their_readings() -> None:
    still = UncertainRoot(0.0j, np.eye(2))
    assert still.damping_ratio().reason == "an integrator has no damping"
    assert still.natural_frequency().reason == "an integrator"
    assert UncertainRoot(None, None, "not determined").damping_ratio().reason == "not determined"
    slow = UncertainRoot(1.0 + 0.0j, None, "no bars")
    assert (slow.damping_ratio().value, slow.damping_ratio().reason) == (-1.0, "real eigenvalue")
    assert slow.natural_frequency().reason == "no bars"
    covariance = np.array([[0.01, 0.004], [0.004, 0.04]])
    pair = UncertainRoot(-3.0 + 4.0j, covariance, freedom=9.0)
    for reading, slope in (
        (pair.real(), [1.0, 0.0]), (pair.imaginary(), [0.0, 1.0]),
        (pair.natural_frequency(), [-0.6, 0.8]),
        (pair.damping_ratio(), [-16.0 / 125.0, -12.0 / 125.0]),
    ):  # fmt: skip
        variance = np.array(slope) @ covariance @ np.array(slope)
        assert_close(reading.stderr, math.sqrt(variance), rtol=1e-9, why=reading.name)
        assert reading.freedom == 9.0
    assert_close(pair.period().value, math.tau / 4.0, rtol=1e-12, why="of the imaginary part")
    assert_close(pair.time_constant().value, 1.0 / 3.0, rtol=1e-12, why="of the real part")
    half, double = pair.halving()
    assert (half.value, double.value) == (pytest.approx(math.log(2.0) / 3.0), None)
    half, double = UncertainRoot(2.0 + 0.0j, covariance).halving()
    assert (half.value, double.value) == (None, pytest.approx(math.log(2.0) / 2.0))
    assert (half.reason, still.halving()[1].reason) == ("no decay", "no growth")
    assert UncertainRoot(-3.0 + 0.0j, covariance).period().reason == "no oscillation"
    for real, told in ((-0.19, False), (-0.21, True)):
        found = UncertainRoot(complex(real, 0.0), covariance).natural_frequency()
        assert (found.interval95 is not None) is told
        assert found.reason == ("" if told else UNSIGNED)


def test_what_is_not_logged_of_an_axis_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    signal = SimpleNamespace(rate_hz=50.0, label="x")
    for there, words in (
        ((), "mixer command and body rate are not logged"),
        (("tau_phi",), "body rate is not logged"),
        (("p",), "mixer command is not logged"),
    ):
        held = [SimpleNamespace(name=name, **vars(signal)) for name in there]
        monkeypatch.setattr(usable_band, "packed", lambda _, h=held: h)
        log: Any = SimpleNamespace(vehicle="copter")
        monkeypatch.setattr(usable_band, "_found", lambda *_: iter(()))
        band = usable_band.axis_bands(log, ((0.0, 9.0),), ())[0]
        assert (band.axis, band.reason, band.rate_hz) == ("roll", words, 0.0)
    for airborne, lowest in ((-1.0, math.inf), (0.0, math.inf), (0.5, 20.0), (40.0, 0.25)):
        assert usable_band.lowest_hz(airborne) == lowest


def test_windows_that_fit_whole_into_records() -> None:
    for lengths, windows, whole in (
        ([10.0, 10.0], 2.0, 10.0), ([10.0, 4.0], 2.0, 5.0), ([10.0, 5.0], 3.0, 5.0),
        ([9.0], 4.5, 1.8), ([400.0], 2.0, 40.0), ([30.0, 29.999999], 2.0, 29.999999),
    ):  # fmt: skip
        assert usable_band._whole_window(lengths, windows) == pytest.approx(whole), lengths
    assert usable_band._longest_window([10.0, 4.0], 2.0) == 5.0
    assert usable_band._enough(np.array([4.49, 4.5, 4.51])).tolist() == [False, True, True]


def test_sticks_explain_by_the_squares_of_the_p_term() -> None:
    error = np.array([1e-3, -2e-3, 3e-3])
    assert_close(_explained(error, 50.0 * error), 1.0, rtol=1e-12, why="in proportion")
    assert_close(_explained(error, -50.0 * error), -1.0, rtol=1e-12, why="the other way")
    other = np.array([3e-3, 0.0, -1e-3])
    assert_close(_explained(error, other), 0.0, atol=1e-12, why="at right angles")
    assert _explained(np.zeros(3), np.zeros(3)) == 0.0
    new = {
        f"{name}[{k}]": 10.0 * k + n
        for k in range(3)
        for n, name in enumerate(("rc_rates", "rates", "rc_expo"))
    }
    assert [_told(new, k) for k in range(3)] == [
        (0.0, 1.0, 2.0),
        (10.0, 11.0, 12.0),
        (20.0, 21.0, 22.0),
    ]
    old = {"rc_rate": 1.0, "rc_rate_yaw": 2.0, "rc_expo": 3.0, "rc_yaw_expo": 4.0}
    old |= {f"rates[{k}]": 5.0 + k for k in range(3)}
    assert [_told(old, k) for k in range(3)] == [(1.0, 5.0, 3.0), (1.0, 6.0, 3.0), (2.0, 7.0, 4.0)]
    del old["rates[1]"]
    assert _told(old, 1) is None


def _run(seed: int, noise: float, n: int = 1500, step_s: float = 0.02) -> ExplainedRun:
    random = np.random.default_rng(seed)
    time_s = step_s * np.arange(n)
    run = np.array(
        [sum(np.sin(w * time_s + w) for w in np.geomspace(0.5, high, 60)) for high in (60.0, 6.0)]
    )
    return ExplainedRun(run + noise * random.standard_normal(run.shape), run, step_s)


def test_powers_of_a_run_are_of_its_hann_windowed_departures() -> None:
    run = _run(0, 0.3)
    edges = np.array([0.5, 2.0, 7.0, 40.0])
    found = _powers(run, edges)
    omega = 2.0 * np.pi * np.fft.rfftfreq(1500, 0.02)
    middle = run.measured.mean(axis=1, keepdims=True)
    for place, rows in enumerate((run.modelled - middle, run.measured - run.modelled)):
        power = np.abs(np.fft.rfft(rows * np.hanning(1500), axis=1)) ** 2
        for k in range(3):
            inside = (omega >= edges[k]) & (omega < edges[k + 1])
            wanted = power[:, inside].sum(axis=1)
            assert_close(found[place, :, k], wanted, rtol=1e-9, why="the same bins")


def test_free_runs_speak_for_band_and_coherence_where_each_output_is_explained() -> None:
    amber = [Check(name, Light.AMBER, "narrow", "sweep") for name in (BAND, COHERENCE, "loop")]
    clear = [_run(1, 0.05), _run(2, 0.05)]
    spans, whole = explained_spans(["p", "r"], clear)
    assert [each.name for each in spans] == ["p", "r"]
    assert spans[0].ratio > spans[1].ratio > 5.0
    assert whole.ratio >= spans[0].ratio
    band, coherence, loop = by_free_runs(amber, ["p", "r"], clear)
    assert (band.light, coherence.light, loop) == (Light.GREEN, Light.GREEN, amber[2])
    assert band.what.endswith(f"(narrowest: {spans[1]})")
    least = min(spans, key=lambda each: each.coherence)
    assert f"explains {100 * least.coherence:.2g} % of {least.name} in its band" in coherence.what
    assert (band.action, coherence.action) == ("", "")
    assert by_free_runs(amber, ["p", "r"], []) == amber
    assert by_free_runs(amber, ["p", "r"], [_run(1, 60.0)]) == amber
    assert by_free_runs(amber, ["p", "r"], [_run(1, 0.05, n=63)]) == amber
    green = [Check(BAND, Light.GREEN, "wide"), amber[1]]
    assert by_free_runs(green, ["p", "r"], clear)[0] == green[0]
    assert explained_spans(["p"], [_run(1, 0.05, n=63)])[0] == []
    assert len(explained_spans(["p", "r"], [_run(1, 0.05, n=64)])[0]) == 2


def test_noise_that_a_free_run_leaves_hides_a_loop_from_a_ten_thousandth_on() -> None:
    run = np.sin(0.1 * np.arange(4000))[None] + np.zeros((2, 1))
    for share, light in ((0.9e-4, Light.GREEN), (1.1e-4, Light.UNKNOWN)):
        left = run.copy()
        left[1] *= 1.0 - math.sqrt(share)
        found = unless_hidden(NOTHING, [ExplainedRun(run, left, 0.02)])
        assert found.light is light
        if light is Light.UNKNOWN:
            assert f"leaves {100 * share:.2g} % of one" in found.what
    still = ExplainedRun(np.zeros((2, 9)), np.ones((2, 9)), 0.02)
    assert unless_hidden(NOTHING, [still]) == NOTHING
    assert unless_hidden(NOTHING, []) == NOTHING
    open_ = Check("loop", Light.GREEN, "open")
    assert unless_hidden(open_, [ExplainedRun(run, 0.5 * run, 0.02)]) == open_
