"""Bands, ends of sweeps and limits that were touched, at both sides of every limit."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.errors import FlightidError
from flightid.inspection import excited_to, saturation, usable_band
from flightid.inspection.actuators import Actuators
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.signals import Signal
from flightid.inspection.usable_band import AxesCoherence, AxisBand
from tests.handmade_log import HandmadeLog


def test_rates_within_a_hundredth_are_one() -> None:
    for rates, said in (
        ((100.0, 100.9), "a and b are logged at 100 Hz"),
        ((101.0, 100.0), "b is logged at 100 Hz and a at 101 Hz"),
    ):
        assert AxisBand("roll", "a", "b", 100.0, None, None, rates_hz=rates).logged == said
    assert AxisBand("roll", "a", "b", 100.0, None, None).logged == ""


def test_a_band_is_for_models_from_half_a_decade_on() -> None:
    for band, coherent, is_usable, span in (
        ((2.0, 6.0), None, True, 3.0),
        ((2.0, 5.99), None, False, 2.995),
        ((2.0, 4.0), (1.0, 4.0), True, 2.0),
        ((2.0, 9.0), (4.0, 9.0), False, 4.5),
        (None, (1.0, 9.0), False, 0.0),
    ):
        found = AxisBand("roll", "a", "b", 9.0, band, None, coherent_rad_s=coherent)
        assert (found.is_usable, found.span) == (is_usable, span)
        assert found.told_rad_s == (band if is_usable else coherent or band)
        assert (found.words == "") is (band is None)


def test_windows_hold_two_cycles_and_five_of_them_the_flight() -> None:
    assert [usable_band.lowest_hz(each) for each in (20.0, 0.5, 0.0, -1.0)] == [
        0.5,
        20.0,
        math.inf,
        math.inf,
    ]
    assert usable_band._enough(np.array([4.5, 4.49])).tolist() == [True, False]
    for lengths, windows, longest, whole in (
        ([15.0], 5, 3.0, 3.0),
        ([15.0, 15.0], 5, 6.0, 5.0),
        ([9.0, 4.0], 3, 4.0, 4.0),
        ([9.0, 4.0], 2.5, 4.0, 4.0),
        ([12.0, 1.0], 5, 2.4, 2.4),
        ([1000.0], 5, 40.0, 40.0),
        ([201.0], 5, 40.0, 40.0),
        ([199.0], 5, 39.8, 39.8),
    ):
        assert usable_band._longest_window(lengths, windows) == pytest.approx(longest)
        assert usable_band._whole_window(lengths, windows) == pytest.approx(whole)
    for length in (0.7, 2.9, 11.1):
        for count in range(1, 25):
            assert usable_band._whole_window([length], count) == pytest.approx(length / count)


def test_a_fit_begins_at_twice_the_lowest_frequency() -> None:
    for coherent, fitted in (
        ((1.0, 2.0), None),
        ((1.0, 2.01), (2.0, 2.01)),
        ((1.2345, 98.765), (2.47, 98.8)),
    ):
        assert usable_band._fitted(coherent) == fitted


class Sums:
    """Stands for a running sum: what it was made of, and the lengths that it took."""

    made: tuple[Any, ...] = ()
    taken: list[float]

    def __init__(self, *made: Any) -> None:
        Sums.made, Sums.taken = made, []

    def add(self, samples: dict[str, float]) -> None:
        """The record tells its length."""
        assert list(samples) == ["u", "p"]
        Sums.taken.append(samples["p"])

    def composite(self, inputs: list[str], outputs: list[str]) -> tuple[list[str], list[str]]:
        """Names alone, or what was wrong."""
        if len(Sums.taken) == 0:
            raise FlightidError("no window", found=0, needed=1)
        return inputs, outputs


class Held(dict[str, float]):
    """A record of which every channel is its length."""

    def __init__(self, length: float) -> None:
        super().__init__(u=length, p=length)
        self.duration_s = length


def test_windows_of_one_length_and_of_half_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(usable_band, "SpectralSum", Sums)
    names = (("u",), ("p",))
    records: Any = [Held(4.0), Held(3.99), Held(7.0)]
    # Two cycles in 4 s are π rad/s, and five samples a cycle of 0.1 s four times as much.
    for step, windows in ((0.0999, [4.0, 2.0]), (0.1001, [4.0])):
        found: Any = usable_band._of_windows(records, names, 4.0, step, "cut")
        assert found.composite == (["u"], ["p"])
        assert (found.inputs, found.outputs, found.cut) == (("u",), ("p",), "cut")
        channels, lengths, omega, told = Sums.made
        assert (channels, lengths, told, Sums.taken) == (("u", "p"), windows, step, [4.0, 7.0])
        assert omega == pytest.approx(np.geomspace(np.pi, 0.4 * np.pi / step, 60))
        assert found.omega_rad_s is omega
    assert isinstance(usable_band._of_windows(records, names, 4.0, 0.333, ""), AxesCoherence)
    assert isinstance(usable_band._of_windows(records, names, 4.0, 0.334, ""), str)
    assert usable_band._of_windows((), names, 4.0, 0.1, "") == "no window"


def test_of_windows_the_longest_with_enough_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Enough at all frequencies, else at some, else the shortest of all that were tried."""

    class Flown(list[Any]):
        are_long = False

    class Moved(dict[str, Any]):
        sample_time_s, duration_s = 0.1, 40.0

    flown = Moved(u=np.arange(2.0))
    monkeypatch.setattr(usable_band, "FlightStretches", lambda *_: Flown([flown]))
    monkeypatch.setattr(usable_band, "_cut", lambda *_: "")
    axis: Any = SimpleNamespace(command="u", rate="p")
    for counts, taken in (
        ([(1, 9), (9, 9), (1, 1)], 1),
        ([(1, 1), (1, 9), (9, 1), (1, 1)], 1),
        ([(1, 1), (1, 9)], 1),
        ([(1, 1), (1, 1), (2, 2)], 2),
        ([(1, 9), "short"], 0),
        ([(1, 1), "short"], 1),
    ):
        tried = [
            each if isinstance(each, str) else SimpleNamespace(
                composite=SimpleNamespace(n_independent=np.array(each, dtype=float))
            )
            for each in counts
        ]  # fmt: skip
        left = iter(tried)
        last = tried[-1]
        monkeypatch.setattr(usable_band, "_of_windows", lambda *_, k=left, e=last: next(k, e))
        found = usable_band._explained((), [axis], ((0.0, 40.0),))
        assert found is tried[taken], counts


def band_of(coherence: list[float], **told: Any) -> Any:
    """Of these coherences at 1, 2, ... rad/s."""
    omega = np.arange(1.0, 1.0 + len(coherence))
    windows = np.asarray(told.pop("windows", np.full(omega.size, 9.0)))
    values = np.zeros((1, 2, 2, omega.size))[0]
    values[1, 0] = coherence
    counts = np.zeros_like(values)
    counts[1, 0] = windows
    composite: Any = SimpleNamespace(coherence=values, n_independent=counts)
    explained = AxesCoherence(omega, ("u", "v"), ("q", "p"), composite, "")
    asked = {"rate_hz": 100.0, "highest": math.inf, **told}
    return usable_band._band(explained, "p", "u", asked["rate_hz"], asked["highest"])


def test_the_band_is_the_widest_coherent_part() -> None:
    wide = [0.9, 0.9, 0.1, 0.9, 0.8, 0.7, 0.6, 0.95, 0.1, 0.1]
    band, coherence, largest, why = band_of(wide)
    assert band[0] == pytest.approx(1.0)
    assert 2.0 <= band[1] <= 3.0
    assert (largest, why) == (0.95, "")
    # One wide enough for a fit: its mean is over the band of the fit.
    long = [0.1, *[0.9] * 2, 0.7, *[0.9] * 6, 0.1]
    (low, high), coherence, largest, why = band_of(long)
    inside = [c for w, c in enumerate(long, 1) if 2.0 * low <= w <= high]
    assert coherence == pytest.approx(np.mean(inside), abs=0.02)
    assert (largest, why) == (0.9, "")
    # The sweep and ten samples a cycle end it.
    assert band_of(long, highest=7.3)[0][1] == 7.3
    ends = [band_of(long, rate_hz=10.0 * each / (2.0 * np.pi))[0][1] for each in (7.01, 6.99)]
    assert ends == [7.0, 6.0]
    few = np.where(np.arange(11) < 6, 9.0, 4.4)
    assert band_of(long, windows=few)[0][1] <= 7.0
    assert band_of(long, windows=few)[2] == 0.9


def test_why_there_is_no_band() -> None:
    for asked, largest, why in (
        ({"rate_hz": 1.5}, None, "logged at 1.5 Hz: ten samples a cycle end below the lowest"),
        ({"windows": np.full(3, 4.4)}, None, "fewer than five independent windows stand behind"),
        ({"highest": 0.9}, None, "the sweep ends below the lowest frequency that its length"),
        ({}, 0.599, "partial coherence stays below 0.6 (largest 0.59)"),
    ):
        found = band_of([0.5, 0.599, 0.2], **asked)
        assert found[:3] == (None, largest, largest)
        assert found[3].startswith(why)
    single = band_of([0.1, 0.8, 0.1], highest=1.0)
    assert single[3] == "partial coherence stays below 0.6 (largest 0.10)"


def found_sweep(kind: str, axis: str = "roll") -> FoundExcitation:
    """From 10 to 40 s."""
    places: Any = {"start_s": 10.0, "stop_s": 40.0, "axis": axis, "kind": kind}
    return SimpleNamespace(**places)  # type: ignore[return-value]


def test_a_sweep_ends_where_its_power_does(monkeypatch: pytest.MonkeyPatch) -> None:
    stamps = np.arange(0.0, 60.0, 0.01)
    values = np.sin(2.0 * np.pi * 3.0 * stamps)
    held = {"p_ref": Signal("p_ref", stamps, values, "rad/s", "R")}
    monkeypatch.setattr(excited_to, "find", lambda _, name: held.get(name))
    log = HandmadeLog("px4").log
    ask = excited_to.excited_to
    found = ask(log, "roll", [found_sweep("chirp")]) / math.tau
    assert 3.0 <= found <= 3.0 + 2.0 * 8.0 / 30.0
    assert ask(log, "roll", [found_sweep("sweep")]) == found * math.tau
    for none in ([], [found_sweep("steps")], [found_sweep("chirp", "yaw")]):
        assert ask(log, "roll", none) == math.inf
    assert ask(log, "yaw", [found_sweep("chirp", "yaw")]) == math.inf


def test_a_run_of_the_mode_ends_at_three_quarters_or_where_it_was_broken_off() -> None:
    stamps = np.arange(0.0, 60.0, 0.01)
    run = SimpleNamespace(chirp_span_s=(10.0, 40.0), f_start_hz=1.0, f_stop_hz=8.0)
    for runs, flown, power_hz, end_hz in (
        ([run], 8.0, 20.0, 6.0),
        ([run], 5.0, 20.0, 5.0),
        ([run], 8.0, 2.0, 2.0),
        ([], 8.0, 20.0, 8.0),
        ([], 0.0, 20.0, 20.0),
    ):
        columns = {
            "Targ": np.sin(2.0 * np.pi * power_hz * stamps),
            "F": np.where((stamps > 10.0) & (stamps < 40.0), flown, 99.0),
        }
        columns["F"][[1000, 4000]] = flown
        log: Any = HandmadeLog("ardupilot", sid_runs=runs).with_table("SIDD", stamps, **columns)
        found = excited_to.excited_to(log, "roll", [found_sweep("sid")]) / math.tau
        assert found == pytest.approx(end_hz, abs=0.6 if end_hz == power_hz else 1e-9)
    turned = SimpleNamespace(chirp_span_s=(10.0, 40.0), f_start_hz=8.0, f_stop_hz=1.0)
    log.sid_runs = [turned, SimpleNamespace(chirp_span_s=(50.0, 60.0), f_start_hz=0.1, f_stop_hz=1)]
    log.with_table("SIDD", stamps, Targ=np.sin(2.0 * np.pi * 20.0 * stamps), F=0.0 * stamps)
    found = excited_to.excited_to(log, "roll", [found_sweep("sid")]) / math.tau
    assert found == pytest.approx(6.0)


def test_the_end_of_power_needs_samples_that_move_and_stamps_that_grow() -> None:
    stamps = np.arange(64) * 0.1
    values = np.sin(2.0 * np.pi * 2.0 * stamps)
    whole = (-1.0, 99.0)
    ends = [
        excited_to._power_end(stamps, values, whole),
        excited_to._power_end(stamps[1:], values[1:], whole),
        excited_to._power_end(stamps, 0.0 * values, whole),
        excited_to._power_end(np.r_[stamps[:-1], stamps[-2]], values, whole),
        excited_to._power_end(stamps, np.where(np.arange(64) == 5, np.nan, values), whole),
    ]
    assert [math.isinf(each) for each in ends] == [False, True, True, True, True]
    # A level is no power, and 20 dB are counted in parts of a decade.
    raised = excited_to._power_end(stamps, values + 1e3, whole)
    assert raised == pytest.approx(ends[0])
    t = np.arange(0.0, 64.0, 0.01)
    for share, end in ((0.99, 8.0), (1.01, 2.0)):
        # Powers in parts of a decade are f a²: those of 8 Hz are a hundredth of those of 2 Hz.
        small = math.sqrt(0.01 * 2.0 / 8.0) / share
        both = np.sin(2.0 * np.pi * 2.0 * t) + small * np.sin(2.0 * np.pi * 8.0 * t)
        assert excited_to.power_end(both, 100.0) / math.tau == pytest.approx(end, abs=0.3)


def test_what_touches_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    stamps = np.arange(4.0)
    rows = np.array([[1005.0, 1005.1, 1994.9, 1995.0]])
    motors = Actuators("RCOU", ("C1",), stamps, rows, 1000.0, 2000.0)
    low, high = saturation._motors(motors, ((0.0, 9.0),))
    assert (low.touched.tolist(), high.touched.tolist()) == (
        [True, False, False, False],
        [False, False, False, True],
    )
    assert (low.limit, high.limit, low.what) == ("lower limit 1000", "upper limit 2000", "RCOU.C1")
    assert list(saturation._motors(motors, ((8.0, 9.0),))) == []
    held = {
        "tau_phi": Signal("tau_phi", stamps, np.array([0.995, -0.995, 0.9949, 0.0]), "1", "M"),
        "tau_psi": Signal("tau_psi", stamps, np.array([0.4, 0.398, 0.3979, 0.0]), "1", "Y"),
        "tau_theta": Signal("tau_theta", stamps, np.full(4, 9.0), "N m", "T"),
        "p": Signal("p", stamps, np.array([34.2, -34.2, 34.1, 0.0]), "rad/s", "P"),
    }
    monkeypatch.setattr(saturation, "find", lambda _, name: held.get(name))
    log = HandmadeLog("betaflight").log
    log.parameters = {"pidsum_limit_yaw": 400.0, "pidsum_limit": 1000.0}
    roll, yaw = saturation._commands(log, ((0.0, 9.0),))
    assert (roll.touched.tolist(), roll.limit, roll.axis) == (
        [True, True, False, False],
        "mixer limit 1",
        "roll",
    )
    assert (yaw.touched.tolist(), yaw.limit) == (
        [True, True, False, False],
        "limit pidsum_limit_yaw 400",
    )
    log.parameters["pidsum_limit"] = 500.0
    assert next(saturation._commands(log, ((0.0, 9.0),))).limit == "limit pidsum_limit 500"
    log.kind = "inav"
    assert saturation._command_limit(log, "yaw") == (1.0, "mixer limit 1")
    (rate,) = saturation._gyroscopes(log, ((0.0, 9.0),))
    assert rate.touched.tolist() == [True, True, False, False]
    log.with_table("VIBE", stamps, Clip=np.array([0, 0, 3, 3]))
    *_, clip = saturation._gyroscopes(log, ((0.0, 9.0),))
    assert (clip.touched.tolist(), clip.time_s.tolist()) == ([False, True, False], [1.0, 2.0, 3.0])
    assert len(list(saturation._gyroscopes(log, ((2.0, 9.0),)))) == 2
    assert len(list(saturation._gyroscopes(log, ((3.0, 9.0),)))) == 1
    shares = saturation.saturations(log, ((0.0, 9.0),), motors)
    assert [each.share for each in shares] == [0.5, 0.5, *[1.0 / 3.0], 0.25, 0.25]


def test_contacts_closer_than_told_are_one() -> None:
    touched = np.isin(np.arange(10), [0, 1, 3, 7])
    contact = saturation.LimitContact("x", "y", np.arange(10.0), touched)
    assert contact.spans(1.0) == [(0.0, 1.0), (3.0, 3.0), (7.0, 7.0)]
    assert contact.spans(2.0) == [(0.0, 3.0), (7.0, 7.0)]
    assert saturation.LimitContact("x", "y", np.arange(10.0), touched & False).spans(1.0) == []


def test_what_is_not_logged_of_an_axis_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    stamps = np.arange(0.0, 9.0, 0.1)
    held = {"p": Signal("p", stamps, np.sin(stamps), "rad/s", "P")}
    monkeypatch.setattr(usable_band, "find", lambda _, name: held.get(name))
    roll, pitch, _ = usable_band.axis_bands(HandmadeLog("px4").log, (), ())
    assert (roll.reason, roll.rate_hz) == ("mixer command is not logged", 0.0)
    assert (pitch.reason, pitch.input) == ("mixer command and body rate are not logged", "")
    held["tau_phi"] = Signal("tau_phi", stamps[::2], np.cos(stamps[::2]), "1", "M")
    roll, *_ = usable_band.axis_bands(HandmadeLog("px4").log, (), ())
    assert (roll.reason, roll.input, roll.output) == ("nothing was flown", "M", "P")
    assert (roll.rate_hz, roll.rates_hz) == (pytest.approx(5.0), pytest.approx((5.0, 10.0)))
