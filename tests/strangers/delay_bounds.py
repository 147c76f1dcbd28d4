"""What records know of a delay: the likelihood that more poles with another delay lose, expected.

Run: python -m tests.strangers.delay_bounds [--runs 200]

Plants of two poles and a zero behind a delay, as `tests/truth/test_delays_truth.py` draws them. For
every delay beside the true one the best structure of one to three poles is fitted to the noise-free
output, weighed by the true noise: what it leaves is the least that twice the log likelihood loses
on average (twice the Kullback-Leibler divergence; its curvature is the information of Cramér and
Rao, over steps of whole samples that a derivative does not see). Where that is less than
`UNCERTAIN`, no test of these data tells the two apart.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

import flightid as fid
from flightid.identification.advice.delayed_output_error import (
    DelayedSignals,
    output_error,
    refined,
)
from flightid.identification.advice.delays import POLES, UNCERTAIN, find_delays
from flightid.models.sampled.channels import gather_channels

KINDS = ("white", "prbs", "sweep", "coloured", "periodic", "multisine")
MORE = (-0.6, 0.0, 0.4, 0.7, 0.9, 0.97)
"""Poles that a third one begins at."""
TRIED = 20


@dataclass(frozen=True)
class DelayedPlant:
    """A plant, what drives it, and what its output is measured with.

    `below` is the noise's denominator, `noise` the deviation of what drives that.
    """

    delay: int
    a: np.ndarray
    u: np.ndarray
    clean: np.ndarray
    below: np.ndarray
    noise: float
    measured: np.ndarray

    @property
    def record(self) -> fid.Record:
        """As a log."""
        time_s = np.arange(self.u.size) / 50
        return fid.Record.from_arrays(time_s, inputs={"u": self.u}, outputs={"y": self.measured})


def _input(random: np.random.Generator, kind: str, n: int) -> np.ndarray:
    t = np.arange(n)
    if kind == "white":
        return random.standard_normal(n)
    if kind == "prbs":
        return np.repeat(random.choice([-1.0, 1.0], n // 4 + 1), 4)[:n]
    if kind == "sweep":
        rate = np.log(1.5 / 0.02)
        return np.sin(0.02 * n / rate * (np.exp(t / n * rate) - 1.0))
    if kind == "coloured":
        return lfilter([1.0], [1.0, -0.9], random.standard_normal(n))
    if kind == "periodic":
        return np.resize(random.choice([-1.0, 1.0], 255), n)
    phases = random.uniform(0.0, 2.0 * np.pi, 120)
    lines = 2.0 * np.pi / 500 * np.arange(1, 121)
    return np.cos(np.outer(t, lines) + phases).sum(axis=1) / 8


def drawn(seed: int) -> DelayedPlant:
    """A second-order plant, damping 0.02 every other time, with a delay of 0 to 12 samples."""
    random, n = np.random.default_rng(seed), 2000
    damping = 0.02 if seed // 6 % 2 else random.uniform(0.2, 1.0)
    omega = np.exp(random.uniform(np.log(0.1), np.log(1.2)))
    pole = np.exp(omega * (-damping + 1j * np.sqrt(1.0 - damping**2)))
    a = np.array([1.0, -2.0 * pole.real, abs(pole) ** 2])
    delay = int(random.integers(0, 13))
    u = _input(random, KINDS[seed % 6], n)
    b = np.concatenate([np.zeros(delay), [1.0, random.uniform(-0.9, 1.0)]])
    y = lfilter(b, a, u)
    below = a if random.random() < 0.3 else np.array([1.0, -random.uniform(0.0, 0.95)])
    noise = lfilter([1.0], below, random.standard_normal(n))
    size = float(random.uniform(0.03, 0.3) * y.std() / noise.std())
    return DelayedPlant(delay, a, u, y, below, size, y + noise * size)


def lost(plant: DelayedPlant, delay: int) -> float:
    """Twice the log likelihood that the best structure with another delay loses, on average."""
    white = lfilter(plant.below, [1.0], np.vstack([plant.clean, plant.u])) / plant.noise
    n = white.shape[1]
    pulse = np.zeros(n)
    pulse[0] = 1.0
    data, skip = DelayedSignals(np.vstack([white, pulse]), (n,), levels=False), TRIED + max(POLES)
    starts = {2: [plant.a], 3: [np.convolve(plant.a, [1.0, -pole]) for pole in MORE]}
    least = np.inf
    for order, begun in starts.items():
        for below in begun:
            end = refined(
                data, [delay], order, skip, output_error(data, [delay], order, skip, below)
            )
            rows, numbers = n - skip, 2 * order
            least = min(least, rows * float(np.exp((end[0] - numbers * np.log(rows)) / rows)))
    return least


def main() -> None:
    """Delays told, and what is left open, beside what the data know."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    asked = parser.parse_args()
    counts = dict.fromkeys(("told", "open", "of these unknowable", "told, unknowable"), 0)
    for seed in range(asked.runs):
        plant = drawn(seed)
        (found,) = find_delays(gather_channels([plant.record], "y", ("u",), "mean"), 40)
        low, high = found.interval or (0, 0)
        ends = {k: lost(plant, k) for k in {low, high} if k != plant.delay}
        beside = {k: lost(plant, k) for k in (plant.delay - 2, plant.delay + 2) if k >= 0}
        near = [k for k in range(max(plant.delay - 8, 0), plant.delay + 9) if k != plant.delay]
        if found.samples is None:
            alike = [k for k in near if lost(plant, k) <= UNCERTAIN]
            reach = (min([*alike, plant.delay]), max([*alike, plant.delay]))
            counts["open"] += 1
            counts["of these unknowable"] += reach[1] - reach[0] > 2
            said = ", ".join(f"{k}: {ends[k]:.3g}" for k in sorted(ends))
            print(
                f"{seed:4d} {KINDS[seed % 6]:9s} delay {plant.delay:2d} told {low} to {high}; "
                f"known to {reach[0]} to {reach[1]}; ends lose {said}",
                flush=True,
            )
        else:
            counts["told"] += 1
            counts["told, unknowable"] += all(each <= UNCERTAIN for each in beside.values())
    print(counts)


if __name__ == "__main__":
    main()
