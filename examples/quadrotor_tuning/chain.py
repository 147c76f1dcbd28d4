"""From a log to gains and back into the air: the promised margins beside those that are flown.

Run: python examples/quadrotor_tuning/chain.py [short|full] [seed] [folder]

The rig of examples/quadrotor_rig is swept with the gains that it has, its log is read, models are
identified and verified, gains are tuned, and the nonlinear simulation flies them: sweeps at the
mixer and at the set-point measure the broken loops. The short form does roll alone.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import flown as measured
import tables

import flightid as fid
from flightid.files import write_atomically
from flightid.report.content import Document, Paragraph, Section, TableBlock
from flightid.report.html import to_html
from flightid.report.tuning import tuning_section
from flightid.vehicles import Autopilot, RateGains, SidActivation, fly, write_ardupilot_log

AXES = ("roll", "pitch", "yaw")
CHANNELS = {"roll": ("tau_phi", "p"), "pitch": ("tau_theta", "q"), "yaw": ("tau_psi", "r")}
BAND_RAD_S = (1.0, 60.0)
YAW_MODEL = Path(__file__).parent.parent / "quadrotor_rig" / "yaw_rate.toml"
ROLES = ("p", "i", "d")


@dataclass(frozen=True)
class Chain:
    """What the chain made.

    Attributes
    ----------
    fits : dict of str to Fit
        By axis.
    tuning : Tuning
    measured : dict of str to dict of str to Margins
        By axis and loop, with the new gains.
    """

    fits: dict[str, fid.Fit]
    tuning: fid.Tuning
    measured: dict[str, dict[str, fid.Margins]]


def sweep(axis: str, start_s: float, *, kind: int = 10, magnitude: float = 0.15) -> SidActivation:
    """Sweep as advised: 0.1 to 12 Hz in 100 s and twenty quiet seconds."""
    return SidActivation(
        axis=kind + AXES.index(axis), start_s=start_s, magnitude=magnitude, start_hz=0.1,
        stop_hz=12.0, record_s=100.0, fade_out_s=1.0, leave_after_s=125.0,
    )  # fmt: skip


def identify(log: fid.Log, axis: str) -> fid.Fit:
    """Rate model of one axis from its mixer sweep, the chirp as instrument."""
    command, rate = CHANNELS[axis]
    run = next(each for each in log.sid_runs if each.axis == 10 + AXES.index(axis))
    record = log.record(names=[command, rate], sid_run=run)
    response = fid.estimate_response(
        [record], inputs=[command], outputs=[rate], excitations="excitation",
        estimator="instrument", band_rad_s=BAND_RAD_S, n_omega=60, window_s=[40, 20],
    )  # fmt: skip
    model = fid.load_model(
        YAW_MODEL if axis == "yaw" else "rate_motor_lag", axis=None if axis == "yaw" else axis
    )
    lag = replace(model.parameters["T_m"], maximum=0.15)
    model = replace(model, parameters=model.parameters.with_parameter(lag))
    return fid.identify(model, response, starts=4, seed=4)


def retuned(autopilot: Autopilot, gains: dict[str, float]) -> Autopilot:
    """The simulated autopilot with parameters by ArduPilot's names."""
    rate, angle = list(autopilot.rate), list(autopilot.angle_p)
    for place, letters in enumerate(("RLL", "PIT", "YAW")):
        found: dict[str, float] = {
            role: gains[name]
            for role in ROLES
            if (name := f"ATC_RAT_{letters}_{role.upper()}") in gains
        }
        rate[place] = replace(rate[place], **found)
        angle[place] = gains.get(f"ATC_ANG_{letters}_P", angle[place])
    first, second, third = rate
    made: tuple[RateGains, RateGains, RateGains] = (first, second, third)
    return replace(autopilot, rate=made, angle_p=(angle[0], angle[1], angle[2]))


def chain(axes: tuple[str, ...], seed: int, folder: Path) -> Chain:
    """Fly, identify, tune, fly the new gains and measure them.

    Parameters
    ----------
    axes : tuple of str
    seed : int
        Of the flights and of the draws.
    folder : Path
        For logs and parameter files.
    """
    autopilot = Autopilot()
    runs = [sweep(axis, 10.0 + 130.0 * k) for k, axis in enumerate(axes)]
    flight = fly(runs=runs, autopilot=autopilot, seed=seed, log_every=4)
    log = fid.read_log(write_ardupilot_log(flight, folder / "before.BIN"))
    fits = {axis: identify(log, axis) for axis in axes}
    tuning = fid.tune(fits, gains=log, requirements=REQUIREMENTS, seed=seed)
    tuning.write(folder / "gains.param", overwrite=True)
    loops = {
        axis: measured.loops(retuned(autopilot, tuning.gains), axis, seed + 100) for axis in axes
    }
    return Chain(fits, tuning, loops)


REQUIREMENTS = fid.TuningRequirements()


def document(made: Chain, subtitle: str) -> Document:
    """The chain as a report."""
    words = (
        "Promised: the margins of the identified models with the new gains, their middle 95 % over "
        "all plants that the first flight allows. Flown: the same margins measured from sweeps of "
        "the nonlinear simulation with the new gains, with the 95 % intervals of that measurement."
    )
    return Document(
        "Gains from a log, flown again",
        subtitle,
        (
            Section(
                "Promised and flown",
                (
                    Paragraph(words),
                    TableBlock(tables.promised_and_flown(made.tuning, made.measured)),
                ),
            ),
            tuning_section(made.tuning),
        ),
    )


def main(form: str = "short", seed: str = "4", folder: str = "tuning-output") -> None:
    """Run the chain, print its tables, write its report."""
    if form not in ("short", "full"):
        sys.exit(__doc__)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    made = chain(AXES if form == "full" else AXES[:1], int(seed), target)
    told = document(made, f"{form} form, seed {seed}")
    print(made.tuning.summary(), end="\n\n")
    for design in made.tuning.designs:
        print(design.promise_table(), end="\n\n")
    print(tables.promised_and_flown(made.tuning, made.measured))
    page = write_atomically(target / "report.html", to_html(told))
    print(f"{told.verdict}: {page}")


if __name__ == "__main__":
    main(*sys.argv[1:])
