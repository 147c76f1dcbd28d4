"""Betaflight: its controller against its own arithmetic, its chirps, its files of gains."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

import flightid as fid
from flightid.control.autopilots import (
    axis_loop,
    axis_loop_of,
    read_parameters,
    write_parameters,
)
from flightid.control.autopilots.from_log import autopilot_of
from flightid.control.autopilots.notch_tracking import Centre, NotchTracking
from flightid.control.tuning.controller_paths import ControllerPaths
from flightid.control.tuning.gain_search_result import GainSearchResult
from flightid.control.tuning.whole_gains import ROUNDED, whole_gains
from flightid.conventions import Light
from flightid.errors import DataError, OptionError
from flightid.inspection.excitation_found import injected_spans
from flightid.inspection.rate_chirps import chirps
from flightid.inspection.saturation import saturations
from flightid.inspection.verdicts import _at_limit
from flightid.logs.blackbox.settings import loop_step_s, settings_of
from flightid.plot.tuning import gain_map
from flightid.review.loops import loop_responses
from tests import betaflight_flight as betaflight
from tests.blackbox_builder import SETTINGS, blackbox
from tests.closeness import assert_close

RATE_HZ = 1.0 / betaflight.STEP


def _settings() -> dict[str, float]:
    """Of the simulated vehicles, by the names of the command line."""
    return settings_of(betaflight.header_of(betaflight.default_gains(1), 0))


def test_a_gain_is_worth_what_the_firmware_makes_of_it() -> None:
    """PTERM_SCALE 0.032029, ITERM_SCALE 0.244381, DTERM_SCALE 0.000529; the mixer takes 1000ths."""
    roll, yaw = (axis_loop("betaflight", axis, loop_rate_hz=4000.0) for axis in ("roll", "yaw"))
    hundred, still = np.radians([100.0, 100.0]), np.zeros(2)
    made, turned = roll.run(hundred, still).terms, roll.run(still, np.radians([0.0, 1.0])).terms
    for found, by_hand in (
        (made["P"][0], 0.1441305),  # 45 · 0.032029 · 100 deg/s / 1000
        (made["I"][1], 2.0 * 4.88762e-4),  # 80 · 0.244381 · 100 deg/s · 25e-5 s / 1000
        (turned["D"][1], -0.06348),  # 30 · 0.000529 · 1 deg/s · 4000 Hz / 1000
        (yaw.run(hundred, still).terms["I"][0], 2.5 * 4.88762e-4),
    ):
        assert_close(found, by_hand, why="arithmetic by hand", rtol=1e-12)


def test_terms_are_those_of_the_firmware() -> None:
    """P, I and D of a noisy flight, TPA and filters at work, against the simulated firmware."""
    quads = betaflight.Quads.of(1, seed=3)
    gains = betaflight.default_gains(1) | {"d": np.array([[30.0, 34.0, 9.0]])}
    none = np.full(500, -1)
    flown = betaflight.fly(
        quads, gains, np.zeros(500), none, noise=3.0, d_max=np.zeros(3), every=1
    ).columns
    throttle = float(quads.throttle[0, 0])
    assert throttle > 0.36, "TPA is at work"
    tracking = NotchTracking(throttle=Centre(throttle, throttle, throttle))
    for place, axis in enumerate(betaflight.AXES):
        settings = _settings() | {f"d_{axis}": gains["d"][0, place]}
        loop = axis_loop("betaflight", axis, settings, notch_tracking=tracking)
        assert_close(loop.loop_rate_hz, RATE_HZ, why="the arithmetic by hand", rtol=1e-12)
        rates = {name: np.radians(flown[name][:, 0, place]) for name in ("set", "gyro")}
        made = loop.run(rates["set"], rates["gyro"])
        for name, term in made.terms.items():
            # The columns are single precision.
            size = np.abs(flown[name]).max()
            assert_close(1e3 * term, flown[name][:, 0, place], why="single", atol=2e-5 * size)
        # The linear view is that of the recursion.
        time_s, omega = np.arange(4000) / RATE_HZ, 2.0 * np.pi * 40.0
        wave = loop.run(np.zeros(4000), np.sin(omega * time_s)).output
        last = slice(2000, 4000)
        basis = np.column_stack([np.sin(omega * time_s), np.cos(omega * time_s), np.ones(4000)])
        found = np.linalg.lstsq(basis[last], wave[last], rcond=None)[0]
        told = -loop.feedback([omega], gyro="filtered", with_hold=False)[0]
        assert_close(
            [found[0], found[1]], [told.real, told.imag], why="settled", atol=2e-4 * abs(told)
        )


def _of_version(version: str, **lines: str) -> dict[str, float]:
    """Settings of a header before 4.3, under the names that it had."""
    told = {
        "Firmware revision": f"Betaflight {version} (a) F4", "looptime": "125",
        "pid_process_denom": "2", "rollPID": "45,40,30", "yawPID": "70,45,20",
        "dterm_lowpass_hz": "100", "dterm_filter_type": "0", "yaw_lowpass_hz": "40",
        "tpa_rate": "50", "tpa_breakpoint": "1500", "iterm_limit": "150", **lines,
    }  # fmt: skip
    return settings_of(told)


@pytest.mark.parametrize(
    ("version", "weight"), [("3.1.7", 0.6), ("3.3.2", 60 / 127), ("3.5.7", 0.6)]
)
def test_terms_of_version_3_are_those_of_its_firmware(version: str, weight: float) -> None:
    """pid.c: D of the weighted error behind its filter up to 3.3, beside it since; TPA in all."""
    settings = _of_version(version, dtermSetpointWeight="60")
    rng = np.random.default_rng(4)
    wanted = np.cumsum(5.0 * rng.standard_normal(800))
    gyro = 0.7 * wanted + 8.0 * rng.standard_normal(800)
    tpa = 1.0 - 0.5 * (0.8 - 0.5) / 0.5
    tracking = NotchTracking(throttle=Centre(0.8, 0.8, 0.8))
    loop = axis_loop("betaflight", "roll", settings, notch_tracking=tracking)
    alpha = 2.0 * np.pi * 100.0 * betaflight.STEP
    alpha /= 1.0 + alpha

    def smooth(values: np.ndarray) -> np.ndarray:
        return lfilter([alpha], [1.0, alpha - 1.0], values)

    kd = 0.000529 * 30 * tpa * RATE_HZ
    if version < "3.4":
        slope = smooth(kd * np.diff(weight * wanted - gyro, prepend=0.0))
    else:
        slope = kd * np.diff(weight * wanted - smooth(gyro), prepend=0.0)
    exact = {
        "P": 0.032029 * 45 * tpa * (wanted - gyro),
        "I": np.cumsum(0.244381 * 40 * (wanted - gyro) / RATE_HZ),
        "D": slope,
    }
    made = loop.run(np.radians(wanted), np.radians(gyro)).terms
    assert np.abs(exact["I"]).max() < 150.0
    for name, term in exact.items():
        assert_close(1e3 * made[name], term, why="rounding", atol=1e-9 * np.abs(term).max())
    # The linear view of the set-point's path, and yaw, whose I had no weight of its own and no D.
    time_s, omega = np.arange(8000) / RATE_HZ, 2.0 * np.pi * 30.0
    wave = loop.run(1e-3 * np.sin(omega * time_s), np.zeros(8000)).output[4000:]
    basis = np.column_stack([np.sin(omega * time_s), np.cos(omega * time_s), np.ones(8000)])
    found = np.linalg.lstsq(basis[4000:], wave, rcond=None)[0]
    told = 1e-3 * loop.forward([omega], with_hold=False)[0]
    assert_close(found[:2], [told.real, told.imag], why="settled", atol=1e-3 * abs(told))
    yaw = axis_loop("betaflight", "yaw", settings)
    assert not np.any(yaw.run(np.radians(wanted), np.radians(gyro)).terms["D"])
    assert "d_yaw" not in {*yaw.ranges, *yaw.basis([10.0])[1]}
    assert_close(yaw.unit_of("i"), loop.unit_of("i"), why="no 2.5 before 4", rtol=1e-12)


def test_versions_between_are_told_apart() -> None:
    four = axis_loop("betaflight", "yaw", _of_version("4.2.9", dterm_lowpass2_hz="150"))
    assert four.era.yaw_integral == 2.5
    assert [stage.name for stage in four.filter_stages()] == ["dterm_lpf1", "dterm_lpf2"]
    assert "does not tell tpa_mode" in " ".join(four.unmodelled)
    gyro = _of_version("4.1.0", gyro_lowpass_hz="120", gyro_lowpass_type="0")
    (stage, *_) = axis_loop("betaflight", "roll", gyro).filter_stages()
    assert (stage.name, stage.rate_hz) == ("gyro_lpf1", 8000.0)
    mean = axis_loop("betaflight", "roll", gyro | _of_version("3.2.0", gyro_soft_type="2"))
    assert [stage.name for stage in mean.filter_stages()] == ["dterm_lpf1"]
    assert "moving mean" in " ".join(mean.unknown_notches)
    with pytest.raises(DataError, match="moving mean"):
        axis_loop("betaflight", "roll", _of_version("3.2.0", dterm_filter_type="2"))


def test_fast_set_points_hold_the_integral_back_as_in_the_firmware() -> None:
    quads, gains = betaflight.Quads.of(1, seed=1), betaflight.default_gains(1)
    run = 2.0 * np.pi * np.cumsum(np.linspace(5.0, 60.0, 600)) * betaflight.STEP
    flown = betaflight.fly(
        quads, gains, run, np.zeros(600, int), noise=0.0, d_max=np.zeros(3), every=1
    ).columns
    loop = axis_loop("betaflight", "roll", _settings())
    signals = [np.radians(flown[name][:, 0, 0]) for name in ("set", "gyro")]
    logged = flown["I"][:, 0, 0]
    assert_close(1e3 * loop.run(*signals).terms["I"], logged, why="single", atol=1e-4)
    free = axis_loop("betaflight", "roll", _settings() | {"iterm_relax": 0.0})
    assert np.abs(1e3 * free.run(*signals).terms["I"] - logged).max() > 1.0
    # By hand: 100 deg/s at once is fast, so that nothing is counted but what goes back.
    rising = axis_loop("betaflight", "roll", _settings() | {"iterm_relax": 3.0})
    wanted = np.radians([-10.0] * 400 + [100.0] * 2)
    both = (each.run(wanted, np.zeros(402)).terms["I"] for each in (loop, rising))
    held, back = (term[-1] - term[-3] for term in both)
    assert_close(held, 0.0, why="stands", atol=1e-12)
    assert_close(back, 2 * 4.88762e-4, why="two loops of 100 deg/s", rtol=1e-12)


def _log(folder: Path, **changes: str) -> fid.Log:
    """Chirps of 4 s on roll and yaw without a vehicle: the set-point and the phase alone."""
    n = round(4.0 / betaflight.STEP)
    axis = np.concatenate([np.full(1000, -1), np.zeros(n, int), np.full(3000, -1), np.full(n, 2)])
    run = 2.0 * np.pi * np.cumsum(np.linspace(3.0, 20.0, n)) * betaflight.STEP
    phase = np.zeros(axis.size)
    phase[axis == 0] = phase[axis == 2] = run
    rng = np.random.default_rng(0)
    columns = {
        name: 5.0 * rng.standard_normal((axis.size // betaflight.LOGGED, 1, 3))
        for name in ("P", "I", "D", "gyro", "set", "sum")
    }
    for place in (0, 2):
        moved = np.where(axis == place, 200.0 * np.cos(phase - 0.8), 0.0)
        columns["set"][:, 0, place] += moved[:: betaflight.LOGGED]
    gains = betaflight.default_gains(1)
    flown = betaflight.Blackbox(columns, gains)
    content = betaflight.blackbox_of(flown, betaflight.Quads.of(1), phase, axis, 0)
    for line, value in changes.items():
        content = content.replace(line.encode(), value.encode())
    path = folder / "chirps.bfl"
    path.write_bytes(content)
    return fid.read_log(path)


def test_chirps_are_found_by_the_phase_that_moves_a_set_point(tmp_path: Path) -> None:
    log = _log(tmp_path)
    roll, yaw = chirps(log)
    assert (roll.axis, yaw.axis) == ("roll", "yaw")
    assert_close(roll.span_s, [5.25, 9.25], why="ends", atol=0.005)
    assert_close(
        [roll.low_hz, roll.high_hz, roll.size_deg_s], [3.0, 20.0, 200.0], why="ends", rtol=0.02
    )
    assert injected_spans(log) == [roll.span_s, yaw.span_s]
    record = log.record(names=["tau_phi", "p", "chirp"], span_s=roll.span_s)
    assert record.hold is None, "every second loop is logged: nothing is known between"
    inside = record["chirp"][10:-10]
    assert_close([inside.max(), inside.min()], [1.0, -1.0], why="a cosine", atol=1e-3)
    # A phase that no set-point follows is another debug field.
    told = log.table("main")["debug[0]"]
    assert told.max() > 31_000
    moved = _log(tmp_path, **{"setpoint[": "setsomes["})
    assert chirps(moved) == ()


def test_loops_of_a_log_are_those_of_its_header(tmp_path: Path) -> None:
    log = _log(tmp_path)
    loop = axis_loop_of(log, "roll")
    assert [loop.gains[name] for name in ("p_roll", "i_roll", "d_roll")] == [45.0, 80.0, 30.0]
    assert [stage.name for stage in loop.filter_stages()] == [
        "gyro_lpf2", "gyro_lpf1", "dterm_lpf1", "dterm_lpf2",
    ]  # fmt: skip
    assert {each.name: each.old for each in loop.beside_gains} == {
        "d_max_roll": 40.0,
        "simplified_pids_mode": 2.0,
    }
    assert "TPA leaves 100 % of P and " in " ".join(loop.unmodelled)
    for firmware in ("Betaflight 3.0.1", "EmuFlight 0.4.1"):
        other = _log(tmp_path, **{"Betaflight 2025.12.1": firmware})
        with pytest.raises(DataError, match=r"needed Betaflight 3\.1 or newer"):
            autopilot_of(other)
    integrated = _settings() | {"use_integrated_yaw": 1.0}
    with pytest.raises(DataError, match="integrates its whole PID sum"):
        axis_loop("betaflight", "yaw", integrated)
    with pytest.raises(OptionError, match="not modelled"):
        _ = loop.angle_gain_1_s
    with pytest.raises(OptionError, match="gyro filters are not run"):
        loop.run([0.0], [0.0], gyro="raw")


def test_gains_are_written_as_lines_and_taken_back(tmp_path: Path) -> None:
    loop = axis_loop("betaflight", "roll", _settings())
    made = write_parameters("betaflight", loop.beside_gains, tmp_path / "gains.txt")
    assert made.path.read_text().splitlines() == [
        "# d_max_roll: D stays what it is tuned to; was 40",
        "set d_max_roll = 0",
        "# simplified_pids_mode: no slider writes over the gains; was 2",
        "set simplified_pids_mode = OFF",
        "save",
    ]
    assert made.rollback is not None
    assert read_parameters(made.rollback) == {"d_max_roll": 40.0, "simplified_pids_mode": 2.0}
    for wrong in ({"p_roll": 45.5}, {"ATC_RAT_RLL_P": 1.0}):
        with pytest.raises(OptionError, match="command line takes no such setting"):
            write_parameters("betaflight", wrong, tmp_path / "wrong.txt")


def test_gains_are_whole_numbers_that_keep_their_margins() -> None:
    plant = fid.load_model("rate_integrator", axis="roll").with_values(
        {"Ltphi": 900.0, "tau": 0.02}
    )
    loop = axis_loop("betaflight", "roll", _settings())
    design = fid.tune_pid(plant, gains=loop, band_rad_s=(2.0, 400.0), nominal=True)
    assert design.exists
    assert all(value == round(value) for value in design.gains.values())
    assert all(v == round(v) for stage in design.stages for v in stage.gains.values())
    assert design.worst_case("rate loop", "phase margin").nominal >= 45.0
    paths = ControllerPaths(loop, "filtered", with_angle=False)
    found = GainSearchResult(paths.gains_of(loop) * 40.0, True, (), {})
    far = whole_gains(design.problem, paths, found)
    assert not far.exists
    assert far.binding == (ROUNDED,)
    # Gains that are whole have no neighbours above them, however much these would be worth.
    one = np.array([loop.unit_of(role) for role in paths.roles])
    judged = lambda gains: SimpleNamespace(  # noqa: E731 - of any gains
        names=("a",), slack=np.ones((1, len(gains), 1)), objective=gains.sum(axis=1)[:, None]
    )
    wide = SimpleNamespace(judge=judged, low=one, high=500.0 * one)
    flown = GainSearchResult(one * np.arange(40.0, 40.0 + one.size), True, (), {})
    kept = whole_gains(wide, paths, flown)
    assert kept.exists
    assert_close(kept.gains / one, np.arange(40.0, 40.0 + one.size), rtol=1e-9, why="themselves")
    # The map is drawn in counts and judged by what they are worth: the new gains lie inside.
    drawn = gain_map(design)
    line = next(trace for trace in drawn.data if trace.name == "all requirements met")
    star = next(trace for trace in drawn.data if trace.name == "new gains")
    place = [np.abs(side - at[0]).argmin() for side, at in ((line.y, star.y), (line.x, star.x))]
    assert line.z[place[0], place[1]] > -0.05


def test_a_log_of_every_loop_tells_its_hold(tmp_path: Path) -> None:
    n = 64
    columns = {"time": 10_000_000 + 500 * np.arange(n), "gyroADC[0]": np.arange(n)}
    path = tmp_path / "a.bfl"
    for denominator, hold in (("2", "zero"), ("1", None)):
        path.write_bytes(blackbox(columns, {**SETTINGS, "pid_process_denom": denominator}))
        assert fid.read_log(path).record().hold == hold
    # A controller acts in every loop of the gyro, or in each of so many.
    for settings, step_s in (
        ({}, None), ({"looptime": 0.0}, None), ({"looptime": 125.0}, 125e-6),
        ({"looptime": 125.0, "pid_process_denom": 0.0}, 125e-6),
        ({"looptime": 125.0, "pid_process_denom": 1.0}, 125e-6),
        ({"looptime": 125.0, "pid_process_denom": 4.0}, 500e-6),
    ):  # fmt: skip
        assert loop_step_s(settings) == (step_s and pytest.approx(step_s, rel=1e-12))


def test_a_command_at_the_limit_of_its_axis_has_a_finding_of_its_own(tmp_path: Path) -> None:
    """The firmware cuts the sum of yaw at pidsum_limit_yaw, long before the mixer is full."""
    n = 4000
    yaw = np.where(np.arange(n) % 10 < 2, 400, 100)
    columns = {"time": 10_000_000 + 500 * np.arange(n), "axisP[2]": yaw, "axisP[0]": 0 * yaw + 450}
    columns |= {f"motor[{k}]": 0 * yaw + 1000 for k in range(4)}
    path = tmp_path / "a.bfl"
    limits = {"pidsum_limit": "500", "pidsum_limit_yaw": "400"}
    path.write_bytes(blackbox(columns, {**SETTINGS, **limits}))
    log = fid.read_log(path)
    (found,) = saturations(log, ((10.0, 12.0),), None)
    assert (found.axis, found.limit) == ("yaw", "limit pidsum_limit_yaw 400")
    assert found.share == pytest.approx(0.2, abs=1e-3)
    said = _at_limit(found)
    assert (said.code, said.light) == ("saturated-yaw", Light.AMBER)
    assert "is at its limit pidsum_limit_yaw 400 for 20 % of the flight" in said.message


def test_steps_of_fast_loops_are_read_of_finer_samples(tmp_path: Path) -> None:
    """A loop of 30 Hz that rises within 12 ms: three samples of 100 Hz do not tell it."""
    n, step_s = 40_000, betaflight.STEP * betaflight.LOGGED
    rng = np.random.default_rng(5)
    wanted = np.repeat(rng.choice([-60.0, 60.0], n // 400), 400)
    turn, zeta = 2.0 * np.pi * 30.0 * step_s, 0.7
    a = [1.0, -2.0 * np.exp(-zeta * turn) * np.cos(turn * np.sqrt(1 - zeta**2)),
         np.exp(-2.0 * zeta * turn)]  # fmt: skip
    rate = lfilter([0.0, sum(a)], a, wanted) + 0.5 * rng.standard_normal(n)
    columns = {name: np.zeros((n, 1, 3)) for name in ("P", "I", "D", "gyro", "set", "sum")}
    columns["set"][:, 0, 0], columns["gyro"][:, 0, 0] = wanted, rate
    flown = betaflight.Blackbox(columns, betaflight.default_gains(1))
    loops = np.zeros(n * betaflight.LOGGED)
    path = tmp_path / "a.bfl"
    content = betaflight.blackbox_of(flown, betaflight.Quads.of(1), loops, loops.astype(int) - 1, 0)
    path.write_bytes(content)
    log = fid.read_log(path)
    made = {each.name: each for each in loop_responses(log, ((5.0, 24.9),))}["roll rate"]
    assert made.rate_hz == pytest.approx(400.0)
    step = np.cumsum(lfilter([0.0, sum(a)], a, np.eye(1, 400)[0]))
    rise = step_s * (np.argmax(step > 0.9) - np.argmax(step > 0.1))
    assert rise < 0.013
    assert_close(made["rise time"].value, rise, why="samples of 2.5 ms", rtol=0.1)
