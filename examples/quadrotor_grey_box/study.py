"""The rig study: published parameters flown, found again, and told with what the paper left out.

Run: python examples/quadrotor_grey_box/study.py [short|full] [seed] [folder]

Prints its tables and writes them with plots to report.html, beside the ArduPilot log of the flight.
The short form takes seconds, the full study a minute or two.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path

import flights
import identification as ident
import tables
from report import document
from vehicles import RATES, UNCOUPLED, grey_box, truth

import flightid as fid
from flightid.files import write_atomically
from flightid.report.content import TableBlock
from flightid.report.html import to_html
from flightid.vehicles import rate_truth

PUBLISHED_NOISE = {
    rate: float(tables.PUBLISHED["mse"][rate]["training"]) ** 0.5 for rate in RATES[:2]
}
"""Deviation of residuals as large as the published ones, rad/s."""


@dataclass(frozen=True)
class Study:
    """What the study found; the last four parts belong to the full form.

    Attributes
    ----------
    log : Log
        Of the flight that was fitted.
    found : Identified
        Both grey boxes.
    doublets : dict of str to Verification
        By grey box.
    errors : dict of str to list
        By rate, in (rad/s)²: training, validation on the other flight's sweep, on a doublet.
    couplings : dict of str to Fit or Refusal
        By the data that were fitted.
    reduction : Reduction or None
        Of the published structure on flights of a vehicle without couplings.
    structures : dict of str to Fit
        On the rig with motors and without couplings.
    rates : dict of str to Fit
        From logs of less than every loop.
    """

    log: fid.Log
    found: ident.Identified
    doublets: dict[str, fid.Verification]
    errors: dict[str, list[float | None]]
    couplings: dict[str, tables.Attempt]
    reduction: fid.Reduction | None = None
    structures: dict[str, fid.Fit] = field(default_factory=dict)
    rates: dict[str, fid.Fit] = field(default_factory=dict)


def study(seed: int, folder: Path, *, full: bool) -> Study:
    """Fly, read the log, fit, validate, and ask what the couplings rest on.

    Parameters
    ----------
    seed : int
        Of the flights and of the random starts.
    folder : Path
        For the logs.
    full : bool
        The whole study instead of its short form.
    """
    flight = flights.fly_published(truth(), seed)
    log = flights.read_back(flight, folder / "rig.BIN")
    sweeps, doublets = flights.sweeps_of(log), flights.doublets_of(log)
    found = ident.identify(sweeps, starts=10 if full else 2, seed=seed)
    seen = {
        "roll_pitch": ident.predict(found.time["roll_pitch"], doublets[:2]),
        "yaw": ident.predict(found.time["yaw"], doublets[2:]),
    }
    other = _sweeps(folder, seed + 1) if full else None
    errors = {rate: _errors(found, place, doublets, other) for place, rate in enumerate(RATES)}
    couplings: dict[str, tables.Attempt] = {
        "both sweeps": found.time["roll_pitch"],
        "roll sweep, controllers off": ident.attempt(
            _sweeps(folder, seed + 2, closed=False, sweeps=(0,))
        ),
    }
    if not full:
        return Study(log, found, seen, errors, couplings)
    uncoupled = _sweeps(folder, seed + 3, changes=UNCOUPLED, sweeps=(0, 1))
    couplings |= _couplings(folder, seed, sweeps, uncoupled)
    alone = couplings["both, of a vehicle that has none"]
    assert isinstance(alone, fid.Fit)
    return Study(
        log,
        found,
        seen,
        errors,
        couplings,
        fid.reduce(alone, uncoupled),
        _structures(folder),
        _rates(flight, folder),
    )


def _sweeps(
    folder: Path,
    seed: int,
    *,
    changes: dict[str, float] | None = None,
    noise_rad_s: dict[str, float] | None = None,
    closed: bool = True,
    sweeps: tuple[int, ...] = (0, 1, 2),
) -> list[fid.Record]:
    """Records of one more flight, through its log."""
    flown = flights.fly_published(
        truth(changes), seed, noise_rad_s=noise_rad_s, closed=closed, sweeps=sweeps
    )
    return flights.sweeps_of(flights.read_back(flown, folder / "other.BIN"))


def _errors(
    found: ident.Identified,
    place: int,
    doublets: list[fid.Record],
    other: list[fid.Record] | None,
) -> list[float | None]:
    rate, box = RATES[place], "yaw" if place == 2 else "roll_pitch"
    fit = found.time[box]
    validated = [None if other is None else other[place], doublets[place]]
    return [
        ident.mse(fit, 0 if box == "yaw" else place, rate),
        *(None if r is None else ident.predict(fit, [r]).mse[rate] for r in validated),
    ]


def _couplings(
    folder: Path, seed: int, sweeps: list[fid.Record], uncoupled: list[fid.Record]
) -> dict[str, tables.Attempt]:
    """Each sweep alone, controllers off, noise as large as the published errors, no couplings."""
    noisy = _sweeps(folder, seed + 4, noise_rad_s=PUBLISHED_NOISE, sweeps=(0, 1))
    off = _sweeps(folder, seed + 5, closed=False, sweeps=(0, 1))
    return {
        "pitch sweep, controllers off": ident.attempt(off[1:]),
        "both sweeps, controllers off": ident.attempt(off),
        "roll sweep, controllers on": ident.attempt(sweeps[:1]),
        "pitch sweep, controllers on": ident.attempt(sweeps[1:2]),
        "both, noise as large as the published MSE": ident.attempt(noisy),
        "both, of a vehicle that has none": ident.attempt(uncoupled),
    }


def _structures(folder: Path) -> dict[str, fid.Fit]:
    """The published structure, and what it lacks, on the rig with motors and without couplings."""
    log = flights.read_back(flights.schedule(), folder / "motors.BIN")
    records = flights.sweeps_of(log)[:2]
    options = {"hold": ident.HOLD, "starts": 3, "seed": 0}
    return {
        "published": fid.identify(grey_box("roll_pitch"), records, **options),
        "and a delay": fid.identify(grey_box("roll_pitch", delay=True), records, **options),
        "and motors": fid.identify(
            grey_box("roll_pitch", delay=True, motor_lag=True), records, **options
        ),
    }


def motor_truth() -> dict[str, float]:
    """What `_structures` should find: the rig linearised at hover."""
    roll, pitch = rate_truth("roll"), rate_truth("pitch")
    return {
        "Lp": roll.damping_1_s,
        "Mq": pitch.damping_1_s,
        "Ltphi": roll.gain_rad_s2,
        **UNCOUPLED,
        "Mttheta": pitch.gain_rad_s2,
        # Without the half loop of hold, which the fit knows of.
        "tau": roll.effective_delay_s() - 0.5 * roll.sample_time_s,
        "T_m": roll.motor_lag_s,
    }


def _rates(flight: flights.Flight, folder: Path) -> dict[str, fid.Fit]:
    """The same flight with every fourth loop in the log."""
    records = flights.sweeps_of(flights.read_back(flight, folder / "rig100.BIN", 4))[:2]
    box, delayed = grey_box("roll_pitch"), grey_box("roll_pitch", delay=True)
    return {
        "commands held between samples": fid.identify(box, records, hold="zero"),
        "straight lines between samples": fid.identify(box, records),
        "straight lines, and a delay": fid.identify(delayed, records),
    }


def main(form: str = "short", seed: str = "0", folder: str = "rig-output") -> None:
    """Run the study, print its tables, write its report."""
    if form not in ("short", "full"):
        sys.exit(__doc__)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    number = int(seed)
    made = document(
        study(number, target, full=form == "full"),
        f"{form} form, seed {number}; truth is table 3 of the published rig study",
        motor_truth(),
    )
    for block in made.walk():
        if isinstance(block, TableBlock):
            print(block.table, end="\n\n")
    page = write_atomically(target / "report.html", to_html(made))
    print(f"{made.verdict}: {page}")


if __name__ == "__main__":
    main(*sys.argv[1:])
