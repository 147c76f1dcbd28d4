"""Stand-in for the rig's own recorder: one degree of freedom, files as MATLAB saves them.

    python fly.py [FOLDER] [--seed N]

The yaw axis is locked. The main rotor's voltage moves about its trim: uniform noise and a
pseudo-random binary sequence of the same amplitude, 120 s each at 5 Hz, then a doublet and a
3-2-1-1 of half the amplitude.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from flightid.excitation import doublet, multistep, prbs, uniform_noise
from flightid.record import Record
from flightid.vehicles import TwinRotor

RATE_HZ = 5.0
AMPLITUDE_V = 1.0
N_SAMPLES = 600


def moves(seed: int) -> dict[str, NDArray[np.float64]]:
    """Departures from trim by name of the manoeuvre, V."""
    both = {"clock_hz": RATE_HZ, "amplitude": AMPLITUDE_V, "sample_rate_hz": RATE_HZ}
    noise = uniform_noise(duration_s=N_SAMPLES / RATE_HZ, seed=seed, **both)
    sequence = prbs(order=10, **both)
    half = {
        "amplitude": 0.5 * AMPLITUDE_V,
        "sample_rate_hz": RATE_HZ,
        "lead_s": 2.0,
        "tail_s": 25.0,
    }
    return {
        "noise": noise.signals[0, :N_SAMPLES],
        "prbs": sequence.signals[0, :N_SAMPLES],
        "doublet": doublet(step_s=1.2, **half).signals[0],
        "3211": multistep(step_s=0.8, **half).signals[0],
    }


def fly(rig: TwinRotor, seed: int) -> list[Record]:
    """Every manoeuvre, each in air of its own."""
    return [
        rig.locked().run({"u1": move}, sample_time_s=1 / RATE_HZ, seed=seed + place, name=name)
        for place, (name, move) in enumerate(moves(seed).items())
    ]


def write_mat(record: Record, folder: Path) -> Path:
    """Time, voltage and measured pitch as variables of a MATLAB file, which knows no units."""
    path = folder / f"{record.name}.mat"
    savemat(path, {"t": record.time_s, "voltage": record["u1"], "pitch": record["y1"]})
    return path


def main() -> None:
    """Fly and write."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("records"))
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for record in fly(TwinRotor(), given.seed):
        print(write_mat(record, given.folder))


if __name__ == "__main__":
    main()
