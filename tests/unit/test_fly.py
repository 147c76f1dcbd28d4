"""The verb `fly` and its settings: determinism, spans, roles, refusals."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from flightid import errors
from flightid.conventions import Role
from flightid.vehicles import (
    Autopilot,
    PilotDoublet,
    QuadrotorParameters,
    RateGains,
    Sensors,
    SidActivation,
    Turbulence,
    fly,
    fly_scenario,
    rate_truth,
)
from flightid.vehicles.scenario import advised_runs, published_runs, stick_moves
from tests.closeness import assert_close

TURN = [PilotDoublet("roll", 0.1, 3.0)]
SHORT = SidActivation(10, 1.0, 0.1, 1.0, 10.0, 1.0, 6.0, 0.5, leave_after_s=8.0)


def test_a_seed_is_a_flight() -> None:
    first, again, other = (fly(duration_s=3.0, seed=seed) for seed in (4, 4, 5))
    assert np.array_equal(first.rows, again.rows)
    assert np.abs(first["p"] - other["p"]).max() > 1e-4


def test_log_rate_does_not_change_the_flight() -> None:
    fast, slow = fly(runs=[SHORT], seed=1), fly(runs=[SHORT], seed=1, log_every=4)
    for name in ("p", "gyro_x", "tau_phi", "sid_target"):
        assert np.array_equal(fast[name][::4], slow[name])


def test_record_roles_and_the_one_loop_skew() -> None:
    flight = fly(runs=[SHORT], seed=1)
    record = flight.run_record("roll")
    assert record.inputs == ("tau_phi", "tau_theta", "tau_psi")
    assert record.names(Role.EXCITATION) == ("excitation",)
    assert record.unit("p") == "rad/s"
    assert_close(record.duration_s, 6.0, atol=0.01, why="the chirp without its silent ends")
    assert np.array_equal(flight["sid_applied"][1:], flight["sid_target"][:-1])
    pid = sum(flight[f"roll_pid_{term}"] for term in ("p", "i", "d", "ff", "d_ff"))
    left = flight["tau_phi"] - pid - flight["sid_applied"]
    assert_close(left, 0.0, atol=1e-7, why="single precision of the controller")


def test_rate_and_angle_injections_go_where_they_belong() -> None:
    for axis, column in ((8, "q_ref"), (2, "theta_ref"), (13, "thrust")):
        run = replace(SHORT, axis=axis, magnitude=0.1 if axis == 13 else 5.0)
        flight = fly(runs=[run], seed=0, turbulence=Turbulence(0.0, 1.0, 0.0, 1.0))
        assert np.ptp(flight[column]) > 0.1
        assert np.abs(flight["p"]).max() < 0.05


def test_the_pilot_holds_free_flight() -> None:
    vehicle = replace(QuadrotorParameters(), on_rig=False)
    moves = [PilotDoublet("pitch", 5.0, 0.15), PilotDoublet("yaw", 10.0, 0.5)]
    flight = fly(doublets=moves, vehicle=vehicle, seed=3)
    assert np.abs(flight["down_m"]).max() < 1.0
    assert np.abs(flight["phi"]).max() < 0.1
    assert np.ptp(flight["psi"]) > 0.3
    assert np.ptp(flight["u_m_s"]) > 0.5


def test_gusts_and_noise_have_the_size_that_was_asked_for() -> None:
    air, sensors = Turbulence(rate_rad_s=0.25), Sensors(gyro_noise_rad_s=0.02)
    flight = fly(duration_s=60.0, sensors=sensors, turbulence=air, seed=8)
    noise = flight["gyro_x"] - flight["p"]
    assert noise.std() == pytest.approx(0.02, rel=0.03)
    assert noise.mean() == pytest.approx(0.002, abs=5e-4)
    assert flight["gust_p_rad_s"].std() == pytest.approx(0.25, rel=0.2)


def test_scenarios_are_the_published_table_and_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    table = [(run.axis, run.magnitude, run.record_s) for run in published_runs()]
    assert table == [(10, 0.15, 130.0), (11, 0.15, 130.0), (12, 0.55, 130.0)]
    assert advised_runs()[0].stop_hz == 12.0
    monkeypatch.setattr("flightid.vehicles.scenario.advised_runs", lambda: (SHORT,))
    changed = fly_scenario(seed=1, vehicle={"mass_kg": 1.0}, autopilot={"rate": [{"p": 0.1}] * 3})
    assert changed.vehicle.mass_kg == 1.0
    assert changed.autopilot.rate[2] == RateGains(p=0.1)
    assert changed.to_dict()["schema"] == "flightid.flight/1"
    moves = stick_moves(0.1, seed=2)
    jumps = [2.0 * abs(each.amplitude) for each in moves if each.axis != "yaw"]
    assert 0.05 <= min(jumps) < 0.06 < 0.09 < max(jumps) <= 0.1
    assert {each.axis for each in moves} == {"roll", "pitch", "yaw"}
    assert all(a.end_s < b.start_s for a, b in pairwise(moves))


def test_refusals() -> None:
    with pytest.raises(errors.OptionError, match="two sweeps overlap"):
        fly(runs=[SHORT, replace(SHORT, start_s=5.0)])
    with pytest.raises(errors.OptionError, match="length of the flight"):
        fly(duration_s=-1.0)
    with pytest.raises(errors.OptionError, match="axis is too large"):
        SidActivation(axis=14, start_s=0.0)
    with pytest.raises(errors.OptionError, match="cannot lift"):
        QuadrotorParameters(mass_kg=5.0)
    with pytest.raises(errors.OptionError, match="motor_lag_s is too small"):
        QuadrotorParameters(motor_lag_s=0.0)
    with pytest.raises(errors.OptionError, match="inertia_kg_m2 is too small"):
        QuadrotorParameters(inertia_kg_m2=(0.1, 0.0, 0.1))
    with pytest.raises(errors.OptionError, match="gyro filter does not fit"):
        Autopilot(gyro_filter_hz=300.0)
    with pytest.raises(errors.OptionError, match="hover throttle"):
        fly(duration_s=1.0, autopilot=Autopilot(voltage_ratio=0.4))
    with pytest.raises(errors.OptionError, match="motor delay"):
        fly(duration_s=1.0, vehicle=QuadrotorParameters(motor_delay_s=2.0))
    with pytest.raises(errors.OptionError, match="log divider"):
        fly(duration_s=1.0, log_every=0)
    with pytest.raises(errors.OptionError, match="chirp record length"):
        fly(runs=[replace(SHORT, record_s=1.5)])
    mute, wild = RateGains(imax=-1.0), RateGains(p=3e38, i=3e38)
    with pytest.raises(errors.OptionError, match="rate controller"):
        fly(duration_s=5.0, autopilot=Autopilot(rate=(mute, mute, mute)))
    with pytest.raises(errors.DataError, match="simulated flight"):
        fly(duration_s=5.0, autopilot=Autopilot(rate=(wild, wild, wild)), doublets=TURN)
    with pytest.raises(errors.OptionError, match="amplitude has no meaning"):
        fly(doublets=[PilotDoublet("roll", 0.1, float("nan"))])


def test_unknown_names_are_refused() -> None:
    flight = fly(duration_s=2.0)
    with pytest.raises(errors.UnknownNameError, match="no such column"):
        flight["nothing"]
    with pytest.raises(errors.UnknownNameError, match="no mixer sweep"):
        flight.run_record("yaw")
    with pytest.raises(errors.OptionError, match="span is empty"):
        flight.record((50.0, 60.0))
    with pytest.raises(errors.OptionError, match="axis is not known"):
        rate_truth("heave")  # type: ignore[arg-type]
    with pytest.raises(errors.OptionError, match="gyro signal is not known"):
        rate_truth("roll").effective_delay_s("best")  # type: ignore[arg-type]
    with pytest.raises(errors.OptionError, match="scenario is not known"):
        fly_scenario("wild")
    with pytest.raises(errors.OptionError, match="flown without sticks"):
        fly_scenario("advised", stick_rad=0.1)
    with pytest.raises(errors.OptionError, match="size of stick moves"):
        fly_scenario("sticks", stick_rad=0.0)
    with pytest.raises(errors.OptionError, match="setting is not known"):
        fly_scenario(weather={})
    with pytest.raises(errors.OptionError, match="has no such field"):
        fly_scenario(vehicle={"weight": 1.0})
