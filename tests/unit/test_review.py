"""The review of a flight: true numbers from ordinary flying, or the reason for none."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from click.testing import CliRunner

import flightid as fid
from flightid.cli.flight import command
from flightid.control.tuning.pid_design import PidDesign
from flightid.control.tuning.responses import ResponseBand
from flightid.conventions import Light
from flightid.errors import DataError
from flightid.inspection.actuators import Actuators
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.plot.gains import has_both, measured_and_predicted
from flightid.plot.glance import flight_glance
from flightid.review.apart import gains_between
from flightid.review.deconvolution import closed_loop
from flightid.review.gyro_noise import GyroNoise
from flightid.review.loop_samples import LoopSamples
from flightid.review.loops import (
    IN_SWEEPS,
    _pair,
    _unless_short,
    loop_responses,
    refused,
    tracking_error,
)
from flightid.review.motors import motor_use, turning, yaw_trim
from flightid.review.verdicts import judge_flight
from flightid.uncertainty.estimate import Estimate, Reading
from flightid.uncertainty.uneven import DrawnEnds
from tests.closeness import assert_close
from tests.ordinary_log import write_ordinary_log
from tests.strangers import inspected_logs
from tests.strangers.ordinary_flights import Axis, step


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("ordinary") / "flight.bin"
    write_ordinary_log(path)
    return path


@pytest.fixture(scope="module")
def review(log: Path) -> fid.FlightReview:
    return fid.review_flight(log)


def codes(review: fid.FlightReview) -> set[str]:
    return {f.code for f in review.findings if f.light is not Light.GREEN}


def test_the_step_of_the_rate_loop_is_that_of_the_simulator(review: fid.FlightReview) -> None:
    loop = review["roll rate"]
    truth = step(Axis(), 1.0)
    at = np.interp(loop.time_s, np.arange(truth.size) / 400.0, truth)
    lower, upper = loop.band()
    assert np.mean((lower <= at) & (at <= upper)) > 0.8
    assert np.max(upper - lower) < 0.4
    half = np.interp(0.5 * at[-10:].mean(), truth[:60], np.arange(60) / 400.0)
    low, high = loop["delay to half"].interval95 or (0.0, 0.0)
    assert low <= half <= high
    assert high - low < 0.02


def test_the_step_of_the_attitude_loop_is_that_of_the_simulator(review: fid.FlightReview) -> None:
    loop = review["roll attitude"]
    truth = step(Axis(), 2.0, angle=True)
    at = np.interp(loop.time_s, np.arange(truth.size) / 400.0, truth)
    lower, upper = loop.band()
    assert np.mean((lower <= at) & (at <= upper)) > 0.8
    assert np.max(upper - lower) < 0.4


def test_a_setting_is_asked_for_once(review: fid.FlightReview) -> None:
    """SDLOG_PROFILE 25 was asked for in two sentences of one screen."""
    slow = replace(
        review.loops[0], step=np.zeros(0), reason="logged too slowly",
        action="set SDLOG_PROFILE 25 (now 1) and fly again",
    )  # fmt: skip
    px4 = replace(review, kind="px4", noise=GyroNoise(reason="too slow"))
    for loops, asked in (((), 1), ((slow,), 1)):
        found = judge_flight(replace(px4, loops=loops))
        assert sum("SDLOG_PROFILE 25" in each.action for each in found) == asked


def test_noise_alone_is_told_from_a_loop() -> None:
    random = np.random.default_rng(2)
    still = LoopSamples(np.zeros(900), random.standard_normal(900), None, (900,), 0.01)
    with pytest.raises(DataError, match="does not move"):
        closed_loop(still)
    short = LoopSamples(*random.standard_normal((2, 300)), None, (300,), 0.01)
    with pytest.raises(DataError, match=r"too few samples.*needed"):
        closed_loop(short)


def test_a_quiet_flight_says_what_to_fly(tmp_path: Path) -> None:
    write_ordinary_log(tmp_path / "quiet.bin", axis=Axis(gust=1.0, noise=0.5), size=0.002)
    loop = fid.review_flight(tmp_path / "quiet.bin")["roll attitude"]
    assert "not enough motion" in loop.reason
    assert "roll stick" in loop.action
    # A yaw that nobody moved: 0.22 deg/s, a level near nothing, half way there at once or late.
    ends = [(0.11, 0.05, 0.17), (0.397, 0.006, 0.46), (0.083, 0.002, 0.47), (21.6, 0.0, 215.0)]
    read = tuple(
        Estimate("r", value, "s", ends=DrawnEnds(np.linspace(low, high, 801)))
        for value, low, high in ends
    )
    yaw = replace(loop, axis="yaw", loop="rate", rate_hz=100.0, moved=0.004)
    still = refused(yaw, read, 0.01, "")
    assert still is not None
    assert "the set-point hardly moved: the step ends at 0.11" in still.reason
    assert "raise" not in still.action
    # "the step ends at -5.33 (-465.5 to 0.9112)" told a pilot nothing.
    wild = Estimate("r", -5.33, "", ends=DrawnEnds(np.linspace(-465.5, 0.91, 801)))
    lost = refused(yaw, (wild, *read[1:]), 0.01, "")
    assert lost is not None
    assert "hardly moved: where the step ends cannot be told" in lost.reason
    sure = tuple(Estimate("r", value, "s", 0.05 * value) for value, _, _ in ends)
    assert refused(yaw, sure, 0.01, "") is None


def test_a_flight_of_sweeps_alone_was_flown(tmp_path: Path) -> None:
    path = tmp_path / "swept.bin"
    random = np.random.default_rng([0, 1215])
    inspected_logs.write(inspected_logs.sound(random), random, path)
    log = fid.read_log(path)
    (run,) = log.sid_runs
    made = loop_responses(log, ((run.start_s, run.stop_s),))
    assert {each.reason for each in made} == {IN_SWEEPS}
    assert {each.reason for each in loop_responses(log, ())} == {"nothing was flown"}


def test_a_slow_log_says_what_to_log(tmp_path: Path) -> None:
    write_ordinary_log(tmp_path / "slow.bin", every=40, duration_s=30.0)
    loop = fid.review_flight(tmp_path / "slow.bin")["roll rate"]
    assert not loop.is_told
    assert "logged at 10 Hz, too slowly" in loop.reason
    assert "LOG_BITMASK" in loop.action
    assert loop.tracking is not None
    write_ordinary_log(tmp_path / "few.bin", every=16, duration_s=5.0)
    few = fid.review_flight(tmp_path / "few.bin")["roll attitude"]
    assert few.reason.startswith("too few samples")
    assert "LOG_BITMASK" in few.action, "rows are few, whatever was flown"
    assert "fly a minute" in few.action


def test_a_flight_that_is_short_is_not_asked_for_settings_of_its_log(tmp_path: Path) -> None:
    """Bits of LOG_BITMASK were asked for of RATE at 400 Hz, which holds every row of the flight."""
    needed = {}
    for every in (8, 1):
        write_ordinary_log(tmp_path / "short.bin", every=every, duration_s=5.0)
        short = fid.review_flight(tmp_path / "short.bin")["roll attitude"]
        assert short.reason.startswith("too little flight, 4.9"), short.reason
        assert short.action.startswith("fly a minute"), short.action
        needed[every] = float(short.reason.split("needed ")[1].split()[0])
    assert_close(needed[1], needed[8], rtol=0.01, why="a faster log asks for as much flight")
    piece = fid.Record.from_arrays(0.0025 * np.arange(1000), outputs={"measured": np.zeros(1000)})
    few = replace(short, reason="too few samples, 2.5 s, needed 10.5 s", action="set bits")
    swept = SimpleNamespace(sid_runs=[SimpleNamespace(point="mixer")])
    told = _unless_short(few, swept, ((0.0, 2.5),), [piece])  # type: ignore[arg-type]
    assert told.reason == "too little flight outside sweeps, 2.5 s, needed 10.5 s"
    gap = _unless_short(few, swept, ((0.0, 9.0),), [piece])  # type: ignore[arg-type]
    assert gap is few, "a pause of the log ended the piece"


def test_a_tracking_error_of_one_wild_stretch_is_no_number() -> None:
    random = np.random.default_rng(4)
    still, wild = random.standard_normal((2, 4000))
    time_s = np.arange(4000) * 0.01
    for errors, told in ((still, True), (np.where(time_s < 36.0, 1e-3 * still, wild), False)):
        flown = fid.Record.from_arrays(
            time_s, outputs={"set_point": np.zeros(4000), "measured": errors}
        )
        found = tracking_error([flown], "rad/s")
        assert (found.value is not None) is told, found
        assert (found.reason == "") is told


def test_a_healthy_flight_has_no_complaint(review: fid.FlightReview) -> None:
    later = replace(review, start_s=44.0, duration_s=50.2).flight().to_text()
    assert "50.2 s, from 44.0 to 94.2 s of the autopilot's clock, as all times here" in later
    assert "clock" not in replace(review, start_s=0.0).flight().to_text(), "its zero is the log's"
    # The simulator flies roll alone: the other axes stand still.
    assert not [code for code in codes(review) if "pitch" not in code and "yaw" not in code]
    assert review.identity.battery is not None
    assert review.identity.battery.least_v == pytest.approx(15.2, abs=0.01)
    assert review.identity.gains["roll"] == {"ATC_RAT_RLL_P": pytest.approx(0.12)}


def test_motors_and_vibration_out_of_order_are_said(tmp_path: Path) -> None:
    write_ordinary_log(
        tmp_path / "sick.bin",
        duration_s=20.0,
        motors_us=(1950.0, 1300.0, 1500.0, 1500.0),
        vibe=70.0,
    )
    review = fid.review_flight(tmp_path / "sick.bin")
    assert {"motor-at-upper", "motors-unbalanced", "vibration"} <= codes(review)
    assert review.verdict is Light.RED


def test_the_command_prints_text_values_and_a_page(
    log: Path, review: fid.FlightReview, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "flight.html"
    done = CliRunner().invoke(command, [str(log), "--html", str(page)])
    assert done.exit_code == 0, done.output
    assert "Steps, from ordinary flying" in done.output
    assert "roll attitude" in page.read_text("utf-8")
    monkeypatch.setattr(fid, "review_flight", lambda *_, **__: review, raising=False)
    values = json.loads(CliRunner().invoke(command, [str(log), "--json"]).stdout)
    assert values["schema"] == "flightid.flight_review/1"
    assert [loop["step"] == [] for loop in values["loops"]].count(False) == 2


def test_a_glance_shows_throttle_modes_and_what_models_were_made_of(
    review: fid.FlightReview,
) -> None:
    start_s = review.phases.airborne[0][0]
    time_s = start_s + np.arange(100) / 50.0
    record = fid.Record.from_arrays(
        time_s, inputs={"tau_phi": np.sin(time_s)}, outputs={"p": np.cos(time_s)},
        units={"p": "rad/s"},
    )  # fmt: skip
    made = flight_glance(review, {"Roll rate": [(record, ("tau_phi", "p"))]})
    throttle, *others = made.data
    assert review.throttle is not None
    assert max(throttle.y) == 100.0 * max(review.throttle.values)
    assert [(each.name, each.yaxis) for each in others] == [
        ("Roll rate", "y2"),
        ("Roll rate", "y3"),
    ]
    assert made.layout.yaxis3.title.text == "p [rad/s]"
    shaded = [(each.x0, each.x1) for each in made.layout.shapes if each.type == "rect"]
    assert shaded == list(review.phases.airborne)
    assert {mode.mode for mode in review.identity.modes} >= {
        each.text for each in made.layout.annotations
    }


def test_measured_loops_stand_beside_what_models_have(review: fid.FlightReview) -> None:
    told = [loop for loop in review.loops if loop.loop == "rate" and loop.is_told]
    time_s = np.linspace(0.0, 1.0, 801)
    rises = 1.0 - np.exp(-10.0 * time_s)
    band = ResponseBand("rate step", "rad/s", time_s, rises, rises, rises, 0.5 * rises)
    design = cast(PidDesign, SimpleNamespace(axis=told[0].axis, responses=(band,)))
    assert not has_both(review, ())
    assert has_both(review, (design,))
    drawn = measured_and_predicted(review, (design,)).data
    model = next(each for each in drawn if each.name == "model")
    assert_close(model.y, 0.5 * rises[::2], rtol=1e-12, why="with the gains that flew")
    measured = next(each for each in drawn if each.name == "measured" and each.line.width)
    assert_close(measured.y[:5], told[0].step[:5], rtol=1e-12, why="as the review has it")


@pytest.mark.parametrize(
    ("over", "error", "light", "gains"),
    [
        (10.0, 5.0, Light.GREEN, ""),
        (50.0, 5.0, Light.AMBER, "lower I"),
        (33.0, 4.0, Light.AMBER, "which gain, sweeps tell: flightid plan"),
        (40.0, 25.0, Light.UNKNOWN, ""),
    ],
)
def test_large_overshoot_is_amber_and_wide_intervals_are_not_green(
    review: fid.FlightReview, over: float, error: float, light: Light, gains: str
) -> None:
    loop = review["roll rate"]
    told = Estimate("overshoot", over, "%", error)
    readings = tuple(told if r.name == told.name else r for r in loop.readings)
    found = judge_flight(replace(review, loops=(replace(loop, readings=readings),)))
    step = next(f for f in found if f.code == "step-roll-rate")
    assert step.light is light
    assert bool(step.action) is (light is not Light.GREEN)
    assert gains in step.action
    _with_sweeps(review, readings, gains)


@pytest.mark.parametrize(
    ("level", "error", "said", "gains"),
    [
        (0.54, 0.03, "short of", "raise I"),
        (0.8, 0.05, "short of", "which gain, sweeps tell: flightid plan"),
        (1.5, 0.1, "beyond", ""),
        (0.54, 0.3, "", ""),
        (0.95, 0.01, "", ""),
    ],
)
def test_a_loop_that_ends_far_from_what_is_asked_is_amber(
    review: fid.FlightReview, level: float, error: float, said: str, gains: str
) -> None:
    loop = review["roll rate"]
    told = Estimate("level", level, "1", error)
    readings = tuple(told if r.name == told.name else r for r in loop.readings)
    found = judge_flight(replace(review, loops=(replace(loop, readings=readings),)))
    step = next(f for f in found if f.code == "step-roll-rate")
    assert re.search(rf"ends at {level:.3g}0* \(", step.message)
    # What still comes at the end of the window, as an integrator brings it, is no steady error.
    slow = level * (1.0 - 0.1 * np.exp(-loop.time_s / loop.time_s[-1]))
    rising = replace(loop, readings=readings, step=slow, draws=np.tile(slow, (9, 1)))
    later = next(f for f in judge_flight(replace(review, loops=(rising,))) if f.code == step.code)
    assert re.search(rf"reaches {level:.3g}0* \(", later.message)
    assert "still rises there: settling is not seen" in later.message
    short = later.light is Light.AMBER
    assert short is (said == "beyond")
    # An end of 0.54 (-0.05 to 1.13) had been green.
    untold = error == 0.3
    assert (later.light is Light.UNKNOWN) is (said == "short of" or untold)
    assert ("it stays" in later.message) is short
    fine = Light.UNKNOWN if untold else Light.GREEN
    assert step.light is (Light.AMBER if said else fine)
    assert (f"it stays {said} what is asked" in step.message) is bool(said)
    assert bool(step.action) is (bool(said) or untold)
    assert gains in step.action
    _with_sweeps(review, readings, gains)


def _with_sweeps(review: fid.FlightReview, readings: tuple[Reading, ...], gains: str) -> None:
    """Where sweeps carry a model no gain is named: a model weighs them, and may say otherwise."""
    loop = replace(review["roll rate"], readings=readings)
    found = judge_flight(replace(review, loops=(loop,), swept=True, carried=("roll",)))
    step = next(f for f in found if f.code == "step-roll-rate")
    assert ("flightid tune" in step.action) is bool(gains)
    assert not any(word in step.action for word in ("raise I", "lower I"))


def test_a_yaw_moment_is_mended_before_the_limits_that_it_leads_to(
    review: fid.FlightReview,
) -> None:
    low = replace(review, motors=(replace(review.motors[0], at_lower=0.3),))
    assert any("MOT_SPIN_MIN" in finding.action for finding in judge_flight(low))
    trim = Estimate("counter-clockwise less clockwise motors", 1.09, "1", 0.05)
    found = judge_flight(replace(low, yaw_trim=trim))
    assert not any("MOT_SPIN_MIN" in finding.action for finding in found)
    said = [finding.code for finding in found]
    assert said.index("yaw-trimmed") < said.index("motor-at-lower")


def test_outputs_without_parameters_are_said_to_be_there(tmp_path: Path) -> None:
    writer = DataflashWriter()
    stamps = np.arange(10_000_000, 20_000_000, 100_000)
    writer.message(int(stamps[0]), "ArduCopter V4.6.0 (test)")
    writer.add("RCOU", stamps, {"C1": 1500.0, "C2": 1500.0})
    writer.write(tmp_path / "bare.bin")
    review = fid.review_flight(tmp_path / "bare.bin")
    told = next(f for f in review.findings if f.code == "flight-unknown")
    assert "outputs are logged (RCOU)" in told.message
    assert "PARM" in told.action
    assert ("in the air", "not known") in review.flight().rows
    assert review.to_dict()["airborne_s"] is None
    assert "airborne not known" in fid.inspect_log(tmp_path / "bare.bin").in_short()


@pytest.mark.parametrize(("bins", "rows"), [(0, 1), (1, 1), (2, 2)])
def test_noise_is_drawn_over_throttle_where_throttle_moved(bins: int, rows: int) -> None:
    hertz = np.arange(1.0, 6.0)
    noise = GyroNoise(
        freedom=20.0, frequency_hz=hertz, spectrum=np.ones((3, 5)),
        throttle=np.linspace(0.4, 0.5, bins), by_throttle=np.ones((bins, 5)),
    )  # fmt: skip
    drawn = noise.plot().to_dict()
    assert sum(trace["type"] == "heatmap" for trace in drawn["data"]) == rows - 1


def test_motors_that_turn_one_way_work_harder_by_their_share_of_the_mean() -> None:
    shares = np.tile([[0.6], [0.6], [0.4], [0.4]], (1, 100))
    shares[:, :20] = 0.0  # two of the ten stretches at the lower limit say nothing of balance
    shares[0, -10:] = 1.0
    made = Actuators(
        "RCOU", ("C1", "C2", "C3", "C4"), np.arange(100.0), 1000 + 1000 * shares, 1e3, 2e3
    )
    trim = yaw_trim(made, ((0.0, 100.0),), (1, 1, -1, -1))
    assert trim is not None
    assert_close(
        trim.value, (7 * 0.4 + 2 * (0.8 - 0.4) / 1.2) / 8, rtol=1e-12, why="one stretch at 1.0"
    )
    assert trim.freedom == 7
    first, *_, last = motor_use(made, ((0.0, 100.0),))
    assert (first.at_lower, first.at_upper, last.at_upper) == (0.2, 0.1, 0.0)
    assert_close(last.difference.value, -(7 * 0.2 + 0.2 / 0.6) / 8, rtol=1e-12, why="as above")
    assert_close(last.mean.value, 0.32, rtol=1e-12, why="eight tenths of 0.4")
    assert yaw_trim(made, ((0.0, 18.0),), (1, 1, -1, -1)) is None
    assert motor_use(made, ((0.0, 18.0),)) == ()


def test_which_way_motors_turn_is_told_by_the_parameters() -> None:
    quadrotor = {f"SERVO{i}_FUNCTION": 32.0 + i for i in range(1, 5)} | {"FRAME_CLASS": 1.0}
    log = cast("fid.Log", SimpleNamespace(kind="ardupilot", parameters=quadrotor))
    assert turning(log, 4) is None
    quadrotor["FRAME_TYPE"] = 1.0
    assert (turning(log, 4), turning(log, 6)) == ((1, 1, -1, -1), None)
    moments = {"CA_ROTOR0_KM": 0.05, "CA_ROTOR1_KM": -0.05}
    px4 = cast("fid.Log", SimpleNamespace(kind="px4", parameters=moments))
    assert (turning(px4, 2), turning(px4, 3)) == ((1, -1), None)


def test_gains_between_flights_are_those_that_differ_in_both() -> None:
    def flight(**gains: float) -> fid.FlightReview:
        identity = SimpleNamespace(gains={"roll": gains})
        return cast("fid.FlightReview", SimpleNamespace(identity=identity))

    found = gains_between(flight(P=1.0, I=2.0, D=3.0), flight(P=1.0, I=2.5, FF=4.0))
    assert found == {"I": (2.0, 2.5)}


@pytest.mark.parametrize("told", [True, False])
def test_the_attitude_goes_with_a_loop_where_it_was_logged(tmp_path: Path, *, told: bool) -> None:
    stamps = (1e7 + 1e4 * np.arange(300)).astype(np.int64)
    writer = DataflashWriter()
    writer.message(int(stamps[0]), "ArduCopter V4.6.0 (test)")
    moved = np.sin(1e-6 * stamps)
    writer.add("RATE", stamps, {"RDes": moved, "R": moved, "ROut": moved})
    if told:
        writer.add("ATT", stamps, {"Roll": moved})
    pair = _pair(fid.read_log(writer.write(tmp_path / "log.bin")), "roll", "rate")
    assert pair is not None
    assert (pair.set_point.name, pair.measured.name) == ("set_point", "measured")
    assert (pair.attitude.name if pair.attitude else None) == ("attitude" if told else None)
