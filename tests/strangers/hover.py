"""One axis of a multicopter in NumPy: motors, delay, gyro filter, AC_PID and angle loop, limits.

Nothing here comes from flightid. The recursion is written once, by `advance`; matrices for long
flights and for closed-loop poles are what it makes of unit vectors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
STEP_S = 1.0 / 400.0
FULL = 1.0
GRID = np.geomspace(0.05, 0.999 * np.pi / STEP_S, 5000)
BLOCK = 40
"""Samples that are flown at once where no limit is met."""


@dataclass(frozen=True)
class Gains:
    """Of ArduCopter, with its filters, Hz."""

    p: float
    i: float
    d: float
    angle_p: float
    flte_hz: float = 0.0
    fltd_hz: float = 20.0
    fltt_hz: float = 20.0


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A rate behind lags: continuous matrices of rate and angle, whole loops of delay.

    Attributes
    ----------
    a, b : ndarray
        Command to states; the last two states are rate (rad/s) and angle (rad).
    delay : int
        Loops between the command and what the motors are given.
    gyro_hz : float
        Corner of the gyro's low-pass.
    name : str
    """

    a: Array
    b: Array
    delay: int
    gyro_hz: float
    name: str
    about: Mapping[str, float] = field(default_factory=dict)

    def sampled(self) -> tuple[Array, Array]:
        """Exact for a command that is held for a loop."""
        n = len(self.a)
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = self.a, self.b
        whole = linalg.expm(block * STEP_S)
        return whole[:n, :n], whole[:n, n]


def vehicle(
    name: str,
    *,
    effect: float,
    damping: float = 0.0,
    motor_s: float = 0.0,
    mode: tuple[float, float] | None = None,
    frame: tuple[float, float, float] | None = None,
    delay: int = 4,
    gyro_hz: float = 60.0,
) -> Vehicle:
    """Command, motor lag, a mode (frequency rad/s, damping ratio; flapping), damped rate, angle.

    A flexible frame (rad/s, damping ratio, share of the effect) moves the gyro beside the body.
    """
    blocks: list[tuple[Array, Array, Array]] = []
    if motor_s:
        blocks.append((np.array([[-1 / motor_s]]), np.array([1 / motor_s]), np.array([1.0])))
    if mode is not None:
        w, zeta = mode
        lag = np.array([[0.0, 1.0], [-(w**2), -2 * zeta * w]])
        blocks.append((lag, np.array([0.0, w**2]), np.array([1.0, 0.0])))
    rigid = np.array([[damping, 0.0], [1.0, 0.0]])
    if frame is None:
        blocks.append((rigid, np.array([effect, 0.0]), np.array([1.0, 0.0])))
    else:
        w, zeta, share = frame
        moved = share * effect
        # Bending and its rate, then what the gyro sees of body and bending, and its integral.
        whole = np.zeros((4, 4))
        whole[0, 1], whole[1, :2] = 1.0, (-(w**2), -2 * zeta * w)
        whole[2, :2] = -(w**2) * moved, -(damping + 2 * zeta * w) * moved
        whole[2:, 2:] = rigid
        blocks.append((whole, np.array([0.0, 1.0, effect + moved, 0.0]), np.eye(4)[2]))
    a, b, c = blocks[0]
    for a2, b2, c2 in blocks[1:]:
        a = np.block([[a, np.zeros((len(a), len(a2)))], [np.outer(b2, c), a2]])
        b, c = np.concatenate([b, np.zeros(len(b2))]), np.concatenate([np.zeros(len(c)), c2])
    about = {"effect": effect, "damping": damping, "motor_s": motor_s}
    return Vehicle(a, b, delay, gyro_hz, name, about)


def low_pass(corner_hz: float) -> tuple[float, float, float, float, float]:
    """Second-order Butterworth by the bilinear transform with prewarping: b0, b1, b2, a1, a2."""
    w = np.tan(np.pi * corner_hz * STEP_S)
    scale = 1 + np.sqrt(2) * w + w**2
    b0 = w**2 / scale
    return b0, 2 * b0, b0, 2 * (w**2 - 1) / scale, (1 - np.sqrt(2) * w + w**2) / scale


def weight(corner_hz: float) -> float:
    """Of a first-order filter's newest sample; 1: off."""
    return 1.0 if corner_hz <= 0 else STEP_S / (STEP_S + 1 / (2 * np.pi * corner_hz))


class Axis:
    """Vehicle and controller as one linear recursion around a limited command.

    ``z' = A z + b_u u + b_n noise + b_d disturbance``, ``u = clip(c z + d noise + injected)``, and
    the filtered rate ``g z + h noise``.
    """

    def __init__(self, craft: Vehicle, gains: Gains) -> None:
        self.craft, self.gains = craft, gains
        self.ad, self.bd = craft.sampled()
        self.n = len(self.ad)
        self.size = self.n + craft.delay + 7
        unit = np.eye(self.size)
        columns = [self._advance(row, 0.0, 0.0, 0.0) for row in unit]
        self.a = np.array([new for new, _, _ in columns]).T
        self.c = np.array([u for _, u, _ in columns])
        self.g = np.array([r for _, _, r in columns])
        nothing = np.zeros(self.size)
        self.b_u = self._advance(nothing, 1.0, 0.0, 0.0)[0]
        self.b_n, self.d, self.h = self._advance(nothing, 0.0, 1.0, 0.0)
        self.b_d = self._advance(nothing, 0.0, 0.0, 1.0)[0]

    def _advance(
        self, z: Array, u: float, noise: float, disturbance: float
    ) -> tuple[Array, float, float]:
        """Next state (for an applied command u), the command wanted, and the filtered rate."""
        n, late, k = self.n, self.craft.delay, self.gains
        x, queue = z[:n], z[n : n + late]
        f1, f2, integral, slope, last, target, pending = z[n + late :]
        b0, b1, b2, a1, a2 = low_pass(self.craft.gyro_hz)
        raw = x[-2] + noise
        rate = b0 * raw + f1
        target = target + weight(k.fltt_hz) * (pending - target)
        error = target - rate
        slope = slope + weight(k.fltd_hz) * ((error - last) / STEP_S - slope)
        integral = integral + k.i * error * STEP_S
        wanted = k.p * error + integral + k.d * slope
        applied = queue[0] if late else u
        new = np.concatenate(
            [
                self.ad @ x + self.bd * (applied + disturbance),
                np.append(queue[1:], u) if late else queue,
                [b1 * raw - a1 * rate + f2, b2 * raw - a2 * rate, integral, slope, error, target],
                [-k.angle_p * x[-1]],
            ]
        )
        return new, float(wanted), float(rate)

    def poles(self) -> Complex:
        """Of the closed loop without limits."""
        return np.linalg.eigvals(self.a + np.outer(self.b_u, self.c))

    def fly(
        self, injected: Array, noise: Array, disturbance: Array, start: Array | None = None
    ) -> tuple[Array, Array]:
        """Commands and filtered rates of every loop; blocks in which no limit is met at once."""
        z = np.zeros(self.size) if start is None else start.copy()
        n = len(injected)
        commands, rates = np.empty(n), np.empty(n)
        rows = np.vstack([self.a, self.c, self.g])
        moved = np.outer(noise, self.b_n) + np.outer(disturbance, self.b_d)
        added = self.d * noise + injected
        seen, pushed, ahead_of = self._block()
        for first in range(0, n, BLOCK):
            some = slice(first, min(first + BLOCK, n))
            push = moved[some] + np.outer(added[some], self.b_u)
            if len(push) == BLOCK:
                path = (seen @ z + np.tensordot(pushed, push, 2)).T
                wanted = path[0] + added[some]
                if np.all(np.abs(wanted) <= FULL):
                    commands[some], rates[some] = wanted, path[1]
                    z = ahead_of[0] @ z + np.einsum("kij,kj->i", ahead_of[1], push)
                    continue
            for t in range(some.start, some.stop):
                ahead = rows @ z
                u = min(max(float(ahead[-2]) + added[t], -FULL), FULL)
                commands[t], rates[t] = u, ahead[-1]
                z = ahead[:-2] + self.b_u * u + moved[t]
        return commands, rates + self.h * noise

    def _block(self) -> tuple[Array, Array, tuple[Array, Array]]:
        """Of unlimited samples: outputs by start and by pushes, and the state behind them."""
        closed = self.a + np.outer(self.b_u, self.c)
        powers = [np.eye(self.size)]
        for _ in range(BLOCK):
            powers.append(closed @ powers[-1])
        out = np.array([np.vstack([self.c, self.g]) @ power for power in powers[:BLOCK]])
        pushed = np.zeros((BLOCK, 2, BLOCK, self.size))
        for t in range(1, BLOCK):
            pushed[t, :, :t] = out[:t][::-1].transpose(1, 0, 2)
        return out, pushed, (powers[BLOCK], np.array(powers[:BLOCK])[::-1])

    def loops(self) -> dict[str, Complex]:
        """Rate loop, whole loop (both broken at the command) and angle loop at `GRID`."""
        lag = np.exp(-1j * GRID * STEP_S)
        z, k = 1 / lag, self.gains
        # Rate and angle without damping share a pole: solved, not by eigenvectors.
        pencil = z[:, None, None] * np.eye(self.n) - self.ad
        states = np.linalg.solve(pencil, self.bd.astype(complex)[:, None])[:, -2:, 0].T
        plant, angle = states * lag**self.craft.delay
        b0, b1, b2, a1, a2 = low_pass(self.craft.gyro_hz)
        gyro = (b0 + b1 * lag + b2 * lag**2) / (1 + a1 * lag + a2 * lag**2)

        def pole(corner_hz: float) -> Complex:
            alpha = weight(corner_hz)
            return alpha / (1 - (1 - alpha) * lag)

        pid = k.p + k.i * STEP_S / (1 - lag) + k.d * pole(k.fltd_hz) * (1 - lag) / STEP_S
        rate = pid * gyro * plant
        outer = pid * pole(k.fltt_hz) * k.angle_p * lag * angle
        return {"rate loop": rate, "whole loop": rate + outer, "angle loop": outer / (1 + rate)}


def margins(loop: Complex) -> tuple[float, float]:
    """Least phase margin (deg) and gain margin upwards (dB) of a loop at `GRID`."""
    size = np.log(np.abs(loop))
    phase = np.unwrap(np.angle(loop))
    least = np.inf
    for k in np.flatnonzero(size[:-1] * size[1:] <= 0.0):
        share = size[k] / (size[k] - size[k + 1])
        at = phase[k] + share * (phase[k + 1] - phase[k])
        least = min(least, abs(np.degrees((at + 2 * np.pi) % (2 * np.pi) - np.pi)))
    turned = (phase + np.pi) / (2 * np.pi)
    room = np.inf
    for k in np.flatnonzero(np.floor(turned[:-1]) != np.floor(turned[1:])):
        edge = max(np.floor(turned[k]), np.floor(turned[k + 1]))
        share = (edge - turned[k]) / (turned[k + 1] - turned[k])
        height = size[k] + share * (size[k + 1] - size[k])
        if height < 0.0:
            room = min(room, -20.0 / np.log(10.0) * height)
    return float(least), float(room)
