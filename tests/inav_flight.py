"""A quadrotor under INAV's rate controller, and its blackbox: nothing of flightid in it.

The controller is written from the firmware (``src/main/flight/pid.c`` and ``pid.h`` of 8 and 9,
``common/filter.c``, ``flight/chirp.c`` in development) in its own numbers: gains as integers, rates
in deg/s, one pass a loop of `looptime`. Arrays are (3,): roll, pitch, yaw.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from tests.blackbox_builder import START

LOOPTIME_US = 500
STEP = LOOPTIME_US * 1e-6
AXES = ("roll", "pitch", "yaw")
P_DIVISOR, I_DIVISOR, D_DIVISOR, CD_DIVISOR = 31.0, 4.0, 1905.0, 7270.0
GAINS = {"p": (40, 44, 85), "i": (75, 75, 45), "d": (25, 25, 0), "cd": (60, 60, 60)}
GYRO_LPF_HZ, DTERM_LPF_HZ, CD_LPF_HZ, YAW_LPF_HZ, RELAX_HZ = 110.0, 90.0, 30.0, 40.0, 15.0
TPA_RATE, TPA_BREAKPOINT, MAXTHROTTLE, MINTHROTTLE = 20, 1300, 1900, 1050
SUM_LIMIT, I_LIMIT, RELAX_DEG_S = 500.0, 165.0, 40.0
CHIRP_S, CHIRP_HZ, CHIRP_DEG_S, SETTLE_S = 20.0, (2.0, 60.0), 60.0, 2.0


@dataclass(frozen=True)
class Quad:
    """Command of one to rad/s², motor lag, damping, delay in loops: each (3,)."""

    gain: tuple[float, float, float] = (1100.0, 900.0, 220.0)
    motor_s: float = 0.028
    damping_1_s: tuple[float, float, float] = (2.5, 2.0, 1.2)
    delay_loops: int = 6
    throttle: float = 0.42


def pt_gain(hertz: float, order: int = 1) -> float:
    """Weight of a one-pole low-pass; several of them take 3 dB at the frequency together."""
    omega = 2.0 * np.pi * hertz / np.sqrt(2.0 ** (1.0 / order) - 1.0) * STEP
    return float(omega / (omega + 1.0))


def tpa_of(throttle: float) -> np.ndarray:
    """What is left of P, D and CD of each axis."""
    rc = 1000.0 + 1000.0 * throttle
    share = min(max(rc - TPA_BREAKPOINT, 0.0) / (MAXTHROTTLE - TPA_BREAKPOINT), 1.0)
    left = (100.0 - TPA_RATE * share) / 100.0
    return np.array([left, left, 1.0])


class Controller:
    """The firmware's pass of one loop."""

    def __init__(self, gains: Mapping[str, tuple[float, ...]], throttle: float) -> None:
        tpa = tpa_of(throttle)
        self.kp = np.array(gains["p"]) / P_DIVISOR * tpa
        self.ki = np.array(gains["i"]) / I_DIVISOR
        self.kd = np.array(gains["d"]) / D_DIVISOR * tpa
        self.kcd = np.array(gains["cd"]) / CD_DIVISOR * tpa / STEP
        self.yaw = np.where([False, False, True], pt_gain(YAW_LPF_HZ), 1.0)
        self.dterm, self.control, self.relax = (
            pt_gain(DTERM_LPF_HZ, 2), pt_gain(CD_LPF_HZ, 3), pt_gain(RELAX_HZ)
        )  # fmt: skip
        self.p, self.integral, self.slow, self.last_target = (np.zeros(3) for _ in range(4))
        self.last_rate, self.delta, self.cd = np.zeros(3), np.zeros((2, 3)), np.zeros((3, 3))

    def step(self, target: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, ...]:
        """P, I, D and CD of this loop; the sum takes the I of the loop before."""
        error = target - rate
        self.p = self.p + self.yaw * (error * self.kp - self.p)
        fresh = self.last_rate - rate
        for k in range(2):
            self.delta[k] = self.delta[k] + self.dterm * (fresh - self.delta[k])
            fresh = self.delta[k]
        d = fresh * self.kd / STEP
        fresh = target - self.last_target
        for k in range(3):
            self.cd[k] = self.cd[k] + self.control * (fresh - self.cd[k])
            fresh = self.cd[k]
        cd = fresh * self.kcd
        total = self.p + d + self.integral + cd
        self.slow = self.slow + self.relax * (target - self.slow)
        relaxed = np.maximum(0.0, 1.0 - np.abs(target - self.slow) / RELAX_DEG_S)
        counted = error * np.where([True, True, False], relaxed, 1.0)
        self.integral = np.clip(self.integral + counted * self.ki * STEP, -I_LIMIT, I_LIMIT)
        self.last_target, self.last_rate = target.copy(), rate.copy()
        return self.p, self.integral, d, cd, np.clip(total, -SUM_LIMIT, SUM_LIMIT)


def chirp(n: int) -> tuple[np.ndarray, np.ndarray]:
    """What is added, deg/s, and its frequency, Hz."""
    elapsed = np.arange(n) * STEP
    hertz = CHIRP_HZ[0] * np.exp(np.log(CHIRP_HZ[1] / CHIRP_HZ[0]) * elapsed / CHIRP_S)
    angle = 2.0 * np.pi * STEP * np.cumsum(0.5 * (hertz + np.roll(hertz, 1)))
    fade = np.clip(np.minimum(elapsed, CHIRP_S - elapsed), 0.0, 1.0)
    return CHIRP_DEG_S * fade * np.sin(angle), hertz


def schedule(rounds: int = 2, lengths_s: float = CHIRP_S) -> tuple[np.ndarray, ...]:
    """Target (n, 3), state, axis, added and hertz (n,) of chirps on each axis in turn."""
    wave, hertz = chirp(round(CHIRP_S / STEP))
    wave, hertz = wave[: round(lengths_s / STEP)], hertz[: round(lengths_s / STEP)]
    rest = round(SETTLE_S / STEP)
    parts = []
    for _ in range(rounds):
        for place in range(3):
            still = np.tile([2.0, place + 1, 0.0, 0.0], (rest, 1))
            parts += [still, np.stack([np.full(wave.size, 3.0), np.full(wave.size, place + 1.0),
                                       wave, hertz], axis=1)]  # fmt: skip
    parts.append(np.zeros((rest, 4)))
    state, axis, added, told = np.concatenate(parts).T
    target = np.zeros((state.size, 3))
    running = state == 3.0
    target[running, axis[running].astype(int) - 1] = added[running]
    return target, state, axis, added, told


def fly(
    quad: Quad, gains: Mapping[str, tuple[float, ...]], target: np.ndarray, *, seed: int = 0
) -> dict[str, np.ndarray]:  # fmt: skip
    """Columns (n, 3) by name: target, gyro, P, I, D, F, sum."""
    rng = np.random.default_rng(seed)
    plants = []
    for gain, damping in zip(quad.gain, quad.damping_1_s, strict=True):
        motor = 1.0 / quad.motor_s
        whole = np.zeros((3, 3))
        whole[:2] = [[-motor, 0.0, motor], [gain, -damping, 0.0]]
        plants.append(expm(whole * STEP))
    a = np.array([p[:2, :2] for p in plants])
    b = np.array([p[:2, 2] for p in plants])
    controller, gyro_gain = Controller(gains, quad.throttle), pt_gain(GYRO_LPF_HZ)
    motor, rate, slow, gust = (np.zeros(3) for _ in range(4))
    waiting = np.zeros((quad.delay_loops + 1, 3))
    rows = {name: np.empty_like(target) for name in ("gyro", "P", "I", "D", "F", "sum")}
    drawn = rng.standard_normal((len(target), 2, 3))
    for k, wanted in enumerate(target):
        slow = slow + gyro_gain * (np.degrees(rate) + 1.5 * drawn[k, 0] - slow)
        terms = controller.step(wanted, slow)
        command = terms[4]
        for name, each in zip(("P", "I", "D", "F", "sum", "gyro"), (*terms[:4], command, slow),
                              strict=True):  # fmt: skip
            rows[name][k] = each
        waiting[k % len(waiting)] = command / 1000.0
        late = waiting[(k + 1) % len(waiting)]
        gust = gust * (1.0 - STEP / 0.2) + 0.05 * drawn[k, 1]
        moved = a[:, 0, 0] * motor + b[:, 0] * late
        rate = a[:, 1, 0] * motor + a[:, 1, 1] * rate + b[:, 1] * late + gust * STEP
        motor = moved
    return {"target": target, **rows}


def phase_margin(quad: Quad, gains: Mapping[str, float], place: int) -> float:
    """Least phase margin of an axis, deg: firmware and vehicle in z, not run but multiplied."""
    hertz = np.geomspace(0.3, 200.0, 20_000)
    back = np.exp(-2j * np.pi * hertz * STEP)

    def one_pole(weight: float) -> np.ndarray:
        return np.asarray(weight / (1.0 - (1.0 - weight) * back))

    tpa = tpa_of(quad.throttle)[place]
    p = gains["p"] / P_DIVISOR * tpa * (one_pole(pt_gain(YAW_LPF_HZ)) if place == 2 else 1.0)
    i = gains["i"] / I_DIVISOR * STEP * back / (1.0 - back)
    d = gains["d"] / D_DIVISOR * tpa / STEP * (1.0 - back)
    controller = p + i + d * one_pole(pt_gain(DTERM_LPF_HZ, 2)) ** 2
    motor = 1.0 / quad.motor_s
    whole = np.zeros((3, 3))
    whole[:2] = [[-motor, 0.0, motor], [quad.gain[place], -quad.damping_1_s[place], 0.0]]
    step = expm(whole * STEP)
    shifted = np.eye(2) / back[:, None, None] - step[:2, :2]
    rate = np.linalg.solve(shifted, np.tile(step[:2, 2:], (back.size, 1, 1)))[:, 1, 0]
    gyro = 180.0 / np.pi * rate / 1000.0 * one_pole(pt_gain(GYRO_LPF_HZ))
    loop = controller * gyro * back**quad.delay_loops
    crossed = np.flatnonzero(np.diff(np.sign(np.log(np.abs(loop)))))
    return min(180.0 - abs(float(np.degrees(np.angle(loop[k])))) for k in crossed)


def header(gains: Mapping[str, tuple[float, ...]], **changes: str) -> dict[str, str]:
    """Lines that INAV's blackbox.c writes, as far as anybody reads them."""
    own = {f"{a}PID": ",".join(str(gains[g][k]) for g in ("p", "i", "d", "cd"))
           for k, a in enumerate(AXES)}  # fmt: skip
    return {
        "Data version": "2", "I interval": "1", "P interval": "1/1",
        "Firmware type": "Cleanflight", "Firmware revision": "INAV 8.0.1 (75cd8bcd) MATEKF722SE",
        "minthrottle": str(MINTHROTTLE), "maxthrottle": str(MAXTHROTTLE),
        "gyro_scale": "0x3f800000", "motorOutput": f"{MINTHROTTLE},{MAXTHROTTLE}",
        "acc_1G": "4096", "vbatref": "1620", "looptime": str(LOOPTIME_US), "rates": "40,40,30",
        "tpa_rate": str(TPA_RATE), "tpa_breakpoint": str(TPA_BREAKPOINT), **own,
        "yaw_lpf_hz": str(int(YAW_LPF_HZ)), "dterm_lpf_hz": str(int(DTERM_LPF_HZ)),
        "dterm_lpf_type": "2", "gyro_lpf_hz": str(int(GYRO_LPF_HZ)), "debug_mode": "28",
        **changes,
    }  # fmt: skip


def blackbox(
    flown: Mapping[str, np.ndarray], quad: Quad, told: tuple[np.ndarray, ...] | None = None,
    *, gains: Mapping[str, tuple[float, ...]] = GAINS, every: int = 2, **changes: str,
) -> bytes:  # fmt: skip
    """The file: terms cut to whole numbers, as C does, rates rounded; every second loop."""
    n = len(flown["gyro"])
    state, axis, added, hertz = told or (np.zeros(n),) * 4
    fields: dict[str, np.ndarray] = {
        "loopIteration": np.arange(n), "time": 5_000_000 + LOOPTIME_US * np.arange(n),
    }  # fmt: skip
    for k in range(3):
        fields[f"axisRate[{k}]"] = np.trunc(flown["target"][:, k])
    for name in "PIDF":
        for k in range(3):
            fields[f"axis{name}[{k}]"] = np.trunc(flown[name][:, k])
    for k in range(3):
        fields[f"rcCommand[{k}]"] = np.zeros(n)
    fields["rcCommand[3]"] = np.full(n, 1000.0 + 1000.0 * quad.throttle)
    fields["vbat"], fields["amperage"] = np.full(n, 1580.0), np.full(n, 1420.0)
    for k in range(3):
        fields[f"gyroADC[{k}]"] = np.rint(flown["gyro"][:, k])
    fields["accSmooth[2]"] = np.full(n, 4096.0)
    for k, values in enumerate((state, axis, np.rint(100.0 * added), np.rint(100.0 * hertz))):
        fields[f"debug[{k}]"] = values
    for motor, signs in enumerate(((-1, 1, -1), (-1, -1, 1), (1, 1, 1), (1, -1, -1))):
        moved = 1000.0 + 1000.0 * quad.throttle + flown["sum"] @ np.array(signs)
        fields[f"motor[{motor}]"] = np.clip(np.rint(moved), MINTHROTTLE, MAXTHROTTLE)
    table = np.stack([np.asarray(each, np.int64) for each in fields.values()], axis=1)[::every]
    unsigned = ("loopIteration", "time", "motor", "rcCommand[3]", "vbat")
    signed = np.array([not name.startswith(unsigned) for name in fields])
    lines = [START, *(f"H {name}:{value}" for name, value in header(gains, **changes).items())]
    lines += [
        "H Field I name:" + ",".join(fields),
        "H Field I signed:" + ",".join(str(int(each)) for each in signed),
        "H Field I predictor:" + ",".join(["0"] * len(fields)),
        "H Field I encoding:" + ",".join("0" if each else "1" for each in signed),
        "H Field P predictor:" + ",".join(["0"] * len(fields)),
        "H Field P encoding:" + ",".join("0" if each else "1" for each in signed),
    ]
    folded = np.where(signed, (table << 1) ^ (table >> 63), table) & 0xFFFFFFFF
    digits = (folded[..., None] >> (7 * np.arange(5))) & 0x7F
    length = 1 + (folded[..., None] >= 1 << (7 * np.arange(1, 5))).sum(axis=-1)
    place = np.arange(5)
    more = place < length[..., None] - 1
    letters = np.full((len(table), 1, 5), ord("I"))
    made = np.concatenate([letters, digits | np.where(more, 0x80, 0)], axis=1)
    there = np.concatenate([np.arange(5) == 0 * letters, place < length[..., None]], axis=1)
    frames = bytes(made[there].astype(np.uint8))
    head = "\n".join(lines).encode() + b"\n"
    return head + frames + b"E\xffEnd of log (disarm reason:4)\0"
