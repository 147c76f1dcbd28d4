"""Loops that `advise` sees in records of open ones, and the delays that it tells.

Run: python -m tests.strangers.open_loops --runs 500 [--first-seed 6000]. Rigs of SciPy, moved in
four ways, by an input that repeats, lightly damped ones (ζ 0.02), and swept ones whose two light
modes stiffen as they move; 1 % is the nominal rate. With --kind noisy the input is measured with
noise beside an output of a fast rig that is cleaner, which foretells it: "unknown" is what can be
told, and delays are not asked.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter

import numpy as np
from scipy.signal import cont2discrete, lfilter

import flightid as fid
from flightid.evidence import FeedbackTest
from tests.strangers.rig_lights import INPUTS, STEP_S, Array, Rig, injected, noise

KINDS = (*INPUTS, "repeats", "light", "stiffens")
ZETA, PERIOD, SAMPLES = 0.02, 300, 2400
NOISY = "noisy"


def drawn(seed: int, kind: str = "") -> tuple[str, int, fid.Record]:
    """Kind, that of the seed unless named, samples until the input acts, and the record."""
    random = np.random.default_rng([seed, 1906])
    if kind == NOISY:
        return kind, 1, _noisily_measured(seed, random)
    kind, rig = kind or KINDS[seed % len(KINDS)], Rig(random)
    if kind == "stiffens":
        return kind, 1, _stiffening(random)
    u = _input(random, kind, rig.omega)
    y, late = rig.answer(u), rig.delay + 1
    if kind == "light":
        den = [rig.omega**-2, 2.0 * ZETA / rig.omega, 1.0]
        b, a, _ = cont2discrete(([2.0], den), STEP_S, "zoh")
        y = lfilter(np.concatenate([np.zeros(rig.delay), b.ravel()]), a, u)
    y = y + noise(random, y.size, float(random.uniform(0.02, 0.2)) * float(np.std(y)))
    time_s = np.arange(y.size) * STEP_S
    record = fid.Record.from_arrays(time_s, inputs={"u": u}, outputs={"y": y}, hold="zero")
    return kind, late, record


def _stiffening(random: np.random.Generator) -> fid.Record:
    """The second of three sweeps of an arm, its torque measured with 0.1 % noise."""
    n = 512
    modes = zip(
        (random.uniform(0.3, 0.45), random.uniform(0.7, 0.95)),
        random.uniform(0.003, 0.02, 2),
        strict=True,
    )
    turned = 2.0 * np.pi * np.cumsum(np.linspace(0.01, 0.16, n)) + random.uniform(0.0, 6.28)
    u = np.tile(np.sin(turned), 3) + 1e-3 * random.standard_normal(3 * n)
    y = np.zeros(3 * n)
    for omega, zeta in modes:
        b, a, _ = cont2discrete(([omega**2], [1.0, 2.0 * zeta * omega, omega**2]), 1.0, "zoh")
        y += random.uniform(0.3, 1.0) * lfilter(b.ravel(), a, u)
    y += random.choice([0.01, 0.07]) * np.std(y) * (y / np.std(y)) ** 3
    y += 1e-3 * np.std(y) * random.standard_normal(3 * n)
    part = slice(n, 2 * n)
    time_s = np.arange(n) * STEP_S
    return fid.Record.from_arrays(
        time_s, inputs={"u": u[part]}, outputs={"y": y[part]}, hold="zero"
    )


def _noisily_measured(seed: int, random: np.random.Generator) -> fid.Record:
    """A lag of 2 to 8 samples, noise of 1 to 15 % on its input and of a tenth of that behind it."""
    n, tau = int(random.integers(1000, 3000)), float(random.uniform(0.04, 0.15))
    way = (*INPUTS, "coloured")[seed % (len(INPUTS) + 1)]
    if way == "coloured":
        u = lfilter([1.0], [1.0, -1.6, 0.7], random.standard_normal(n))
    else:
        u = injected(random, way, n, float(random.uniform(2.0, 8.0)))
    decay, size = np.exp(-STEP_S / tau), float(np.exp(random.uniform(np.log(0.01), np.log(0.15))))
    y = lfilter([0.0, 1.0 - decay], [1.0, -decay], u)
    y = y + noise(random, n, 0.1 * size * float(np.std(y)))
    seen = u + size * float(np.std(u)) * random.standard_normal(n)
    return fid.Record.from_arrays(np.arange(n) * STEP_S, inputs={"u": seen}, outputs={"y": y})


def _input(random: np.random.Generator, kind: str, omega: float) -> Array:
    if kind == "repeats":
        held = max(round(0.5 / omega / STEP_S), 1)
        levels = np.repeat(random.choice([-1.0, 1.0], PERIOD), held)[:PERIOD]
        return np.resize(levels, SAMPLES)
    return injected(random, "prbs" if kind == "light" else kind, SAMPLES, omega)


def _found(record: fid.Record, kind: str) -> tuple[FeedbackTest, int | None]:
    """The loop that is seen, and the delay that is told."""
    if kind == NOISY:
        return fid.feedback_test(record), None
    found = fid.advise(record)
    return found.feedback, found.delays.get("u")


def main() -> None:
    """Count by kind: records, loops that are not there, delays told, off by more than a sample."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--first-seed", type=int, default=6000)
    parser.add_argument("--kind", choices=(*KINDS, NOISY), default="", help="of all records")
    parser.add_argument("--until-s", type=float, default=np.inf, help="stop after so many seconds")
    asked = parser.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    begun = time.monotonic()
    for seed in range(asked.first_seed, asked.first_seed + asked.runs):
        if time.monotonic() - begun > asked.until_s:
            break
        kind, late, record = drawn(seed, asked.kind)
        loop, told = _found(record, kind)
        off = told is not None and abs(told - late) > 1
        closed = loop.is_closed
        facts = {"records": True, "closed": closed, "unknown": not loop.is_known}
        facts |= {"told": told is not None, "off": off}
        counts.update(
            (each, name) for name, true in facts.items() if true for each in (kind, "all")
        )
        if closed or off:
            print(f"{seed} {kind}: {loop}; delay {told} of {late}", flush=True)
    print(f"{'':12s} records  closed unknown    told  off by more than one")
    for kind in (*KINDS, NOISY, "all"):
        row = (counts[kind, name] for name in ("records", "closed", "unknown", "told", "off"))
        print(f"{kind:12s}" + "".join(f"{value:8d}" for value in row))


if __name__ == "__main__":
    main()
