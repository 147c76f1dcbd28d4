"""Records as strangers bring them: exact, clipped, coloured, constant, with gaps, of any scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

import flightid as fid

Array = NDArray[np.float64]
LENGTHS = (3, 4, 6, 9, 15, 30, 60, 100, 160)
SCALES = (1e-12, 1e-6, 1e-3, 1.0, 1.0, 1.0, 1e3, 1e6, 1e12)
POLES = (-0.9, -0.5, 0.0, 0.0, 0.5, 0.9, 0.999)
NOISES = (0.0, 0.0, 1e-9, 0.01, 0.1, 1.0, 100.0)
HOLDS = (None, "zero", "first", "band_limited")


@dataclass(frozen=True)
class Flights:
    """Records with the names of their channels and what was done to them."""

    records: list[fid.Record]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    story: str


def flown(random: np.random.Generator) -> Flights:
    """One to three records of one drawn vehicle; a faulty record is refused when it is made.

    Raises
    ------
    DataError
        What `Record.from_arrays` says of gaps and the like.
    """
    count = int(random.choice([1, 1, 1, 2, 3]))
    n_in, n_out = int(random.choice([1, 1, 1, 2, 3])), int(random.choice([1, 1, 1, 2, 3, 5]))
    order = int(random.integers(1, 7))
    poles = random.uniform(0.2, 1.0, order)
    if random.random() < 0.1:
        poles[0] = random.choice([1.0, 1.02, 1.2])
    gains = random.standard_normal((n_out, n_in))
    fault = str(random.choice(["", "", "", "", "flat", "clip", "equal", "gap", "still", "spike"]))
    colour, level = random.choice(POLES), random.choice(NOISES)
    scales = random.choice(SCALES, 2)
    step_s, hold = float(random.choice([1e-3, 0.02, 0.1, 1.0])), random.choice(HOLDS)
    names = tuple(f"u{k}" for k in range(n_in)), tuple(f"y{k}" for k in range(n_out))
    records = []
    for _ in range(count):
        n = int(random.choice(LENGTHS))
        u = _inputs(random, n_in, n)
        y = gains @ lfilter([0.0, 1.0], np.poly(poles), u)
        noise = lfilter([1.0], [1.0, -colour], random.standard_normal((n_out, n)))
        u, y = _spoiled(random, u, y + level * (y.std() or 1.0) * noise, fault)
        records.append(
            fid.Record.from_arrays(
                np.arange(n) * step_s,
                inputs=dict(zip(names[0], scales[0] * u, strict=True)),
                outputs=dict(zip(names[1], scales[1] * y, strict=True)),
                units=dict.fromkeys((*names[0], *names[1]), "1"),
                hold=hold,
            )
        )
    return Flights(records, *names, f"{fault or 'sound'}, noise {level:g}, scales {scales}")


def _inputs(random: np.random.Generator, count: int, n: int) -> Array:
    kind = random.integers(4)
    if kind == 0:
        return random.standard_normal((count, n))
    if kind == 1:
        return np.repeat(random.choice([-1.0, 0.0, 1.0], (count, n // 5 + 1)), 5, axis=1)[:, :n]
    if kind == 2:
        return np.sin(np.outer(random.uniform(0.01, 1.0, count), np.arange(n)))
    return np.clip(3.0 * random.standard_normal((count, n)), -1.0, 1.0)


def _spoiled(random: np.random.Generator, u: Array, y: Array, fault: str) -> tuple[Array, Array]:
    place = int(random.integers(len(y)))
    if fault == "flat":
        y[place] = random.choice([0.0, 1.0])
    elif fault == "still":
        u[:] = random.choice([0.0, 1.0])
    elif fault == "clip":
        y[place] = np.clip(y[place], *np.quantile(y[place], [0.3, 0.7]))
    elif fault == "equal":
        y[place], u[-1] = y[0], u[0]
    elif fault == "gap":
        y[place, random.integers(y.shape[1])] = random.choice([np.nan, np.inf])
    elif fault == "spike":
        y[place, random.integers(y.shape[1])] *= 1e9
    return u, y
