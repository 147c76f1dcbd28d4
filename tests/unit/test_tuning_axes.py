"""Several axes: coupled ones together, files step by step, pictures and report."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.control.autopilots import AxisLoop, axis_loop, read_parameters
from flightid.control.tuning.sampled_plants import SampledPlants, sample_plants
from flightid.control.tuning.tune_pid import _couplings
from flightid.conventions import Light
from flightid.errors import DataError, ModelError, OptionError, UnknownNameError
from flightid.plot.gains import margins_caption, overlaid_steps, promised_margins, steps_caption
from flightid.plot.tuning import gain_map, nichols, time_responses
from flightid.report.content import Document
from flightid.report.html import to_html
from flightid.report.tuning import tuning_section
from tests.closeness import assert_close

STEP_S = 1 / 400
NEED = fid.TuningRequirements(noise_growth=None)


def _coupled(strength: float) -> fid.LinearSystem:
    """Roll and pitch with a lag each, and effects of each command on the other axis."""
    lag, effect = 25.0, np.array([[140.0, strength * 120.0], [-strength * 140.0, 120.0]])
    a = np.zeros((4, 4))
    a[:2, :2], a[2:, :2], a[2:, 2:] = -lag * np.eye(2), effect, np.diag([-4.0, -5.0])
    b = np.vstack([lag * np.eye(2), np.zeros((2, 2))])
    c = np.hstack([np.zeros((2, 2)), np.eye(2)])
    return fid.LinearSystem(
        a, b, c, np.zeros((2, 2)), ("tau_phi", "tau_theta"), ("p", "q"), [0.01, 0.01]
    )


_FIXED = _coupled(0.4)


def _loops(*axes: str) -> dict[str, AxisLoop]:
    return {
        axis: axis_loop("arducopter", axis, loop_rate_hz=400.0).with_gains(
            {
                name: value * 0.6
                for name, value in axis_loop("arducopter", axis, loop_rate_hz=400.0).gains.items()
                if name.endswith(("_P", "_I", "_D"))
            }
            | {"INS_GYRO_FILTER": 0.0}
        )
        for axis in axes
    }


def _largest_pole(plants: SampledPlants, loops: list[AxisLoop]) -> float:
    """Of two ArduCopter axes around a sampled plant, by stepping each state of the whole once."""
    system, n = plants.systems[0], len(plants.systems[0].a)
    whole = int(plants.delays[0][0])
    size = n + 2 * whole + 2 * 6

    def advance(x: np.ndarray) -> np.ndarray:
        state, pipe = x[:n], x[n : n + 2 * whole].reshape(2, whole)
        memory = x[n + 2 * whole :].reshape(2, 6)
        seen, out, kept = np.asarray(system.c) @ state, np.zeros(2), np.zeros((2, 6))
        for axis, loop in enumerate(loops):
            v = loop.values
            alpha = {
                role: 1.0 if v[role] <= 0 else STEP_S / (STEP_S + 1 / (2 * np.pi * v[role]))
                for role in ("fltt", "flte", "fltd")
            }
            waiting, target, error, slope, integral, _ = memory[axis]
            target += alpha["fltt"] * (waiting - target)
            new = error + alpha["flte"] * ((target - seen[axis]) - error)
            slope += alpha["fltd"] * ((new - error) / STEP_S - slope)
            integral += v["i"] * new * STEP_S
            out[axis] = v["p"] * new + integral + v["d"] * slope
            kept[axis] = [-loop.angle_gain_1_s * seen[2 + axis], target, new, slope, integral, 0.0]
        applied = pipe[:, 0] if whole else out
        moved = np.hstack([pipe[:, 1:], out[:, None]]) if whole else pipe
        after = np.asarray(system.a) @ state + np.asarray(system.b) @ applied
        return np.concatenate([after, moved.ravel(), kept.ravel()])

    matrix = np.column_stack([advance(column) for column in np.eye(size)])
    return float(np.abs(np.linalg.eigvals(matrix)).max())


@pytest.fixture(scope="module")
def tuning() -> fid.Tuning:
    return fid.tune(
        {"roll": _FIXED, "pitch": _FIXED},
        gains=_loops("roll", "pitch"),
        requirements=NEED,
        gyro="raw",
        band_rad_s=(0.5, 100.0),
        nominal=True,
    )


def test_coupled_axes_are_stable_together_by_their_poles(tuning: fid.Tuning) -> None:
    assert tuning.exists
    plants = sample_plants(
        [_coupled(0.4)], ["p", "q"], ["tau_phi", "tau_theta"], STEP_S, hold_in_model=True
    )
    loops = [tuning[axis].loop for axis in ("roll", "pitch")]
    assert _largest_pole(plants, loops) < 1.0
    (together,) = tuning.together
    assert together.all_stable
    assert together.coupling is not None
    assert together.coupling > 0.2
    assert (together.worst_disk_margin or 0.0) > 0.3
    assert together.flown_stable_plants == together.n_plants == 1
    table = tuning.together_table()
    digits = [column.digits for column in table.columns]
    assert digits[2:6] == [3, 3, 3, 3], "as margins are said everywhere"
    shown = (together.disk_margin, together.worst_disk_margin, together.gain_db)
    assert table.rows[0][2:5] == shown
    assert any(f.code == "together" and f.light is Light.GREEN for f in tuning.findings)


ALONE = {"requirements": NEED, "gyro": "raw", "band_rad_s": (0.5, 100.0), "nominal": True}


@pytest.fixture(scope="module")
def alone() -> fid.PidDesign:
    """Roll as if no other loop were closed."""
    return fid.tune_pid(_FIXED, gains=_loops("roll")["roll"], **ALONE)


def test_coupling_costs_what_designing_alone_does_not_see(
    tuning: fid.Tuning, alone: fid.PidDesign
) -> None:
    free = fid.tune_pid(_coupled(0.0), gains=_loops("roll")["roll"], **ALONE)
    assert any(finding.code == "couplings" for finding in alone.findings)
    assert_close(
        alone.gains["ATC_RAT_RLL_P"], free.gains["ATC_RAT_RLL_P"], rtol=1e-2,
        why="one loop closed alone does not feel the other axis",
    )  # fmt: skip
    ratio = tuning.gains["ATC_RAT_RLL_P"] / free.gains["ATC_RAT_RLL_P"]
    assert abs(ratio - 1.0) > 0.02


@pytest.mark.nightly
def test_flown_gains_are_judged_with_the_other_axes_flown_gains(tuning: fid.Tuning) -> None:
    slow = fid.tune(
        {"roll": _FIXED, "pitch": _FIXED},
        gains=_loops("roll", "pitch"),
        requirements={"roll": NEED, "pitch": dataclasses.replace(NEED, crossover_rad_s=6.0)},
        gyro="raw", band_rad_s=(0.5, 100.0), nominal=True,
    )  # fmt: skip
    assert slow["pitch"].gains["ATC_RAT_PIT_P"] < 0.7 * tuning["pitch"].gains["ATC_RAT_PIT_P"]
    moved = False
    for before, after in zip(tuning["roll"].worst_cases, slow["roll"].worst_cases, strict=True):
        # What flew does not depend on what pitch is given now.
        assert (before.flown is None) == (after.flown is None)
        assert before.flown is None or before.flown == pytest.approx(after.flown, rel=1e-9)
        moved |= before.nominal != after.nominal
    assert moved


def test_steps_of_all_axes_are_written_together(tuning: fid.Tuning, tmp_path: Path) -> None:
    written = tuning.write(tmp_path / "gains.param")
    last = [path for path in written if "rollback" not in path.name][-1]
    got = read_parameters(last)
    assert set(got) == set(tuning.gains)
    for name, value in tuning.gains.items():
        assert_close(got[name], value, rtol=1e-6, why="single precision of the file")
    back = read_parameters(next(path for path in written if "rollback" in path.name))
    assert back == pytest.approx(
        {name: tuning[axis].flown.gains[name] for axis in ("roll", "pitch")
         for name in tuning[axis].gains}, rel=1e-6
    )  # fmt: skip
    with pytest.raises(OptionError, match="already there"):
        tuning.write(tmp_path / "gains.param")


def test_nothing_is_written_where_there_are_no_gains(tmp_path: Path) -> None:
    slow = fid.LinearSystem([[-1.0]], [[120.0]], [[1.0]], [[0.0]], ("u",), ("y",), [0.4])
    design = fid.tune_controller(
        slow, controller=fid.ControllerOptions(controller="p"), nominal=True,
        band_rad_s=(0.5, 90.0), requirements=dataclasses.replace(NEED, crossover_rad_s=20.0),
    )  # fmt: skip
    assert not design.exists
    assert design.findings[0].code == "no-gains"
    with pytest.raises(DataError, match="meet the requirements, so none are written"):
        design.write(tmp_path / "gains.toml")
    assert not list(tmp_path.iterdir())


def _slow_yaw() -> fid.LinearSystem:
    return fid.LinearSystem([[-1.0]], [[140.0]], [[1.0]], [[0.0]], ("tau_psi",), ("r",), [0.4])


def test_a_refused_axis_leaves_the_others_and_their_files(
    alone: fid.PidDesign, tmp_path: Path
) -> None:
    turned = dataclasses.replace(_slow_yaw(), b=[[-140.0]])
    made = fid.tune({"yaw": turned, "roll": _FIXED}, gains=_loops("roll", "yaw"), **ALONE)
    assert [each.axis for each in made.refused] == ["yaw"]
    assert "positive command with a negative rate" in made.refused[0].reason
    assert not made.exists
    assert [each.axis for each in made.sound] == ["roll"]
    assert made.gains == alone.gains
    assert "yaw is not tuned" in str(made.summary())
    written = made.write(tmp_path / "gains.param")
    for path in written:
        assert "YAW" not in "".join(read_parameters(path))
    first = written[0].read_text("utf-8")
    assert "# yaw is not in this file, its gains stay as flown: r answers" in first
    assert next(f for f in made.findings if f.code == "axis-refused").light is Light.RED


def test_axes_of_one_model_are_not_written_without_each_other(
    tuning: fid.Tuning, tmp_path: Path
) -> None:
    quick = dataclasses.replace(_slow_yaw(), delays_s=[0.02])
    yaw = fid.tune_pid(quick, gains=_loops("yaw")["yaw"], angle_loop=False, **ALONE)
    both = (tuning["roll"], dataclasses.replace(tuning["pitch"], exists=False, changes=()))
    made = fid.Tuning((*both, yaw), tuning.together)
    assert [each.axis for each in made.sound] == ["yaw"]
    assert "couples it with pitch" in made.left_out["roll"]
    path, *_ = made.write(tmp_path / "gains.param")
    assert {name.split("_")[2] for name in read_parameters(path)} == {"YAW"}
    with pytest.raises(DataError, match="so none are written"):
        fid.Tuning(both, tuning.together).write(tmp_path / "none.param")


@pytest.mark.nightly  # the test above holds the same of results put together
def test_axes_of_one_model_are_written_together_or_not_at_all(tmp_path: Path) -> None:
    fast = dataclasses.replace(NEED, crossover_rad_s=60.0)
    plant = fid.load_model("rate_integrator", axis="yaw").with_values({"Ntpsi": 40.0, "tau": 0.03})
    made = fid.tune(
        {"roll": _FIXED, "pitch": _FIXED, "yaw": plant},
        gains=_loops("roll", "pitch", "yaw"),
        requirements={"roll": NEED, "pitch": fast, "yaw": NEED},
        gyro="raw", angle_loop=False, band_rad_s=(0.5, 60.0), nominal=True,
    )  # fmt: skip
    assert made["roll"].exists
    assert not made["pitch"].exists
    assert [each.axis for each in made.sound] == ["yaw"]
    assert "couples it with pitch" in made.left_out["roll"]
    path, *_ = made.write(tmp_path / "gains.param")
    assert {name.split("_")[2] for name in read_parameters(path)} == {"YAW"}


def test_no_axis_that_may_be_tuned_is_an_error() -> None:
    turned = dataclasses.replace(_slow_yaw(), b=[[-140.0]])
    with pytest.raises(ModelError, match="negative rate"):
        fid.tune({"yaw": turned}, gains=_loops("yaw"), nominal=True, band_rad_s=(0.5, 60.0))


@pytest.mark.nightly
def test_axes_designed_alone_are_refused_where_the_coupling_breaks_them(tmp_path: Path) -> None:
    options = {"requirements": NEED, "gyro": "raw", "band_rad_s": (0.5, 60.0), "nominal": True}
    fits = {"roll": _FIXED, "pitch": _FIXED}
    made = fid.tune(fits, gains=_loops("roll", "pitch"), other_loops="open", **options)
    single = fid.tune_pid(_FIXED, gains=_loops("roll")["roll"], **options)
    assert made["roll"].gains == single.gains
    (together,) = made.together
    crossover = next(
        each
        for each in together.closed[0].worst_cases
        if (each.loop, each.name) == ("rate loop", "crossover")
    )
    alone = made["roll"].worst_case("rate loop", "crossover")
    assert alone.nominal is not None
    assert crossover.nominal is not None
    assert alone.nominal <= 20.0 < crossover.nominal
    # The same number as of gains that flew, which are judged with all flown loops closed.
    gains = {design.axis: design.loop for design in made.designs}
    again = fid.tune(fits, gains=gains, **options)
    assert_close(
        crossover.nominal, again["roll"].worst_case("rate loop", "crossover").flown, rtol=1e-9,
        why="one computation",
    )  # fmt: skip
    red = [finding for finding in made.findings if finding.light is Light.RED]
    assert {finding.code for finding in red} == {"coupling-ignored"}
    assert "crossover" in red[0].message
    assert not made.sound
    with pytest.raises(DataError, match="so none are written"):
        made.write(tmp_path / "gains.param")
    assert "no" in str(made.closed_table())
    assert not any(each.closed for each in again.together)


def test_axes_without_coupling_may_be_designed_alone() -> None:
    free = _coupled(0.0)
    made = fid.tune(
        {"roll": free, "pitch": free}, gains=_loops("roll", "pitch"), other_loops="open",
        requirements=NEED, gyro="raw", band_rad_s=(0.5, 60.0), nominal=True,
    )  # fmt: skip
    assert [each.is_kept for each in made.together[0].closed] == [True, True]
    assert len(made.sound) == 2


def test_pictures_and_report_show_every_loop(tuning: fid.Tuning) -> None:
    design = tuning["roll"]
    assert len({trace.name for trace in time_responses(design).data if trace.name}) == 2
    titles = {note.text for note in nichols(design).layout.annotations}
    assert {"rate loop", "whole loop", "angle loop"} <= titles
    steps = overlaid_steps(tuning.designs)
    assert {"roll", "roll as flown", "pitch"} <= {trace.name for trace in steps.data}
    # A mode above the band may take the margins of these loops: as if it left some.
    told = [
        dataclasses.replace(e, worst=e.nominal, flown_worst=e.flown)
        if e.name == "phase margin" or e.loop == "angle loop"
        else e
        for e in design.worst_cases
    ]
    design = dataclasses.replace(design, worst_cases=tuple(told))
    promise = promised_margins([design, *tuning.designs[1:]])
    bars = [trace for trace in promise.data if trace.type == "bar"]
    worst = [each.worst for each in design.worst_cases if each.name == "phase margin"]
    assert set(worst) <= set(bars[0].x)
    assert set(promise.data[2].x) == {45.0, 60.0}
    assert steps_caption(tuning.designs).startswith("Steps with the new gains, dashed as flown")
    bare = dataclasses.replace(
        design,
        worst_cases=tuple(
            dataclasses.replace(each, flown_worst=None) for each in design.worst_cases
        ),
        responses=tuple(dataclasses.replace(each, flown=None) for each in design.responses),
    )
    alone = promised_margins([bare])
    names = {trace.name for trace in alone.data}
    assert names == {"worst vehicle, new gains", "required", "not promised"}
    assert all(len(trace.x) for trace in alone.data if trace.name == "required")
    dark = [each.loop for each in bare.worst_cases if each.worst is None]
    words = [trace for trace in alone.data if trace.name == "not promised"]
    assert {row for trace in words for row in trace.y} <= {f"roll, {loop}" for loop in dark}
    assert "flown" not in steps_caption([bare])
    none = tuple(dataclasses.replace(each, worst=None) for each in design.worst_cases)
    unread = promised_margins([dataclasses.replace(design, worst_cases=none)])
    said = {note.text for note in unread.layout.annotations}
    has = any(x.name == "gain margin" and x.estimate.value is not None for x in none)
    # One number a loop had run across the other panel.
    words = [text for text in said if text.startswith("no gain margin is promised<br>(")]
    assert bool(words) == has
    assert all(len(line) < 50 for text in words for line in text.split("<br>"))
    # An empty panel took half of the picture: the caption says what it said.
    half = tuple(
        dataclasses.replace(each, worst=None) if each.name == "gain margin" else each
        for each in design.worst_cases
    )
    lone = dataclasses.replace(design, worst_cases=half)
    one = promised_margins([lone])
    assert {trace.xaxis for trace in one.data} == {"x"}
    told = "no gain margin is promised (" if has else "no vehicle's loop has a finite gain margin"
    assert told in margins_caption([lone])
    assert "no gain margin" not in margins_caption(tuning.designs)
    drawn = gain_map(design)
    line = next(trace for trace in drawn.data if trace.name == "all requirements met")
    assert np.nanmax(line.z) > 0.0
    with pytest.raises(UnknownNameError, match="no such gain"):
        gain_map(design, up="X")
    page = to_html(Document("Gains", "", (tuning_section(tuning),)))
    assert "Coupled axes closed together" in page
    assert "Roll gains" in page


def test_the_result_shows_itself(tuning: fid.Tuning) -> None:
    assert repr(tuning).startswith("Tuning(roll: ATC_RAT_RLL_P")
    assert tuning.to_dict()["schema"] == "flightid.tuning/1"
    assert "pitch: Binding" in str(tuning.summary())
    assert "roll and pitch" in str(tuning.together_table())
    with pytest.raises(UnknownNameError, match="no such axis"):
        tuning["yaw"]


@pytest.mark.parametrize("fits", [{}, {"heave": None}])
def test_axes_that_cannot_be_tuned_are_refused(fits: dict[str, object]) -> None:
    with pytest.raises(OptionError, match="axes to tune"):
        fid.tune(fits, gains={})


def test_parameters_by_name_stand_for_loops() -> None:
    plant = fid.load_model("rate_integrator", axis="yaw").with_values({"Ntpsi": 40.0, "tau": 0.03})
    loop = axis_loop("px4_multicopter", "yaw", loop_rate_hz=400.0)
    made = fid.tune(
        {"yaw": plant}, gains=loop.gains | {"IMU_GYRO_RATEMAX": 400.0},
        autopilot="px4_multicopter", nominal=True, band_rad_s=(0.5, 60.0),
        requirements=fid.TuningRequirements(noise_growth=None), angle_loop=False,
    )  # fmt: skip
    assert made["yaw"].exists
    assert set(made.gains) == {"MC_YAWRATE_P", "MC_YAWRATE_I", "MC_YAWRATE_D"}


def test_angles_of_a_recursion_are_trapezoids_of_its_rates() -> None:
    plant = fid.LinearSystem(
        [[0.9, 0.1], [0.0, 0.7]], [[0.3], [0.5]], [[1.0, 0.4]], [[0.0]], ("u",), ("p",),
        sample_time_s=STEP_S,
    )  # fmt: skip
    (system,) = sample_plants([plant], ["p"], ["u"], STEP_S, hold_in_model=False).systems
    omega = np.geomspace(1.0, 1000.0, 20)
    rate, angle = system.frequency_response(omega)[:, 0]
    turn = np.exp(1j * omega * STEP_S)
    trapezoid = 0.5 * STEP_S * (turn + 1.0) / (turn - 1.0)
    assert_close(angle, rate * trapezoid, rtol=1e-9, why="the same sums")
    assert_close(rate, plant.frequency_response(omega)[0, 0], rtol=1e-9, why="the plant")


def test_couplings_are_the_other_rates_whose_commands_the_model_holds() -> None:
    assert _couplings(_FIXED, "p") == ["q"]
    assert _couplings(_FIXED, "q") == ["p"]
    assert _couplings(_FIXED.select(inputs=["tau_phi"]), "p") == []
