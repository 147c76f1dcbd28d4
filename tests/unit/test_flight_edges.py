"""Flight, limits and stamps of a log at both sides of what tells them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.inspection import divergence, excitation_found, saturation, stamps
from flightid.inspection import flight_phases as phases
from flightid.inspection.actuators import Actuators, _ardupilot
from flightid.inspection.excitation_found import FoundExcitation
from flightid.inspection.saturation import LimitContact, _command_limit, _motors, saturations
from flightid.inspection.signals import Signal
from tests.closeness import assert_close

TENTHS = 0.1 * np.arange(101)


def _between(*spans: tuple[float, float]) -> np.ndarray:
    found = np.zeros(TENTHS.size, np.bool_)
    for low, high in spans:
        found |= np.abs(TENTHS - (low + high) / 2.0) < (high - low) / 2.0 + 0.05
    return found


def test_interruptions_of_less_than_a_second_do_not_end_a_flight() -> None:
    for mask, spans in (
        (_between((1.0, 4.0), (4.9, 9.0)), [(1.0, 9.0)]),
        (_between((1.0, 4.0), (5.1, 9.0)), [(1.0, 4.0), (5.1, 9.0)]),
        (_between((0.0, 0.0), (10.0, 10.0)), [(0.0, 0.0), (10.0, 10.0)]),
        (_between((0.0, 10.0)), [(0.0, 10.0)]),
        (_between(), []),
    ):
        assert_close(np.ravel(phases._spans(TENTHS, mask)), np.ravel(spans), atol=1e-9, why="grid")
    # A silence ends a span, where it is longer than a second and than 2.5 steps.
    for late, count in ((0.89, 1), (0.91, 2)):
        silent = np.r_[TENTHS[:50], TENTHS[50:] + late]
        assert len(phases._spans(silent, np.ones(101, np.bool_))) == count
    slow = np.r_[np.arange(0.0, 10.0), 11.4 + np.arange(0.0, 9.0)]
    assert len(phases._spans(slow, np.ones(slow.size, np.bool_))) == 1
    assert len(phases._spans(slow + 0.2 * (slow > 10.0), np.ones(slow.size, np.bool_))) == 2
    assert phases._spans(np.array([3.0]), np.array([True])) == [(3.0, 3.0)]


def test_spans_that_two_witnesses_share() -> None:
    assert phases._common([(0.0, 5.0), (6.0, 9.0)], [(1.0, 7.0)]) == [(1.0, 5.0), (6.0, 7.0)]
    assert phases._common([(0.0, 5.0)], [(5.0, 7.0)]) == []


def test_half_of_the_median_throttle_in_use_carries() -> None:
    for throttle, limit in (
        ([0.0, 0.04, 0.05], 0.05), ([0.0, 0.08, 0.09, 0.08], 0.05), ([0.0, 0.3, 0.4, 0.5], 0.2),
        ([0.06, 0.6, 0.8], 0.3),
    ):  # fmt: skip
        assert phases._carrying_throttle(np.array(throttle)) == pytest.approx(limit), throttle
    assert phases._carrying_throttle(np.array([0.051, 0.051, 0.2])) == 0.05


def test_states_last_until_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phases, "log_span", lambda _: (2.0, 12.0))
    log: Any = None
    assert phases._held(log, np.empty(0), np.empty(0, np.bool_)) is None
    found = phases._held(log, np.array([4.0, 7.0]), np.array([True, False]))
    assert found is not None
    grid, flying = found
    assert (grid[0], grid[-1], grid.size) == (2.0, 12.0, 100)
    assert flying.tolist() == ((grid >= 4.0) & (grid < 7.0)).tolist()
    late = phases._held(log, np.array([4.0]), np.array([False]))
    assert late is not None
    assert late[1].tolist() == (grid < 4.0).tolist()  # Before the first, its opposite.


def _log(**tables: Any) -> Any:
    log = SimpleNamespace(kind="px4", vehicle="copter", parameters={})
    messages = {
        name: SimpleNamespace(fields=tuple(table), instances=(0,)) for name, table in tables.items()
    }

    class Found(dict):
        time_s = 1.0 * np.arange(4)
        name = "RCOU"

        def arrays(self, names: list[str]) -> dict[str, np.ndarray]:
            return {each: self[each] for each in names}

    class Log:
        def __contains__(self, name: str) -> bool:
            return name in tables

        def __getattr__(self, name: str) -> Any:
            return getattr(log, name)

        def table(self, name: str, _: Any = None) -> Found:
            return Found(tables[name])

    made: Any = Log()
    log.messages = messages
    return made


def test_tilt_is_the_angle_of_the_z_axis_from_the_vertical(monkeypatch: pytest.MonkeyPatch) -> None:
    roll, pitch = np.array([0.0, 0.4, 0.0, 0.7]), np.array([0.0, 0.0, -0.6, 0.3])
    cosine = np.cos(roll) * np.cos(pitch)
    half = [np.cos(roll / 2), np.sin(roll / 2)], [np.cos(pitch / 2), np.sin(pitch / 2)]
    quaternion = {
        "q[0]": half[0][0] * half[1][0], "q[1]": half[0][1] * half[1][0],
        "q[2]": half[0][0] * half[1][1], "q[3]": -half[0][1] * half[1][1],
    }  # fmt: skip
    found = phases.tilt(_log(vehicle_attitude=quaternion))
    assert found is not None
    assert_close(found[1], np.arccos(cosine), atol=1e-7, why="near one")
    assert phases.tilt(_log()) is None
    assert phases.tilt(_log(vehicle_attitude={"q[2]": roll})) is None
    upside = phases.tilt(_log(vehicle_attitude={"q[1]": np.ones(4), "q[2]": np.full(4, 1e-9)}))
    assert upside is not None
    assert_close(upside[1], np.full(4, np.pi), atol=1e-6, why="upside down")
    log = _log()
    log.__dict__["kind"] = "ardupilot"
    time_s = 1.0 * np.arange(4)
    signals = {
        "phi": Signal("phi", time_s, roll, "rad", "ATT.Roll"),
        "theta": Signal("theta", time_s + 0.5, pitch, "rad", "ATT.Pitch"),
    }
    monkeypatch.setattr(phases, "find", lambda _, name: signals.get(name))
    found = phases.tilt(log)
    assert found is not None
    at = np.interp(time_s, time_s + 0.5, pitch)
    assert_close(found[1], np.arccos(np.cos(roll) * np.cos(at)), rtol=1e-12, why="rounding")
    del signals["theta"]
    assert phases.tilt(log) is None


def test_a_vehicle_that_lies_tilted_without_thrust_has_fallen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log: Any = SimpleNamespace(vehicle="copter")
    for lies, thrust, vehicle, told in (
        (0.53, 0.0, "copter", 6.0), (0.51, 0.0, "copter", None), (0.53, 0.3, "copter", None),
        (0.53, 0.0, "plane", None),
    ):  # fmt: skip
        angle = np.interp(TENTHS, [0.0, 6.0, 6.5], [0.1, 0.349, lies])
        monkeypatch.setattr(phases, "tilt", lambda _, a=angle: (TENTHS, a))
        log.vehicle = vehicle
        carrying = Signal("thrust", TENTHS, np.where(TENTHS < 6.0, 0.4, thrust), "1", "t")
        found = phases._tip_over(log, carrying, 0.2)
        assert found == (None if told is None else pytest.approx(told)), (lies, thrust)
    monkeypatch.setattr(phases, "tilt", lambda _: (TENTHS, np.full(101, 0.6)))
    log.vehicle = "copter"
    idle = Signal("thrust", TENTHS, np.zeros(101), "1", "t")
    assert phases._tip_over(log, idle, 0.2) == 0.0  # It lay from the beginning.
    monkeypatch.setattr(phases, "tilt", lambda _: (TENTHS, 0.6 + 0.11 * TENTHS))
    assert phases._tip_over(log, idle, 0.2) is None  # It still moves.
    monkeypatch.setattr(phases, "tilt", lambda _: None)
    assert phases._tip_over(log, idle, 0.2) is None


def _actuators(*motors: list[float], low: float = 1100.0, high: float = 1900.0) -> Actuators:
    values = np.array(motors, np.float32)
    names = tuple(f"C{k + 1}" for k in range(len(motors)))
    return Actuators("RCOU", names, 1.0 * np.arange(values.shape[1]), values, low, high)


def test_motors_ran_where_five_samples_of_one_lie_above_a_hundredth() -> None:
    up, down = 1108.1, 1107.9
    assert _actuators([up] * 5 + [1000.0]).ran
    assert not _actuators([up] * 4 + [down]).ran
    assert not _actuators([up] * 4 + [1000.0], [1000.0] * 4 + [up]).ran
    log: Any = SimpleNamespace(vehicle="copter")
    mean = phases._mean_motor(log, _actuators([1100.0, 1500.0], [1300.0, 1900.0]))
    assert mean is not None
    assert_close(mean.values, [0.125, 0.75], rtol=1e-9, why="shares of 800 us")
    assert mean.label == "mean of RCOU"
    assert phases._mean_motor(log, _actuators([1100.0])) is None
    assert phases._mean_motor(SimpleNamespace(vehicle="plane"), _actuators([1.0, 2.0])) is None  # type: ignore[arg-type]


def test_limits_of_motors_are_those_of_parameters() -> None:
    table = {f"C{k}": np.full(4, 1000.0 + 100.0 * k) for k in range(1, 15)}
    log = _log(RCOU=table)
    assert _ardupilot(_log()) is None
    assert _ardupilot(log) is None
    functions = {"SERVO1_FUNCTION": 33.0, "SERVO2_FUNCTION": 32.0, "SERVO3_FUNCTION": 41.0}
    log.parameters.update(functions | {"SERVO14_FUNCTION": 40.0})
    found = _ardupilot(log)
    assert found is not None
    assert found.names == ("C1", "C14")
    assert_close((found.low, found.high), (1150.0, 1950.0), rtol=1e-12, why="1000 to 2000 us")
    log.parameters.update(
        MOT_PWM_MIN=1100.0, MOT_PWM_MAX=1900.0, MOT_SPIN_MIN=0.1, MOT_SPIN_MAX=0.9
    )
    found = _ardupilot(log)
    assert found is not None
    assert_close((found.low, found.high), (1180.0, 1820.0), rtol=1e-12, why="of 800 us")


def test_a_motor_is_at_its_limit_within_half_a_hundredth_of_its_range() -> None:
    motor = _actuators([1103.9, 1104.1, 1500.0, 1895.9, 1896.1, 1900.0, 1000.0])
    low, high = _motors(motor, ((0.5, 5.5),))
    assert (low.what, low.limit, high.limit) == (
        "RCOU.C1",
        "lower limit 1100",
        "upper limit 1900",
    )
    assert low.time_s.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert low.touched.tolist() == [False] * 5
    assert high.touched.tolist() == [False, False, False, True, True]
    low, _ = _motors(motor, ((0.0, 9.0),))
    assert low.touched.tolist() == [True, *[False] * 5, True]
    assert list(_motors(motor, ((20.0, 30.0),))) == []
    assert list(_motors(None, ((0.0, 9.0),))) == []


def test_contacts_closer_than_what_is_apart_are_one() -> None:
    time_s = np.array([0.0, 1.0, 2.0, 4.5, 5.0, 9.0])
    touched = np.array([True, True, False, True, False, True])
    contact = LimitContact("m", "upper", time_s, touched)
    assert contact.spans(3.5) == [(0.0, 4.5), (9.0, 9.0)]
    assert contact.spans(3.4) == [(0.0, 1.0), (4.5, 4.5), (9.0, 9.0)]
    assert LimitContact("m", "upper", time_s, np.zeros(6, np.bool_)).spans(1.0) == []


def test_commands_are_cut_where_the_mixer_cuts_them() -> None:
    log: Any = SimpleNamespace(kind="betaflight", parameters={})
    assert _command_limit(log, "roll") == (1.0, "mixer limit 1")
    for most, found in (
        (0.0, (1.0, "mixer limit 1")), (500.0, (0.5, "limit pidsum_limit 500")),
        (999.0, (0.999, "limit pidsum_limit 999")), (1000.0, (1.0, "mixer limit 1")),
    ):  # fmt: skip
        log.parameters = {"pidsum_limit": most, "pidsum_limit_yaw": 400.0}
        assert _command_limit(log, "pitch") == found
    assert _command_limit(log, "yaw") == (0.4, "limit pidsum_limit_yaw 400")
    log.kind = "inav"
    assert _command_limit(log, "yaw") == (1.0, "mixer limit 1")


def test_what_was_at_a_limit_is_told_most_first(monkeypatch: pytest.MonkeyPatch) -> None:
    time_s = 1.0 * np.arange(1000)
    values = np.where(time_s < 100, 0.996, 0.994)
    signals = {
        "tau_phi": Signal("tau_phi", time_s, values, "1", "ROut"),
        "tau_theta": Signal("tau_theta", time_s, np.full(1000, 5.0), "N m", "POut"),
        "p": Signal("p", time_s, np.where(time_s < 300, -34.21, 34.19), "rad/s", "R"),
    }
    monkeypatch.setattr(saturation, "find", lambda _, name: signals.get(name))
    log = _log(VIBE={"Clip": np.array([0.0, 0.0, 2.0, 2.0])})
    found = saturations(log, ((-1.0, 999.0),), _actuators([1900.0, 1500.0, 1500.0, 1500.0]))
    assert [(each.what, each.limit, each.axis) for each in found] == [
        ("VIBE.Clip", "accelerometer range", ""),
        ("R", "gyroscope range 2000 deg/s", ""),
        ("RCOU.C1", "upper limit 1900", ""),
        ("ROut", "mixer limit 1", "roll"),
    ]
    assert_close([each.share for each in found], [1 / 3, 0.3, 0.25, 0.1], rtol=1e-9, why="counts")


def test_blocks_of_stamps_meet_without_losing_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stamps, "BLOCK", 4)
    for count in range(12):
        time_s = 1.0 * np.arange(count)
        steps = np.concatenate([np.diff(part) for part in stamps._parts(time_s)] or [[]])
        assert steps.size == max(count - 1, 0)
        assert stamps.believable(time_s).all()
        for place in range(1, count):
            late = time_s + 2.0 * (time_s >= place)
            assert stamps.longer_steps(late, 2.5) == [(place - 1.0, place + 2.0)]
            same = time_s.copy()
            same[place] = same[place - 1]
            assert not stamps._are_all_believable(same)


def test_stamps_far_from_the_middle_are_not_believed() -> None:
    """98 % of them span 98 s: a fifth of that and a second lie to either side."""
    time_s = np.r_[0.0, 100.0 + np.arange(99.0), 0.0]
    low, high = time_s[1], time_s[-2]
    for first, good in ((79.5, True), (79.3, False)):
        time_s[0] = first
        time_s[-1] = high + 1.0
        assert stamps._are_all_believable(time_s) is good
        assert stamps.believable(time_s)[0] == good
    time_s[0] = low - 1.0
    for last, good in ((218.5, True), (218.7, False)):
        time_s[-1] = last
        assert stamps._are_all_believable(time_s) is good
    assert stamps._limits(0.0, 1e6) == (-2e5 - 1.0, 1.2e6 + 1.0)
    assert stamps._limits(0.0, 1e6 + 1.0) == (np.inf, -np.inf)


def test_the_span_of_a_log_is_of_its_longest_believable_message() -> None:
    def info(name: str, count: int, rate: float | None = 1.0, places: tuple[int, ...] = ()) -> Any:
        return SimpleNamespace(name=name, count=count, rate_hz=rate, instances=places)

    tables = {("A", None): [5.0], ("B", 3): [1.0, 2.0, 9.0], ("C", None): [0.0, 50.0]}
    told = [info("A", 9), info("B", 7, places=(3, 4)), info("C", 3), info("D", 99, None)]
    log: Any = SimpleNamespace(
        messages={each.name: each for each in told},
        table=lambda name, place: SimpleNamespace(time_s=np.array(tables[name, place])),
    )
    assert stamps.log_span(log) == (1.0, 9.0)
    log.messages = {"A": told[0]}
    assert stamps.log_span(log) == (0.0, 0.0)


def test_spans_of_injected_runs_are_asked_for_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, tuple[float, float]]] = []
    for name, found in (
        ("_chirped", [FoundExcitation("chirp", "roll", 1.0, 9.0, "")]),
        ("_autotune", [FoundExcitation("autotune", "yaw", 40.0, 45.0, "")]),
    ):
        monkeypatch.setattr(excitation_found, name, lambda _, f=found: f)
    monkeypatch.setattr(excitation_found, "find", lambda *_: None)

    def moved(_: Any, axis: str, span: tuple[float, float], *__: str) -> FoundExcitation | None:
        asked.append((axis, span))
        return FoundExcitation("pilot", axis, *span, "") if axis == "yaw" else None

    monkeypatch.setattr(excitation_found, "_motion", moved)
    log: Any = SimpleNamespace(sid_runs=(), vehicle="copter", events=())
    spans = ((0.0, 1.0), (0.5, 1.1), (8.9, 20.0), (9.0, 40.0), (20.0, 30.0), (44.0, 60.0))
    made = excitation_found.excitations(log, spans)
    kept = (spans[0], spans[3], spans[4])
    assert asked == [(axis, span) for axis in ("roll", "pitch", "yaw") for span in kept]
    assert [each.kind for each in made] == ["chirp", "autotune", "pilot", "pilot", "pilot"]


def test_a_signal_diverges_from_its_set_point_or_its_middle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[np.ndarray] = []
    monkeypatch.setattr(divergence, "_grown", lambda _t, error, _w: seen.append(error))
    values = 5.0 + np.sin(TENTHS)
    assert divergence.divergence(TENTHS, values) is None
    assert_close(seen[0], values - np.median(values), rtol=1e-12, why="its middle")
    assert divergence.divergence(TENTHS, values, 0.5 * TENTHS) is None
    assert_close(seen[-1], values - 0.5 * TENTHS, rtol=1e-12, why="its set-point")
