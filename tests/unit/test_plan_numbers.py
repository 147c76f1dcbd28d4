"""Numbers behind a flight plan, one by one: noise, band, amplitude, loops that stay on, battery."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import flightid as fid
from flightid.inspection.flight_phases import FlightPhases
from flightid.logs.dataflash.writer import DataflashWriter
from flightid.planning.axis_guess import _typical
from flightid.planning.flight_time import flight_time
from flightid.planning.flown_axis import FlownAxis
from flightid.planning.options import PlanOptions
from flightid.planning.plan import _loop, _sweep
from flightid.planning.procedures import PROCEDURES, procedure_of
from flightid.planning.sweep_band import crossover_rad_s, ends_too_low, sweep_band
from flightid.report.flight_card import card_html
from tests.closeness import assert_close

BARE = FlownAxis(20.0, 0.5, 0.02, motor_lag_s=0.05, rate_feedback=0.3)


def _loop_gain(omega: float) -> complex:
    s = 1j * omega
    return complex(6.0 * np.exp(-0.02 * s) / ((0.5 * s + 1.0) * (0.05 * s + 1.0)))


def test_the_air_is_that_of_the_log() -> None:
    axis = replace(BARE, still_omega_rad_s=(1.0, 100.0), still_density=(1e-2, 1e-6))
    found = axis.noise_density(np.array([1.0, 10.0, 100.0]), 0.0025)
    assert_close(found, np.array([1e-2, 1e-4, 1e-6]), rtol=1e-12, why="straight in logarithms")


def test_the_band_is_an_eighth_of_the_crossover_to_two_and_a_half_times_the_turn() -> None:
    crossover = brentq(lambda w: abs(_loop_gain(w)) - 1.0, 1.0, 30.0)
    turned = brentq(
        lambda w: np.arctan(0.5 * w) + np.arctan(0.05 * w) + 0.02 * w - math.pi, 5.0, 80.0
    )
    low, high = sweep_band(BARE, 400.0, by_stick=False)
    assert_close(high, 2.5 * turned, rtol=0.05, why="two digits of Hz, and a grid of 1 %")
    assert_close(low, crossover / 8.0, rtol=0.05, why="the same")
    assert sweep_band(BARE, 400.0, by_stick=True)[1] <= 2.0 * math.tau
    slow = sweep_band(BARE, 48.0, by_stick=False)
    assert_close(slow[1], 3.0 * math.tau, rtol=1e-9, why="16 in a cycle")


def test_a_sweep_below_what_the_loop_needs_is_said_on_the_card() -> None:
    """A pilot's 2 Hz, and gains that cross over below a third of what was swept."""
    crossover = brentq(lambda w: abs(_loop_gain(w)) - 1.0, 1.0, 30.0)
    found = {"roll": crossover_rad_s(BARE), "yaw": None}
    assert_close(found["roll"], crossover, rtol=0.01, why="a grid of 1 %")
    assert ends_too_low({"roll": 3.1 * crossover, "yaw": 1.0}, found) is None
    told = ends_too_low({"roll": 2.9 * crossover, "yaw": 1.0}, found)
    assert told is not None
    assert (str(told.light), told.message.split(":")[0]) == ("amber", "roll")
    assert f"up to {3.0 * found['roll'] / math.tau:.2g} Hz" in told.action
    made = fid.plan_flight(vehicle="quad", autopilot="px4", axes=("roll",))
    assert "sweep-below-loop" in [each.code for each in made.findings]
    assert "expect a model of it, not gains" in card_html(made)
    made = fid.plan_flight(vehicle="quad", axes=("roll",))
    assert "sweep-below-loop" not in [each.code for each in made.findings]


@pytest.mark.parametrize(("gain", "capped"), [(60.0, False), (140.0, True)])
def test_a_sweep_goes_up_until_no_light_mode_beyond_takes_a_margin(
    gain: float, capped: bool
) -> None:
    """A loop of much gain turns long before it is low: 20 dB of a mode and 6 of margin."""
    high = sweep_band(replace(BARE, gain=gain), 400.0, by_stick=False)[1]
    left = gain / 20.0 * abs(_loop_gain(high))
    if capped:
        assert_close(high, 25.0 * math.tau, rtol=1e-9, why="as far as the log's rate allows")
        assert left > 10.0 ** (-26.0 / 20.0)
    else:
        assert_close(20.0 * math.log10(left), -26.0, atol=0.8, why="two digits of Hz")
        assert high > 94.3, "the 15 Hz that were the most"


def test_an_amplitude_is_as_large_as_coherence_asks_for_between_half_and_all() -> None:
    loop = fid.axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    axis, procedure = _typical(loop, "multirotor"), procedure_of("quad", "ardupilot")

    def swept(density: float, amplitude: float | None = None) -> tuple[float, float]:
        air = replace(axis, still_omega_rad_s=(0.1, 1e3), still_density=(density, density))
        made = _sweep(procedure, "roll", air, PlanOptions(amplitude=amplitude))
        least = float(np.quantile(made.axes[0].coherence, 0.05))
        return float(made.excitation.peak[0]), least

    largest, _ = swept(1e6)
    assert_close(swept(1e-9)[0], 0.5 * largest, rtol=0.1, why="never less than half; two digits")
    assert_close(swept(1e-9, 0.7 * largest)[0], 0.7 * largest, rtol=1e-6, why="as asked for")
    _, least = swept(1e-4, 0.7 * largest)
    density = 1e-4 * least / (1.0 - least) / 19.0
    amplitude, reached = swept(density)
    assert_close(amplitude, 0.7 * largest, rtol=0.1, why="rounded down to two digits")
    assert 0.93 < reached < 0.951


def test_the_integrator_that_the_file_sets_to_zero_is_out_of_the_forecast() -> None:
    for vehicle, stays in (("quad", False), ("heli", True)):
        plan = fid.plan_flight(vehicle=vehicle, axes=("roll",))
        (sweep,) = plan.sweeps
        assert sweep.plan is not None
        edges = np.array(plan.summary().rows[0][2:4], dtype=np.float64)
        assert_close(math.tau * edges, sweep.plan.band_rad_s, rtol=1e-9, why="shown in Hz")
        assert sweep.guess is not None
        told = sweep.plan.axes[0]
        percent = 100.0 * told.peak_control / sweep.guess.vehicle.full_command
        shown = np.array(plan.expected().rows[0][1:3], dtype=np.float64)
        wanted = np.array([percent, math.degrees(told.peak_rate_rad_s)])
        assert_close(shown, wanted, rtol=1e-9, why="percent and degrees")
        assert sweep.guess.vehicle.loop is not None
        assert bool(sweep.guess.vehicle.loop.values["i"]) is stays


def _log(path: Path, parameters: dict[str, float], who: str) -> fid.Log:
    writer = DataflashWriter()
    writer.message(10_000_000, who)
    for name, value in parameters.items():
        writer.parameter(name, value)
    stamps = np.arange(10_000_000, 40_000_000, 100_000)
    writer.add("BAT", stamps, {"Volt": 16.0, "Curr": 10.0})
    return fid.read_log(writer.write(path))


def test_hover_controllers_of_a_quadplane_have_their_own_names(tmp_path: Path) -> None:
    gains = {"Q_A_RAT_RLL_P": 0.21, "Q_A_RAT_RLL_D": 0.007, "Q_A_ANG_RLL_P": 6.0}
    gains |= {"Q_A_RAT_RLL_I": 0.21, "Q_A_RAT_RLL_IMAX": 0.5}
    named = {"Q_ENABLE": 1.0, "SCHED_LOOP_RATE": 300.0, "INS_GYRO_FILTER": 20.0, **gains}
    log = _log(tmp_path / "plane.bin", named, "ArduPlane V4.6.0 (test)")
    loop = _loop(PROCEDURES["quadplane"], "roll", log)
    assert_close(loop.gains["ATC_RAT_RLL_P"], 0.21, rtol=1e-6, why="single precision")
    assert_close(loop.gains["ATC_RAT_RLL_D"], 0.007, rtol=1e-6, why="single precision")
    assert_close(loop.angle_gain_1_s, 6.0, rtol=1e-6, why="single precision")


def test_charge_is_that_of_the_log_and_three_tenths_stay_in_the_battery(tmp_path: Path) -> None:
    log = _log(tmp_path / "quad.bin", {"BATT_CAPACITY": 700.0}, "ArduCopter V4.6.0 (test)")
    phases = FlightPhases(((11.0, 39.0),), True, None, "throttle")
    found = flight_time([60.0], 2, log, phases)
    assert found.total_s == 180.0, "two runs and a take-off"
    assert_close(found.needed_mah or 0.0, 500.0, rtol=1e-6, why="10 A for 180 s")
    assert found.batteries == 2, "490 mAh of each"
