"""Before and after: changes that are there are found, promises are kept, the next file is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.control.autopilots.parameter_files import GainChange, write_ardupilot_parameters
from flightid.conventions import Light
from flightid.dynamics.conditions.ratios import difference_of
from flightid.errors import DataError
from flightid.plot.flight import compared_steps
from flightid.review.next_step import flown_step
from flightid.review.promised import promised_loops
from flightid.uncertainty.estimate import Estimate
from flightid.uncertainty.uneven import DrawnEnds
from flightid.vehicles import Autopilot, Turbulence, fly, rate_truth, write_ardupilot_log
from tests.closeness import assert_close
from tests.ordinary_log import write_ordinary_log
from tests.strangers.ordinary_flights import Axis
from tests.unit.test_flight_plan import ordinary

LIVELIER = {"ATC_RAT_RLL_P": 0.12, "ATC_RAT_RLL_I": 0.12, "ATC_RAT_RLL_D": 0.0033}


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


def test_a_flight_with_more_gain_is_told_from_one_with_the_same(logs: dict[str, Path]) -> None:
    same = fid.compare_flights(logs["before"], logs["again"])
    assert not same.significant
    assert same.findings[0].code == "loops-unchanged"
    more = fid.compare_flights(logs["before"], logs["after"])
    assert "roll rate, rise time" in more.significant
    assert (more["roll rate, rise time"].difference.interval95 or (0.0, 0.0))[1] < 0.0
    assert len(compared_steps(more).data) > 4


def test_parts_of_one_log_are_compared(
    logs: dict[str, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    log = logs["before"]
    start_s = fid.review_flight(log).phases.airborne[0][0]
    parts = [f"{log}@{start_s:.0f}:{start_s + 29:.0f}", f"{log}@{start_s + 30:.0f}:"]
    assert run(["compare", *parts]) == 0
    assert "no change beyond chance" in capsys.readouterr().out
    with pytest.raises(DataError, match="there is no loop that both tell"):
        fid.compare_flights(log, fid.review_flight(log, span_s=(0.0, 1.0)))


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
    assert "gains-1.rollback.param" in step.finding(kept=False).action
    assert replace(step, following=None).finding(kept=True).code == "last-step"
    assert flown_step([log.parent], {"ATC_RAT_RLL_P": 0.5}) is None


def test_angle_loops_are_promised_where_nothing_else_moves_them(tmp_path: Path) -> None:
    log = write_ardupilot_log(
        fly(duration_s=3.0, turbulence=Turbulence(), seed=1), tmp_path / "still.bin"
    )
    model = fid.load_model("rate_motor_lag", axis="roll")
    told = promised_loops([model], fid.read_log(log))
    assert [loop.name for loop in told] == ["roll rate", "roll attitude"]
    with pytest.raises(DataError, match="no model promises anything"):
        promised_loops([fid.load_model("r50_hover")], fid.read_log(log))
