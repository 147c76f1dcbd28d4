"""Logs that hold nothing to be identified, of which an inspection may carry no axis, and good ones.

The roll axis of `hover`, loops closed, written as an ArduCopter log of 45 s in the air. What can be
wrong with a log is done to it: nothing injected, too little of it, on the bench, cut, slow, a gyro
that stands still, units. "Green" is an axis that carries a model without anything red beside it;
"red" one that does not, or something red.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.signal import chirp

import flightid as fid
from flightid.conventions import Light
from flightid.inspection.carried import carried_axes
from flightid.logs.dataflash.writer import DataflashWriter
from tests.strangers import noises
from tests.strangers.counting import Case, Trial
from tests.strangers.hover import STEP_S, Axis, Gains, vehicle

AIR_S, GROUND_S = 45.0, 4.0
LOWEST_HZ = 0.3
Array = noises.Array


@dataclass(frozen=True)
class Flown:
    """What a log is written of."""

    amplitude: float
    top_hz: float
    every: int = 2
    air_s: float = AIR_S
    gust: float = 0.004
    injected: bool = True
    on_the_bench: bool = False
    stands_still: float = 0.0
    unit: float = 180.0 / np.pi


def sound(random: np.random.Generator) -> Flown:
    """A sweep that moves the vehicle well beyond its gusts."""
    return Flown(
        amplitude=float(random.uniform(0.1, 0.25)),
        top_hz=float(random.uniform(6.0, 12.0)),
        every=int(random.choice([1, 2, 4])),
        gust=float(np.exp(random.uniform(np.log(0.001), np.log(0.008)))),
    )


BARREN: dict[str, dict[str, object]] = {
    "nothing injected": {"injected": False},
    "injection within gusts": {"amplitude": 0.001, "gust": 0.02},
    "on the bench": {"on_the_bench": True},
    "cut": {"air_s": 4.0},
    "slow log": {"every": 80},
    "dead gyro": {"stands_still": 0.7},
    "rad/s for deg/s": {"unit": 1.0},
}


def write(flown: Flown, random: np.random.Generator, path: Path) -> None:
    """Fly it, and write its log."""
    n = round(flown.air_s / STEP_S)
    t = np.arange(n) * STEP_S
    fade = np.clip(np.minimum(t, AIR_S - t) / 2.0, 0.0, 1.0)
    sweep = flown.amplitude * fade * chirp(t, LOWEST_HZ, AIR_S, flown.top_hz, "logarithmic")
    sweep *= flown.injected
    effect = float(np.exp(random.uniform(np.log(80), np.log(250))))
    craft = vehicle(
        "motor lag", effect=effect, damping=-float(random.uniform(1.0, 5.0)), motor_s=0.05
    )
    gains = Gains(5.0 / effect, 5.0 / effect, 0.0, 3.0)
    gusts = flown.gust * noises.ar1(random, n, 0.995)
    hiss = 0.01 * random.standard_normal(n)
    commands, rates = Axis(craft, gains).fly(sweep, hiss, gusts)
    still = slice(round((1.0 - flown.stands_still) * n), None)
    rates[still] = rates[still][0] if flown.stands_still else rates[still]
    ground = np.zeros(round(GROUND_S / STEP_S))
    whole = [np.concatenate([ground, each, ground]) for each in (commands, rates)]
    _logged(flown, sweep, whole[0], whole[1], path)


def _logged(flown: Flown, sweep: Array, commands: Array, rates: Array, path: Path) -> None:
    n = commands.size
    stamps = (1e7 + 1e6 * STEP_S * np.arange(n)).astype(np.int64)
    lead = round(GROUND_S / STEP_S)
    flying = np.zeros(n, dtype=bool)
    flying[lead : n - lead] = not flown.on_the_bench
    writer = DataflashWriter()
    writer.message(int(stamps[0]), "ArduCopter V4.6.0 (test)")
    motors = {f"SERVO{i}_FUNCTION": 32.0 + i for i in (1, 2, 3, 4)}
    limits = {"MOT_PWM_MIN": 1000.0, "MOT_PWM_MAX": 2000.0, "SCHED_LOOP_RATE": 400.0}
    for name, value in {**motors, **limits}.items():
        writer.parameter(name, value)
    rows, slow = slice(None, None, flown.every), slice(None, None, 40)
    writer.add(
        "RATE",
        stamps[rows],
        {"ROut": commands[rows], "R": flown.unit * rates[rows], "RDes": np.zeros(n)[rows]},
    )
    writer.add("IMU", stamps[rows], {"GyrX": rates[rows]})
    bank = np.degrees(np.cumsum(rates) * STEP_S)
    writer.add("ATT", stamps[slow], {"Roll": bank[slow]})
    writer.add("CTUN", stamps[slow], {"ThO": np.where(flying, 0.4, 0.0)[slow]})
    outputs = np.where(flying, 1500.0, 1000.0)[slow]
    writer.add("RCOU", stamps[slow], {f"C{i}": outputs for i in (1, 2, 3, 4)})
    if flown.injected:
        during = stamps[lead : n - lead]
        told = {"Ax": 10, "Mag": flown.amplitude, "FSt": LOWEST_HZ, "FSp": flown.top_hz}
        writer.add("SIDS", during[:1], {**told, "TC": 0.0, "TR": AIR_S - 1.0})
        waveform = STEP_S * np.arange(during.size)
        kept = slice(None, None, flown.every)
        writer.add("SIDD", during[kept], {"Time": waveform[kept], "Targ": sweep[kept]})
    writer.write(path)


def inspected(seed: int, *, change: dict[str, object]) -> Trial:
    """One log, inspected as the command does."""
    random, begun = np.random.default_rng([seed, 1215]), time.process_time()
    flown = replace(sound(random), **change)  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.bin"
        write(flown, random, path)
        found = fid.inspect_log(path)
    red = found.verdict in (Light.RED, Light.UNKNOWN)
    light = str(found.verdict) if red else ("green" if carried_axes(found) else "red")
    return Trial(light=light, seconds=time.process_time() - begun)


def _case(group: str, name: str, change: dict[str, object]) -> Case:
    fly: Callable[[int], Trial] = partial(inspected, change=change)
    return Case(f"{group}: {name}, inspected", fly)


LIGHTS = (
    *(_case("barren", name, change) for name, change in BARREN.items()),
    _case("sound", "sweep", {}),
)
