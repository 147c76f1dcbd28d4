"""Rigs that work about a point far from zero and start away from it, so that means are no trims."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.signal import lfilter

import flightid as fid
from tests.strangers import noises
from tests.strangers.black_boxes import STEP_S, Noise, fly, recorded
from tests.strangers.counting import Case

SAMPLES = 600
POLE, GAIN = 0.97, 4.0
A, B = [1.0, -POLE], [0.0, GAIN * (1.0 - POLE)]
TRUTH = {"frequency": -np.log(POLE) / STEP_S, "gain": GAIN}
WORKING_POINT, LEVEL = 5.0, 20.0
"""Of the input, which is at zero before the record, and of the output at rest."""
SHARE = 0.1
P = fid.PolynomialModel


def levels(random: np.random.Generator, n: int) -> noises.Array:
    """A level of random size every two seconds."""
    return np.repeat(random.standard_normal(n // 20), 20)


def prbs(random: np.random.Generator, n: int) -> noises.Array:
    """One of two levels, drawn every second."""
    return np.repeat(random.choice((-1.0, 1.0), n // 10), 10)


def doublets(random: np.random.Generator, n: int) -> noises.Array:
    """Four steps a record, of random moment and size."""
    made = np.zeros(n)
    for start in np.sort(random.integers(0, n, 4)):
        made[start:] = random.uniform(-2.0, 2.0)
    return made


Moves = Callable[[np.random.Generator, int], noises.Array]


def started(
    random: np.random.Generator, *, moves: Moves, noise: Noise, in_equation: bool = False
) -> fid.Record:
    """The rig is switched on with the record: its first time constants run up to the point."""
    u = WORKING_POINT + moves(random, SAMPLES)
    y = lfilter(B, A, u)
    size = SHARE * float(np.std(y[SAMPLES // 3 :]))
    error = size * noise(random, SAMPLES)
    if in_equation:
        error = lfilter([1.0], A, error)
    return recorded(u, LEVEL + y + error)


NOISE_POLE = 0.9
RED: Noise = partial(noises.ar1, pole=NOISE_POLE)
BOXES: dict[str, tuple[object, Noise, bool]] = {
    "oe": (P.oe("u", "y", nb=1, nf=1), noises.white, False),
    "bj": (P.bj("u", "y", nb=1, nc=0, nd=1, nf=1), RED, False),
    "arx": (P.arx("u", "y", na=1, nb=1), noises.white, True),
    "armax": (P.armax("u", "y", na=1, nb=1, nc=1), noises.white, False),
    "subspace": (fid.InnovationsModel.subspace("u", "y", order=1), noises.white, False),
}
CASES = tuple(
    Case(
        f"operating point, {name}, {moves.__name__}",
        partial(
            fly,
            flight=partial(started, moves=moves, noise=noise, in_equation=in_equation),
            structure=structure,
            truth=TRUTH | ({"d1": -NOISE_POLE} if name == "bj" else {}),
        ),
    )
    for name, (structure, noise, in_equation) in BOXES.items()
    for moves in (levels, prbs, doublets)
)
