"""The whole linear study of a twin-rotor rig, beside what was published of a real one.

    python analyse.py [FOLDER] [--seed N]

Flies the simulated rig, runs study.toml on its records, and prints: modes by channel beside the
published ones and those of the rig's own equations; the identified transfer functions in the
published form; and what the published transfer functions themselves imply.

Published: Ahmad, Chipperfield & Tokhi, parametric modelling of a twin-rotor system in hover
(ARMAX, 600 samples at 10 Hz), table 1 and equations (3) to (6).
"""

from __future__ import annotations

import argparse
import math
import shutil
from pathlib import Path

import numpy as np
from fly import fly, write_csv
from numpy.typing import ArrayLike

import flightid as fid
from flightid.models.sampled.discrete_modes import discrete_modes
from flightid.study import run_study
from flightid.table import Cell, Column, Table
from flightid.vehicles import TwinRotor

HERE = Path(__file__).parent
SAMPLE_TIME_S = 0.1
PUBLISHED_HZ = {"y1/u1": "0.1 and 0.34", "y2/u1": "0.1", "y2/u2": "0.1", "y1/u2": "no coupling"}
EQUATION_3 = (
    (-0.0007, 0.007, 0.0001, 0.006),
    (1.0, -2.372, 1.465, 0.2673, -0.351),
)
"""Numerator and denominator in falling powers of z."""
ROOTS = {
    "(3), y1/u1": (np.roots(EQUATION_3[0]), np.roots(EQUATION_3[1])),
    "(5), y2/u1": (
        [0.6971, 0.0515 + 1.8236j, 0.0515 - 1.8236j],
        [0.9573, -0.5961, 0.9773 + 0.0492j, 0.9773 - 0.0492j],
    ),
    "(6), y2/u2": (
        [-1.48, 0.91 + 1.5089j, 0.91 - 1.5089j],
        [0.773, -0.582, 0.982 + 0.0497j, 0.982 - 0.0497j],
    ),
}
"""Zeros and poles; those of (4) follow from (3)."""


def rig_modes() -> str:
    """Modes of the simulated rig's own linear equations, Hz."""
    poles = np.linalg.eigvals(TwinRotor().linearised().state_space()[0])
    said = [
        f"{abs(pole) / (2 * math.pi):.3f} Hz (ζ {-pole.real / abs(pole):.2f})"
        for pole in sorted(poles, key=abs)
        if pole.imag >= 0
    ]
    return "; ".join(said)


def table_1(study: fid.Study) -> Table:
    """Natural frequencies of each channel's oscillation beside the published ones."""
    columns = (
        Column("channel"),
        Column("published", "Hz"),
        Column("natural frequency", "Hz", 3),
        Column("± (95 %)", "Hz", 2),
        Column("damping", digits=2),
        Column("structure"),
    )
    rows: list[tuple[Cell, ...]] = []
    for item in study.identified:
        channel = f"{item.settings.structure.outputs[0]}/{item.settings.structure.inputs[0]}"
        if item.fit is None:
            rows.append((channel, PUBLISHED_HZ[channel], None, None, None, "left out"))
            continue
        for root in item.fit.details.modes:
            frequency, damping = root.natural_frequency, root.damping
            if frequency is None or damping is None:
                continue
            hertz = 1 / (2 * math.pi)
            rows.append(
                (
                    channel,
                    PUBLISHED_HZ[channel],
                    frequency.value * hertz,
                    None if frequency.stderr is None else 1.96 * frequency.stderr * hertz,
                    damping.value,
                    item.fit.structure.orders_text,
                )
            )
    notes = (
        f"the rig's own equations, without Coulomb friction: {rig_modes()}",
        "damping ratio 1 stands for a real pole; Coulomb friction makes the identified damping "
        "larger than that of the equations without it, the more the smaller the motion",
    )
    return Table("Table 1: identified natural frequencies", columns, tuple(rows), notes)


def in_z(values: ArrayLike) -> str:
    """A polynomial in falling powers of z, as the paper prints it."""
    row = np.trim_zeros(np.asarray(values, dtype=np.float64), "f")
    top = row.size - 1
    said = ""
    for place, value in enumerate(row):
        if value == 0.0:
            continue
        power = top - place
        letter = "" if power == 0 else ("z" if power == 1 else f"z^{power}")
        number = "" if place == 0 and value == 1.0 and letter else f"{abs(value):.4g}"
        sign = ("-" if value < 0 else "") if place == 0 else (" - " if value < 0 else " + ")
        said += f"{sign}{number}{letter}"
    return said


def factored(roots: ArrayLike) -> str:
    """Product of (z - root), as equations (4) to (6) print it."""
    every = np.atleast_1d(np.asarray(roots, dtype=np.complex128))
    at_origin = int(np.sum(every == 0.0))
    said = ["" if not at_origin else ("z" if at_origin == 1 else f"z^{at_origin}")]
    for root in every[every != 0.0]:
        real = f"{'-' if root.real >= 0 else '+'} {abs(root.real):.4g}"
        imaginary = f" {'-' if root.imag > 0 else '+'} {abs(root.imag):.4g}i"
        said.append(f"(z {real}{imaginary if abs(root.imag) > 1e-9 else ''})")
    return "".join(said) or "1"


def equation(fit: fid.Fit) -> str:
    """The identified transfer function expanded and factored."""
    model = fit.model
    above, below = model.transfer(model.inputs[0])
    size = max(above.size, below.size)
    numerator, denominator = (np.pad(row, (0, size - row.size)) for row in (above, below))
    # Common powers of z: trailing zeros of both.
    while numerator[-1] == 0.0 and denominator[-1] == 0.0:
        numerator, denominator = numerator[:-1], denominator[:-1]
    name = f"{model.output}/{model.inputs[0]}"
    gain = np.trim_zeros(numerator, "f")[0]
    zeros, poles = np.roots(np.trim_zeros(numerator, "f")), np.roots(denominator)
    return (
        f"{name} = ({in_z(numerator)}) / ({in_z(denominator)})\n"
        f"      = {gain:.4g} {factored(zeros)} / {factored(poles)}"
    )


def re_analysed() -> Table:
    """Modes and zeros that the published transfer functions imply."""
    columns = (
        Column("equation"),
        Column("root"),
        Column("z"),
        Column("natural frequency", "Hz", 3),
        Column("damping", digits=2),
        Column("note"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, (zeros, poles) in ROOTS.items():
        for mode in discrete_modes(poles, SAMPLE_TIME_S):
            natural = mode.natural_frequency_rad_s
            hertz = None if natural is None else natural / (2 * math.pi)
            place = f"{mode.z:.4g}" if mode.is_pair else f"{mode.z.real:.4g}"
            rows.append((name, "pole", place, hertz, mode.damping, mode.reason))
        for zero in sorted(np.asarray(zeros, dtype=np.complex128), key=abs):
            if zero.imag >= 0:
                outside = "outside the unit circle: non-minimum phase" if abs(zero) > 1 else ""
                place = f"{zero:.4g}" if zero.imag else f"{zero.real:.4g}"
                rows.append((name, "zero", place, None, None, outside))
    return Table("The published transfer functions", columns, tuple(rows), (note_on_4(),))


def note_on_4() -> str:
    """Whether the factored form (4) is that of (3)."""
    below = EQUATION_3[1]
    printed, other = (abs(np.polyval(below, z)) for z in (0.42, -0.42))
    return (
        f"equation (4) prints (z - 0.42), yet the denominator of (3) is {printed:.2f} at z = 0.42 "
        f"and {other:.4f} at z = -0.42: it must read (z + 0.42)"
    )


def analyse(folder: Path, seed: int) -> fid.Study:
    """Fly, write records and study into a folder, run, and print the tables."""
    records = folder / "records"
    records.mkdir(parents=True, exist_ok=True)
    for record in fly(TwinRotor(), seed):
        write_csv(record, records)
    shutil.copy(HERE / "study.toml", folder / "study.toml")
    study = run_study(folder / "study.toml", output=folder / "output")
    print(study.summary().to_text(), "\n")
    print(table_1(study).to_text(), "\n")
    print("Equations (3) to (6) from these records")
    for item in study.identified:
        if item.fit is not None:
            print(equation(item.fit))
    print()
    print(re_analysed().to_text())
    print(f"\nReport: {study.output / 'report.html'}")
    return study


def main() -> None:
    """Read the arguments and run."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("twin-rotor-linear"))
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    analyse(given.folder, given.seed)


if __name__ == "__main__":
    main()
