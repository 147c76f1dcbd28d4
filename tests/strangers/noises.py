"""Disturbances as they are met: coloured, drifting, quantised, spiked, gusts of Dryden's form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

Array = NDArray[np.float64]
SETTLING = 4000
"""Samples thrown away before a coloured sequence counts as stationary."""


def white(random: np.random.Generator, n: int) -> Array:
    """Unit variance."""
    return random.standard_normal(n)


def ar1(random: np.random.Generator, n: int, pole: float) -> Array:
    """First-order autoregression of unit variance, stationary from its first sample."""
    drive = np.sqrt(1.0 - pole**2) * random.standard_normal(n)
    drive[0] = random.standard_normal()
    return lfilter([1.0], [1.0, -pole], drive)


def ar2(random: np.random.Generator, n: int, radius: float, angle: float) -> Array:
    """Resonant noise: poles of that radius and angle (rad per sample), unit variance."""
    poles = [1.0, -2.0 * radius * np.cos(angle), radius**2]
    found = lfilter([1.0], poles, random.standard_normal(n + SETTLING))[SETTLING:]
    a1, a2 = poles[1], poles[2]
    variance = (1 + a2) / ((1 - a2) * ((1 + a2) ** 2 - a1**2))
    return found / np.sqrt(variance)


def drift(random: np.random.Generator, n: int) -> Array:
    """White noise on a random walk that ends about one standard deviation away."""
    walk = np.cumsum(random.standard_normal(n)) / np.sqrt(n)
    return random.standard_normal(n) + walk


def quantised(values: Array, step: float) -> Array:
    """Values as an encoder of that step gives them."""
    return step * np.round(values / step)


def spiked(random: np.random.Generator, values: Array, count: int, size: float) -> Array:
    """Values with a few single samples off by `size`."""
    out = values.copy()
    out[random.choice(values.size, count, replace=False)] += size * random.choice((-1, 1), count)
    return out


def dryden_vertical(
    random: np.random.Generator, n: int, step_s: float, sigma: float, time_s: float
) -> Array:
    """Vertical gust, MIL-F-8785C: sigma * sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2, T = L / V."""
    return _gust(
        random, n, step_s, sigma, [np.sqrt(3.0) * time_s, 1.0], [time_s**2, 2.0 * time_s, 1.0]
    )


def dryden_along(
    random: np.random.Generator, n: int, step_s: float, sigma: float, time_s: float
) -> Array:
    """Longitudinal gust, MIL-F-8785C: first-order lag of T = L / V seconds."""
    return _gust(random, n, step_s, sigma, [1.0], [time_s, 1.0])


def _gust(
    random: np.random.Generator,
    n: int,
    step_s: float,
    sigma: float,
    numerator: list[float],
    denominator: list[float],
) -> Array:
    b, a, _ = cont2discrete((numerator, denominator), step_s, method="bilinear")
    long = lfilter(b.ravel(), a, random.standard_normal(20 * n + SETTLING))
    return sigma * long[-n:] / _deviation(b.ravel(), a)


def _deviation(b: Array, a: Array) -> float:
    pulse = np.zeros(200_000)
    pulse[0] = 1.0
    return float(np.sqrt(np.sum(lfilter(b, a, pulse) ** 2)))
