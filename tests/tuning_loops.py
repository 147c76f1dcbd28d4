"""Loops whose tuning is known in closed form, and closed-loop poles computed another way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots import AxisLoop
from flightid.control.tuning.loop_problem import LoopProblem, Plants
from flightid.control.tuning.requirements import TuningRequirements
from flightid.control.tuning.sampled_plants import SampledPlants, loop_grid

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
LOW = {"P": 1e-3, "I": 1e-4, "D": 0.0, "A": 0.1}
HIGH = {"P": 1e2, "I": 1e3, "D": 10.0, "A": 1e2}


@dataclass(frozen=True)
class ContinuousPid:
    """P + I/s + D s/(1 + s/120) with an angle gain."""

    kinds: tuple[str, ...]

    def feedback(self, omega_rad_s: Array) -> Complex:
        s = 1j * omega_rad_s
        terms = {"P": np.ones_like(s), "I": 1 / s, "D": s / (1 + s / 120.0)}
        return np.array([terms[kind] for kind in self.kinds if kind != "A"])

    def forward(self, omega_rad_s: Array) -> Complex:
        terms = self.feedback(omega_rad_s)
        return np.vstack([terms, np.zeros_like(terms[:1])])

    def angle(self, omega_rad_s: Array) -> Complex:
        return np.ones_like(omega_rad_s, dtype=np.complex128)


def integrators_with_delay(
    gains: Array, delays_s: Array, kinds: tuple[str, ...], **required: object
) -> LoopProblem:
    """Plants k e^(−Ls)/s under a continuous controller."""
    omega = loop_grid(0.001, 900)
    s = 1j * omega
    rate = gains[:, None] * np.exp(-np.outer(delays_s, s)) / s
    plants = Plants(omega, rate, rate / s, np.ones_like(rate), np.zeros(len(gains), dtype=np.int64))
    low, high = (np.array([bound[kind] for kind in kinds]) for bound in (LOW, HIGH))
    need = TuningRequirements(**required)  # type: ignore[arg-type]
    return LoopProblem(plants, ContinuousPid(kinds), kinds, low, high, need)


def closed_loop_poles(plants: SampledPlants, row: int, loop: AxisLoop, *, angle: bool) -> Complex:
    """Poles of an ArduCopter axis around a sampled plant, from polynomials in z."""
    system, whole = plants.systems[row], int(plants.delays[row][0])
    a, b, c, d, _ = system.state_space()
    assert not np.any(d)
    below = np.poly(a)
    above = [np.poly(a - np.outer(b[:, 0], line)) - below for line in c]
    step, gains = plants.sample_time_s, {role: loop.values[role] for role in loop.values}

    def weight(cutoff_hz: float) -> float:
        return 1.0 if cutoff_hz <= 0 else step / (step + 1 / (2 * np.pi * cutoff_hz))

    def pole(cutoff_hz: float) -> tuple[Array, Array]:
        alpha = weight(cutoff_hz)
        return np.array([alpha, 0.0]), np.array([1.0, alpha - 1.0])

    error, slope, target = (pole(gains[role]) for role in ("flte", "fltd", "fltt"))
    difference = np.array([1.0, -1.0])
    # (P + I T z/(z−1) + D (z−1)/(T z) F(z)) E(z), over (z−1) z F_below E_below.
    common = np.polymul(np.polymul(difference, [1.0, 0.0]), slope[1])
    pid = gains["p"] * common
    pid = np.polyadd(
        pid, gains["i"] * step * np.polymul(np.polymul([1.0, 0.0], [1.0, 0.0]), slope[1])
    )
    pid = np.polyadd(
        pid, gains["d"] / step * np.polymul(np.polymul(difference, difference), slope[0])
    )
    control, control_below = np.polymul(pid, error[0]), np.polymul(common, error[1])
    late = np.zeros(whole + 1)
    late[0] = 1.0
    if not angle:
        whole_below = np.polymul(np.polymul(below, late), control_below)
        return np.roots(np.polyadd(whole_below, np.polymul(above[0], control)))
    outer = np.polymul(np.polymul(control, target[0]), above[1]) * loop.angle_gain_1_s
    outer_below = np.polymul(target[1], [1.0, 0.0])
    inner = np.polymul(np.polymul(control, above[0]), outer_below)
    closed = np.polymul(np.polymul(np.polymul(below, late), control_below), outer_below)
    return np.roots(np.polyadd(np.polyadd(closed, inner), outer))


def largest_pole(plants: SampledPlants, row: int, loop: AxisLoop, *, angle: bool) -> float:
    """Largest size of a closed-loop pole; without the angle loop its own integrator is left out."""
    poles = closed_loop_poles(plants, row, loop, angle=angle)
    if not angle:
        poles = np.delete(poles, np.argmin(np.abs(poles - 1.0)))
    return float(np.abs(poles).max())
