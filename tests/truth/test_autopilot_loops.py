"""Linear views of the autopilots' controllers against their own recursions, gain by gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightid.control.autopilots import AUTOPILOTS, AXES, AxisLoop, axis_loop
from flightid.control.autopilots.filter_stages import pole_stage
from flightid.control.autopilots.gyro_notches import ardupilot_notches, px4_notches
from flightid.control.gyro import Gyro
from flightid.logs.blackbox.firmware import BLACKBOX
from tests.closeness import assert_close
from tests.examples import examples

N, AT = 1 << 14, 40
LOOP_HZ = 400.0
GAIN_ROLES = ("p", "i", "d", "ff", "d_ff")
FILTERS = {
    "fltt": (0.0, 60.0),
    "flte": (0.0, 60.0),
    "fltd": (0.0, 80.0),
    "gyro_filter": (0.0, 150.0),
    "derivative_filter": (0.0, 90.0),
    "output_cutoff": (0.0, 20.0),
}


def _random_loop(autopilot: str, axis: str, rng: np.random.Generator, per_loop: int) -> AxisLoop:
    """A loop with random gains and filters (each off in one of four cases), limits out of reach."""
    loop = axis_loop(autopilot, axis, loop_rate_hz=LOOP_HZ, gyro_rate_hz=LOOP_HZ * per_loop)
    values = dict(loop.values)
    for role in values:
        if role in GAIN_ROLES:
            values[role] *= rng.uniform(0.2, 3.0)
            values[role] += rng.uniform(0.0, 0.01)
        elif role in FILTERS:
            low, high = FILTERS[role]
            values[role] = 0.0 if rng.random() < 0.25 else rng.uniform(low + 1.0, high)
    values |= {key: 0.0 for key in ("pdmx", "smax") if key in values}
    values |= {key: 1e9 for key in ("imax", "int_limit") if key in values}
    if "ilmi" in values and rng.random() < 0.5:
        values["ilmi"] = 0.0
    changes: dict[str, object] = {"values": values}
    if autopilot in BLACKBOX:
        values |= {key: rng.uniform(20.0, 150.0) for key in ("p_filter",) if key in values}
        stage = pole_stage("D", rng.uniform(30, 90), "derivative", LOOP_HZ, order=2)
        shares = (rng.uniform(0.5, 1.0), rng.uniform(0.5, 1.0))
        changes |= {"stages": (stage,), "throttle_shares": shares}
        if autopilot == "inav":
            changes["set_point_filter"] = pole_stage("CD", 40.0, "target", LOOP_HZ, order=3)
            changes["relax"] = None
        return replace(loop, **changes)
    notch = (rng.uniform(20, 90), rng.uniform(0.7, 4.0), rng.uniform(5, 45))
    if autopilot.startswith("ardu"):
        changes |= {"target_notch": notch, "error_notch": (rng.uniform(20, 90), 2.0, 30.0)}
        sections = ardupilot_notches(_harmonic_notch(rng), loop.gyro_rate_hz).sections
    else:
        fixed = {"IMU_GYRO_NF0_FRQ": notch[0], "IMU_GYRO_NF0_BW": 20.0}
        sections = px4_notches(fixed, loop.gyro_rate_hz).sections
        changes["old"] = autopilot == "px4_multicopter" and rng.random() < 0.3
    changes["gyro_notches"] = sections
    if autopilot in ("arduplane", "px4_fixed_wing"):
        changes["airspeed_scale"] = rng.uniform(0.6, 1.6)
    if autopilot == "arduplane":
        changes["eas2tas"] = rng.uniform(1.0, 1.3)
    return replace(loop, **changes)


def _harmonic_notch(rng: np.random.Generator) -> dict[str, float]:
    return {
        "INS_HNTCH_ENABLE": 1.0,
        "INS_HNTCH_MODE": 0.0,
        "INS_HNTCH_FREQ": rng.uniform(40, 80),
        "INS_HNTCH_BW": 30.0,
        "INS_HNTCH_ATT": 40.0,
        "INS_HNTCH_HMNCS": float(rng.integers(1, 8)),
        "INS_HNTCH_OPTS": float(rng.choice([0, 1, 16])),
    }


def _measured(
    loop: AxisLoop, omega: np.ndarray, *, of: str, per_loop: int, gyro: Gyro
) -> np.ndarray:
    """Response from the impulse response of the exact recursion in double precision.

    The integrator keeps the impulse for ever, so the difference of the response is transformed, and
    the transform divided by that of the difference. A raw gyro sample is pulsed at each place
    within a loop: the tone's response is the sum over them, each with its own phase.
    """
    k = np.arange(N)
    total = np.zeros(omega.size, dtype=complex)
    places = per_loop if of == "rate" else 1
    size = 1e-5  # far below 400 deg/s, where PX4's integrator is linear to (1e-5/7)² = 2e-12
    for place in range(places):
        setpoint, rate = np.zeros(N), np.zeros(N * per_loop)
        if of == "rate":
            rate[AT * per_loop + place] = size
        else:
            setpoint[AT] = size
        output = loop.run(setpoint, rate, gyro=gyro, single_precision=False).output
        steps = np.diff(output, prepend=0.0) / size
        kernel = np.exp(-1j * np.outer(omega, k - AT) / LOOP_HZ) @ steps
        # A loop takes the last gyro sample of its group.
        late = (per_loop - 1 - place) / loop.gyro_rate_hz
        total += kernel * np.exp(-1j * omega * late) if of == "rate" else kernel
    return total / (1 - np.exp(-1j * omega / LOOP_HZ))


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
@examples(6)
@given(seed=st.integers(0, 2**32 - 1), axis=st.sampled_from(AXES), per_loop=st.sampled_from([1, 3]))
def test_feedback_and_forward_are_the_recursions_own(
    autopilot: str, seed: int, axis: str, per_loop: int
) -> None:
    rng = np.random.default_rng(seed)
    gyro: Gyro = "raw"
    if autopilot in BLACKBOX:  # its gyro filters are the firmware's own
        gyro, per_loop = "filtered", 1
    loop = _random_loop(autopilot, axis, rng, per_loop)
    omega = np.geomspace(2.0, 0.95 * np.pi * LOOP_HZ, 9)
    for of, linear in (
        ("rate", -loop.feedback(omega, gyro=gyro, with_hold=False)),
        ("setpoint", loop.forward(omega, with_hold=False)),
    ):
        exact = _measured(loop, omega, of=of, per_loop=per_loop, gyro=gyro)
        why = f"{of} of {loop}: one is the transform of the other"
        assert_close(exact, linear, atol=1e-9 * np.abs(exact).max(), why=why)


def test_hold_and_delay_follow_their_closed_forms() -> None:
    omega = np.array([3.0, 50.0, 400.0])
    loop = replace(axis_loop("arducopter", "roll", loop_rate_hz=LOOP_HZ), computation_delay_s=1e-3)
    ratio = loop.feedback(omega) / loop.feedback(omega, with_hold=False)
    hold = (1 - np.exp(-1j * omega / LOOP_HZ)) / (1j * omega / LOOP_HZ)
    assert_close(ratio, hold * np.exp(-1j * omega * 1e-3), rtol=1e-12, why="held for one loop")
    ratio = loop.forward(omega) / loop.forward(omega, with_hold=False)
    assert_close(ratio, hold * np.exp(-1j * omega * 1e-3), rtol=1e-12, why="same for set-points")
    assert_close(
        loop.angle(omega), 4.5 * np.exp(-1j * omega / LOOP_HZ), rtol=1e-12, why="one loop late"
    )


def test_continuous_limit_is_the_textbook_pid() -> None:
    # At 100 kHz the discrete controller is C(s) = L_E (P + I/s + D s L_D).
    loop = axis_loop("arducopter", "roll", loop_rate_hz=1e5).with_gains(ATC_RAT_RLL_FLTE=30.0)
    omega = np.geomspace(0.1, 300.0, 12)
    s = 1j * omega
    low_pass = {f: 1 / (1 + s / (2 * np.pi * f)) for f in (20.0, 30.0)}
    expected = low_pass[30.0] * (0.135 + 0.135 / s + 0.0036 * s * low_pass[20.0])
    found = loop.feedback(omega, gyro="filtered", with_hold=False)
    assert_close(found, expected, rtol=2e-3, why="time steps of 10 µs")


@pytest.mark.parametrize("autopilot", AUTOPILOTS)
def test_basis_carries_the_gains(autopilot: str) -> None:
    loop = axis_loop(autopilot, "pitch", loop_rate_hz=LOOP_HZ)
    omega = np.geomspace(1.0, 200.0, 5)
    terms, names = loop.basis(omega)
    changed = {name: 0.1 * (place + 1) for place, name in enumerate(names)}
    total = sum(changed[name] * term for name, term in zip(names, terms, strict=True))
    found = loop.with_gains(changed).feedback(omega)
    assert_close(found, total, rtol=1e-12, why="feedback is linear in these gains")
    terms, names = loop.forward_basis(omega)
    shared = set(loop.basis(omega)[1]) - {loop.names["d"]}
    assert set(names) >= shared
    assert (set(names) == shared) is (autopilot == "betaflight"), "whose feed-forward is on sticks"
    gains = loop.gains
    total = sum(gains[name] * term for name, term in zip(names, terms, strict=True))
    assert_close(loop.forward(omega), total, rtol=1e-12, why="and so is the forward path")
