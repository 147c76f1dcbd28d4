"""Margins of two identified rigs, or of two sets of gains: do intervals of differences hold."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import flightid as fid
from flightid.control.stepped.gain_controller import pid_controller
from flightid.errors import FlightidError
from tests.strangers.counting import Case, Reading, Trial

STEP_S, SAMPLES, HELD, LATER = 0.01, 2000, 15, 5000
"""Sample time, s; samples of a record; samples of a step of the input; seeds between records."""


@dataclass(frozen=True)
class Rig:
    """A rate behind a lag and whole samples of delay, driven by held steps."""

    pole: float = 4.0
    gain: float = 40.0
    delay: int = 3
    noise: float = 0.2

    def response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Of the held input to the sampled rate."""
        late = np.exp(-1j * omega * STEP_S)
        kept = np.exp(-self.pole * STEP_S)
        made = self.gain / self.pole * (1 - kept) * late / (1 - kept * late) * late**self.delay
        return np.asarray(made)

    def record(self, seed: int) -> fid.Record:
        """A record of steps by chance."""
        random = np.random.default_rng(seed)
        u = np.repeat(random.choice([-0.2, 0.2], SAMPLES // HELD + 1), HELD)[:SAMPLES]
        late = np.concatenate([np.zeros(self.delay), u[: SAMPLES - self.delay]])
        kept, rate = np.exp(-self.pole * STEP_S), np.zeros(SAMPLES)
        for k in range(SAMPLES - 1):
            rate[k + 1] = kept * rate[k] + self.gain / self.pole * (1 - kept) * late[k]
        seen = rate + self.noise * random.standard_normal(SAMPLES)
        return fid.Record.from_arrays(
            STEP_S * np.arange(SAMPLES), inputs={"tau_phi": u}, outputs={"p": seen},
            units={"p": "rad/s"}, hold="zero", loop="open",
        )  # fmt: skip


@dataclass(frozen=True)
class Gains:
    """P and I, the integral by backward differences."""

    p: float = 0.3
    i: float = 0.5

    def response(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Of the rate to the output, with the opposite sign."""
        return np.asarray(self.p + self.i * STEP_S / (1 - np.exp(-1j * omega * STEP_S)))

    @property
    def table(self) -> dict[str, object]:
        """As a file of gains has it."""
        return {"output": "p", "Kp": self.p, "Ki": self.i, "sample_time_s": STEP_S}


def truths(rig: Rig, gains: Gains) -> dict[str, float]:
    """Crossover, margins and disturbance bandwidth by bisection."""

    def loop(omega: float) -> complex:
        at = np.array([omega])
        return complex((rig.response(at) * gains.response(at))[0])

    grid = np.geomspace(0.5, 0.999 * np.pi / STEP_S, 4000)
    rows = rig.response(grid) * gains.response(grid)

    def first(values: NDArray[np.float64], of: object) -> float:
        place = int(np.flatnonzero(np.diff(np.sign(values)))[0])
        return float(brentq(of, grid[place], grid[place + 1]))  # type: ignore[arg-type]

    crossover = first(np.abs(rows) - 1.0, lambda w: abs(loop(w)) - 1.0)
    phases = np.unwrap(np.angle(rows))
    turned = phases - 2 * np.pi * np.round((phases[0] + np.pi / 2) / (2 * np.pi)) + np.pi
    place = int(np.flatnonzero(np.diff(np.sign(turned)))[0])
    turn = float(brentq(lambda w: loop(w).imag, grid[place], grid[place + 1]))
    level = 10 ** (-3 / 20)
    phase = 180.0 + np.degrees(np.angle(loop(crossover)))
    return {
        "crossover": crossover,
        "phase margin": float(phase),
        "gain margin": -20.0 * float(np.log10(abs(loop(turn)))),
        "delay margin": float(np.radians(phase)) / crossover,
        "sensitivity peak": float(np.max(1.0 / np.abs(1.0 + rows))),
        "disturbance bandwidth": first(
            1.0 / np.abs(1.0 + rows) - level, lambda w: 1.0 / abs(1.0 + loop(w)) - level
        ),
    }


def fitted(rig: Rig, seed: int) -> fid.Fit:
    """The rig identified from a record."""
    return fid.identify(
        fid.load_model("rate_first_order", axis="roll"), rig.record(seed), method="output_error"
    )


def compared(before: tuple[object, Gains], after: tuple[object, Gains]) -> fid.MarginComparison:
    """Margins of two rigs under their gains."""
    sides = [
        (source, pid_controller([gains.table], getattr(source, "model", source), 1 / STEP_S))
        for source, gains in (before, after)
    ]
    return fid.compare_margins(sides[0], sides[1])


def fly_pair(seed: int, *, before: tuple[Rig, Gains], after: tuple[Rig, Gains], one: bool) -> Trial:
    """Differences of every margin; of one fit, or of a fit of each rig."""
    begun = time.perf_counter()
    try:
        fit = fitted(before[0], seed)
        other = fit if one else fitted(after[0], seed + LATER)
        found = compared((fit, before[1]), (other, after[1]))
    except FlightidError as error:
        return Trial(refusal=str(error), seconds=time.perf_counter() - begun)
    old, new = truths(*before), truths(*after)
    readings = []
    for change in found.changes:
        told, exact = change.difference, new[change.name] - old[change.name]
        if told.value is not None:
            readings.append(Reading(change.name, exact, told.value, told.stderr, told.interval95))
    return Trial(tuple(readings), "", time.perf_counter() - begun)


CASES = tuple(
    Case(f"margins, {name}", partial(fly_pair, before=before, after=after, one=one))
    for name, before, after, one in (
        ("one rig twice", (Rig(), Gains()), (Rig(), Gains()), False),
        ("a rig half again as quick", (Rig(), Gains()), (Rig(6.0, 60.0), Gains()), False),
        ("one fit, two sets of gains", (Rig(), Gains()), (Rig(), Gains(0.5, 1.0)), True),
    )
)
