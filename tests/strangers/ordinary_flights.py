"""One axis of a vehicle under an autopilot's loops, flown by sticks: a simulator of its own.

ArduPilot: D on the filtered error, set-point filtered first. PX4 and Betaflight: D on the measured
rate; Betaflight feeds the slope of the set-point forward, through a filter. Linear, one step a
tick; the truth is the same loop's answer to a step of the set-point without noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter

from tests.strangers import noises

Array = noises.Array
HAND_S = 0.04
"""Of the two lags of a hand on a stick."""


@dataclass(frozen=True)
class Axis:
    """A body axis: effectiveness, damping, motor lag and delay, and the gains about it.

    Gains in the autopilot's own units: rad/s in, normalised command out. An error of the angle that
    would ask for more than the acceleration `brake` (rad/s²; 0: none) is answered by its root.
    """

    form: str = "ardupilot"
    loop_hz: float = 400.0
    effectiveness: float = 140.0
    damping: float = 3.0
    motor_s: float = 0.045
    delay_ticks: int = 3
    p: float = 0.12
    i: float = 0.12
    d: float = 0.0035
    angle_p: float = 4.5
    brake: float = 0.0
    target_hz: float = 20.0
    derivative_hz: float = 20.0
    gyro_hz: float = 40.0
    forward: float = 0.0
    forward_hz: float = 30.0
    gust: float = 4.0
    gust_s: float = 0.4
    noise: float = 0.05


@dataclass(frozen=True, eq=False)
class Flown:
    """Signals at every tick: attitude and rate, wanted and measured."""

    time_s: Array
    angle_wanted: Array
    angle: Array
    rate_wanted: Array
    rate: Array
    command: Array


def sticks(random: np.random.Generator, n: int, tick_s: float, size: float, lag_s: float) -> Array:
    """A pilot's wishes: levels held for a random while, smoothed as a hand does."""
    levels, at = np.zeros(n), 0
    while at < n:
        held = int(random.uniform(0.3, 2.0) / tick_s)
        levels[at : at + held] = size * random.standard_normal() * (random.random() < 0.7)
        at += held
    pole = np.exp(-tick_s / lag_s) if lag_s else 0.0
    for _ in range(2):
        levels = noises.lfilter([1.0 - pole], [1.0, -pole], levels)
    return levels


def fly(
    axis: Axis,
    angle_wanted: Array | None,
    rate_wanted: Array | None,
    gust: Array,
    noise: Array,
    *,
    twitch_at: int | None = None,
) -> Flown:
    """Run the loops: from attitudes wanted, or from rates wanted where attitude is left alone.

    From the tick of a twitch on, rates are wanted in place of attitudes, beyond what was seen then.
    """
    n, h = gust.size, 1.0 / axis.loop_hz
    out = []
    wanted = rate_wanted.tolist() if rate_wanted is not None else [0.0] * n
    angles = angle_wanted.tolist() if angle_wanted is not None else None
    gusts, noisy = gust.tolist(), noise.tolist()

    def share(hz: float) -> float:
        return h / (h + 1.0 / (2.0 * np.pi * hz)) if hz else 1.0

    at, ad = share(axis.target_hz if axis.form == "ardupilot" else 0.0), share(axis.derivative_hz)
    af = share(axis.forward_hz)
    b, a = _biquad(axis.gyro_hz, axis.loop_hz)
    motor = 1.0 - np.exp(-h / axis.motor_s)
    queue = [0.0] * max(axis.delay_ticks, 1)
    target = total = slope = before = lag = rate = angle = pushed = last = 0.0
    z1 = z2 = seen = start = 0.0
    for k in range(n):
        if k == twitch_at:
            angles, start = None, seen
        raw = rate + noisy[k]
        seen = b[0] * raw + z1
        z1, z2 = b[1] * raw - a[1] * seen + z2, b[2] * raw - a[2] * seen
        asked = _turned(axis, angles[k] - angle) if angles is not None else wanted[k] + start
        target += at * (asked - target)
        error = target - seen
        total += axis.i * error * h
        moved = error if axis.form == "ardupilot" else -seen
        slope += ad * ((moved - before) / h - slope)
        before = moved
        pushed += af * ((asked - last) / h - pushed)
        last = asked
        u = axis.p * error + total + axis.d * slope + axis.forward * pushed
        out.append((angle, asked, seen, u))
        queue.append(u)
        lag += motor * (queue.pop(0) - lag)
        accel = axis.effectiveness * lag - axis.damping * rate + gusts[k]
        rate += h * accel
        angle += h * rate
    return Flown(
        np.arange(n) * h,
        np.zeros(n) if angle_wanted is None else angle_wanted,
        *np.array(out).T.copy(),
    )


def _turned(axis: Axis, error: float) -> float:
    """Rate that an angle's error asks for: what stops in time at the acceleration, if any."""
    most = axis.brake / axis.angle_p**2
    if axis.brake <= 0.0 or abs(error) <= most:
        return axis.angle_p * error
    return float(np.copysign(np.sqrt(2.0 * axis.brake * (abs(error) - most / 2.0)), error))


def _biquad(hz: float, rate_hz: float) -> tuple[list[float], list[float]]:
    """Second-order low-pass of Butterworth's shape, as autopilots filter gyros."""
    b, a = butter(2, hz, fs=rate_hz)
    return b.tolist(), a.tolist()


def ordinary(
    axis: Axis, seed: int, duration_s: float, *, acro: bool, size: float, lag_s: float = HAND_S
) -> Flown:
    """A flight by sticks in gusts: rates wanted in acro, attitudes wanted else."""
    random = np.random.default_rng(seed)
    n, h = round(duration_s * axis.loop_hz), 1.0 / axis.loop_hz
    wish = sticks(random, n, h, size, lag_s)
    gust = axis.gust * noises.ar1(random, n, np.exp(-h / axis.gust_s))
    noise = axis.noise * random.standard_normal(n)
    return fly(axis, None if acro else wish, wish if acro else None, gust, noise)


def step(axis: Axis, duration_s: float, *, angle: bool = False) -> Array:
    """Answer of the quiet loop at every tick to a step of its set-point at tick 0."""
    n = round(duration_s * axis.loop_hz)
    quiet, one = np.zeros(n), np.ones(n)
    flown = fly(replace(axis), one if angle else None, None if angle else one, quiet, quiet)
    return flown.angle if angle else flown.rate
