"""Hovers with dynamics that no structure of the library holds, low in the band of their sweeps.

Run: python -m tests.strangers.lacking --runs 120 [--first-seed 0] [--keep FILE]

Each is a shape in series with motors and rate: what a slung load, fuel, flapping or a trim that
follows slowly make of a command. Written with SciPy alone; flown by `hover`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from tests.strangers.gain_counts import Outcome
from tests.strangers.gains import METHODS, Flight, count, drawn, flown_gains, outcome_of
from tests.strangers.hover import Vehicle, vehicle

Array = NDArray[np.float64]
Shape = tuple[Array, Array]
"""Numerator and denominator, highest power first."""
STRUCTURES = ("rate_motor_lag", "rate_motor_lag", "rate_motor_lag", "rate_second_order")
BY_WAY = ("instrument", "prewhitened", "output_error", "joint")
"""Methods that keep the loop's noise out, and those that tuning takes back to the excitation."""


def pair(zero: tuple[float, float], pole: tuple[float, float]) -> Shape:
    """Unit steady gain, two zeros over two poles: frequency (rad/s) and damping ratio of each."""
    top, bottom = (np.array([1.0 / w**2, 2.0 * z / w, 1.0]) for w, z in (zero, pole))
    return top, bottom


def lead(zero: float, pole: float) -> Shape:
    """One zero over one pole (rad/s), unit gain far above both."""
    return np.array([1.0, zero]), np.array([1.0, pole])


def light_mode(r: np.random.Generator) -> Shape:
    """A lightly damped mode that the command moves a little, below the crossover."""
    w, zeta = r.uniform(2.5, 12.0), r.uniform(0.04, 0.2)
    return pair((w * np.exp(r.uniform(-0.06, 0.06)), zeta), (w, zeta))


def pendulum(r: np.random.Generator) -> Shape:
    """A slung load: the vehicle is held fast at its own frequency, and swings faster with it."""
    w, zeta, share = r.uniform(2.0, 9.0), r.uniform(0.05, 0.2), np.exp(r.uniform(-4.5, -1.8))
    faster = np.sqrt(1.0 + share)
    return pair((w, zeta), (w * faster, zeta * faster))


def slow_zero(r: np.random.Generator) -> Shape:
    """A zero and a pole about the low end of the band."""
    zero = np.exp(r.uniform(np.log(0.3), np.log(4.0)))
    return lead(zero, zero * np.exp(r.uniform(-0.7, 0.7)))


def trim_lag(r: np.random.Generator) -> Shape:
    """Part of the answer fades as a trim follows it."""
    pole = np.exp(r.uniform(np.log(0.2), np.log(2.0)))
    return lead(pole * r.uniform(0.3, 0.9), pole)


def integrator(r: np.random.Generator) -> Shape:
    """Nothing but the rate: its damping is what the structure lacks, or has too much."""
    return np.ones(1), np.ones(1)


KINDS: dict[str, Callable[[np.random.Generator], Shape]] = {
    "light mode": light_mode,
    "pendulum": pendulum,
    "slow zero": slow_zero,
    "trim lag": trim_lag,
    "integrator": integrator,
}


def shaped(craft: Vehicle, shape: Shape) -> Vehicle:
    """A vehicle whose command goes through a shape first."""
    top, bottom = shape
    if len(bottom) == 1:
        return craft
    a, b, c, d = signal.tf2ss(top, bottom)
    n = len(a)
    whole = np.block([[a, np.zeros((n, len(craft.a)))], [np.outer(craft.b, c), craft.a]])
    moved = np.concatenate([b[:, 0], craft.b * float(d[0, 0])])
    return replace(craft, a=whole, b=moved)


def drawn_lacking(seed: int) -> Flight:
    """A flight as of `gains.drawn`, of a vehicle that its structure does not hold."""
    r = np.random.default_rng([seed, 41])
    kind = [*KINDS][seed % len(KINDS)]
    damping = 0.0 if kind == "integrator" and r.uniform() < 0.5 else -float(r.uniform(0.5, 6.0))
    craft = vehicle(
        kind,
        effect=float(np.exp(r.uniform(np.log(60), np.log(300)))),
        damping=damping,
        motor_s=float(r.uniform(0.02, 0.09)),
        delay=int(r.integers(1, 9)),
        gyro_hz=float(r.uniform(30, 90)),
    )
    craft = shaped(craft, KINDS[kind](r))
    structure = STRUCTURES[r.integers(len(STRUCTURES))]
    if kind == "integrator":
        structure = "rate_integrator_motor_lag" if damping else "rate_first_order"
    methods = [*BY_WAY]
    weights = np.array([METHODS[name] for name in methods], dtype=float)
    method = str(r.choice(methods, p=weights / weights.sum()))
    usual = drawn(seed)
    return replace(
        usual, craft=craft, flown=flown_gains(craft, r), structure=structure, method=method
    )


def tried(seed: int) -> Outcome:
    """Draw, fly, fit, tune and fly what was tuned."""
    return outcome_of(drawn_lacking(seed), seed)


if __name__ == "__main__":
    count({"lacking": tried}, __doc__)
