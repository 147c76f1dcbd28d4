"""Margins over vehicles that would fly so, against a simulator whose loop is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.control.autopilots.from_log import axis_loop_of
from flightid.conventions import Light
from flightid.review.flown_range import UNLIKE, FlownRange, range_table
from flightid.vehicles import Autopilot
from tests.ordinary_log import write_ordinary_log
from tests.strangers.ordinary_flights import Axis

RACER = Axis(effectiveness=400.0, motor_s=0.02, damping=5.0, p=0.08, i=0.1, d=0.0012, delay_ticks=2)


@pytest.mark.parametrize(("axis", "light"), [(Axis(), Light.GREEN), (RACER, None)])
def test_the_margins_of_the_vehicle_that_flew_are_among_them(
    axis: Axis, light: Light, tmp_path: Path
) -> None:
    review, held = _flown(axis, tmp_path / "a.bin", seed=1)
    assert held == [True, True]
    if light is not None:
        (said,) = (each for each in review.findings if each.code == "flown-range-roll")
        assert said.light is light
        assert "Flown gains, over a range of vehicles" in review.to_text()


@pytest.mark.slow
def test_margins_of_many_flights_are_among_them(tmp_path: Path) -> None:
    """Sticks are too slow for a racer in half of its flights: nothing is told there."""
    found = [
        _flown(axis, tmp_path / "a.bin", seed=seed)[1]
        for axis in (Axis(), RACER, replace(Axis(), p=0.05, i=0.05, d=0.001))
        for seed in range(20)
    ]
    told = [each for held in found for each in held]
    assert len(told) >= 90
    # 95 % intervals: two deviations of chance over so many.
    assert np.mean(told) >= 0.9


def _flown(axis: Axis, path: Path, *, seed: int) -> tuple[fid.FlightReview, list[bool]]:
    """A review, and whether the true margins lie in what it tells of them."""
    gains = dict(zip("PID", (axis.p, axis.i, axis.d), strict=True))
    flown = {f"ATC_RAT_RLL_{name}": value for name, value in gains.items()}
    filters = {"INS_GYRO_FILTER": 40.0, "ATC_RAT_RLL_FLTT": 20.0, "ATC_RAT_RLL_FLTD": 20.0}
    told = {**Autopilot().parameters(), **flown, **filters, "ATC_RAT_RLL_FLTE": 0.0}
    write_ordinary_log(path, axis=axis, seed=seed, parameters=told)
    log = fid.read_log(path)
    review = fid.review_flight(log)
    phase, gain = _truth(axis, log)
    told = [
        pair
        for found in review.ranges
        for pair in ((phase, found.phase_margin_deg), (gain, found.gain_margin_db))
    ]
    return review, [ends[0] <= truth <= ends[1] for truth, ends in told if ends is not None]


def _truth(axis: Axis, log: fid.Log) -> tuple[float, float]:
    """Phase and gain margin of the simulator's rate loop, deg and dB."""
    s = 1j * np.geomspace(0.5, 1200.0, 4000)
    delay_s = (axis.delay_ticks + 0.5) / axis.loop_hz
    plant = axis.effectiveness * np.exp(-delay_s * s)
    plant /= (s + axis.damping) * (axis.motor_s * s + 1.0)
    opened = plant * axis_loop_of(log, "roll").feedback(s.imag, gyro="raw", with_hold=False)
    phase = np.unwrap(np.angle(opened))
    crossing = np.flatnonzero(np.diff(np.sign(np.abs(opened) - 1.0)))
    turned = np.argmax(phase <= -np.pi)
    return (
        float(np.degrees(np.min(phase[crossing]) + np.pi)),
        float(-20.0 * np.log10(np.abs(opened[turned]))),
    )


def test_what_no_typical_vehicle_does_is_said() -> None:
    none = FlownRange("yaw", 3.0, None, None, None, UNLIKE)
    assert none.finding("a.bin") is None
    assert "–: yaw: hardly any typical vehicle answers so." in range_table([none]).notes
    poor = FlownRange("roll", 200.0, (20.0, 30.0), (20.0, 40.0), (3.0, 9.0))
    said = poor.finding("a.bin")
    assert said is not None
    assert (said.light, said.action) == (Light.AMBER, "lower the gains of roll")
