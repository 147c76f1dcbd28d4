"""Before and after: changes that are there are found, promises are kept, the next file is named."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import click
import numpy as np
import pytest

import flightid as fid
from flightid.cli.compare import _flights
from flightid.cli.next_comparison import flown_for
from flightid.cli.program import run
from flightid.control.autopilots.angle_law import AngleLaw
from flightid.control.autopilots.parameter_files import GainChange, write_ardupilot_parameters
from flightid.conventions import Light
from flightid.dynamics.conditions.ratios import difference_of
from flightid.errors import DataError
from flightid.files import sha256_of_file
from flightid.findings import said_once
from flightid.plot.flight import compared_steps
from flightid.record import Record
from flightid.review.changes import (
    TRACKING,
    ExpectedLoop,
    LoopChange,
    _beside,
    change_of,
    significant_of,
    verdicts,
)
from flightid.review.comparison import compare_loops, expected, unheld
from flightid.review.flight_state import FlightState
from flightid.review.loop_response import LoopResponse
from flightid.review.loops import _in_proportion
from flightid.review.next_step import FlownStep, flown_step, left_to_fly
from flightid.review.promised import promised_loops
from flightid.review.proportional import excess_of
from flightid.review.step_features import BANDWIDTH, step_features
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.uneven import DrawnEnds
from flightid.vehicles import Autopilot, Turbulence, fly, rate_truth, write_ardupilot_log
from tests.closeness import assert_close
from tests.ordinary_log import write_ordinary_log
from tests.strangers.ordinary_flights import Axis
from tests.strangers.ordinary_flights import step as true_step
from tests.unit.test_flight_plan import ordinary

LIVELIER = {"ATC_RAT_RLL_P": 0.12, "ATC_RAT_RLL_I": 0.12, "ATC_RAT_RLL_D": 0.0033}


@pytest.fixture(scope="module", autouse=True)
def kept() -> Iterator[None]:
    """Each part of each log is reviewed once for all tests: logs of this file do not change."""
    whole, made = fid.review_flight, {}

    def once(
        log: fid.Log | Path | str, *, span_s: tuple[float, float] | None = None
    ) -> fid.FlightReview:
        key = str(log.path if isinstance(log, fid.Log) else log), span_s
        if key not in made:
            made[key] = whole(log, span_s=span_s)
        return made[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flightid.review.before_after.review_flight", once)
        patch.setattr(fid, "review_flight", once, raising=False)
        yield


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pair")
    made = {name: folder / f"{name}.bin" for name in ("before", "again", "after")}
    write_ordinary_log(made["before"], seed=1)
    write_ordinary_log(made["again"], seed=2)
    write_ordinary_log(made["after"], axis=Axis(p=0.18, d=0.005), seed=3)
    return made


def test_even_intervals_add_in_squares_and_uneven_ones_keep_their_sides() -> None:
    one, other = Estimate("a", 1.0, "s", 0.3), Estimate("b", 2.0, "s", 0.4)
    low, high = difference_of(other, one).interval95 or (0.0, 0.0)
    assert_close(high - low, 2.0 * 1.959964 * 0.5, rtol=1e-6, why="root of 0.3² + 0.4²")
    long_right = Estimate("c", 1.0, "s", ends=DrawnEnds(np.linspace(0.9, 4.0, 400)))
    low, high = difference_of(long_right, Estimate("d", 0.0, "s", 1e-9)).interval95 or (0.0, 0.0)
    assert high - 1.0 > 5.0 * (1.0 - low)
    withheld = Estimate("e", 1.0, "s", None, "errors are not white")
    assert difference_of(withheld, one).interval95 is None


@pytest.fixture(scope="module")
def reviews(logs: dict[str, Path]) -> dict[str, fid.FlightReview]:
    return {name: fid.review_flight(logs[name]) for name in ("before", "after")}


def test_a_flight_with_more_gain_is_told_from_one_with_the_same(
    logs: dict[str, Path], reviews: dict[str, fid.FlightReview]
) -> None:
    same = fid.compare_flights(reviews["before"], logs["again"])
    assert not same.significant
    assert same.findings[0].code == "loops-unchanged"
    more = fid.compare_flights(reviews["before"], reviews["after"])
    assert "roll rate, rise time" in more.significant
    assert (more["roll rate, rise time"].difference.interval95 or (0.0, 0.0))[1] < 0.0
    assert len(compared_steps(more).data) > 4


def test_a_slower_loop_is_amber_and_its_way_back_is_not(
    reviews: dict[str, fid.FlightReview],
) -> None:
    slower = fid.compare_flights(reviews["after"], reviews["before"])
    found = next(f for f in slower.findings if f.message.startswith("roll rate"))
    assert found.light is Light.AMBER
    assert "rise time" in found.message.partition("; worse: ")[2]
    # What is to be done is told once, of the first: it had held what got worse of each.
    pitch = replace(
        next(c for c in slower.changes if c.key == "roll rate, rise time"), loop="pitch"
    )
    both = [replace(pitch, loop="roll"), replace(pitch, name="delay to half")]
    told = said_once(verdicts(both, [each.key for each in both]))
    assert [str(e).partition("; worse: ")[2].split(" — ")[0] for e in told] == [
        "rise time", "delay to half",
    ]  # fmt: skip
    quick = replace(slower.before[0], asked=3.0 * (slower.before[0].asked or 0.0))
    again = compare_loops((quick,), (slower.before[0],), ("a", "b"), promised=False)
    assert [f.light for f in again.findings] == [Light.UNKNOWN]
    assert_close(
        again[f"{quick.name}, {TRACKING}"].after.value or 0.0,
        3.0 * (again[f"{quick.name}, {TRACKING}"].before.value or 0.0),
        rtol=1e-9, why="the same error of a third of the set-point",
    )  # fmt: skip


def _slower(loop: LoopResponse, level: float) -> LoopResponse:
    """A loop whose step still rises at the end of its window, as a slow integrator has it."""
    curve = level * (1.0 - np.exp(-loop.time_s / 0.3))
    errors = 1e-3 * np.random.default_rng(4).standard_normal((loop.draws.shape[0] + 1, 1))
    steps = (1.0 + errors) * curve
    made = replace(loop, step=curve, draws=steps[1:])
    return replace(made, readings=step_features(np.vstack([curve, made.draws]), loop.time_s))


def test_a_loop_that_became_too_slow_to_settle_is_named_and_held_against_its_promise(
    reviews: dict[str, fid.FlightReview],
) -> None:
    """A rise of 120 ms that became 658 was dashes without a reason, and green."""
    quick = reviews["before"]["roll rate"]
    slow = _slower(quick, 1.0)
    assert slow["rise time"].value is None
    made = compare_loops((quick,), (slow,), ("a", "b"), promised=False)
    (found,) = made.findings
    assert found.light is Light.AMBER
    assert "delay to half" in found.message
    notes = " ".join(made.summary().notes)
    assert "Not settled in that time: roll rate; level and delay are of what is" in notes
    dashes = [
        (each.loop, each.name) for each in made.changes
        if None in (each.before.value, each.after.value, each.chance)
    ]  # fmt: skip
    assert dashes
    assert all(f"{loop} ({name}" in notes for loop, name in dashes)
    kept = compare_loops((slow,), (_slower(quick, 1.01),), ("models", "b"), promised=True)
    assert "no rise time is told that goes by its end" in " ".join(kept.summary().notes)
    (as_told,) = compare_loops(
        (quick,), (slow,), ("a", "b"), promised=False, promise=kept
    ).findings  # fmt: skip
    assert (as_told.code, as_told.light) == ("loop-as-promised", Light.GREEN)
    missed = compare_loops((_slower(quick, 1.3),), (slow,), ("models", "b"), promised=True)
    (off,) = compare_loops((quick,), (slow,), ("a", "b"), promised=False, promise=missed).findings
    assert off.light is Light.AMBER
    assert "not as the models promised" in off.message
    assert "promised → flown: level" in off.message
    # What was kept is no reason for what was missed.
    told = {"level": "level 0.855 → 0.852", "delay to half": "delay to half 63.6 → 80.6 ms"}
    late = _beside("roll rate", ["level"], ExpectedLoop(told, ("delay to half",)))
    assert late.message.endswith("(promised → flown: delay to half 63.6 → 80.6 ms)")
    assert late.light is Light.AMBER
    # Large moves are judged neither way: better is no more told than worse.
    bent = replace(quick, loop="attitude", is_bent=True)
    better = compare_loops((replace(slow, loop="attitude"),), (bent,), ("a", "b"), promised=False)
    assert [each.light for each in better.findings] == [Light.UNKNOWN]


def test_large_moves_of_an_angle_are_not_held_against_small_ones(tmp_path: Path) -> None:
    """Of 10 such flights the whole flight's rise time is 26 % long in the mean, none inside."""
    log, axis = tmp_path / "some.bin", Axis(angle_p=8.0, brake=9.6)
    told = {"ATC_ANG_RLL_P": 8.0, "ATC_ACCEL_R_MAX": 110_008.0}
    small = true_step(replace(axis, brake=0.0), 1.5, angle=True)
    truth = np.argmax(small >= 0.5) / axis.loop_hz
    loops = {}
    for name, size in (("some", 0.25), ("all", 0.6)):
        made = log.with_stem(name)
        write_ordinary_log(made, axis=axis, size=size, duration_s=40.0, parameters=told)
        loops[name] = fid.review_flight(made)["roll attitude"]
    low, high = loops["some"]["delay to half"].interval95 or (0.0, 0.0)
    assert low < truth < high
    assert "ATC_ACCEL_R_MAX makes the angle controller" in loops["some"].how
    assert not loops["some"].is_bent
    # 521 % had been the whole flight's error over the set-point of its small moves alone.
    flight = fid.read_log(log).table("ANG")
    wanted, got = (np.asarray(flight[name], dtype=float) for name in ("DesRoll", "Roll"))
    twice = (loops["some"],), (loops["some"],), ("a", "b")
    share = compare_loops(*twice, promised=False)[f"roll attitude, {TRACKING}"].before.value
    assert_close(
        share or 0.0, 100.0 * np.sqrt(np.mean((got - wanted) ** 2)) / np.std(wanted),
        rtol=0.03, why="the log's first and last seconds are not in the air",
    )  # fmt: skip
    large = loops["all"]
    assert large.is_bent
    assert (large["delay to half"].interval95 or (0.0, 0.0))[0] > 1.1 * truth
    rate = replace(large, loop="rate", is_bent=False)
    quick = (replace(loops["some"], beyond=""), rate)
    promise = compare_loops(quick, (large, rate), ("models", "b"), promised=True)
    assert {each.loop for each in promise.changes} == {"roll rate"}
    assert promise.findings[-1].code == "beyond-angle-law"
    assert "moves of the roll stick by 8.6 deg at once" in promise.findings[-1].action
    assert promise.kept is None
    # "Fly these gains again as asked for above" had said neither what nor what then.
    again = {"kept": promise.kept, "again": "flightid compare out LOG"}
    told = FlownStep(log, None, log).finding(**again, to_fly=left_to_fly(promise))
    assert told.light is Light.UNKNOWN
    assert told.message.endswith("not judged: roll attitude")
    assert told.action.startswith(
        f"load {log} and fly a minute of quick moves of the roll stick by"
    )
    assert told.action.endswith("or less; then flightid compare out LOG")
    both = {name: f"fly a minute of the {name} stick" for name in ("roll", "pitch")}
    pair = FlownStep(log, None, log).finding(kept=True, to_fly=both).action
    assert "fly a minute of the roll and pitch stick; then" in pair
    flights = compare_loops(quick[:1], (large,), ("a", "b"), promised=False)
    assert [each.light for each in flights.findings] == [Light.UNKNOWN]
    assert "whose sticks moved as far" in flights.findings[0].action


def test_small_moves_are_chosen_by_the_set_point_and_hold_enough_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Chosen by measured errors, yaws of two flights with the same gains had changed, one by -0.1.

    What was left of the set-point was a tenth of it: gusts.
    """
    time_s, law = 0.02 * np.arange(500), AngleLaw(8.0, 0.1, "ATC_ACCEL_Y_MAX")
    sticks = np.where(time_s < 5.0, 0.05, 0.2) * np.sign(np.sin(2.0 * time_s))
    gust = np.where((time_s > 2.0) & (time_s < 3.0), 0.3, 0.0)
    flown = Record.from_arrays(
        time_s, inputs={"set_point": sticks}, outputs={"measured": sticks + gust}
    )
    quiet = [np.where(time_s >= 5.0, 0.2, 0.05)]
    chosen = excess_of(law, "yaw", [flown], quiet)
    assert chosen is not None
    assert [begin > 4.9 for begin, _ in chosen.spans] == [True]
    read: list[list[Record]] = []

    def stepped(log: object, begun: LoopResponse, pieces: list[Record]) -> LoopResponse:
        read.append(pieces)
        return replace(begun, step=np.ones(2))

    monkeypatch.setattr("flightid.review.loops._read", stepped)
    small, none = flown.segment(0.0, 1.9), np.zeros(0)
    begun = LoopResponse("yaw", "attitude", "", "", 0.0, 0.0, 0, None, None, none, none, none)
    for asked, is_bent in ((0.15, False), (0.3, True)):
        begun = replace(begun, asked=asked)
        made = _in_proportion(fid.Log, begun, chosen, [flown], [small])  # type: ignore[arg-type]
        assert made.is_bent is is_bent
    assert [pieces[0] is flown for pieces in read] == [False, True]


def test_gains_filters_and_other_vehicles_are_said(
    stepped: tuple[Path, fid.TransferFunctionModel],
    reviews: dict[str, fid.FlightReview],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    old, _ = stepped
    new = ordinary(tmp_path / "new.bin", autopilot=Autopilot().with_parameters(
        {"ATC_RAT_YAW_P": 0.5, "INS_GYRO_FILTER": 30.0}
    ))  # fmt: skip
    page = tmp_path / "page.html"
    assert run(["compare", str(old), str(new), "--html", str(page)]) == 0
    said = capsys.readouterr().out
    for text in ("Gains that differ", "ATC_RAT_YAW_P", "Filters that differ", "two poles at 30 Hz"):
        assert text in said
        assert text in page.read_text()
    review = reviews["before"]
    battery = None if review.identity.battery is None else replace(review.identity.battery, cells=6)
    other = replace(
        review, name="b", firmware="V5", identity=replace(review.identity, battery=battery)
    )
    found = fid.compare_flights(review, other)
    assert (found.findings[0].code, found.findings[0].light) == ("not-alike", Light.AMBER)
    assert found.summary().title.endswith("of different firmware")
    framed = replace(other, identity=replace(other.identity, frame="another FRAME_CLASS"))
    assert Light.GREEN not in [f.light for f in fid.compare_flights(review, framed).findings]
    named = replace(other, identity=replace(other.identity, frame="QUAD/X"))
    assert "frame" not in fid.compare_flights(review, named).unlike
    limit = replace(review.motors[0], at_upper=0.2)
    bound = replace(review, name="b", motors=(limit, *review.motors[1:]))
    held = fid.compare_flights(review, bound).findings
    assert [(f.code, f.light) for f in held] == [
        ("motor-at-upper", Light.AMBER), ("loops-unchanged", Light.UNKNOWN),
    ]  # fmt: skip
    assert held[0].message.startswith("b: ")
    cut = replace(review, name="b", loops=review.loops[1:])
    notes = fid.compare_flights(review, cut).summary().notes
    assert f"b logs no set-point of {review.loops[0].name}." in notes


def test_what_intervals_show_to_be_worse_is_not_green_and_the_tolerance_is_printed() -> None:
    less = Estimate[float | None]("overshoot", 6.8, "%", 0.1)
    more = Estimate[float | None]("overshoot", 10.7, "%", 0.1)
    change = change_of("yaw attitude", less, more)
    assert not change.is_material
    (found,) = verdicts([change], [change.key])
    assert found.light is Light.UNKNOWN
    assert "5 points of overshoot: overshoot" in found.message
    (kept,) = verdicts([change], [change.key], promised=True)
    assert "but for 1 that changed by less than what counts (10 % of a number, 5 p" in kept.message
    (back,) = verdicts([change_of("yaw attitude", more, less)], [change.key])
    assert back.light is Light.GREEN


@pytest.mark.parametrize(
    ("name", "old", "new", "material", "worse"),
    [
        ("rise time", 1.0, 1.08, False, False),
        ("rise time", 1.0, 1.15, True, True),
        ("rise time", 1.0, 0.85, True, False),
        ("overshoot", 10.0, 14.0, False, False),
        ("overshoot", 10.0, 17.0, True, True),
        (BANDWIDTH, 10.0, 8.0, True, True),
        (BANDWIDTH, 10.0, 12.0, True, False),
        ("level", 1.0, 1.2, True, True),
        ("gain at 1 Hz", 0.7, 0.58, True, True),
        ("gain at 0.25 Hz", 0.7, 0.9, True, False),
        ("level", 1.3, 1.1, True, False),
        ("level", 1.1, 0.7, True, True),
    ],
)
def test_a_tenth_or_five_points_of_overshoot_are_felt(
    name: str, old: float, new: float, *, material: bool, worse: bool
) -> None:
    found = change_of("roll rate", *(Estimate(name, value, "1", 1e-3) for value in (old, new)))
    assert found.is_material is material
    assert found.is_worse is worse


def test_what_is_read_over_another_time_is_said(
    reviews: dict[str, fid.FlightReview],
) -> None:
    long = reviews["before"]
    cut = tuple(
        replace(each, time_s=each.time_s[:-9], step=each.step[:-9], draws=each.draws[:, :-9])
        for each in long.loops
        if each.is_told
    )
    notes = fid.compare_flights(long, replace(long, loops=cut)).summary().notes
    assert any("flightid flight reads each over its own" in note for note in notes)
    assert not any("over its own" in n for n in fid.compare_flights(long, long).summary().notes)


def test_parts_of_one_log_are_compared(
    logs: dict[str, Path],
    reviews: dict[str, fid.FlightReview],
    capsys: pytest.CaptureFixture[str],
) -> None:
    log = logs["before"]
    start_s = reviews["before"].phases.airborne[0][0]
    parts = [f"{log}@{start_s:.0f}:{start_s + 29:.0f}", f"{log}@{start_s + 30:.0f}:"]
    assert run(["compare", *parts]) == 0
    assert "no change beyond chance" in capsys.readouterr().out
    with pytest.raises(DataError, match="there is no loop that both tell") as none:
        fid.compare_flights(log, fid.review_flight(log, span_s=(0.0, 1.0)))
    assert str(none.value).count("nothing was flown") == 1
    assert run(["compare", f"{log}@0:1", str(log)]) == 2
    assert "lies outside of the log: 10.0 to" in capsys.readouterr().err


def test_a_difference_beyond_its_own_interval_is_told_where_chance_allows_it() -> None:
    """It stood under "flown as promised" without a word: the reader saw zero outside of it."""

    def change(loop: str, apart: float) -> LoopChange:
        one, other = (Estimate("gain at 1 Hz", 0.4 + by, "1", 1e-3) for by in (0.0, apart))
        return change_of(loop, one, other)

    same = [change(f"loop {k}", 1e-4 * (k - 9)) for k in range(19)]
    beyond = change("yaw rate", 3.2e-3)
    assert beyond.excludes_zero
    assert not any(each.excludes_zero for each in same)
    significant = significant_of([*same, beyond])
    assert significant == (), "by Holm's rule over all rows"
    for promised, told in ((True, "flown as promised"), (False, "no change beyond chance")):
        (found,) = verdicts([*same, beyond], significant, promised=promised)
        said = "1 is beyond its own 95 % interval, where chance alone brings 1 of so many"
        assert found.message == f"20 numbers of 20 loops: {told}; {said}"
        (found,) = verdicts(same, (), promised=promised)
        assert found.message == f"19 numbers of 19 loops: {told}"


@pytest.fixture(scope="module")
def stepped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, fid.TransferFunctionModel]:
    """A folder with a log under new gains and the model of its roll axis, which is the truth."""
    folder = tmp_path_factory.mktemp("steps")
    log = ordinary(folder / "after.bin", autopilot=Autopilot().with_parameters(LIVELIER))
    truth = rate_truth("roll")
    model = fid.load_model("rate_motor_lag", axis="roll").with_values(
        {
            "Ltphi": truth.gain_rad_s2,
            "Lp": truth.damping_1_s,
            "T_m": truth.motor_lag_s,
            "tau": truth.effective_delay_s(),
        }
    )
    fid.write_model(model, folder / "roll.toml")
    old = Autopilot().parameters()
    for step, share in ((1, 1.0), (2, 1.3)):
        changes = [GainChange(n, share * v, old[n]) for n, v in LIVELIER.items()]
        write_ardupilot_parameters(changes, folder / f"gains-{step}.param")
    return log, model


def test_a_promise_is_kept_by_the_truth_and_missed_by_another_vehicle(
    stepped: tuple[Path, fid.TransferFunctionModel],
) -> None:
    log, model = stepped
    kept = fid.compare_with_promise([model], log)
    assert kept.kept
    assert_close(
        kept["roll rate, rise time"].after.value or 0.0,
        kept["roll rate, rise time"].before.value or 1.0,
        rtol=0.05, why="the truth; sampled to two and a half milliseconds",
    )  # fmt: skip
    delay = kept["roll rate, delay to half"]
    assert_close(
        delay.before.value or 0.0, delay.after.value or 1.0, rtol=0.01,
        why="the rate loop takes a set-point a tick, 4 % of this, after its row in the log",
    )  # fmt: skip
    other = model.with_values({"Ltphi": 2.5 * model.parameters["Ltphi"].value})
    missed = fid.compare_with_promise([other], log)
    assert missed.findings[0].code == "promise-missed"
    assert missed.findings[0].light is Light.AMBER


def test_the_step_that_flew_names_the_next_and_the_way_back(
    stepped: tuple[Path, fid.TransferFunctionModel], capsys: pytest.CaptureFixture[str]
) -> None:
    log, _ = stepped
    assert run(["compare", str(log.parent / "roll.toml"), str(log)]) == 0
    assert "gains-2.param next" in capsys.readouterr().out
    step = flown_step([log.parent], fid.read_log(log).parameters)
    assert step is not None
    assert step.flown.name == "gains-1.param"
    back = step.finding(kept=False, log="f.BIN").action
    assert "gains-1.rollback.param; what the models missed" in back
    assert back.endswith("flightid plan f.BIN")
    assert step.finding(kept=False, log="f.BIN", swept=True).action.endswith("flightid tune f.BIN")
    assert replace(step, following=None).finding(kept=True).code == "last-step"
    assert flown_step([log.parent], {"ATC_RAT_RLL_P": 0.5}) is None


def test_what_lies_beside_two_logs_changes_no_verdict_and_a_promise_that_is_named_does(
    logs: dict[str, Path], stepped: tuple[Path, fid.TransferFunctionModel]
) -> None:
    """`compare f1 f3` went by the study's folder that lay beside: amber and green by turns."""
    before, after = logs["before"], stepped[0]
    alone = _flights(str(before), str(after), [])
    assert "flightid compare STUDY-output" in alone.beside
    models = before.parent / "before-output" / "models"
    models.mkdir(parents=True)
    model = models / "roll.toml"
    model.write_bytes((after.parent / "roll.toml").read_bytes())
    used = {"files": {before.name: sha256_of_file(before)}}
    (models.parent / "results.json").write_text(json.dumps(used))
    beside = _flights(str(before), str(after), [])
    assert beside.findings == alone.findings
    assert "before-output" in beside.beside
    named = _flights(str(before), str(after), [str(model)])
    assert "gains-2.param next" in named.findings[-1].action
    with pytest.raises(click.UsageError, match="with a whole log"):
        _flights(str(before), f"{after}@1:2", [str(model)])


def test_a_study_of_another_vehicle_is_told_and_nothing_is_praised(
    stepped: tuple[Path, fid.TransferFunctionModel],
    reviews: dict[str, fid.FlightReview],
    tmp_path: Path,
) -> None:
    """A quadrotor's study beside a log of another vehicle was held against it without a word."""
    log, model = stepped
    flown = fid.review_flight(log)
    (tmp_path / "results.json").write_text(json.dumps({"review": flown.to_dict()}))
    state = flown_for(tmp_path)
    assert state == FlightState.of(flown) == FlightState.of(fid.read_log(log))
    assert state == flown_for(tmp_path / "models" / "roll.toml")
    assert flown_for(log) is None
    kept = fid.compare_with_promise([model], log, review=flown, state=state)
    assert (kept.findings[0].light, kept.kept) == (Light.GREEN, True)
    new = replace(state, told={**state.told, "firmware": "V4"})
    later = fid.compare_with_promise([model], log, review=flown, state=new)
    assert (later.findings[0].light, later.kept) == (Light.AMBER, True)
    # A filter of the study's flight that this one lacks had read as gains to go back from.
    low_pass = state.gyro[0] if state.gyro else None
    assert low_pass is not None
    slow = replace(low_pass, settings="two poles at 20 Hz", rate_hz=low_pass.rate_hz / 4.0)
    filtered = replace(state, gyro=(slow,))
    assert state.other_filters(replace(state, gyro=(replace(low_pass, settings="as good"),))) == {}
    truer = fid.compare_with_promise([model], log, review=flown, state=filtered)
    assert truer.filters == {low_pass.name: (slow.settings, low_pass.settings)}
    wrong = model.with_values({"Ltphi": 2.5 * model.parameters["Ltphi"].value})
    missed = fid.compare_with_promise([wrong], log, review=flown, state=filtered)
    assert [each.light for each in missed.findings[:2]] == [Light.AMBER, Light.UNKNOWN]
    assert slow.settings in missed.findings[0].message
    assert missed.kept is None
    flew = FlownStep(log, None, log.with_suffix(".rollback"))
    next_ = flew.finding(kept=missed.kept, otherwise=missed.set_otherwise)
    assert "rollback" not in next_.action
    assert f"set {low_pass.name} as before" in next_.action
    assert not expected(missed)
    assert missed.findings[0] in unheld(missed)
    others = ({"vehicle": "px4 plane"}, Light.RED), ({"autopilot": "Cube 1"}, Light.AMBER)
    for told, light in others:
        seen = replace(flown, identity=replace(flown.identity, board="Cube 2"))
        other = replace(state, told={**state.told, **told})
        found = fid.compare_with_promise([model], log, review=seen, state=other).findings
        assert (found[0].code, found[0].light) == ("not-alike", light)
        assert Light.GREEN not in [each.light for each in found]
    assert FlightState.of(reviews["before"]).unlike(state)["firmware"]


def test_angle_loops_are_promised_where_nothing_else_moves_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = write_ardupilot_log(
        fly(duration_s=3.0, turbulence=Turbulence(), seed=1), tmp_path / "still.bin"
    )
    model = fid.load_model("rate_motor_lag", axis="roll")
    told = promised_loops([model], fid.read_log(log))
    assert [loop.name for loop in told] == ["roll rate", "roll attitude"]
    yaw = fid.load_model("rate_motor_lag", axis="yaw")
    assert [loop.name for loop in promised_loops([yaw], fid.read_log(log))] == ["yaw rate"]
    fed = fid.read_log(log)
    monkeypatch.setattr(fed, "parameters", {**fed.parameters, "ATC_RATE_FF_ENAB": 1.0})
    assert [loop.name for loop in promised_loops([model], fed)] == ["roll rate"]
    with pytest.raises(DataError, match="no model promises anything"):
        promised_loops([fid.load_model("r50_hover")], fid.read_log(log))


def test_a_copy_of_a_flight_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("day.bin", "copy.bin"):
        (tmp_path / name).write_bytes(b"\xa3\x95" * 40)
    assert run(["compare", str(tmp_path / "day.bin"), str(tmp_path / "copy.bin")]) == 2
    assert "are one flight, byte by byte" in capsys.readouterr().err
