"""Filters in the review of a flight: noise in the outputs, notches proposed, files written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import butter, lfilter, welch

import flightid as fid
from flightid.cli.flight import command
from flightid.cli.program import program
from flightid.control.autopilots import NotchTracking
from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.findings import FALL, Finding
from flightid.logs.dataflash.layout import MessageLayout
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.review.edited_filters import NOTCHES, EditedAxis, filter_bench
from flightid.review.filter_costs import filter_costs
from flightid.review.filter_findings import _advice
from flightid.review.gyro_noise import GyroNoise, floor_beneath
from flightid.review.notch_proposal import _series
from flightid.review.tried_filters import tried_filters
from flightid.review.verdicts import judge_flight
from tests.closeness import assert_close

PARAMETERS = {
    "SCHED_LOOP_RATE": 400.0, "INS_GYRO_RATE": 0.0, "FRAME_CLASS": 1.0, "INS_GYRO_FILTER": 40.0,
    "MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0, "INS_HNTCH_ENABLE": 0.0,
    **{f"ATC_RAT_{axis}_{k}": v for axis in ("RLL", "PIT", "YAW")
       for k, v in (("P", 0.12), ("I", 0.12), ("D", 0.004), ("FLTD", 20.0), ("IMAX", 0.5))},
    **{f"ATC_ANG_{axis}_P": 4.5 for axis in ("RLL", "PIT", "YAW")},
    **{f"SERVO{i}_FUNCTION": 32.0 + i for i in (1, 2, 3, 4)},
}  # fmt: skip


def _write(path: Path, *, tone: float, white: float, esc: bool) -> None:
    """A hover whose throttle wanders, with motors that turn 100 Hz at a throttle of 0.4."""
    random, rate_hz = np.random.default_rng(4), 1000.0
    time_s = 10.0 + np.arange(0.0, 60.0, 1 / rate_hz)
    throttle = 0.4 + 0.08 * np.sin(2 * np.pi * time_s / 17.0)
    turns = 100.0 * np.sqrt(throttle / 0.4)
    angle = 2 * np.pi * np.cumsum(turns) / rate_hz
    stamps = (1e6 * time_s).astype(np.int64)
    writer = DataflashWriter()
    writer.message(int(stamps[0]), "ArduCopter V4.6.0 (test)")
    for name, value in PARAMETERS.items():
        writer.parameter(name, value)
    shake = tone * np.sqrt(2) * (np.sin(angle) + 0.5 * np.sin(2 * angle))
    gyro = {f"Gyr{axis}": shake + white * random.standard_normal(time_s.size) for axis in "XYZ"}
    labels = "TimeUS,I,SampleUS,GyrX,GyrY,GyrZ"
    writer.define(MessageLayout("GYR", 220, "QBQfff", labels, "s#sEEE", "F-F000"))
    writer.add("GYR", stamps, {"SampleUS": 1e-6 * stamps, **gyro})
    slow = slice(None, None, 100)
    writer.add("CTUN", stamps[slow], {"ThO": throttle[slow]})
    writer.add("RCOU", stamps[slow], {f"C{i}": 1500.0 for i in (1, 2, 3, 4)})
    if esc:
        writer.add("ESC", stamps[slow], {"RPM": 60.0 * turns[slow]})
    writer.write(path)


def test_a_notch_by_throttle_is_proposed_where_motors_shake_the_gyro(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, file = tmp_path / "shaken.bin", tmp_path / "filters.param"
    _write(path, tone=0.6, white=0.002, esc=False)
    review = fid.review_flight(path)
    assert review.noise.gyro == "raw"
    assert review.noise.label.startswith("GYR.GyrX")
    roll = review.filters.axes[0].noise
    assert roll is not None
    # 0.6 rad/s at about 100 Hz and half at twice that, by P and D alone.
    loop = fid.axis_loop("arducopter", "roll", PARAMETERS, gyro_rate_hz=1000.0)
    turns = 2 * np.pi * 100.0 * np.sqrt(1.0 + 0.2 * np.sin(np.linspace(0.0, 2 * np.pi, 200)))
    gains = [np.abs(loop.feedback(k * turns, with_hold=False)) ** 2 for k in (1.0, 2.0)]
    exact = 0.6 * np.sqrt(np.mean(gains[0] + 0.25 * gains[1]))
    assert_close(roll.total, exact, rtol=0.05, why="two tones that wander, and little noise")
    choice = review.filters.choice
    assert choice is not None
    assert choice.values["INS_HNTCH_MODE"] == 1.0
    assert abs(choice.values["INS_HNTCH_REF"] - 0.4) < 0.02
    assert abs(choice.values["INS_HNTCH_FREQ"] - 100.0) < 8.0
    assert choice.values["INS_HNTCH_HMNCS"] == 3.0
    assert any(f.code == "output-noise-roll" for f in review.findings)
    # Of a fall the same filters were advised with a command that refuses to write them.
    fell = judge_flight(replace(review, phases=replace(review.phases, tipped_s=20.0)))
    (noisy,) = (each for each in fell if each.code == "output-noise-roll")
    assert noisy.action.startswith("find the cause of the fall first")
    assert not any("--write" in each.action for each in fell)
    monkeypatch.setattr(fid, "review_flight", lambda *_, **__: review, raising=False)
    made = CliRunner().invoke(command, [str(path), "--write", str(file)])
    assert made.exit_code == 0, made.output
    assert "set INS_HNTCH_ENABLE 1" in " ".join(made.output.split())
    assert fid.read_parameters(file) == pytest.approx(choice.values)
    back = fid.read_parameters(tmp_path / "filters.rollback.param")
    assert back["INS_HNTCH_ENABLE"] == 0.0
    fell = Finding(FALL, Light.AMBER, "the vehicle falls over", "look for the cause first")
    fallen = replace(review, findings=(*review.findings, fell))
    monkeypatch.setattr(fid, "review_flight", lambda *_, **__: fallen, raising=False)
    unwritten = tmp_path / "after_the_fall.param"
    made = CliRunner().invoke(command, [str(path), "--write", str(unwritten)])
    assert "the vehicle falls over; look for the cause first" in " ".join(made.output.split())
    assert not unwritten.exists()


@pytest.mark.parametrize(
    ("heights", "first", "found"),
    [
        ({60.0: 50.0, 120.0: 90.0, 180.0: 20.0, 240.0: 20.0}, 60.0, (1, 2, 3)),
        ({60.0: 50.0, 180.0: 90.0}, 60.0, (1, 3)),
        ({60.0: 3.0, 120.0: 90.0}, 120.0, (1,)),  # less than four times its floor
    ],
)
def test_the_lowest_harmonic_that_stands_out_counts_the_others(
    heights: dict[float, float], first: float, found: tuple[int, ...]
) -> None:
    frequency = np.arange(1.0, 500.0)
    power = np.ones(frequency.size)
    for hz, height in heights.items():
        power[frequency == hz] = height
    noise = GyroNoise(frequency_hz=frequency, spectrum=np.stack([power] * 3))
    assert _series(noise, NotchTracking()) == (first, found)


def test_the_floor_follows_what_is_wider_than_half_of_a_frequency() -> None:
    frequency = np.arange(2.0, 1000.0)
    for wide, floor in ((1.2, 1.0), (2.0, 100.0)):
        inside = np.abs(np.log(frequency / 200.0)) < 0.5 * np.log(wide)
        found = floor_beneath(frequency, np.where(inside, 100.0, 1.0))
        assert_close(found[198], floor, rtol=1e-9, why="a median")


def test_telemetry_of_the_motors_leads_the_notch_where_it_is_logged(tmp_path: Path) -> None:
    path = tmp_path / "shaken.bin"
    _write(path, tone=0.6, white=0.002, esc=True)
    review = fid.review_flight(path)
    sources = {peak.source for peak in review.noise.peaks}
    assert sources == {"two blades: ESCs say 89.5 to 109 turns a second"}
    choice = review.filters.choice
    assert choice is not None
    assert (choice.values["INS_HNTCH_MODE"], choice.values["INS_HNTCH_REF"]) == (3.0, 1.0)


def test_a_quiet_gyro_may_have_faster_filters_and_says_what_they_save(tmp_path: Path) -> None:
    path = tmp_path / "quiet.bin"
    _write(path, tone=0.0, white=0.001, esc=False)
    review = fid.review_flight(path)
    assert review.filters.choice is not None
    assert review.filters.choice.values["INS_GYRO_FILTER"] == 80.0
    (found,) = (f for f in review.findings if f.code == "filters-slow")
    # Of each axis the table says it; the verdict repeated the table to the letter.
    (note, *_) = review.filters.choice_table().notes
    assert note.startswith("roll: saves")
    assert f"saves up to {note.split()[2]} deg" in found.message
    assert note not in found.message
    assert review.filters.table().rows[0][:2] == ("all", "INS_GYRO_FILTER")


def test_edited_filters_pass_what_filtering_the_gyro_again_passes(tmp_path: Path) -> None:
    """Against SciPy: its Butterworth filter on the samples that were logged, and Welch's method."""
    path = tmp_path / "shaken.bin"
    _write(path, tone=0.6, white=0.01, esc=False)
    log = fid.read_log(path)
    bench = filter_bench(log)
    (roll, *_) = bench.edited({"INS_GYRO_FILTER": 25.0})
    again = lfilter(*butter(2, 25.0, fs=1000.0), log.table("GYR")["GyrX"])[2000:]
    hz, power = welch(again, 1000.0, nperseg=2048)
    seen = (roll.frequency_hz > 8.0) & (roll.frequency_hz < 80.0)
    there = np.interp(roll.frequency_hz[seen], hz, power)
    share = 10.0 * np.log10(roll.edited[seen] / there)
    assert abs(np.median(share)) < 0.3
    # Phase, noise and notches are those that the review found for the same parameters.
    assert bench.choice is not None
    for made, told in zip(bench.edited(bench.choice.values), bench.choice.axes, strict=True):
        assert_close(made.phase_edited_deg, told.phase_new_deg, atol=1e-9, why="one controller")
        assert_close(made.noise_edited, told.noise_new, rtol=1e-9, why="one spectrum")
    fixed = {"INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_MODE": 0.0, "INS_HNTCH_FREQ": 150.0,
             "INS_HNTCH_BW": 40.0, "INS_HNTCH_HMNCS": 1.0}  # fmt: skip
    (cut, *_) = bench.edited(fixed)
    at = int(np.argmin(np.abs(cut.frequency_hz - 150.0)))
    assert cut.edited[at] < 1e-3 * cut.flown[at]
    assert cut.phase_edited_deg < cut.phase_flown_deg
    # The file holds all that the notch rests on, what the log does not tell as well; so does the
    # way back.
    changes = bench.changes(fixed | {"INS_GYRO_FILTER": 40.0})
    assert {each.name: each.value for each in changes} == NOTCHES["ardupilot"] | fixed
    assert all((each.old is None) == (each.name not in PARAMETERS) for each in changes)
    back = bench.way_back(fixed)
    assert {each.name: each.value for each in back} == NOTCHES["ardupilot"]
    # The page shows these numbers, and a file with its way back.
    filter_work = pytest.importorskip("flightid.app.filter_work", exc_type=ImportError)
    shown = filter_work.try_filters(path, {"INS_GYRO_FILTER": 25.0})
    assert shown["axes"][0]["noise_edited_percent"] == pytest.approx(100.0 * roll.noise_edited)
    assert "INS_GYRO_FILTER,25" in shown["files"][0]["text"].replace(" ", "")
    assert "INS_GYRO_FILTER,40" in shown["files"][1]["text"].replace(" ", "")
    # Noise is known up to half of the log's rate: who opens a filter beyond it is told so.
    assert shown["seen_hz"] == pytest.approx(500.0, rel=1e-3)
    assert "up to 500 Hz" in tried_filters(bench, {}).summary().notes[1]
    (unseen,) = tried_filters(bench, {"INS_GYRO_FILTER": 2000.0}).findings[-1:]
    assert (unseen.code, unseen.light) == ("edited-noise-unseen", Light.AMBER)
    assert "INS_GYRO_FILTER 2000 Hz passes noise above 500 Hz" in unseen.message
    assert not any(each["code"] == unseen.code for each in shown["findings"])
    assert (shown["raw"], filter_work.try_filters(path, {})["files"]) == (True, [])
    # What cannot be tried stands beside its field, and the panel works with all others.
    bad = filter_work.try_filters(path, {"INS_GYRO_FILTER": -5.0, "NO_SUCH": 1.0})
    assert bad["axes"] == filter_work.try_filters(path, {})["axes"]
    assert bad["refused"] == {
        "INS_GYRO_FILTER": "INS_GYRO_FILTER may be 0 to 10000, not -5; 40 flew",
        "NO_SUCH": "NO_SUCH is no filter of this vehicle",
    }
    with pytest.raises(OptionError, match="no filter of this vehicle"):
        bench.edited({"ATC_RAT_RLL_P": 0.2})


@pytest.mark.parametrize(
    ("cost", "margin", "light", "said"),
    [
        (134.0, (62.5, 110.0), Light.RED, "leave 62.5 to 110 deg: the loop would be unstable"),
        (80.0, (62.5, 110.0), Light.RED, "the loop may be unstable"),
        (30.0, (62.5, 110.0), Light.AMBER, "32.5 to 80 deg are left, 45 are asked for"),
        (10.0, (62.5, 110.0), Light.GREEN, "52.5 to 100 deg are left"),
        (50.0, None, Light.RED, "all of the 45 deg that a loop is designed to keep"),
        (10.0, None, Light.AMBER, "the flight does not tell what is left"),
        (2.0, (40.0, 50.0), None, ""),
    ],
)
def test_what_filters_cost_is_said_beside_what_the_loop_has(
    cost: float, margin: tuple[float, float] | None, light: Light | None, said: str
) -> None:
    one = np.ones(1)
    axis = EditedAxis("roll", one, one, one, one, -30.0, -30.0 - cost, 0.005, 0.004, ())
    known = {} if margin is None else {"roll": margin}
    found = list(filter_costs([axis], 3.07, known, measured=True))
    assert [each.light for each in found] == ([] if light is None else [light])
    assert all(f"cost {cost:.3g} deg of phase at 3.07 Hz" in each.message for each in found)
    assert all(each.message.endswith(said) for each in found)


def test_filters_that_let_more_noise_through_than_is_fine_are_amber() -> None:
    one = np.ones(1)
    axis = EditedAxis("roll", one, one, one, one, -30.0, -25.0, 0.008, 0.021, ())
    (found,) = filter_costs([axis], 5.0, {}, measured=False)
    assert (found.light, found.code) == (Light.AMBER, "edited-noise-roll")
    assert "2.1 % of full command, rms (0.8 as flown)" in found.message


def test_filters_that_cannot_be_told_say_why_and_nothing_is_written(tmp_path: Path) -> None:
    writer = DataflashWriter()
    writer.message(10_000_000, "ArduCopter V4.6.0 (test)")
    writer.parameter("SCHED_LOOP_RATE", 400.0)
    writer.add("CTUN", np.arange(10_000_000, 30_000_000, 100_000), {"ThO": 0.0})
    writer.write(tmp_path / "bare.bin")
    review = fid.review_flight(tmp_path / "bare.bin")
    assert "no ATC_RAT_RLL_P" in review.filters.reason
    with pytest.raises(DataError, match="no filters can be tried"):
        filter_bench(fid.read_log(tmp_path / "bare.bin"))
    made = CliRunner().invoke(
        command, [str(tmp_path / "bare.bin"), "--write", str(tmp_path / "none.param")]
    )
    assert "Not written" in made.output
    assert not (tmp_path / "none.param").exists()


def test_the_command_tunes_with_suggested_filters_and_writes_them(tmp_path: Path) -> None:
    log, file = tmp_path / "quiet.bin", tmp_path / "gains.param"
    _write(log, tone=0.0, white=0.001, esc=False)
    plant = fid.load_model("rate_integrator", axis="roll").with_values(
        {"Ltphi": 140.0, "tau": 0.03}
    )
    fid.write_model(plant, tmp_path / "roll.toml")
    words = [
        "tune", str(tmp_path / "roll.toml"), "--log", str(log), "--nominal", "--band-rad-s", "1",
        "100", "--filters", "suggested", "--write", str(file), "--accept-red",
    ]  # fmt: skip
    made = CliRunner().invoke(program, words)
    assert "INS_GYRO_FILTER 40 → 80" in made.output, made.output
    assert "pitch and yaw fly the shared filters" in " ".join(made.output.split())
    written = sorted(tmp_path.glob("gains*.param"))
    changed = {fid.read_parameters(each)["INS_GYRO_FILTER"] for each in written}
    assert changed == {80.0, 40.0}, "every step, and the way back"


def test_filters_that_change_nothing_are_not_advised() -> None:
    nothing: Any = SimpleNamespace(within_limit=True, axes=())
    assert _advice("", "", nothing, "", "").startswith("balance propellers")
    assert _advice("", "", None, "", "").startswith("balance propellers")
