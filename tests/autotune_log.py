"""Logs of an autotune from a simulator of their own: ArduCopter's twitches, PX4's steps."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from flightid.logs.dataflash.layout import MessageLayout
from flightid.logs.dataflash.writer import DataflashWriter
from tests.strangers.noises import ar1
from tests.strangers.ordinary_flights import Axis, Flown, _biquad, fly
from tests.ulog_builder import UlogBuilder

TARGET_DEG_S, TARGET_DEG, AGGRESSIVENESS, MIN_D = 90.0, 20.0, 0.1, 0.001
WAIT_S = 0.5
"""Of the loop's own run before a twitch; the slowest gust's memory is 0.4 s."""
RATE_D_UP, RATE_D_DOWN, RATE_P_UP = 0, 1, 2
LAYOUTS = (
    MessageLayout("ATUN", 221, "QBBfffffff", "TimeUS,Axis,TuneStep,Targ,Min,Max,RP,RD,SP,ddt",
                  "s--ddd---o", "F--000---0"),
    MessageLayout("ATDE", 222, "Qff", "TimeUS,Angle,Rate", "sdk", "F00"),
)  # fmt: skip
PARAMETERS = {
    "SCHED_LOOP_RATE": 400.0, "INS_GYRO_FILTER": 40.0, "FRAME_CLASS": 1.0, "AUTOTUNE_MIN_D": MIN_D,
    "AUTOTUNE_AXES": 1.0,
    **{f"ATC_RAT_{axis}_{k}": v for axis in ("RLL", "PIT", "YAW")
       for k, v in (("FLTD", 20.0), ("FLTT", 20.0), ("IMAX", 0.5))},
    **{f"ATC_ANG_{axis}_P": 4.5 for axis in ("RLL", "PIT", "YAW")},
}  # fmt: skip


@dataclass(frozen=True)
class Tuned:
    """Gains that the simulated autotune ended with, and its tests."""

    p: float
    d: float
    tests: int


def _twitch(
    axis: Axis, random: np.random.Generator, sign: float, *, held: bool
) -> tuple[Flown, int, float, float]:
    """One rate twitch until the vehicle leans 20°, with what it measures, deg/s.

    The loop, its gyro noise and the air run before it, as they do in flight: what the twitch begins
    with is nowhere in the log. Held level, it starts from the rate that was seen.
    """
    before, n = round(WAIT_S * axis.loop_hz), 400
    wanted = np.zeros(before + n)
    wanted[before:] = sign * np.radians(TARGET_DEG_S)
    noise = axis.noise * random.standard_normal(before + n)
    air = axis.gust * ar1(random, before + n, np.exp(-1.0 / (axis.loop_hz * axis.gust_s)))
    level, at = (np.zeros(before + n), before) if held else (None, None)
    whole = fly(axis, level, wanted, air, noise, twitch_at=at)
    flown = Flown(*(getattr(whole, each.name)[before:] for each in fields(whole)))
    flown = replace(
        flown, time_s=flown.time_s - flown.time_s[0], angle=flown.angle - flown.angle[0]
    )
    leaned = np.flatnonzero(np.abs(flown.angle) >= np.radians(TARGET_DEG))
    stop = int(leaned[0]) if leaned.size else n
    rate = sign * np.degrees(flown.rate[:stop])
    top = int(np.argmax(rate))
    return flown, stop, float(rate.max()), float(rate[top:].min())


def write_ardupilot(
    path: Path,
    axis: Axis,
    *,
    events: tuple[int, ...] = (33, 37),
    most: int = 60,
    seed: int = 1,
    trim: float = 0.0,
    jitter_s: float = 0.0,
    held: bool = False,
) -> Tuned:
    """Tune P and D of roll as AC_AutoTune_Multi does, and log it as the firmware would.

    `trim` holds the vehicle still; stamps scatter by `jitter_s` about the ticks of the loop. Where
    it is held, attitude is until a twitch, which starts from the rate that is seen then.
    """
    stamping = np.random.default_rng([seed, 1])
    random, writer = np.random.default_rng(seed), DataflashWriter()
    for layout in LAYOUTS:
        writer.define(layout)
    writer.message(1_000_000, "ArduCopter V4.6.0 (test)")
    gains = {"P": axis.p, "I": axis.i, "D": axis.d}
    for name, value in {**PARAMETERS, "INS_GYRO_FILTER": axis.gyro_hz}.items():
        writer.parameter(name, value)
    for letters in ("RLL", "PIT", "YAW"):
        for name, value in gains.items():
            writer.parameter(f"ATC_RAT_{letters}_{name}", value)
    p, d, counter, step, at_us, tests = axis.p, axis.d, 0, RATE_D_UP, 20_000_000, 0
    while step <= RATE_P_UP and tests < most:
        trial = replace(axis, p=p, d=d, i=0.01 * p, target_hz=0.0)
        flown, stop, top, least = _twitch(trial, random, (-1.0) ** tests, held=held)
        stamps = flown.time_s[:stop] + jitter_s * stamping.standard_normal(stop)
        _log_twitch(writer, at_us + (1e6 * stamps).astype(np.int64), flown, trim)
        p, d, counter = _update(step, p, d, counter, top, least)
        at_us += int(2.5e3 * stop)
        writer.add("ATUN", [at_us], {
            "Axis": 0, "TuneStep": step, "Targ": TARGET_DEG_S, "Min": least, "Max": top,
            "RP": p, "RD": d, "SP": 4.5,
        })  # fmt: skip
        at_us += 1_500_000
        tests += 1
        if counter >= 4:
            step, counter = step + 1, 0
    for number in events:
        writer.add("EV", [at_us], {"Id": number})
    writer.write(path)
    return Tuned(p, d, tests)


def _update(
    step: int, p: float, d: float, counter: int, top: float, least: float
) -> tuple[float, float, int]:
    """AC_AutoTune_Multi's rules for the rate gains, without the one repeat that it ignores."""
    bounced = top - least > top * AGGRESSIVENESS
    if step in (RATE_D_UP, RATE_D_DOWN):
        if top > TARGET_DEG_S:
            return p * 0.95, d, counter
        if top < 0.8 * TARGET_DEG_S:
            return p * 1.05, d, counter
        if step == RATE_D_UP:
            return (p, d, counter + 1) if bounced else (p, d * 1.1, max(counter - 1, 0))
        if bounced:
            less = max(d * 0.95, MIN_D)
            return p, less, 4 if less == MIN_D else max(counter - 1, 0)
        return p, d, counter + 1
    if top > TARGET_DEG_S * (1 + 0.5 * AGGRESSIVENESS):
        return p, d, counter + 1
    return p * 1.05, d, max(counter - 1, 0)


def _log_twitch(writer: DataflashWriter, stamps: np.ndarray, flown: Flown, trim: float) -> None:
    stop = len(stamps)
    writer.add("ATDE", stamps, {
        "Angle": np.degrees(flown.angle[:stop]), "Rate": np.degrees(flown.rate[:stop])
    })  # fmt: skip
    # Only the sum of the terms counts here: P holds it, and I what holds the vehicle still.
    writer.add("PIDR", stamps, {
        "Tar": flown.rate_wanted[:stop], "Act": flown.rate[:stop], "P": flown.command[:stop],
        "I": np.full(stop, trim),
    })  # fmt: skip


def write_px4(
    path: Path,
    axis: Axis,
    tuned: tuple[float, float, float],
    *,
    states: tuple[int, ...] = (2, 11),
    seed: int = 5,
    log_hz: float = 100.0,
) -> None:
    """PX4's steps on roll for ten seconds; the last state follows them."""
    random, rate_hz, n = np.random.default_rng(seed), axis.loop_hz, int(10 * axis.loop_hz)
    every = int(rate_hz // log_hz)
    wanted, at, sign, count = np.zeros(n), 0, 1.0, 5
    while at < n:
        wanted[at : at + int(0.04 * count * rate_hz)] = 0.7 * sign
        at, sign, count = at + int(0.04 * count * rate_hz), -sign, count - 1 or 10
    noise = axis.noise * random.standard_normal(n)
    air = axis.gust * ar1(random, n, np.exp(-1.0 / (rate_hz * axis.gust_s)))
    flown = fly(axis, None, wanted, air, noise)
    builder = UlogBuilder()
    for name, value in (
        ("IMU_GYRO_CUTOFF", axis.gyro_hz), ("IMU_DGYRO_CUTOFF", axis.derivative_hz),
        ("IMU_GYRO_RATEMAX", int(rate_hz)), ("MC_ROLLRATE_K", 1.0), ("MC_ROLL_P", 6.5),
        ("MC_ROLLRATE_P", axis.p), ("MC_ROLLRATE_I", axis.i), ("MC_ROLLRATE_D", axis.d),
        ("MC_RR_INT_LIM", 0.3), ("SYS_AUTOSTART", 4001), ("CA_ROTOR_COUNT", 4),
    ):  # fmt: skip
        builder.parameter(name, value)
    builder.info("char[3] sys_name", b"PX4")
    builder.format(
        "vehicle_angular_velocity:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;"
    )
    builder.format(
        "vehicle_torque_setpoint:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;"
    )
    builder.format(
        "autotune_attitude_control_status:uint64_t timestamp;float[5] coeff_var;float kc;float ki;"
        "float kd;float att_p;uint8_t state;"
    )
    builder.format("vehicle_status:uint64_t timestamp;uint8_t vehicle_type;")
    names = ("vehicle_angular_velocity", "vehicle_torque_setpoint",
             "autotune_attitude_control_status", "vehicle_status")  # fmt: skip
    for number, name in enumerate(names):
        builder.announce(name, number)
    builder.sample(3, "QB", 1_000_000, 1)
    for k in range(0, n, every):
        stamp = 2_000_000 + int(1e6 * flown.time_s[k])
        builder.sample(0, "QQ3f", stamp, stamp, float(flown.rate[k]), 0.0, 0.0)
        builder.sample(1, "QQ3f", stamp, stamp, float(flown.command[k]), 0.0, 0.0)
        if k % int(rate_hz // 10) == 0:
            builder.sample(2, "Q9fB", stamp, *[3.0] * 5, *tuned, 5.0, states[0])
    end = 2_000_000 + int(1e6 * n / rate_hz) + 100_000
    for place, state in enumerate(states[1:]):
        builder.sample(2, "Q9fB", end + 100_000 * place, *[3.0] * 5, *tuned, 5.0, state)
    path.write_bytes(bytes(builder))


def true_margins(axis: Axis) -> tuple[float, float, float]:
    """Crossover (Hz), phase margin (deg) and gain margin (dB) of the simulator's own rate loop."""
    h = 1.0 / axis.loop_hz
    omega = np.geomspace(1.0, 0.95 * np.pi / h, 20_000)
    back = np.exp(-1j * omega * h)

    def pole(share: float) -> np.ndarray:
        return share / (1.0 - (1.0 - share) * back)

    b, a = _biquad(axis.gyro_hz, axis.loop_hz)
    gyro = (b[0] + b[1] * back + b[2] * back**2) / (1.0 + a[1] * back + a[2] * back**2)
    motor = pole(1.0 - np.exp(-h / axis.motor_s))
    # A command waits in the queue, and the rate of its tick is measured at the next one.
    body = h * axis.effectiveness / (1.0 - (1.0 - h * axis.damping) * back)
    plant = back ** (axis.delay_ticks + 1) * motor * body
    slope = pole(h / (h + 1.0 / (2.0 * np.pi * axis.derivative_hz))) * (1.0 - back) / h
    loop = gyro * plant * (axis.p + axis.i * h / (1.0 - back) + axis.d * slope)
    gain, phase = np.abs(loop), np.degrees(np.unwrap(np.angle(loop)))
    phase -= 360.0 * np.round((phase[0] + 90.0) / 360.0)
    cross = int(np.flatnonzero((gain[:-1] >= 1.0) & (gain[1:] < 1.0))[-1])
    turn = int(np.flatnonzero((phase[:-1] >= -180.0) & (phase[1:] < -180.0))[0])
    return omega[cross] / (2 * np.pi), 180.0 + phase[cross], -20.0 * np.log10(gain[turn])
