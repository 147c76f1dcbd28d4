"""First use by the clock: a wheel, a fresh environment, an empty folder, one command each.

    python tools/stopwatch.py WHEEL LOG [--keep FOLDER]

LOG is the demo's (`make demo` leaves demo-output/flight.bin, `flightid simulate quadrotor` writes
one); it is renamed. The rig is a second-order one with a delay and coloured noise, made in SciPy.
Prints wall and processor time of each step, and ends with 1 where a step after the installation
takes a minute of processor time, or leaves no gains with margins. Wall is that of this machine as
loaded as it is.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.signal import cont2discrete, lfilter

LONGEST_S = 60.0
RIG_HZ, RIG_S, FINE_S = 20.0, 120.0, 0.01


class Step(NamedTuple):
    """What one command took."""

    name: str
    wall_s: float
    processor_s: float
    said: str


def main() -> int:
    """Time every step and print the table."""
    asked = _asked()
    place = asked.keep or Path(tempfile.mkdtemp(prefix="stopwatch-"))
    python = _environment(place / "venv")
    pip = [str(python), "-m", "pip", "install", "--quiet", str(asked.wheel.resolve())]
    steps = [_timed("pip install", pip, place)]
    command = str(python.with_name("flightid"))
    folder = _empty(place / "log")
    shutil.copy(asked.log, folder / "tuesday.bin")
    steps.append(_timed("tune tuesday.bin", [command, "tune", "tuesday.bin"], folder))
    folder = _empty(place / "rig")
    write_rig(folder / "rig.csv")
    told = ["rig.csv", "--inputs", "u", "--outputs", "y"]
    steps.append(_timed("tune rig.csv", [command, "tune", *told], folder))
    print(f"{'step':20s} {'wall [s]':>9s} {'CPU [s]':>9s}")
    for step in steps:
        print(f"{step.name:20s} {step.wall_s:9.1f} {step.processor_s:9.1f}")
    bad = [s.name for s in steps[1:] if s.processor_s > LONGEST_S or not _has_gains(s.said)]
    for name in bad:
        print(f"{name}: more than {LONGEST_S:.0f} s of processor time, or no gains with margins")
    if asked.keep is None:
        shutil.rmtree(place)
    return int(bool(bad))


def _asked() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="First use by the clock.")
    parser.add_argument("wheel", type=Path)
    parser.add_argument("log", type=Path)
    parser.add_argument("--keep", type=Path, help="leave environment, answers and reports here")
    return parser.parse_args()


def _environment(folder: Path) -> Path:
    """The Python of a fresh environment."""
    venv.create(folder, with_pip=True, clear=True)
    return folder / ("Scripts" if os.name == "nt" else "bin") / "python"


def _empty(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def _timed(name: str, command: list[str], folder: Path) -> Step:
    """Run a command in a folder; what it prints is kept beside it."""
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    wall_s, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    said = done.stdout + done.stderr
    (folder / f"{name.split(maxsplit=1)[0]}.txt").write_text(f"{' '.join(command)}\n{said}")
    return Step(name, wall_s, spent, said)


def write_rig(path: Path, seed: int = 7) -> None:
    """A rig's records: 3.4 rad/s, damping 0.3, delay 80 ms, noise of one pole at 0.9."""
    rng = np.random.default_rng(seed)
    n = round(RIG_S * RIG_HZ)
    omega, zeta, gain = 3.4, 0.3, 1.8
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]])
    b, c = np.array([[0.0], [gain * omega**2]]), np.array([[1.0, 0.0]])
    fine = round(1.0 / RIG_HZ / FINE_S)
    ad, bd, *_ = cont2discrete((a, b, c, np.zeros((1, 1))), FINE_S)
    u = np.repeat(rng.choice([-1.0, 1.0], n // 8 + 1), 8)[:n] * 0.5
    held = np.concatenate([np.zeros(round(0.08 / FINE_S)), np.repeat(u, fine)])
    state, y = np.zeros(2), np.empty(n)
    for k in range(n):
        y[k] = state[0]
        for each in held[k * fine : (k + 1) * fine]:
            state = ad @ state + bd[:, 0] * each
    noise = lfilter([1.0], [1.0, -0.9], rng.standard_normal(n))
    y += 0.05 * y.std() * noise / noise.std()
    rows = np.column_stack([np.arange(n) / RIG_HZ, u, y])
    np.savetxt(path, rows, "%.6g", ",", header="t,u,y", comments="")


def _has_gains(said: str) -> bool:
    """Gains, and the phase margin that they keep."""
    return "phase margin" in said and ("Gains to fly" in said or "Gains of the controller" in said)


if __name__ == "__main__":
    sys.exit(main())
