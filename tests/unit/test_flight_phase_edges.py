"""When a vehicle flew, at both sides of every limit: signals are made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid.inspection import flight_phases as phases
from flightid.inspection.actuators import Actuators
from flightid.inspection.signals import Signal
from tests.handmade_log import HandmadeLog

TENTHS = np.round(np.arange(0.0, 20.0, 0.1), 10)


def signal(values: np.ndarray, stamps: np.ndarray = TENTHS, name: str = "thrust") -> Signal:
    return Signal(name, stamps, values, "1" if name == "thrust" else "m/s", f"T.{name}")


def test_runs_of_true_samples_and_what_joins_them() -> None:
    time = np.arange(10.0)
    for true, longest, spans in (
        ((0, 1, 3, 4, 9), 2.0, [(0, 1), (3, 4), (9, 9)]),
        ((0, 1, 3, 4, 9), 2.1, [(0, 4), (9, 9)]),
        ((0, 1, 3, 4, 9), 5.1, [(0, 9)]),
        ((0, 4, 6), 2.1, [(0, 0), (4, 6)]),
        ((5,), 1.0, [(5, 5)]),
        ((), 1.0, []),
        (range(10), 1.0, [(0, 9)]),
    ):
        mask = np.isin(np.arange(10), list(true))
        assert phases._runs(time, mask, longest) == spans


def test_a_silence_ends_a_span_from_a_second_or_two_and_a_half_usual_steps_on() -> None:
    for step, silence, count in ((0.1, 0.95, 1), (0.1, 1.05, 2), (1.0, 2.45, 1), (1.0, 2.55, 2)):
        before = np.arange(8) * step
        stamps = np.concatenate([before, before[-1] + silence + before])
        spans = phases._spans(stamps, np.ones(16, bool))
        ends = [(0.0, stamps[-1])] if count == 1 else [(0.0, before[-1]), (stamps[8], stamps[-1])]
        assert spans == ends
    assert phases._spans(np.array([3.0]), np.array([True])) == [(3.0, 3.0)]
    assert phases._spans(np.array([3.0, 3.5]), np.array([True, True])) == [(3.0, 3.5)]
    assert phases._spans(np.array([0.0, 0.5, 1.4, 3.0]), np.array([1, 0, 1, 0], bool)) == [
        (0.0, 0.0),
        (1.4, 1.4),
    ]
    assert phases._common([(0.0, 4.0), (6.0, 9.0)], [(3.0, 7.0), (9.0, 12.0)]) == [
        (3.0, 4.0),
        (6.0, 7.0),
    ]


def test_what_carries_is_half_of_the_median_in_use_or_a_twentieth() -> None:
    for values, limit in (
        ([0.0, 0.05, 0.4, 0.6], 0.25),
        ([0.06, 0.08], 0.05),
        ([0.05, 0.04], 0.05),
        ([0.3] * 3 + [0.9], 0.15),
    ):
        assert phases._carrying_throttle(np.array(values)) == pytest.approx(limit)


def test_states_last_until_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    log: Any = None
    at, up = np.array([0.35, 0.75]), np.array([True, False])
    for span, size in (((0.0, 1.05), 10), ((5.0, 5.05), 2), ((0.0, 1e9), 1_000_000)):
        monkeypatch.setattr(phases, "log_span", lambda _, span=span: span)
        found = phases._held(log, at, up)
        assert found is not None
        assert (found[0].size, found[0][0], found[0][-1]) == (size, *span)
    monkeypatch.setattr(phases, "log_span", lambda _: (0.0, 1.0))
    for first in (True, False):
        found = phases._held(log, at, np.array([first, not first]))
        assert found is not None
        known = [first if 0.35 <= t < 0.75 else not first for t in np.linspace(0.0, 1.0, 10)]
        assert found[1].tolist() == known
    assert phases._held(log, at[:0], up[:0]) is None


def test_the_landing_detector_of_either_autopilot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(phases, "_held", lambda _, *states: states)
    copter = HandmadeLog("ardupilot").with_table("EV", [1.0, 2.0, 3.0], Id=np.array([28, 10, 18]))
    stamps, up = phases.landing_detector(copter.log)  # type: ignore[misc]
    assert (stamps.tolist(), up.tolist()) == ([1.0, 3.0], [True, False])
    landed = HandmadeLog("ardupilot").with_table("EV", [1.0, 2.0], Id=np.array([18, 10]))
    assert phases.landing_detector(landed.log) is None
    assert phases.landing_detector(HandmadeLog("ardupilot").log) is None
    stream = "vehicle_land_detected"
    px4 = HandmadeLog("px4").with_table(stream, [1.0, 2.0, 3.0], landed=np.array([1, 0, 1]))
    stamps, up = phases.landing_detector(px4.log)  # type: ignore[misc]
    assert (stamps.tolist(), up.tolist()) == ([1.0, 2.0, 3.0], [False, True, False])
    assert phases.landing_detector(HandmadeLog("px4").log) is None
    assert phases.landing_detector(HandmadeLog("px4").with_table(stream, [1.0], x=[0]).log) is None


def test_the_tilt_is_the_angle_of_the_z_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    stream, angle = "vehicle_attitude", np.array([0.0, 0.4, 2.5, np.nan])
    for turned, other in (("q[1]", "q[2]"), ("q[2]", "q[1]")):
        columns = {turned: np.sin(angle / 2.0), other: np.zeros(4)}
        px4 = HandmadeLog("px4").with_table(stream, np.arange(4.0), **columns)
        stamps, found = phases.tilt(px4.log)  # type: ignore[misc]
        assert stamps.tolist() == [0.0, 1.0, 2.0]
        assert found == pytest.approx(angle[:3], abs=1e-7)
    both = {"q[1]": np.array([0.5]), "q[2]": np.array([0.5])}
    (found,) = phases.tilt(HandmadeLog("px4").with_table(stream, [0.0], **both).log)[1:]  # type: ignore[index]
    assert found[0] == pytest.approx(np.pi / 2.0)
    # A quaternion longer than one is not beyond upside down.
    long = {"q[1]": np.array([1.1]), "q[2]": np.array([0.0])}
    (found,) = phases.tilt(HandmadeLog("px4").with_table(stream, [0.0], **long).log)[1:]  # type: ignore[index]
    assert found[0] == pytest.approx(np.pi)
    assert phases.tilt(HandmadeLog("px4").log) is None
    assert phases.tilt(HandmadeLog("px4").with_table(stream, [0.0], x=[0]).log) is None
    held = {
        "phi": signal(0.02 * TENTHS, name="phi"),
        "theta": signal(np.array([0.3, 0.3]), np.array([0.0, 20.0]), "theta"),
    }
    monkeypatch.setattr(phases, "find", lambda _, name: held.get(name))
    copter = HandmadeLog("ardupilot").log
    stamps, found = phases.tilt(copter)  # type: ignore[misc]
    assert found == pytest.approx(np.arccos(np.cos(0.02 * TENTHS) * np.cos(0.3)), abs=1e-9)
    held.pop("theta")
    assert phases.tilt(copter) is None


def fallen(
    angle: float = 0.6, drift: float = 0.0, rest_s: float = 1.3, thrust: float = 0.0
) -> float | None:
    """Upright to 10 s, falls in one second, lies so long; thrust as told once it lies."""
    stamps = TENTHS[11.0 + rest_s >= TENTHS]
    path = np.interp(stamps, [10.0, 11.0, 31.0], [0.0, angle, angle + 20.0 * drift])
    gas = np.where(stamps < 10.5, 0.5, thrust)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(phases, "tilt", lambda _: (stamps, path))
        return phases._tip_over(HandmadeLog("ardupilot").log, signal(gas, stamps), 0.25)


def test_what_lies_still_and_tilted_without_thrust_has_fallen() -> None:
    assert fallen() == pytest.approx(10.5)
    assert fallen(angle=1.4) == pytest.approx(10.2)
    for either, kept in (
        ({"angle": 0.53}, True),
        ({"angle": 0.51}, False),
        ({"drift": 0.09}, True),
        ({"drift": 0.11}, False),
        ({"rest_s": 1.3}, True),
        ({"rest_s": 1.0}, False),
        ({"thrust": 0.24}, True),
        ({"thrust": 0.26}, False),
    ):
        assert (fallen(**either) is not None) is kept, either
    # Down, up again and down once more: the first fall counts.
    twice = [*[0.0] * 9, *[0.6] * 30, *[0.0] * 30, *[0.6] * 30]
    for path, found in (([0.6] * 30, 0.0), ([0.6, 0.6], None), (twice, 0.8)):
        lying = (TENTHS[: len(path)], np.array(path))
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(phases, "tilt", lambda _, lying=lying: lying)
            log = HandmadeLog("ardupilot").log
            assert phases._tip_over(log, signal(np.zeros(len(path)), lying[0]), 0.25) == found
            log.vehicle = "plane"
            assert phases._tip_over(log, signal(np.zeros(len(path)), lying[0]), 0.25) is None


def long_log(kind: str = "ardupilot", vehicle: str = "copter") -> Any:
    """A minute that holds something, but nothing of flight."""
    return HandmadeLog(kind, vehicle, duration_s=60.0).with_table("BARO", [0.0], Alt=[1.0]).log


def told(tipped: float | None = None, vehicle: str = "copter", **held: Signal) -> Any:
    """Phases of a log of these signals that fell then."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(phases, "find", lambda _, name: held.get(name))
        patched.setattr(phases, "_tip_over", lambda *_: tipped)
        return phases.flight_phases(long_log(vehicle=vehicle), None)


def test_the_air_is_where_throttle_or_speed_carries() -> None:
    gas = signal(np.where((TENTHS >= 2.0) & (TENTHS <= 12.0), 0.5, 0.1))
    found = told(thrust=gas)
    assert (found.airborne, found.airborne_s, found.evidence) == (
        ((2.0, 12.0),),
        10.0,
        "T.thrust above 0.25",
    )
    assert (found.is_known, found.airborne_words, found.fall) == (True, "10.0 s", "")
    for end, kept in ((4.0, ((2.0, 4.0),)), (3.9, ())):
        hop = signal(np.where((TENTHS >= 2.0) & (end >= TENTHS), 0.5, 0.04))
        assert told(thrust=hop).airborne == kept
    speed = signal(np.where((TENTHS >= 5.0) & (TENTHS <= 9.0), 6.1, 6.0), name="airspeed")
    plane = told(vehicle="plane", airspeed=speed, thrust=gas)
    assert (plane.airborne, plane.evidence) == (((5.0, 9.0),), "T.airspeed above 6 m/s")
    # The fall: in flight, soon after the throttle went down, later, and before take-off.
    for tipped, airborne, is_told in (
        (8.0, ((2.0, 8.0),), True),
        (16.9, ((2.0, 12.0),), True),
        (17.0, ((2.0, 12.0),), False),
        (2.0, ((2.0, 12.0),), False),
    ):
        found = told(tipped, thrust=gas)
        assert found.airborne == airborne
        assert (found.tipped_s == tipped, found.evidence.endswith(", attitude")) == (is_told,) * 2
    assert told(8.0, thrust=gas).fall == (
        "the vehicle falls over at 8.0 s of the autopilot's clock"
    )


def test_a_landing_detector_tells_alone() -> None:
    up = np.where((TENTHS >= 3.0) & (TENTHS <= 7.0), True, False)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(phases, "find", lambda *_: None)
        patched.setattr(phases, "landing_detector", lambda _: (TENTHS, up))
        found = phases.flight_phases(long_log(), None)
    assert (found.airborne, found.evidence) == (((3.0, 7.0),), "landing detector")


def test_motors_that_never_ran_and_logs_that_tell_nothing() -> None:
    still: Any = SimpleNamespace(ran=False)
    found = phases.flight_phases(HandmadeLog("ardupilot").log, still)
    assert (found.airborne, found.motors_ran, found.evidence) == ((), False, "motor outputs")
    nothing = told()
    assert (nothing.is_known, nothing.airborne_words, nothing.airborne) == (False, "not known", ())
    assert nothing.action == (
        "log the throttle (CTUN) or the outputs (RCOU) with the parameters (PARM)"
    )
    px4 = phases._untold(long_log("px4"), None)
    assert (px4.action, px4.is_known) == ("log the throttle or the motors' outputs as well", False)
    assert phases._untold(HandmadeLog("px4").log, None).is_known is False
    assert "before anything was measured" in phases._untold(HandmadeLog("px4").log, None).evidence
    outputs = long_log().with_table("RCOU", [0.0], C1=[1500.0])
    beginning = phases._untold(outputs, None)
    assert beginning.action.startswith("keep the beginning of the log")
    assert beginning.is_known is False


def test_motors_stand_in_for_a_throttle_as_a_share_of_their_range() -> None:
    log = HandmadeLog("ardupilot").log
    values = np.array([[1000.0, 1500.0, 2000.0], [1200.0, 1500.0, 1600.0]])
    motors = Actuators("RCOU", ("C1", "C2"), np.arange(3.0), values, 1000.0, 2000.0)
    found = phases._mean_motor(log, motors)
    assert found is not None
    assert found.values == pytest.approx([0.1, 0.5, 0.8])
    assert (found.unit, found.label, found.name) == ("1", "mean of RCOU", "thrust")
    two = Actuators("RCOU", ("C1",), np.arange(2.0), values[:1, :2], 1000.0, 2000.0)
    one = Actuators("RCOU", ("C1",), np.arange(1.0), values[:1, :1], 1000.0, 2000.0)
    assert phases._mean_motor(log, two) is not None
    assert phases._mean_motor(log, one) is None
    assert phases._mean_motor(log, None) is None
    log.vehicle = "plane"
    assert phases._mean_motor(log, motors) is None
