"""Autotunes of a simulator that is not flightid's: margins of their gains, and why they failed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import flightid as fid
from flightid.cli.autotune import command
from flightid.control.margins.margins import Margins
from flightid.conventions import Light
from flightid.errors import DataError
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.review.autotune.ardupilot import ardupilot_run
from flightid.review.autotune.px4 import px4_run
from tests.autotune_log import Tuned, true_margins, write_ardupilot, write_px4
from tests.closeness import assert_close
from tests.strangers.ordinary_flights import Axis

CALM = Axis(gust=0.0, noise=0.02, p=0.08, i=0.08, d=0.002)
PX4 = Axis(form="px4", gust=0.0, noise=0.02, p=0.1, i=0.15, d=0.002, derivative_hz=30.0)


@pytest.fixture(scope="module")
def tuned(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Tuned]:
    path = tmp_path_factory.mktemp("autotune") / "autotune.bin"
    return path, write_ardupilot(path, CALM)


def _codes(review: fid.AutotuneReview) -> set[str]:
    return {finding.code for finding in review.findings}


def _inside(found: Margins | None, truth: tuple[float, float, float]) -> list[bool]:
    assert found is not None
    read = (found.crossover, found.phase_margin, found.gain_margin)
    held = []
    for reading, exact, unit in zip(read, truth, (2 * np.pi, 1.0, 1.0), strict=True):
        if reading is found.gain_margin and reading.interval95 is None:
            # What a resonance above the band may take is told without a bar.
            held.append("resonance above the identified band" in reading.reason)
            continue
        low, high = reading.interval95 or (np.inf, -np.inf)
        held.append(low <= unit * exact <= high)
    return held


@pytest.fixture(scope="module")
def reviewed(tuned: tuple[Path, Tuned]) -> fid.AutotuneReview:
    return fid.review_autotune(tuned[0])


def test_margins_of_twitched_gains_are_those_of_the_vehicle(
    tuned: tuple[Path, Tuned], reviewed: fid.AutotuneReview
) -> None:
    (_, gains), review = tuned, reviewed
    (roll,) = review.opinions
    ends = replace(CALM, p=gains.p, i=gains.p, d=gains.d)
    assert all(_inside(roll.tuned, true_margins(ends)))
    assert all(_inside(roll.flown, true_margins(CALM)))
    fitted = {name: p.value for name, p in roll.fit.parameters.items()} if roll.fit else {}
    assert_close(fitted["K"], CALM.effectiveness, rtol=0.03, why="angular acceleration")
    assert_close(fitted["T_m"], CALM.motor_s, rtol=0.03, why="motors")
    assert review.run.gains["roll"]["ATC_RAT_RLL_P"] == pytest.approx(gains.p, rel=1e-6)
    assert review.run.gains["roll"]["ATC_RAT_RLL_I"] == pytest.approx(gains.p, rel=1e-6)
    assert [step.step for step in review.run.steps] == ["rate D up", "rate D down", "rate P up"]
    assert sum(step.tests for step in review.run.steps) == gains.tests
    assert review.run.finished
    assert not _codes(review) & {"autotune-failed", "autotune-not-saved", "autotune-unfinished"}


def test_the_command_prints_margins_and_writes_a_page(
    tuned: tuple[Path, Tuned],
    reviewed: fid.AutotuneReview,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fid, "review_autotune", {tuned[0]: reviewed}.__getitem__)
    page = tmp_path / "autotune.html"
    made = CliRunner().invoke(command, [str(tuned[0]), "--html", str(page)])
    assert made.exit_code == 0, made.output
    assert "Second opinion: margins" in made.output
    assert "roll: autotune's gains have phase margin" in made.output
    assert "Autotune autotune.bin" in page.read_text(encoding="utf-8")


def _reasons(path: Path) -> set[str]:
    log = fid.read_log(path)
    run = px4_run(log) if path.suffix == ".ulg" else ardupilot_run(log)
    return set() if run is None else {finding.code for finding in run.findings}


def test_why_a_tune_of_ardupilot_ended_is_told(tmp_path: Path) -> None:
    path = tmp_path / "short.bin"
    write_ardupilot(path, CALM, events=(34,), most=3)
    assert "autotune-failed" in _reasons(path)
    write_ardupilot(path, replace(CALM, p=0.03), events=(), most=3)
    assert {"autotune-unfinished", "autotune-short-roll"} <= _reasons(path)
    write_ardupilot(path, CALM, events=(33,), most=3)
    assert "autotune-not-saved" in _reasons(path)
    # Gyro noise of 0.2 rad/s bounces by itself: D goes down to its least.
    write_ardupilot(path, replace(CALM, noise=0.2, p=0.15, d=0.00105), most=60)
    assert "autotune-noise-roll" in _reasons(path)
    # A vehicle that is too weak for its weight does not follow.
    write_ardupilot(path, replace(CALM, effectiveness=2.0), events=(), most=3)
    assert "autotune-no-response-roll" in _reasons(path)


def test_margins_of_px4_s_gains_are_those_of_the_vehicle(tmp_path: Path) -> None:
    path = tmp_path / "autotune.ulg"
    write_px4(path, PX4, (0.15, 1.5, 0.02))
    review = fid.review_autotune(path)
    (roll,) = review.opinions
    assert review.run.gains["roll"] == pytest.approx(
        {"MC_ROLLRATE_P": 0.15, "MC_ROLLRATE_I": 0.225, "MC_ROLLRATE_D": 0.003,
         "MC_ROLLRATE_K": 1.0, "MC_ROLL_P": 5.0}, rel=1e-6,
    )  # fmt: skip
    assert review.run.finished
    truth = true_margins(replace(PX4, p=0.15, i=0.225, d=0.003))
    assert roll.tuned is not None
    assert_close(roll.tuned.phase_margin.value, truth[1], atol=4.0, why="logged at a quarter rate")
    assert_close(roll.tuned.gain_margin.value, truth[2], atol=2.5, why="the same")


def test_samples_slower_than_the_loop_give_no_intervals(tmp_path: Path) -> None:
    """With this seed residuals are white, and a bar of 0.1 % stood 3.7 % beside the crossover."""
    path = tmp_path / "autotune.ulg"
    write_px4(path, PX4, (0.15, 1.5, 0.02), seed=4)
    review = fid.review_autotune(path)
    (roll,) = review.opinions
    assert roll.tuned is not None
    assert roll.tuned.crossover.interval95 is None
    assert "logged at 100 Hz" in roll.doubt
    assert any("logged at 100 Hz" in note for note in review.summary().notes)
    assert not any(each.light is Light.GREEN for each in review.findings if "roll" in each.message)


def test_why_px4_s_tune_failed_is_told(tmp_path: Path) -> None:
    path = tmp_path / "failed.ulg"
    write_px4(path, PX4, (0.7, 1.5, 0.02), states=(2, 8, 12))
    assert {"autotune-refused", "autotune-gains-refused-roll"} <= _reasons(path)
    write_px4(path, PX4, (float("nan"), 1.5, 0.02), states=(2, 12))
    assert {"autotune-interrupted", "autotune-not-a-number-roll"} <= _reasons(path)
    write_px4(path, PX4, (0.15, 1.5, 0.02), states=(2, 10, 12))
    assert "autotune-oscillation" in _reasons(path)
    # Since fixed wings have states of their own, roll is 3 and failure 15.
    write_px4(path, PX4, (0.15, 1.5, 0.02), states=(3, 15))
    assert "autotune-interrupted" in _reasons(path)


def test_a_log_without_an_autotune_is_refused_and_one_without_twitches_says_so(
    tmp_path: Path,
) -> None:
    writer = DataflashWriter()
    writer.message(1_000_000, "ArduCopter V4.6.0 (test)")
    writer.add("CTUN", np.arange(2_000_000, 9_000_000, 100_000), {"ThO": 0.4})
    writer.write(tmp_path / "plain.bin")
    with pytest.raises(DataError, match=r"holds no autotune.*ATUN"):
        fid.review_autotune(tmp_path / "plain.bin")
    writer.add("MODE", [3_000_000], {"Mode": 15, "ModeNum": 15})
    writer.message(4_000_000, "AutoTune: Failed to Level, Please Tune Manually")
    writer.write(tmp_path / "waiting.bin")
    review = fid.review_autotune(tmp_path / "waiting.bin")
    assert _codes(review) == {"autotune-no-tests", "autotune-not-level"}
