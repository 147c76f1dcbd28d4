"""A DataFlash log of a flight by sticks alone, from the strangers' simulator."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from flightid.logs.dataflash.writer import DataflashWriter
from tests.strangers.ordinary_flights import Axis, Flown, ordinary

PARAMETERS = {
    "SCHED_LOOP_RATE": 400.0,
    "FRAME_CLASS": 1.0,
    "MOT_PWM_MIN": 1000.0,
    "MOT_PWM_MAX": 2000.0,
    "MOT_SPIN_MIN": 0.15,
    "MOT_SPIN_MAX": 0.95,
    "ATC_RAT_RLL_P": 0.12,
    **{f"SERVO{i}_FUNCTION": 32.0 + i for i in (1, 2, 3, 4)},
}


def write_ordinary_log(
    path: Path,
    *,
    axis: Axis | None = None,
    seed: int = 1,
    duration_s: float = 60.0,
    every: int = 4,
    size: float = 0.25,
    motors_us: tuple[float, ...] = (1500.0, 1500.0, 1500.0, 1500.0),
    vibe: float = 8.0,
    parameters: Mapping[str, float] = MappingProxyType({}),
) -> Flown:
    """Write a log whose roll axis flew in angle mode, logged at every `every`-th tick."""
    flown = ordinary(axis or Axis(), seed, duration_s, acro=False, size=size)
    stamps = (1e7 + 1e6 * flown.time_s).astype(np.int64)
    writer = DataflashWriter()
    writer.message(int(stamps[0]), "ArduCopter V4.6.0 (test)")
    for name, value in {**PARAMETERS, **parameters}.items():
        writer.parameter(name, value)
    rows = slice(None, None, every)
    writer.add(
        "RATE",
        stamps[rows],
        {
            "RDes": np.degrees(flown.rate_wanted[rows]),
            "R": np.degrees(flown.rate[rows]),
            "ROut": flown.command[rows],
        },
    )
    attitudes = {"DesRoll": np.degrees(flown.angle_wanted), "Roll": np.degrees(flown.angle)}
    writer.add("ANG", stamps[rows], {name: values[rows] for name, values in attitudes.items()})
    slow = slice(None, None, 40)
    writer.add("CTUN", stamps[slow], {"ThO": 0.4})
    writer.add("RCOU", stamps[slow], {f"C{i + 1}": us for i, us in enumerate(motors_us)})
    writer.add("VIBE", stamps[slow], {"VibeX": vibe, "VibeY": vibe, "VibeZ": vibe})
    writer.add("BAT", stamps[slow], {"Volt": np.linspace(16.4, 15.2, stamps[slow].size)})
    writer.write(path)
    return flown
