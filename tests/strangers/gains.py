"""Gains flown: tunings over right and wrong structures, methods and noise, each in `hover`.

Run: python -m tests.strangers.gains --runs 500 [--first-seed 0] [--family rig] [--keep FILE]

`rig` is `tests.strangers.rig_gains`; `bare` draws hovers without a bending frame; `--rigid` does so
too, and declares them rigid. A promise is broken where the vehicle with the tuned gains is unstable
or saturates hands off, or where its own worst margin lies below the lowest that the table prints
for that loop.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import chirp

import flightid as fid
from flightid.control.tuning import tune_pid
from flightid.conventions import Light
from tests.strangers import noises, rig_gains
from tests.strangers.gain_counts import Outcome, collected, table
from tests.strangers.hover import STEP_S, Axis, Gains, Vehicle, margins, vehicle

TRUTHS = (
    "first order", "motor lag", "motor lag, no damping", "flapping", "motor lag and flapping",
    "motor lag, flexible frame", "motor lag, stiffer frame",
)  # fmt: skip
BARE = tuple(name for name in TRUTHS if "frame" not in name)
"""Of vehicles that hold no light mode: flapping is damped by 0.4 or more."""
FRAMES_HZ = {"flexible": (7.0, 14.0), "stiffer": (15.0, 35.0)}
STRUCTURES = (
    "rate_first_order", "rate_gain_lag", "rate_integrator", "rate_integrator_motor_lag",
    "rate_motor_lag", "rate_second_order", "published",
)  # fmt: skip
METHODS = {
    "instrument": 8, "frequency_domain": 2, "prewhitened": 2, "output_error": 3,
    "output_error, closed": 3, "joint": 1, "equation_error": 1, "filter_error": 1,
}  # fmt: skip
"""And how often each is drawn; ", closed": told that the loop was."""
HOLDS = {
    "first order": ("rate_first_order", "rate_gain_lag", "rate_motor_lag", "rate_second_order"),
    "motor lag": ("rate_motor_lag", "rate_second_order"),
    "motor lag, no damping": ("rate_integrator_motor_lag", "rate_motor_lag"),
    "flapping": (),
    "motor lag and flapping": (),
    "motor lag, flexible frame": (),
    "motor lag, stiffer frame": (),
}
"""Structures that hold a truth; the gyro's filter is a delay to all."""
NEARLY = ("rate_motor_lag", "rate_second_order")
"""What lacks a frame's bending alone."""
TOLERANCE = {"phase margin": 0.25, "gain margin": 0.1}
"""Of grids and interpolation: deg, dB."""
QUIET_S, SATURATED = 8.0, 0.02
OTHER = 10**6
"""From the seed of one sweep to that of the next."""
NAMES = {
    "p": "ATC_RAT_RLL_P",
    "i": "ATC_RAT_RLL_I",
    "d": "ATC_RAT_RLL_D",
    "angle_p": "ATC_ANG_RLL_P",
}


@dataclass(frozen=True)
class Flight:
    """What was drawn for a seed."""

    craft: Vehicle
    flown: Gains
    structure: str
    method: str
    noise: float
    gust: float
    every: int
    amplitude: float
    top_hz: float
    sweeps: int

    @property
    def right(self) -> bool:
        """Whether the structure holds the truth."""
        return self.structure in HOLDS.get(self.craft.name, ())


def drawn(seed: int, truths: Sequence[str] = TRUTHS) -> Flight:
    """Vehicle, flown gains, structure, method and noise."""
    r = np.random.default_rng(seed)
    name = truths[r.integers(len(truths))]
    lagged = "motor" in name
    craft = vehicle(
        name,
        effect=float(np.exp(r.uniform(np.log(60), np.log(300)))),
        damping=0.0 if "no damping" in name else -float(r.uniform(0.5, 6.0)),
        motor_s=float(r.uniform(0.02, 0.09)) if lagged else 0.0,
        mode=(float(r.uniform(9, 30)), float(r.uniform(0.4, 0.9))) if "flapping" in name else None,
        frame=_frame(name, r),
        delay=int(r.integers(1, 9)),
        gyro_hz=float(r.uniform(30, 90)),
    )
    weights = np.array([*METHODS.values()]) / sum(METHODS.values())
    method = str(r.choice([*METHODS], p=weights))
    fitting = (HOLDS[name] or NEARLY) if r.uniform() < 0.65 else STRUCTURES
    structure = fitting[r.integers(len(fitting))]
    if method == "equation_error":
        structure = "published"
    elif structure == "published":
        method = "output_error"
    return Flight(
        craft, flown_gains(craft, r), structure, method,
        noise=float(np.exp(r.uniform(np.log(0.003), np.log(0.05)))),
        gust=float(np.exp(r.uniform(np.log(0.002), np.log(0.03)))),
        every=int(r.choice([1, 1, 4])),
        amplitude=float(r.uniform(0.08, 0.3)),
        top_hz=float(r.uniform(4.0, 20.0)),
        sweeps=int(r.choice([1, 2, 2])),
    )  # fmt: skip


def _frame(name: str, r: np.random.Generator) -> tuple[float, float, float] | None:
    for word, (low, high) in FRAMES_HZ.items():
        if word in name:
            return float(2 * np.pi * r.uniform(low, high)), 0.02, float(r.uniform(0.05, 0.25))
    return None


def flown_gains(craft: Vehicle, r: np.random.Generator) -> Gains:
    """Timid gains: lowered until the margins are 40° and 8 dB, outer loops and I faster than P.

    Lowered alike they would never be stable around an undamped rate: I over P and the angle's gain
    have to fall beside the crossover.
    """
    p = r.uniform(3.0, 8.0) / craft.about["effect"]
    gains = Gains(p, p, float(r.choice([0.0, 0.015])) * p, float(r.uniform(2.0, 5.0)))
    while True:
        axis = Axis(craft, gains)
        least = [margins(loop) for loop in axis.loops().values()]
        stable = np.abs(axis.poles()).max() < 1.0
        if stable and min(m[0] for m in least) > 40 and min(m[1] for m in least) > 8:
            return gains
        gains = replace(
            gains, p=gains.p / 1.4, i=gains.i / 2.4, d=gains.d / 1.4, angle_p=gains.angle_p / 1.6
        )


def record(flight: Flight, seed: int, duration_s: float = 60.0) -> fid.Record:
    """A sweep injected at the command with both loops closed, as a log at every loop or fourth.

    Of the latter half tell how their inputs move between samples.
    """
    r = np.random.default_rng([seed, 7])
    n = round(duration_s / STEP_S)
    t = np.arange(n) * STEP_S
    fade = np.clip(np.minimum(t, t[-1] - t) / 2.0, 0.0, 1.0)
    sweep = flight.amplitude * fade * chirp(t, 0.1, t[-1], flight.top_hz, method="logarithmic")
    commands, rates = Axis(flight.craft, flight.flown).fly(
        sweep, flight.noise * r.standard_normal(n), flight.gust * noises.ar1(r, n, 0.995)
    )
    kept = slice(None, None, flight.every)
    return fid.Record.from_arrays(
        t[kept],
        inputs={"tau_phi": commands[kept]},
        outputs={"p": rates[kept]},
        excitations={"injected": sweep[kept]},
        units={"p": "rad/s"},
        hold="zero" if flight.every == 1 else (None, "band_limited")[seed % 2],
    )


def structure_of(name: str) -> fid.TransferFunctionModel | fid.StateSpaceModel:
    """A library structure; "published": that of the rig study, without lag and delay."""
    if name != "published":
        return fid.load_model(name, axis="roll")
    return fid.StateSpaceModel(
        states={"p": "rad/s"},
        input_units={"tau_phi": "1"},
        measurements={"p": fid.Output("p", "rad/s")},
        equations={"p'": "Lp*p + Ltphi*tau_phi"},
        parameters=fid.Parameters(
            [
                fid.Parameter("Lp", -3.0, "1/s", -60.0, 0.0),
                fid.Parameter("Ltphi", 100.0, "rad/s^2", 0.0, 2000.0),
            ]
        ),
    )


def fitted(flight: Flight, seed: int) -> fid.Fit:
    """By the method of the flight, as the documentation says."""
    model = structure_of(flight.structure)
    name, _, told = flight.method.partition(", ")
    data = [record(flight, seed + OTHER * k) for k in range(flight.sweeps)]
    if told:
        data = [each.declare(loop=told) for each in data]
    if name in ("output_error", "equation_error", "filter_error"):
        return fid.identify(model, data, method=name)
    estimator = name if name in ("instrument", "prewhitened") else "composite"
    response = fid.estimate_response(data, inputs="tau_phi", outputs="p", estimator=estimator)
    if name == "joint":
        return fid.identify(model, (response, record(flight, seed + 7 * OTHER)), method="joint")
    return fid.identify(model, response)


def loop_of(gains: Gains, flight: Flight) -> fid.AxisLoop:
    """The axis as flightid knows it."""
    values = {NAMES[key]: getattr(gains, key) for key in NAMES}
    values |= {"ATC_RAT_RLL_FLTE": gains.flte_hz, "ATC_RAT_RLL_FLTD": gains.fltd_hz}
    values |= {"ATC_RAT_RLL_FLTT": gains.fltt_hz, "INS_GYRO_FILTER": flight.craft.gyro_hz}
    usual = fid.axis_loop("arducopter", "roll", loop_rate_hz=1 / STEP_S)
    return usual.with_gains({name: value for name, value in values.items() if name in usual.gains})


def tried(seed: int, *, draws: int = 120) -> Outcome:
    """Draw, fly, fit, tune and fly what was tuned."""
    return outcome_of(drawn(seed), seed, draws=draws)


def tried_bare(seed: int, *, draws: int = 120, rigid: bool = False) -> Outcome:
    """The same of vehicles that hold no light mode, declared rigid or not."""
    return outcome_of(drawn(seed, BARE), seed, draws=draws, rigid=rigid)


def outcome_of(flight: Flight, seed: int, *, draws: int = 120, rigid: bool = False) -> Outcome:
    """Fly, fit, tune and fly what was tuned."""
    begun = time.process_time()

    def outcome(verdict: str, why: str, broken: str = "", wasted: bool = False) -> Outcome:
        return Outcome(
            seed, flight.craft.name, flight.structure, flight.method, flight.right, verdict, why,
            broken, time.process_time() - begun, wasted,
        )  # fmt: skip

    try:
        fit = fitted(flight, seed)
    except fid.FlightidError as error:
        return outcome("refused", str(error))
    except np.linalg.LinAlgError as error:
        return outcome("fault", str(error))
    options = {"gains": loop_of(flight.flown, flight), "draws": draws, "seed": seed, "rigid": rigid}
    try:
        design = fid.tune_pid(fit, **options)
    except fid.FlightidError as error:
        return outcome("refused", str(error), wasted=_would_hold(fit, flight, seed, options))
    if not design.exists:
        lost = flight.right and known_exactly(flight, options, design)
        return outcome("none", design.findings[0].message, wasted=lost)
    red = [f.message for f in design.findings if f.light is Light.RED]
    broken = broken_promise(design, flight, seed)
    if red:
        return outcome("red", "; ".join(red), broken, flight.right and not broken)
    light = max((f.light for f in design.findings), key=[*Light].index)
    doubts = "; ".join(f"{f.code}" for f in design.findings if f.light is not Light.GREEN)
    return outcome(str(light), doubts, broken)


def known_exactly(flight: Flight, options: dict[str, Any], found: fid.PidDesign) -> bool:
    """Whether one who knew the vehicle would find gains inside the band that the data showed."""
    craft, n = flight.craft, len(flight.craft.a)
    truth = fid.LinearSystem(
        craft.a, craft.b[:, None], np.eye(n)[[-2]], [[0.0]], ("tau_phi",), ("p",),
        [craft.delay * STEP_S],
    )  # fmt: skip
    band = found.provenance["band_rad_s"]
    known = fid.tune_pid(truth, gyro="raw", nominal=True, band_rad_s=band, **options | {"draws": 1})
    return known.exists


def _would_hold(fit: fid.Fit, flight: Flight, seed: int, options: dict[str, Any]) -> bool:
    """Whether refused gains of a right structure would have flown as promised."""
    if not flight.right:
        return False
    try:
        design = fid.tune_pid(fit, accept_red=True, nominal=fit.covariance is None, **options)
    except (fid.FlightidError, TypeError):
        return False
    return design.exists and not broken_promise(design, flight, seed)


def broken_promise(design: fid.PidDesign, flight: Flight, seed: int) -> str:
    """Fly the tuned gains, and compare their own margins with the least promised."""
    new = replace(flight.flown, **{key: design.gains[NAMES[key]] for key in NAMES})
    axis = Axis(flight.craft, new)
    if np.abs(axis.poles()).max() >= 1.0:
        return "unstable"
    if share := saturation(axis, flight, seed):
        return f"saturated {share:.0%}"
    for name, loop in axis.loops().items():
        for kind, true in zip(("phase margin", "gain margin"), margins(loop), strict=True):
            least = design.worst_case(name, kind).worst
            if least is not None and true < least - TOLERANCE[kind]:
                return f"{name}: {kind} {true:.2f}, promised {least:.2f}"
    return ""


def saturation(axis: Axis, flight: Flight, seed: int) -> float:
    """Share of saturated loops hands off, above what a quiet vehicle has."""
    r, n = np.random.default_rng([seed, 11]), round(QUIET_S / STEP_S)
    push = np.where(np.arange(n) < 40, 0.1, 0.0)
    commands, _ = axis.fly(push, flight.noise * r.standard_normal(n), np.zeros(n))
    share = float(np.mean(np.abs(commands[n // 2 :]) >= 1.0))
    return share if share > SATURATED else 0.0


def count(families: Mapping[str, Callable[[int], Outcome]], description: str | None) -> None:
    """Count by options of the command line; the first family by default."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--family", choices=(*families,), default=next(iter(families)))
    parser.add_argument("--keep", type=Path, help="file that outcomes are added to, and read from")
    parser.add_argument("--rigid", action="store_true", help="bare hovers, declared rigid")
    parser.add_argument("--each", action="store_true", help="one line for every tuning")
    asked = parser.parse_args()
    tune_pid.response_bands = lambda *_: ()  # pictures, which no gain depends on
    made = partial(tried_bare, rigid=True) if asked.rigid else families[asked.family]
    if asked.rigid and asked.family not in ("hover", "bare"):
        parser.error(f"--rigid is of hovers, not of --family {asked.family}")
    seeds = range(asked.first_seed, asked.first_seed + asked.runs)

    def show(found: Outcome) -> None:
        if asked.each or (found.broken and found.is_made):
            print(found.row(), flush=True)

    print(table(collected(seeds, made, asked.keep, show)))


if __name__ == "__main__":
    count({"hover": tried, "bare": tried_bare, "rig": rig_gains.tried}, __doc__)
