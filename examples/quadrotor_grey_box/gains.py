"""Gains from the identified derivatives, with the cross-coupling that the study leaves open.

Run: python examples/quadrotor_grey_box/gains.py [short|full] [seed] [folder]

The published vehicle is flown and identified as in study.py. Then roll and pitch are tuned twice:
each as if the other had no controller, which is what derivatives read one by one suggest, and with
each other's loops closed, beside yaw. The tables say what the first gains promise alone, what
becomes of them when all loops are closed, and what the second ones hold.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import flights
import identification as ident
from vehicles import COMMANDS, truth

import flightid as fid
from flightid.control.autopilots import AxisLoop, axis_loop
from flightid.table import Cell, Column, Table

AXES = {"roll": "roll_pitch", "pitch": "roll_pitch", "yaw": "yaw"}
LETTERS = {"roll": "RLL", "pitch": "PIT", "yaw": "YAW"}
BAND_RAD_S = (2.0 * math.pi * 0.05, 2.0 * math.pi * 5.0)
"""Of the published sweeps."""
REVERSED = {"roll": -1, "pitch": -1, "yaw": 1}
"""The published effectiveness of roll and pitch is negative."""
SHOWN = (
    ("crossover", "rad/s"),
    ("phase margin", "deg"),
    ("gain margin", "dB"),
    ("sensitivity peak", "1"),
)


@dataclass(frozen=True)
class Gains:
    """Gains made in two ways from one identification.

    Attributes
    ----------
    alone : dict of str to PidDesign
        Roll and pitch, each as if the other had no controller.
    together : Tuning
        All axes, roll and pitch with each other's loops closed; as flown are those of `alone`.
    """

    alone: dict[str, fid.PidDesign]
    together: fid.Tuning


def flown(axis: str) -> AxisLoop:
    """ArduCopter's controller with the gains of `flights.py`: P alone; filters wait for I and D."""
    letters, command = LETTERS[axis], COMMANDS[list(AXES).index(axis)]
    rate = {"P": abs(flights.RATE_P[command]), "I": 0.0, "D": 0.0, "IMAX": 0.5}
    named = {f"ATC_RAT_{letters}_{key}": value for key, value in rate.items()}
    named |= {f"ATC_RAT_{letters}_{key}": 20.0 for key in ("FLTT", "FLTD")}
    named |= {f"ATC_RAT_{letters}_FLTE": 0.0, f"ATC_ANG_{letters}_P": flights.ANGLE_P}
    named |= {"INS_GYRO_FILTER": 0.0}
    return axis_loop("arducopter", axis, named, loop_rate_hz=flights.LOOP_HZ)


def gains(fits: Mapping[str, fid.Fit], *, draws: int, seed: int) -> Gains:
    """Tune in both ways, and judge the first gains with all loops closed.

    Parameters
    ----------
    fits : mapping of str to Fit
        By grey box.
    draws : int
        Plants of the search, and as many again to judge by.
    seed : int
        Of the draws.
    """
    options = {
        "requirements": fid.TuningRequirements(noise_growth=None), "gyro": "raw",
        "band_rad_s": BAND_RAD_S, "draws": draws, "seed": seed,
    }  # fmt: skip
    alone = {
        axis: fid.tune_pid(fits[box], gains=flown(axis), sign=REVERSED[axis], **options)
        for axis, box in AXES.items()
        if box != "yaw"
    }
    together = fid.tune(
        {axis: fits[box] for axis, box in AXES.items()},
        gains={axis: alone[axis].loop if axis in alone else flown(axis) for axis in AXES},
        signs=REVERSED, **options,
    )  # fmt: skip
    return Gains(alone, together)


def gain_table(made: Gains) -> Table:
    """Every gain as in the study's flights, made alone and made together."""
    rows: list[tuple[Cell, ...]] = [
        (
            *(design.axis, change.name, flown(design.axis).gains[change.name]),
            *(change.flown if design.axis in made.alone else None, change.new),
        )
        for design in made.together.designs
        for change in design.changes
    ]
    columns = (
        *(Column("axis"), Column("gain"), Column("flown", digits=3)),
        *(Column("couplings ignored", digits=3), Column("couplings closed", digits=3)),
    )
    return Table("Gains", columns, tuple(rows))


def margin_table(made: Gains) -> Table:
    """What each axis promises alone, what is left of it, and what tuning together keeps."""
    rows: list[tuple[Cell, ...]] = []
    for axis, alone in made.alone.items():
        for loop in ("rate loop", "whole loop", "angle loop"):
            for name, unit in SHOWN:
                before, after = alone.promise(loop, name), made.together[axis].promise(loop, name)
                rows.append(
                    (
                        axis,
                        loop,
                        name,
                        unit,
                        before.nominal,
                        after.flown,
                        after.nominal,
                        after.worst,
                    )
                )
    columns = (
        *(Column("axis"), Column("loop"), Column("quantity"), Column("unit")),
        *(Column("ignored: promised", digits=3), Column("ignored: true", digits=3)),
        *(Column("closed", digits=3), Column("worst", digits=3)),
    )
    note = (
        "Promised: with the other axis' loops open, as if nothing coupled them. True: the same "
        "gains with all loops closed. Closed: tuned so, with the worst of the fresh plants."
    )
    return Table("Roll and pitch, one loop broken at a time", columns, tuple(rows), (note,))


def main(form: str = "short", seed: str = "0", folder: str = "rig-output") -> None:
    """Fly, identify, tune in both ways, and print what comes of it."""
    if form not in ("short", "full"):
        sys.exit(__doc__)
    full, number, target = form == "full", int(seed), Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    log = flights.read_back(flights.fly_published(truth(), number), target / "rig.BIN")
    found = ident.identify(flights.sweeps_of(log), starts=10 if full else 1, seed=number)
    made = gains(found.time, draws=300 if full else 20, seed=number)
    for table in (gain_table(made), margin_table(made), made.together.together_table()):
        print(table, end="\n\n")
    for finding in made.together.findings:
        print(finding)


if __name__ == "__main__":
    main(*sys.argv[1:])
