"""Records with the loop open and closed from a simulator of its own, in NumPy alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, signal

Array = NDArray[np.float64]
DT = 0.05
OMEGA = 3.0
SETTLING = 400
"""Samples before the record begins."""
REFERENCES = (
    "white", "coloured", "resonant", "prbs", "repeating prbs", "repeating held prbs", "held",
    "sweep", "multistep", "multisine",
)  # fmt: skip


def reference(kind: str, n: int, rng: np.random.Generator) -> Array:
    """What moves the input besides feedback; repeating ones repeat exactly."""
    time_s = np.arange(n) * DT
    if kind == "white":
        return rng.standard_normal(n)
    if kind == "coloured":
        return signal.lfilter([0.3], [1.0, -0.95], rng.standard_normal(n))
    if kind == "resonant":
        return signal.lfilter([0.05], [1.0, -1.862, 0.9604], rng.standard_normal(n))
    if kind == "prbs":
        return np.repeat(np.sign(rng.standard_normal(-(-n // 4))), 4)[:n]
    if kind == "repeating prbs":
        return np.resize(np.sign(rng.standard_normal(127)), n)
    if kind == "repeating held prbs":
        return np.resize(np.repeat(np.sign(rng.standard_normal(63)), 4), n)
    if kind == "held":
        return np.repeat(rng.standard_normal(-(-n // 6)), 6)[:n]
    if kind == "sweep":
        return signal.chirp(time_s, 0.08, time_s[-1], 3.2, method="logarithmic")
    if kind == "multisine":
        phases = rng.uniform(0.0, 2.0 * np.pi, 12)
        tones = np.linspace(0.1, 3.0, 12)
        return np.sum(np.sin(2.0 * np.pi * tones[:, None] * time_s + phases[:, None]), axis=0) / 3.0
    steps = np.zeros(n)
    first = 0
    while first < n:
        length = int(rng.integers(10, 80))
        steps[first : first + length] = rng.choice([-1.0, 0.0, 1.0])
        first += length
    return steps


def noise(pole: float, size: float, n: int, rng: np.random.Generator) -> Array:
    """White noise (pole 0) or a first-order one, of a standard deviation."""
    share = np.sqrt(1.0 - pole**2)
    return size * share * signal.lfilter([1.0], [1.0, -pole], rng.standard_normal(n))


def flight(
    kind: str,
    *,
    n: int,
    seed: int,
    zeta: float = 0.7,
    pole: float = 0.0,
    size: float = 0.1,
    gain: float = 0.0,
    integral: float = 0.0,
) -> tuple[Array, Array]:
    """Input and output of a second-order vehicle; feedback acts one sample late.

    Returns
    -------
    tuple of ndarray, each shape (n,)
    """
    rng = np.random.default_rng(seed)
    generator = np.zeros((3, 3))
    generator[:2, :2] = [[0.0, 1.0], [-(OMEGA**2), -2.0 * zeta * OMEGA]]
    generator[1, 2] = OMEGA**2
    step = linalg.expm(generator * DT)
    total = n + SETTLING
    r, v = reference(kind, total, rng), noise(pole, size, total, rng)
    (one, two, in_one), (three, four, in_two), _ = step.tolist()
    rows, place, rate, late, sum_y = [], 0.0, 0.0, 0.0, 0.0
    for asked, error in zip(r.tolist(), v.tolist(), strict=True):
        sum_y += DT * late
        u = asked - gain * late - integral * sum_y
        late = place + error
        rows.append((u, late))
        place, rate = (
            one * place + two * rate + in_one * u,
            three * place + four * rate + in_two * u,
        )
    u, y = np.array(rows[SETTLING:]).T
    return u, y
