"""Stand-in for the rig's own recorder: runs a simulated twin rotor and writes CSV files.

    python fly.py [FOLDER] [--seed N]

One channel at a time is moved about its trim, the other holds its trim voltage: a pseudo-random
binary sequence of 2 Hz half-power bandwidth for 120 s at 10 Hz, then doublets and 3-2-1-1s whose
steps suit the mode of pitch (short) or yaw (long).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid.excitation import doublet, multistep, prbs
from flightid.files import write_atomically
from flightid.record import Record
from flightid.vehicles import TwinRotor

RATE_HZ = 10.0
AMPLITUDE_V = 0.1
STEPS_S = {"pitch": (1.1, 0.8), "yaw": (4.2, 2.9)}
"""Steps of doublet and 3-2-1-1: 2.3 and 1.6 over a mode's natural frequency in rad/s."""


def moves() -> dict[str, NDArray[np.float64]]:
    """Departures from trim by name of the manoeuvre, V."""
    # 5 levels a second: half the power lies below 2.2 Hz.
    sequence = prbs(order=10, clock_hz=5.0, amplitude=AMPLITUDE_V, sample_rate_hz=RATE_HZ)
    made = {"prbs": sequence.signals[0, :1200]}
    common = {"amplitude": AMPLITUDE_V, "sample_rate_hz": RATE_HZ, "lead_s": 2.0, "tail_s": 25.0}
    for axis, (two, four) in STEPS_S.items():
        made[f"doublet_{axis}"] = doublet(step_s=two, **common).signals[0]
        made[f"3211_{axis}"] = multistep(step_s=four, **common).signals[0]
    return made


def fly(rig: TwinRotor, seed: int) -> list[Record]:
    """Every manoeuvre on every channel, each in air of its own."""
    plan = [(channel, name, move) for channel in ("u1", "u2") for name, move in moves().items()]
    return [
        rig.run(
            {channel: move}, sample_time_s=1 / RATE_HZ, seed=seed + place, name=f"{channel}_{name}"
        )
        for place, (channel, name, move) in enumerate(plan)
        if not (channel == "u2" and name.endswith("pitch"))
    ]


def write_csv(record: Record, folder: Path) -> Path:
    """Time, voltages and measured angles, as a rig's computer would write them."""
    rows = np.column_stack([record.time_s, record.matrix(("u1", "u2", "y1", "y2")).T])
    lines = ["time [s],u1 [V],u2 [V],y1 [rad],y2 [rad]"]
    lines += [",".join(f"{value:.7g}" for value in row) for row in rows]
    return write_atomically(folder / f"{record.name}.csv", "\n".join(lines) + "\n")


def main() -> None:
    """Fly and write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("records"))
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for record in fly(TwinRotor(), given.seed):
        print(write_csv(record, given.folder))


if __name__ == "__main__":
    main()
