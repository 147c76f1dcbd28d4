"""A quadrotor under Betaflight's rate controller, and its blackbox: nothing of flightid in it.

The controller is written from the firmware (``src/main/flight/pid.c``, ``pid_init.c``, ``pid.h``,
``common/filter.c``, ``common/chirp.c`` of 2025.12) in its own numbers: gains as integers, rates in
deg/s, one pass a PID loop. All vehicles fly at once: arrays are (n_vehicles, 3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import expm

PTERM_SCALE, ITERM_SCALE, DTERM_SCALE = 0.032029, 0.244381, 0.000529
LOOPTIME_US, DENOMINATOR, LOGGED = 125, 2, 2
GYRO_STEP, STEP = LOOPTIME_US * 1e-6, LOOPTIME_US * DENOMINATOR * 1e-6
AXES = ("roll", "pitch", "yaw")
LPF = {"gyro_lpf2": 500.0, "gyro_lpf1": (200.0, 400.0), "dterm_lpf1": (75.0, 150.0),
       "dterm_lpf2": 150.0, "yaw": 100.0, "expo": 5.0}  # fmt: skip
TPA_RATE, TPA_BREAKPOINT = 65.0, 1350.0
D_MAX = np.array([40.0, 46.0, 0.0])
D_MAX_GAIN, D_MAX_RANGE_HZ, D_MAX_LOWPASS_HZ = 37.0, 85.0, 35.0
RELAX_HZ, RELAX_DEG_S = 15.0, 40.0
CHIRP_S, PAUSE_S, LAG_HZ, LEAD_HZ = 20.0, 1.0, 3.0, 30.0
CHIRP_HZ, CHIRP_DEG_S = (0.3, 100.0), np.array([230.0, 230.0, 180.0])


@dataclass(frozen=True)
class Quads:
    """Vehicles: command to angular acceleration, motor lag, delay, damping; each (n, 3)."""

    gain: np.ndarray
    motor_s: np.ndarray
    delay_steps: np.ndarray
    damping_1_s: np.ndarray
    kick_s: np.ndarray
    throttle: np.ndarray

    @classmethod
    def of(cls, n: int, seed: int = 0) -> Quads:
        """From 3 to 7 inches of propeller."""
        rng = np.random.default_rng(seed)
        size = rng.uniform(0.0, 1.0, (n, 1))
        shape = np.array([1.0, 0.75, 0.22]) * rng.uniform(0.9, 1.1, (n, 3))
        return cls(
            (1500.0 - 800.0 * size) * shape,
            np.repeat(0.018 + 0.02 * size, 3, axis=1),
            np.repeat(rng.integers(12, 36, (n, 1)), 3, axis=1),
            rng.uniform(1.0, 4.0, (n, 3)),
            np.tile([0.0, 0.0, 0.02], (n, 1)),
            rng.uniform(0.25, 0.5, (n, 1)),
        )


@dataclass(frozen=True)
class Blackbox:
    """What the logger of each vehicle got: columns of shape (n_rows, n_vehicles[, 3])."""

    columns: dict[str, np.ndarray]
    gains: dict[str, np.ndarray] = field(default_factory=dict)


def _pt1(hertz: Any, step: float) -> Any:
    omega = 2.0 * np.pi * np.asarray(hertz) * step
    return omega / (omega + 1.0)


def _dynamic(bounds: tuple[float, float], throttle: np.ndarray) -> np.ndarray:
    curve = throttle * (1.0 - throttle) * LPF["expo"] / 10.0 + throttle
    return (bounds[1] - bounds[0]) * curve + bounds[0]


def default_gains(n: int) -> dict[str, np.ndarray]:
    """Of the firmware; the feed-forward is off, as for chirps."""
    made = {"p": [45, 47, 45], "i": [80, 84, 80], "d": [30, 34, 0]}
    return {name: np.tile(np.array(each, dtype=float), (n, 1)) for name, each in made.items()}


def _chirp(n_steps: int) -> np.ndarray:
    """Phase of the chirp at each loop; its frequency grows by equal ratios."""
    low, high = CHIRP_HZ
    beta = (high / low) ** (1.0 / CHIRP_S)
    time_s = np.arange(n_steps) * STEP
    return 2.0 * np.pi * low * (beta**time_s - 1.0) / np.log(beta)


def chirp_flight(rounds: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Phase of the chirp (n_loops,) and the axis that it is on (n_loops,), −1 for none."""
    run, rest = round(CHIRP_S / STEP), round(PAUSE_S / STEP)
    phase, axis = [np.zeros(3 * rest)], [np.full(3 * rest, -1)]
    for _ in range(rounds):
        for place in range(3):
            phase += [_chirp(run), np.zeros(rest)]
            axis += [np.full(run, place), np.full(rest, -1)]
    return np.concatenate(phase), np.concatenate(axis)


def _shaped(phase: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Excitation behind the lead-lag, in amplitudes: cos(phase), times f below 1 Hz."""
    hertz = np.gradient(phase, STEP) / (2.0 * np.pi)
    raw = np.where(axis >= 0, np.cos(phase) * np.minimum(np.maximum(hertz, 0.0), 1.0), 0.0)
    # phaseCompInit: a first-order lag at LAG_HZ, lead at LEAD_HZ, by the bilinear rule.
    lag, lead = (np.tan(np.pi * each * STEP) for each in (LAG_HZ, LEAD_HZ))
    gain = lag / lead
    b0, b1, a1 = gain * (1 + lead), gain * (lead - 1), lag - 1
    out, last, before = np.empty_like(raw), 0.0, 0.0
    for k, value in enumerate(raw):
        last = (b0 * value + b1 * before - a1 * last) / (1 + lag)
        before = value
        out[k] = last
    return out


def _plant(quads: Quads) -> tuple[np.ndarray, np.ndarray]:
    """Exact steps of [motor, rate] over one sample of the gyro: (n, 3, 2, 2) and (n, 3, 2)."""
    n = len(quads.gain)
    a, b = np.empty((n, 3, 2, 2)), np.empty((n, 3, 2))
    for i in np.ndindex(n, 3):
        motor, gain = 1.0 / quads.motor_s[i], quads.gain[i]
        kick = gain * quads.kick_s[i] * motor
        whole = np.zeros((3, 3))
        whole[:2] = [[-motor, 0.0, motor], [gain - kick, -quads.damping_1_s[i], kick]]
        step = expm(whole * GYRO_STEP)
        a[i], b[i] = step[:2, :2], step[:2, 2]
    return a, b


def fly(
    quads: Quads,
    gains: Mapping[str, np.ndarray],
    phase: np.ndarray,
    axis: np.ndarray,
    *,
    seed: int = 0,
    noise: float = 1.0,
    d_max: np.ndarray | None = None,
    probe: np.ndarray | None = None,
    every: int = LOGGED,
) -> Blackbox:
    """Fly; with a `probe` (n_loops,) added behind the PID sum of every axis, in its counts."""
    n, rng = len(quads.gain), np.random.default_rng(seed)
    kp, kd = PTERM_SCALE * gains["p"], DTERM_SCALE * gains["d"]
    ki = ITERM_SCALE * gains["i"] * np.array([1.0, 1.0, 2.5])
    excess = np.maximum(quads.throttle - (TPA_BREAKPOINT - 1000.0) / 1000.0, 0.0)
    tpa = 1.0 - TPA_RATE / 100.0 * excess / (1.0 - (TPA_BREAKPOINT - 1000.0) / 1000.0)
    most = D_MAX if d_max is None else d_max
    boost = np.where(most > gains["d"], most / np.maximum(gains["d"], 1.0), 1.0)
    gyro_gain = D_MAX_GAIN * 0.00008 / D_MAX_LOWPASS_HZ
    alpha = {
        "gyro2": _pt1(LPF["gyro_lpf2"], GYRO_STEP),
        "gyro1": _pt1(_dynamic(LPF["gyro_lpf1"], quads.throttle), STEP),
        "d1": _pt1(_dynamic(LPF["dterm_lpf1"], quads.throttle), STEP),
        "d2": _pt1(LPF["dterm_lpf2"], STEP), "yaw": _pt1(LPF["yaw"], STEP),
        "relax": _pt1(RELAX_HZ, STEP),
        "range": _pt1(1.553773974 * D_MAX_RANGE_HZ, STEP),
        "boost": _pt1(1.553773974 * D_MAX_LOWPASS_HZ, STEP),
    }  # fmt: skip
    yaw = np.array([False, False, True])
    smooth_p = np.where(yaw, alpha["yaw"], 1.0)
    a, b = _plant(quads)
    zero = np.zeros((n, 3))
    motor, rate, slow, fast, integral, p_held = (zero.copy() for _ in range(6))
    d_one, d_two, d_last, setpoint_low = (zero.copy() for _ in range(4))
    range_one, range_two = zero.copy(), zero.copy()
    boost_one, boost_two = np.ones((n, 3)), np.ones((n, 3))
    gust = zero.copy()
    longest = int(quads.delay_steps.max()) + 1
    waiting = np.zeros((longest, n, 3))
    vehicle, body = np.indices((n, 3))
    shaped = _shaped(phase, axis)
    stick = np.zeros((len(phase), 3))
    limit = np.array([500.0, 500.0, 400.0])
    kept: dict[str, list[np.ndarray]] = {name: [] for name in ("P", "I", "D", "gyro", "set", "sum")}
    count = 0
    for k in range(len(phase)):
        for _ in range(DENOMINATOR):
            measured = np.degrees(rate) + noise * rng.standard_normal((n, 3))
            slow = slow + alpha["gyro2"] * (measured - slow)
            if count % DENOMINATOR == 0:
                fast = fast + alpha["gyro1"] * (slow - fast)
                setpoint = np.broadcast_to(stick[k], (n, 3)).copy()
                if axis[k] >= 0:
                    setpoint[:, axis[k]] += CHIRP_DEG_S[axis[k]] * shaped[k]
                error = setpoint - fast
                setpoint_low = setpoint_low + alpha["relax"] * (setpoint - setpoint_low)
                relax = np.maximum(0.0, 1.0 - np.abs(setpoint - setpoint_low) / RELAX_DEG_S)
                relaxed = error * np.where(yaw, 1.0, relax)
                p_held = p_held + smooth_p * (kp * error - p_held)
                integral = np.clip(integral + ki * STEP * relaxed, -0.85 * limit, 0.85 * limit)
                d_one = d_one + alpha["d1"] * (fast - d_one)
                d_two = d_two + alpha["d2"] * (d_one - d_two)
                delta = -(d_two - d_last) / STEP
                d_last = d_two
                range_one = range_one + alpha["range"] * (delta - range_one)
                range_two = range_two + alpha["range"] * (range_one - range_two)
                wanted = 1.0 + (boost - 1.0) * np.abs(range_two) * gyro_gain
                boost_one = boost_one + alpha["boost"] * (wanted - boost_one)
                boost_two = boost_two + alpha["boost"] * (boost_one - boost_two)
                slope = kd * delta * np.minimum(boost_two, boost) * tpa
                total = p_held + integral + slope
                command = np.clip(total, -limit, limit)
                if probe is not None:
                    command = command + probe[k]
                if k % every == 0:
                    now = (p_held, integral, slope, fast, setpoint, command)
                    for name, each in zip(kept, now, strict=True):
                        kept[name].append(each.astype(np.float32))
            waiting[count % longest] = command / 1000.0
            late = waiting[(count - quads.delay_steps) % longest, vehicle, body]
            late = np.where(count >= quads.delay_steps, late, 0.0)
            if noise:
                gust = gust * (1.0 - GYRO_STEP / 0.2) + 0.25 * rng.standard_normal((n, 3))
            moved = a[..., 0, 0] * motor + b[..., 0] * late
            rate = a[..., 1, 0] * motor + a[..., 1, 1] * rate + b[..., 1] * late + gust * GYRO_STEP
            motor = moved
            count += 1
    columns = {name: np.array(each) for name, each in kept.items()}
    return Blackbox(columns, dict(gains))


def header_of(gains: Mapping[str, np.ndarray], vehicle: int) -> dict[str, str]:
    """Lines of the header that tell the settings of one vehicle."""
    own = {name: each[vehicle].astype(int) for name, each in gains.items()}
    lists = {f"{a}PID": ",".join(str(own[g][k]) for g in "pid") for k, a in enumerate(AXES)}
    return {
        "Data version": "2", "I interval": "1", "P interval": "1/1",
        "Firmware type": "Cleanflight",
        "Firmware revision": "Betaflight 2025.12.1 (abcdef) STM32F7X2",
        "minthrottle": "1070", "gyro_scale": "0x3f800000", "motorOutput": "158,2047",
        "acc_1G": "2048", "looptime": str(LOOPTIME_US), "pid_process_denom": str(DENOMINATOR),
        **lists, "d_max": ",".join(str(int(each)) for each in D_MAX), "ff_weight": "0,0,0",
        "gyro_lpf1_type": "0", "gyro_lpf1_static_hz": "250", "gyro_lpf1_dyn_hz": "200,400",
        "gyro_lpf1_dyn_expo": "5", "gyro_lpf2_type": "0", "gyro_lpf2_static_hz": "500",
        "dterm_lpf1_type": "0", "dterm_lpf1_static_hz": "75", "dterm_lpf1_dyn_hz": "75,150",
        "dterm_lpf1_dyn_expo": "5", "dterm_lpf2_type": "0", "dterm_lpf2_static_hz": "150",
        "yaw_lowpass_hz": "100", "tpa_mode": "1", "tpa_rate": "65", "tpa_breakpoint": "1350",
        "iterm_relax": "1", "iterm_windup": "85", "pidsum_limit": "500", "pidsum_limit_yaw": "400",
        "simplified_pids_mode": "2", "blackbox_high_resolution": "1",
    }  # fmt: skip


def _bytes_of(values: np.ndarray, *, signed: np.ndarray) -> bytes:
    """Rows (n, n_fields) of integers as whole frames: seven bits a byte, least first."""
    folded = np.where(signed, (values << 1) ^ (values >> 31), values) & 0xFFFFFFFF
    digits = (folded[..., None] >> (7 * np.arange(5))) & 0x7F
    length = 1 + (folded[..., None] >= 1 << (7 * np.arange(1, 5))).sum(axis=-1)
    place = np.arange(5)
    more = place < length[..., None] - 1
    letters = np.full((len(values), 1, 5), ord("I"))
    made = np.concatenate([letters, digits | np.where(more, 0x80, 0)], axis=1)
    there = np.concatenate([np.arange(5) == 0 * letters, place < length[..., None]], axis=1)
    return bytes(made[there].astype(np.uint8))


def blackbox_of(
    flown: Blackbox, quads: Quads, phase: np.ndarray, axis: np.ndarray, k: int
) -> bytes:
    """The file of one vehicle."""
    at = slice(None, None, LOGGED)
    n = len(flown.columns["P"])
    throttle = float(quads.throttle[k, 0])
    fields: dict[str, np.ndarray] = {
        "loopIteration": LOGGED * np.arange(n),
        "time": 5_000_000 + np.rint(np.arange(n) * LOGGED * STEP * 1e6),
    }
    for name, source, size in (
        ("axisP", "P", 1.0), ("axisI", "I", 1.0), ("axisD", "D", 1.0),
        ("setpoint", "set", 10.0), ("gyroADC", "gyro", 10.0),
    ):  # fmt: skip
        for body in range(3):
            fields[f"{name}[{body}]"] = np.rint(size * flown.columns[source][:, k, body])
    fields["setpoint[3]"] = np.full(n, 10_000.0 * throttle)
    told = np.where(axis[at] >= 0, np.rint(5000.0 * np.mod(phase[at], 2.0 * np.pi)), 0.0)
    fields["debug[0]"] = told
    command = flown.columns["sum"][:, k] / 1000.0
    for motor, signs in enumerate(((-1, 1, -1), (-1, -1, 1), (1, 1, 1), (1, -1, -1))):
        share = np.clip(throttle + command @ np.array(signs), 0.0, 1.0)
        fields[f"motor[{motor}]"] = np.rint(158.0 + share * 1889.0)
    table = np.stack([np.rint(each).astype(np.int64) for each in fields.values()], axis=1)
    unsigned = ("loopIteration", "time", "debug", "motor")
    signed = np.array([not name.startswith(unsigned) for name in fields])
    lines = ["H Product:Blackbox flight data recorder by Nicholas Sherlock"]
    lines += [f"H {name}:{value}" for name, value in header_of(flown.gains, k).items()]
    many = len(fields)
    lines += [
        "H Field I name:" + ",".join(fields),
        "H Field I signed:" + ",".join(str(int(each)) for each in signed),
        "H Field I predictor:" + ",".join(["0"] * many),
        "H Field I encoding:" + ",".join("0" if each else "1" for each in signed),
        "H Field P predictor:" + ",".join(["0"] * many),
        "H Field P encoding:" + ",".join("0" if each else "1" for each in signed),
    ]
    head = "\n".join(lines).encode() + b"\n"
    return head + _bytes_of(table, signed=signed) + b"E\xffEnd of log\0"


def flown_margins(quads: Quads, gains: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Phase margin (deg) and gain margin (dB) of each axis, measured at the PID sum: (n, 3).

    A multisine is added behind it; over what it makes of the sum stands 1 + L.
    """
    seconds, base = 8.0, 0.25
    hertz = base * np.unique(np.rint(np.geomspace(0.5, 600.0, 260) / base))
    n_loops = round(seconds / STEP)
    time_s = np.arange(2 * n_loops) * STEP
    phases = np.pi * np.arange(hertz.size) ** 2 / hertz.size
    probe = np.zeros(2 * n_loops)
    for each, start in zip(hertz, phases, strict=True):
        probe += np.cos(2.0 * np.pi * each * time_s + start)
    nothing, none = np.zeros(len(probe)), np.full(len(probe), -1)
    off = {"noise": 0.0, "d_max": np.zeros(3), "every": 1}
    still = fly(quads, gains, nothing, none, probe=probe, **off)
    total = still.columns["sum"][-n_loops:]
    rows = np.rint(hertz * seconds).astype(int)
    given = np.fft.rfft(probe[-n_loops:])[rows]
    made = np.fft.rfft(total, axis=0)[rows]
    loop = given[:, None, None] / made - 1.0
    size, turn = np.abs(loop), np.unwrap(np.angle(loop), axis=0)
    found = {"phase": np.full(loop.shape[1:], np.inf), "gain": np.full(loop.shape[1:], np.inf)}
    for i in np.ndindex(*loop.shape[1:]):
        own = size[(slice(None), *i)]
        log = np.log(own)
        for j in np.flatnonzero(np.diff(np.sign(log))):
            part = log[j] / (log[j] - log[j + 1])
            here = loop[(j, *i)] * (loop[(j + 1, *i)] / loop[(j, *i)]) ** part
            found["phase"][i] = min(found["phase"][i], abs(180.0 - abs(np.degrees(np.angle(here)))))
        course = turn[(slice(None), *i)]
        for j in range(len(own) - 1):
            first, last = course[j], course[j + 1]
            for whole in np.arange(-9, 10, 2) * np.pi:
                if (first - whole) * (last - whole) < 0.0:
                    part = (whole - first) / (last - first)
                    level = np.exp(log[j] + part * (log[j + 1] - log[j]))
                    margin = abs(20.0 * np.log10(level))
                    found["gain"][i] = min(found["gain"][i], margin)
    return found
