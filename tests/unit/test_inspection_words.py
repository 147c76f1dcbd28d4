"""What the inspection says of lags, gaps, modes and firmware holds where it is said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.evidence import inspection_check, sweep_check
from flightid.findings import Finding
from flightid.inspection import advice, thresholds
from flightid.inspection import skew as stream_skew
from flightid.inspection.excitation_found import FoundExcitation, _plain, _shape, _steps, _sweep
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.gap_findings import _remedy
from flightid.inspection.inspection import Inspection
from flightid.inspection.rates import StreamRate
from flightid.inspection.saturation import Saturation
from flightid.inspection.signals import Signal
from flightid.inspection.skew import StreamSkew, _skew
from flightid.inspection.thresholds import LONGEST_WINDOW
from flightid.inspection.usable_band import AxisBand, _cut, _longest_window, _of_windows
from flightid.inspection.verdicts import _logging, _quality
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.logs.source import Event, Gap
from flightid.record.stamps import GAP_FACTOR
from flightid.study.proposal import propose_study
from flightid.study.settings import read_settings
from tests.closeness import assert_close
from tests.sweep_log import SweepFlight
from tests.ulog_builder import flight


def log(**fields: object) -> Any:
    known: dict[str, object] = {
        "kind": "px4",
        "vehicle": "copter",
        "parameters": {},
        "gaps": (),
        "sid_runs": (),
        "findings": (),
        "messages": ("vehicle_attitude",),
        "duration_s": 60.0,  # seconds, beyond which nothing was to come
    }
    known["path"] = Path("flown.bin")
    return SimpleNamespace(**{**known, **fields})


def skew(
    late_s: float,
    rate_hz: float,
    seconds: float,
    noise: float,
    scale: float = 1.0,
    level: float = 0.0,
) -> StreamSkew:
    rng = np.random.default_rng(3)
    fast_s = np.arange(0.0, seconds, 0.005)
    motion = np.convolve(rng.standard_normal(fast_s.size + 40), np.hanning(41), "valid")
    slow_s = np.arange(1.0, seconds - 1.0, 1.0 / rate_hz)
    values = np.interp(slow_s - late_s, fast_s, motion)
    values += noise * motion.std() * rng.standard_normal(slow_s.size)
    first, second = (
        Signal("p", fast_s, motion, "rad/s", "a"),
        Signal("p", slow_s, scale * values + level, "", "b"),
    )
    found = _skew("p", first, second, ((0.0, seconds),))
    assert found is not None
    return found


def test_a_lag_has_an_interval_and_is_told_only_where_the_streams_tell_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clear = skew(0.02, 50.0, 60.0, noise=0.1)
    assert abs(clear.lag_s - 0.02) < clear.half_width_s < 0.002
    assert clear.exceeds(0.004)
    level = skew(0.02, 50.0, 60.0, noise=0.1, level=100.0)
    assert_close(level.half_width_s, clear.half_width_s, rtol=1e-6, why="nor of their level")
    other_unit = skew(0.02, 50.0, 60.0, noise=0.1, scale=57.3).half_width_s
    assert_close(other_unit, clear.half_width_s, rtol=1e-6, why="a lag has no unit of the values")
    assert not skew(0.03, 1.0, 90.0, noise=0.1).is_told
    short = skew(0.012, 10.0, 8.0, noise=0.4)
    assert short.half_width_s > 0.004
    assert not short.exceeds(0.004)

    # It is at the top of a parabola through three points, and in the middle of a flat one.
    def found(left: float, right: float) -> float:
        near = {20: 0.99, 19: left, 21: right}
        with monkeypatch.context() as patch:
            patch.setattr(stream_skew, "_about_the_best", lambda *_: near)
            return skew(0.02, 50.0, 20.0, noise=0.1).lag_s

    middle, step = found(0.98, 0.98), 2.0 * (found(0.98, 0.99) - found(0.98, 0.98))
    assert abs(step) > 1e-5
    assert found(0.99, 0.99) == middle
    assert_close(found(0.97, 0.98) - middle, step / 6.0, rtol=1e-9, why="through three points")
    assert_close(found(0.98, 0.97) - middle, -step / 6.0, rtol=1e-9, why="through three points")


@pytest.mark.parametrize(
    ("parameters", "logging", "excitation"),
    [
        (
            {"SDLOG_PROFILE": 1.0, "MC_AT_START": 0.0},
            "set SDLOG_PROFILE 25 (now 1;",
            "(MC_AT_START",
        ),
        ({"SDLOG_PROFILE": 35.0}, "set SDLOG_PROFILE 59 (now 35;", "0.3 Hz up;"),
        ({"SYS_AUTOSTART": 1.0}, "hold no SDLOG_PROFILE", "0.3 Hz up;"),
    ],
)
def test_advice_names_only_what_the_firmware_has(
    parameters: dict[str, float], logging: str, excitation: str
) -> None:
    flown = log(parameters=parameters)
    assert logging in advice.logging(flown)
    assert excitation in advice.excitation(flown)


def test_a_log_that_ends_before_its_messages_says_nothing_of_its_firmware(tmp_path: Path) -> None:
    """Cut among its parameters: those that are missing are not known to be missing in flight."""
    whole = bytes(flight())
    cut = tmp_path / "cut.ulg"
    cut.write_bytes(whole[: whole.index(b"MC_ROLL_P")])
    started = fid.read_log(cut)
    assert not started.parameters
    assert "ends before anything was measured" in advice.logging(started)
    assert "firmware" not in fid.inspect_log(started).to_text()
    writer = DataflashWriter()
    writer.parameter("LOG_BITMASK", 1.0)
    writer.write(tmp_path / "cut.bin")
    review = fid.review_flight(tmp_path / "cut.bin")
    (told,) = (each for each in review.findings if each.code == "flight-unknown")
    assert told.action.startswith("hand in the whole log"), (
        "CTUN was to be logged, which was cut off"
    )
    assert review.answer.endswith("whether it flew: the log ends before anything was measured.")
    cut.write_bytes(whole)
    assert "hold no SDLOG_PROFILE" in advice.logging(fid.read_log(cut))


def test_a_log_cut_soon_after_its_first_rows_is_not_said_to_lack_what_came_later(
    tmp_path: Path,
) -> None:
    """Its outputs' functions were still to come: "keep the beginning of the log" was said of it."""
    writer = DataflashWriter()
    writer.parameter("LOG_BITMASK", 1.0)
    writer.add("RCOU", np.array([1_000_000, 1_100_000]), {"C1": 1500.0, "C2": 1500.0})
    writer.write(tmp_path / "cut.bin")
    review = fid.review_flight(tmp_path / "cut.bin")
    (told,) = (each for each in review.findings if each.code == "flight-unknown")
    assert told.message == "the log ends 0.1 s after its first stamp"
    assert told.action.startswith("hand in the whole log")


def test_bits_of_the_logging_mask_are_those_of_the_vehicle() -> None:
    plane = log(kind="ardupilot", vehicle="plane", parameters={"LOG_BITMASK": 65535.0})
    assert advice.logging(plane) == "set LOG_BITMASK 1114111 (now 65535; bit 20 is missing)"
    without_sid = log(kind="ardupilot", parameters={"LOG_BITMASK": 65535.0})
    assert "SID_AXIS" not in advice.excitation(without_sid)
    swept = log(kind="ardupilot", parameters={"A": 1.0}, sid_runs=["a run"])
    assert advice.excitation(swept).startswith("fly system identification mode"), "it has just been"
    with_sid = log(kind="ardupilot", parameters={"SID_AXIS": 0.0})
    assert "flightid plan flown.bin" in advice.excitation(with_sid)


@pytest.mark.parametrize(
    ("modes", "kind", "words"),
    [
        (["AUTO_MISSION", "AUTO_RTL"], "autopilot", "the autopilot's own flying (AUTO_MISSION and"),
        (["STABILIZE (mode 0, reason 1)"], "pilot", "plain flying (STABILIZE)"),
        (["LOITER (mode 5)", "RTL (mode 6)"], "flying", "plain flying (LOITER and RTL)"),
        ([], "flying", "plain flying"),
    ],
)
def test_who_flew_is_read_from_the_modes(modes: list[str], kind: str, words: str) -> None:
    events = tuple(Event(5.0 + 3 * i, "mode", mode) for i, mode in enumerate(modes))
    found = _plain(log(events=events), (6.0, 20.0))
    to_the_last = _plain(log(events=events), (6.0, 5.0 + 3 * max(1, len(events) - 1)))
    assert to_the_last == found
    assert found[0] == kind
    assert found[1].startswith(words)
    if kind == "flying" and modes:
        assert _plain(log(events=events, vehicle="plane"), (6.0, 20.0))[0] == "autopilot"


def test_a_card_is_blamed_only_where_the_logger_lost_samples() -> None:
    gaps = [(3.0, 3.4)]
    assert "faster card" in _remedy(log(gaps=(Gap(3.1, 3.2, ""),)), gaps)
    silent = _remedy(log(gaps=(Gap(3.1, 3.1, ""), Gap(8.0, 9.0, "")), parameters={}), gaps)
    assert "no card is to blame" in silent


def test_one_scrap_does_not_shorten_the_windows_of_all() -> None:
    pieces = (1.45, 2.91, 3.12, 1.87, 2.08, 5.51, 4.16, 6.55)
    window = _longest_window(list(pieces), 7.0)
    assert window == 2.91
    kept = sorted((each for each in pieces if each >= window), reverse=True)
    assert kept == [6.55, 5.51, 4.16, 3.12, 2.91]


def test_a_long_flight_gives_more_windows_not_longer_ones() -> None:
    assert _longest_window([279.0], 7.0) == 279.0 / 7.0
    assert _longest_window([12_000.0], 7.0) == LONGEST_WINDOW.value


def test_where_no_band_is_left_both_of_its_ends_are_said() -> None:
    """Two cycles in 4 s, five samples a cycle of 0.5 s."""
    said = _of_windows((), (("tau_phi",), ("p",)), 4.0, 0.5, "; cut")
    assert said == (
        "the windows reach down to 0.5 Hz, the sampling up to 0.4 Hz: no band is left; cut"
    )


def test_pieces_that_gaps_made_of_spans_are_counted() -> None:
    """Two spans in three parts, and five records: two are by gaps."""
    flown: Any = SimpleNamespace(n_parts=3, spans=((0.0, 9.0), (20.0, 29.0)))
    assert _cut([1.0, 2.0, 3.0], flown) == ""
    assert _cut([1.0, 2.0, 3.0, 4.0, 5.25], flown) == (
        "; gaps cut the flight into 4 pieces, the longest 5.2 s: close them first"
    )


def test_bursts_have_no_rate() -> None:
    steady = StreamRate("SIDD", None, 9000, 400.0, 80.0, 0.1, 1, 60.0, 0)
    assert not steady.is_burst
    assert replace(steady, rate_hz=2.5e5, mean_hz=1.5e5).is_burst
    assert replace(steady, rate_hz=10.2, mean_hz=3.0, jitter=5.1).is_burst


def test_a_table_tells_the_band_that_the_verdict_tells() -> None:
    """A fit begins at twice the lowest frequency: a verdict said 11.7, its table 23.5 rad/s."""
    roll = AxisBand("roll", "a", "b", 47.7, (23.5, 26.5), 0.66, coherent_rad_s=(11.7, 26.5))
    yaw = AxisBand("yaw", "a", "b", 47.7, (2.5, 7.3), 0.77, coherent_rad_s=(1.25, 7.3))
    phases = FlightPhases(((0.0, 9.0),), True, None, "")
    seen = Inspection("a", "px4", "", "copter", 9.0, (), phases, (), (), (), (), ())
    rows = [row[4:8] for row in replace(seen, bands=(roll, yaw))._axes().rows]
    assert rows == [(11.7, 26.5, 0.66, "too narrow for more than a gain"), (2.5, 7.3, 0.77, None)]


def test_each_rate_is_said_of_the_signal_that_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A command by every motor status at 9.62 Hz: the rate beside it was said to be as slow."""
    rates = (9.62, 31.25)
    band = AxisBand("roll", "motors", "rollspeed", 9.62, None, None, rates_hz=rates)
    phases = FlightPhases(((0.0, 9.0),), True, None, "")
    seen = Inspection("a", "px4", "", "copter", 9.0, (), phases, (), (), (), (band,))
    monkeypatch.setattr(advice, "logging", lambda _: "log faster")
    log: Any = None
    (found,) = _logging(log, seen)
    assert found.message.startswith("motors is logged at 9.62 Hz and rollspeed at 31.25 Hz: ")
    alike = replace(band, rates_hz=(9.63, 9.62))
    (found,) = _logging(log, replace(seen, bands=(alike,)))
    assert found.message.startswith("motors and rollspeed are logged at 9.62 Hz: ")


def test_evidence_of_an_axis_is_not_that_of_another() -> None:
    findings = (
        Finding("narrow-band-roll", Light.AMBER, "roll: too narrow", "sweep"),
        Finding("band-pitch", Light.GREEN, "pitch: usable"),
        Finding("airborne", Light.GREEN, "airborne"),
    )
    phases = FlightPhases(((0.0, 9.0),), True, None, "")
    seen = Inspection("a", "px4", "", "copter", 9.0, (), phases, (), (), (), (), findings)
    assert inspection_check(seen, ("tau_theta", "q")).light is Light.GREEN
    assert inspection_check(seen, ("tau_phi", "p")).what == "roll: too narrow"
    assert inspection_check(seen, ("u", "y")).light is Light.AMBER
    assert sweep_check(seen, ("u", "y")) == ()
    (plain,) = sweep_check(seen, ("tau_phi", "p", "tau_psi"))
    assert plain.what.startswith("nothing was injected about roll, and no sweep was flown")
    assert plain.action == "sweep it: flightid plan a"
    sweep = FoundExcitation("sweep", "roll", 1.0, 9.0, "")
    assert sweep_check(replace(seen, excitations=(sweep,)), ("tau_phi", "p")) == ()


@pytest.mark.parametrize(
    ("first", "last", "found"), [(0.5, 5.0, True), (5.0, 0.5, True), (1.0, 2.5, False)]
)
def test_a_sweep_of_a_set_point_grows_or_shrinks_threefold(
    first: float, last: float, *, found: bool
) -> None:
    stamps = np.arange(0.0, 20.0, 0.01)
    swept = np.sin(2.0 * np.pi * (first * stamps + (last - first) * stamps**2 / 40.0))
    ends = _sweep(stamps, swept)
    assert (ends is not None) is found
    if ends is not None:
        # The middle one of the 13 half periods at either end, 3.5 cycles from it.
        slope = (last**2 - first**2) / (2.75 * 20.0)
        middle = np.sqrt([first**2 + 3.5 * slope, last**2 - 3.5 * slope])
        assert_close(np.array(ends), middle, rtol=0.05, why="stamps of 0.01 s")
    shape = _shape(Signal("p", stamps, swept, "rad/s", "a"), "roll", (0.0, 19.99))
    assert (shape is not None) is found
    if shape is not None and ends is not None:
        assert (shape.kind, shape.start_s, shape.stop_s) == ("sweep", 0.0, 19.99)
        assert shape.detail == f"set-point from {ends[0]:.2g} to {ends[1]:.2g} Hz"


def test_axes_share_a_reason_and_each_has_its_number(shared_data: Path) -> None:
    """Of a flight of sticks with a bent frame: 0.52 and 0.80 were of two axes, and yaw was cut."""
    found = fid.inspect_log(shared_data / "logs" / "arducopter_457.BIN")
    messages = {each.code: each.message for each in found.findings}
    assert "roll, pitch, yaw: nothing was injected, and no sweep was flown." in found.to_text(
    ).replace("\n", " ")  # fmt: skip
    assert messages["no-band-roll"].endswith("partial coherence stays below 0.6 (largest 0.52)")
    assert {"unswept-pitch", "unswept-yaw"} <= messages.keys(), "coherent by their loops alone"
    assert set(found.usable_band_rad_s.values()) == {None}
    assert "is at its mixer limit 1 for 26 % of the flight" in messages["saturated-yaw"]
    assert "RCOU.C3 is at its lower limit" in messages["saturated"]


def test_one_axis_has_one_band_wherever_it_is_said(tmp_path: Path) -> None:
    """Card, finding, table and study of one log: its study's band to the last digit."""
    path = SweepFlight(sweep_s=20.0, rate_hz=100.0).write(tmp_path)
    found = fid.inspect_log(path)
    proposed = propose_study([path], folder=tmp_path)
    settings = read_settings(proposed.write(tmp_path / "study.toml"))
    for band, model in zip(found.bands, settings.models, strict=True):
        assert model.band_rad_s == band.band_rad_s
        assert f"# The log carries {band.words}: " in proposed.text
        said = next(f.message for f in found.findings if f.code == f"band-{band.axis}")
        assert f"usable from {band.words} (" in said


def test_steps_of_a_set_point_are_counted_where_a_level_is_held() -> None:
    stamps = np.arange(0.0, 12.0, 0.02)
    stairs = np.floor(stamps / 3.0) % 2
    assert _steps(stamps, stairs) == 3
    assert _steps(stamps, np.sin(stamps)) == 0
    assert _steps(stamps[:39], stairs[:39]) == 0


def test_limits_are_what_their_sentences_say() -> None:
    """Each beside the figures of its source, rounded to as many digits as it has."""
    meant = {
        "INDEPENDENT_WINDOWS": 1 / (1 / 5),
        "CYCLES_IN_WINDOW": 2.0,
        "LOWEST_OF_INTEREST": 2 / (2 * np.pi),
        "LONGEST_WINDOW": 2 / 0.05,
        "SAMPLES_PER_CYCLE": 180 / 18,
        "SAMPLES_PER_CYCLE_LEAST": 1 / (1 / 5),
        "RATE_GOOD": 25 * 4.0,
        "RATE_LEAST": 10 * 3.0,
        "EXCITED_POWER": 10 ** (-20 / 10),
        "BAND_GOOD": 10.0,
        "BAND_LEAST": 10**0.5,
        "GAP_FACTOR": GAP_FACTOR,
        "RESTING_RATE": np.radians(3.0),
        "SHORTEST_SEGMENT": 2 / 1.0,
        "LYING_TILT": np.radians(30.0),
        "TIPPING_TILT": np.radians(20.0),
        "GYRO_RANGE": 0.98 * np.radians(2000.0),
        "SKEW": np.radians(14.0) / (2 * np.pi * 10.0),
        "GROWTH": 2.0**3,
        "DIVERGED_RATE": np.radians(29.0),
        "DIVERGED_ANGLE": np.radians(20.0),
    }
    held = {name: getattr(thresholds, name).value for name in meant}
    digits = {name: len(f"{value:g}".replace(".", "").strip("0")) for name, value in held.items()}
    assert {name: float(f"{meant[name]:.{digits[name]}g}") for name in meant} == held


def test_a_twentieth_of_the_flight_at_a_limit_and_a_fifth_of_jitter_are_said() -> None:
    rows = SimpleNamespace(time_s=np.arange(0.0, 9.0, 0.0025))
    flown = log(table=lambda *_: rows, events=())
    band = AxisBand("roll", "RATE.ROut", "RATE.R", 400.0, None, None)
    phases = FlightPhases(((0.0, 9.0),), True, None, "")
    for times, codes in ((0.98, []), (1.02, ["saturated-yaw", "saturated", "jitter"])):
        rate = StreamRate("RATE", None, 9000, 400.0, 400.0, 0.2 * times, 0, 60.0, 0)
        hits = tuple(Saturation("x", "upper limit 1", 0.05 * times, axis) for axis in ("", "yaw"))
        seen = Inspection("a", "px4", "", "copter", 9.0, (rate,), phases, (), hits, (), (band,))
        assert [finding.code for finding in _quality(flown, seen)] == codes
