"""Notches that move and Betaflight's filters against SciPy and against the published formulas."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import signal

import flightid as fid
from flightid.control.autopilots.betaflight_filters import betaflight_filters
from flightid.control.autopilots.filters import sections_response
from flightid.control.autopilots.gyro_notches import ardupilot_notches, px4_notches
from flightid.control.autopilots.notch_tracking import Centre, NotchTracking
from flightid.errors import OptionError
from tests.closeness import assert_close

RATE_HZ = 4000.0
OMEGA = np.geomspace(1.0, 10_000.0, 60)
Array = np.ndarray


def _scipy(b: Array, a: Array) -> Array:
    return signal.freqz(b, a, worN=OMEGA, fs=2 * np.pi * RATE_HZ)[1]


def _ours(stages: tuple) -> Array:
    assert len(stages) == 1
    return stages[0].response(OMEGA)


def _steady(hz: float) -> Centre:
    return Centre(hz, hz, hz)


def _recursion(step: Callable[[float], float], count: int = 40_000) -> Array:
    """Response at OMEGA of a recursion, by its own impulse response."""
    pulse = np.array([step(1.0 if k == 0 else 0.0) for k in range(count)])
    assert abs(pulse[-100:]).max() < 1e-14
    return np.exp(-1j * np.outer(OMEGA, np.arange(count)) / RATE_HZ) @ pulse


def _pt(order: int, cutoff_hz: float) -> Callable[[float], float]:
    """Betaflight's PTn, filter.c, in its own words."""
    omega = 2 * np.pi * cutoff_hz * {1: 1.0, 2: 1.553773974, 3: 1.961459177}[order] / RATE_HZ
    gain, states = omega / (omega + 1.0), [0.0] * order

    def step(value: float) -> float:
        for k in range(order):
            states[k] += gain * (value - states[k])
            value = states[k]
        return value

    return step


@pytest.mark.parametrize("order", [1, 2, 3])
def test_pt_filters_are_the_recursions_of_betaflight(order: int) -> None:
    settings = {"dterm_lpf1_static_hz": 90.0, "dterm_lpf1_type": f"PT{order}"}
    ours = _ours(betaflight_filters(settings, loop_rate_hz=RATE_HZ))
    assert_close(ours, _recursion(_pt(order, 90.0)), atol=1e-9, why="constants of ten digits")


def test_betaflight_biquad_and_notches_are_the_textbook_sections() -> None:
    low_pass = betaflight_filters(
        {"gyro_lpf1_static_hz": 120.0, "gyro_lpf1_type": "BIQUAD"}, loop_rate_hz=RATE_HZ
    )
    theirs = _scipy(*signal.butter(2, 120.0, fs=RATE_HZ))
    assert_close(_ours(low_pass), theirs, atol=1e-11, why="Butterworth, prewarped")
    fixed = betaflight_filters(
        {"gyro_notch1_hz": 300.0, "gyro_notch1_cutoff": 200.0}, loop_rate_hz=RATE_HZ
    )
    # The cook book takes α = sin ω₀/(2Q): a bandwidth of ω₀/Q before the bilinear transform.
    quality = 300.0 * 200.0 / (300.0**2 - 200.0**2)
    theirs = _scipy(*_cook_book(300.0, quality))
    assert_close(_ours(fixed), theirs, atol=1e-11, why="cook-book notch")


def _cook_book(center_hz: float, quality: float) -> tuple[Array, Array]:
    """Notch as the bilinear transform of (s² + 1)/(s² + s/Q + 1), prewarped at its centre."""
    warped = 2 * RATE_HZ * np.tan(np.pi * center_hz / RATE_HZ)
    top, below = [1.0, 0.0, warped**2], [1.0, warped / quality, warped**2]
    return signal.bilinear(top, below, fs=RATE_HZ)


def test_rpm_notches_fade_in_and_out_as_betaflight_does() -> None:
    settings = {
        "rpm_filter_harmonics": 2.0, "rpm_filter_min_hz": 100.0, "rpm_filter_q": 500.0,
        "rpm_filter_fade_range_hz": 50.0, "rpm_filter_weights": "100,60",
    }  # fmt: skip
    motor = 110.0
    ours = _ours(betaflight_filters(settings, loop_rate_hz=RATE_HZ, motors_hz=[motor]))
    expected = np.ones_like(ours)
    for number, weight in ((1, 10.0 / 50.0), (2, 0.6)):
        notch = _scipy(*_cook_book(number * motor, 5.0))
        expected = expected * (weight * notch + 1.0 - weight)
    assert_close(ours, expected, atol=1e-11, why="weight · filtered + (1 − weight) · input")
    parked = betaflight_filters(settings, loop_rate_hz=RATE_HZ, motors_hz=[40.0])
    assert parked == (), "at the least frequency a notch has no weight"


def test_betaflight_filters_stand_in_its_order_and_follow_throttle_and_peaks() -> None:
    settings: dict[str, float | str] = {
        "gyro_lpf2_static_hz": 500.0, "gyro_lpf1_dyn_min_hz": 200.0, "gyro_lpf1_dyn_max_hz": 400.0,
        "gyro_lpf1_dyn_expo": 5.0, "gyro_lpf1_type": 2.0, "dyn_notch_count": 2.0,
        "dyn_notch_q": 300.0, "dterm_lpf1_static_hz": 75.0,
    }  # fmt: skip
    stages = betaflight_filters(
        settings, loop_rate_hz=RATE_HZ, gyro_rate_hz=8000.0, throttle=0.4, peaks_hz=[150, 240, 9]
    )
    assert [s.name for s in stages] == ["gyro_lpf2", "gyro_lpf1", "dyn_notch", "dterm_lpf1"]
    assert [s.rate_hz for s in stages] == [8000.0, RATE_HZ, RATE_HZ, RATE_HZ]
    # 0.4 · 0.6 · 0.5 + 0.4 = 0.52 of the way from 200 to 400 Hz.
    assert stages[1].settings == "PT2 at 304 Hz"
    theirs = _scipy(*_cook_book(150.0, 3.0)) * _scipy(*_cook_book(240.0, 3.0))
    assert_close(stages[2].response(OMEGA), theirs, atol=1e-11, why="one at each peak")


def test_betaflight_refuses_what_it_has_not() -> None:
    with pytest.raises(OptionError, match=r"gyro_lpf1 has no such type.*BESSEL"):
        betaflight_filters(
            {"gyro_lpf1_static_hz": 100.0, "gyro_lpf1_type": "BESSEL"}, loop_rate_hz=RATE_HZ
        )
    with pytest.raises(OptionError, match=r"throttle 1\.5"):
        betaflight_filters({}, loop_rate_hz=RATE_HZ, throttle=1.5)


HARMONIC = {
    "INS_HNTCH_ENABLE": 1.0, "INS_HNTCH_FREQ": 80.0, "INS_HNTCH_BW": 40.0, "INS_HNTCH_ATT": 30.0,
    "INS_HNTCH_HMNCS": 5.0, "INS_HNTCH_REF": 0.25, "INS_HNTCH_FM_RAT": 0.7,
}  # fmt: skip


def _ardupilot(centers: list[float]) -> Array:
    """Product of ArduPilot's notches, NotchFilter.cpp: Q and A are those of FREQ and BW."""
    octaves = np.log2(80.0 / (80.0 - 20.0)) * 2.0
    quality = np.sqrt(2.0**octaves) / (2.0**octaves - 1.0)
    deep = 10 ** (-30.0 / 40.0)
    made = np.ones(OMEGA.size, dtype=complex)
    for center in centers:
        omega = 2 * np.pi * center / RATE_HZ
        alpha = np.sin(omega) / (2 * quality)
        top = np.array([1 + alpha * deep**2, -2 * np.cos(omega), 1 - alpha * deep**2])
        made = made * _scipy(top, np.array([1 + alpha, -2 * np.cos(omega), 1 - alpha]))
    return made


@pytest.mark.parametrize(
    ("mode", "options", "tracking", "first"),
    [
        (1, 0, NotchTracking(throttle=_steady(0.36)), [96.0]),
        (1, 0, NotchTracking(throttle=_steady(0.04)), [56.0]),
        (2, 0, NotchTracking(rotors={0: _steady(400.0)}), [100.0]),
        (5, 0, NotchTracking(rotors={1: _steady(400.0)}), [100.0]),
        (3, 0, NotchTracking(motors=(_steady(360.0), _steady(440.0))), [100.0]),
        (3, 2, NotchTracking(motors=(_steady(90.0), _steady(110.0))), [90.0, 110.0]),
        (4, 0, NotchTracking(centres={0: (_steady(70.0),)}), [70.0]),
    ],
)
def test_ardupilot_notches_stand_where_what_they_follow_puts_them(
    mode: int, options: int, tracking: NotchTracking, first: list[float]
) -> None:
    asked = HARMONIC | {"INS_HNTCH_MODE": float(mode), "INS_HNTCH_OPTS": float(options)}
    found = ardupilot_notches(asked, RATE_HZ, tracking)
    theirs = _ardupilot([number * center for number in (1, 3) for center in first])
    ours = sections_response(found.sections, OMEGA, RATE_HZ)
    assert_close(ours, theirs, atol=1e-11, why="FREQ · max(FM_RAT, √(throttle/REF)), or turns")
    assert found.unknown == ()


def test_notches_that_move_far_or_nowhere_known_are_said() -> None:
    asked = HARMONIC | {"INS_HNTCH_MODE": 3.0}
    moved = ardupilot_notches(asked, RATE_HZ, NotchTracking(motors=(Centre(400.0, 320.0, 560.0),)))
    assert len(moved.sections) == 2
    assert "from 80 to 140 Hz in flight" in moved.unknown[0]
    (said,) = ardupilot_notches(asked | {"INS_HNTCH_MODE": 4.0}, RATE_HZ, NotchTracking()).unknown
    assert "the on-board spectrum in flight, which the log does not tell" in said


def test_px4_dynamic_notches_stand_at_every_harmonic_of_every_motor() -> None:
    parameters = {
        "IMU_GYRO_DNF_EN": 3.0, "IMU_GYRO_DNF_BW": 15.0, "IMU_GYRO_DNF_HMC": 2.0,
        "IMU_GYRO_DNF_MIN": 25.0, "IMU_GYRO_NF0_FRQ": 300.0, "IMU_GYRO_NF0_BW": 30.0,
    }  # fmt: skip
    tracking = NotchTracking(
        motors=(_steady(90.0), _steady(5.0)), peaks={1: (_steady(200.0),)}, peaks_bandwidth_hz=8.0
    )
    found = px4_notches(parameters, RATE_HZ, tracking, axis=1)
    # The second motor is parked: 25 Hz, and half a bandwidth higher for its harmonic.
    at = [(90, 15), (180, 15), (25, 15), (32.5, 15), (200, 8), (300, 30)]
    theirs = np.ones(OMEGA.size, dtype=complex)
    for center, width in at:
        theirs = theirs * _scipy(*signal.iirnotch(center, center / width, fs=RATE_HZ))
    ours = sections_response(found.sections, OMEGA, RATE_HZ)
    assert_close(ours, theirs, atol=1e-9, why="SciPy's notch")


@pytest.mark.parametrize("autopilot", ["arducopter", "arduplane", "px4_multicopter"])
def test_stages_multiply_to_the_controller_s_own_path(autopilot: str) -> None:
    loop = fid.axis_loop(autopilot, "yaw", loop_rate_hz=400.0, gyro_rate_hz=2000.0)
    omega = np.geomspace(2.0, 700.0, 30)
    stages = loop.filter_stages()
    gyro = np.prod([s.response(omega) for s in stages if s.path == "gyro"], axis=0)
    assert_close(gyro, loop.gyro_response(omega), rtol=1e-12, why="all filters of the gyro")
    first = loop.with_gains(dict.fromkeys((n for r, n in loop.names.items() if r in "id"), 0.0))
    p_path = first.feedback(omega, with_hold=False) / first.feedback([1e-9], with_hold=False)[0]
    shared = [s.response(omega) for s in stages if s.path in ("gyro", "error", "output")]
    assert_close(p_path, np.prod(shared, axis=0), rtol=1e-6, why="P passes them and nothing else")
