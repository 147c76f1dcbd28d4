"""Flights that stand in for the rig's logs: the published vehicle with the published sweeps.

Run: python examples/quadrotor_grey_box/fly.py [all] [seed]

Writes rig.BIN, as ArduCopter would; with `all` also rig100.BIN (every fourth loop of it),
controllers_off.BIN (of roll and pitch), noisy.BIN (noise as large as the published errors) and
uncoupled.BIN (a vehicle without couplings). Truth is the published table 3. Gains of roll and pitch
fly negative since the published effectiveness is; the log holds them without sign.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import flightid as fid
from flightid.excitation import Excitation
from flightid.vehicles import (
    Autopilot,
    CrudePilot,
    Flight,
    FlightConditions,
    PilotDoublet,
    RateGains,
    Sensors,
    fly,
    fly_closed_loop,
    write_ardupilot_log,
)
from flightid.vehicles.scenario import published_runs

COMMANDS = ("tau_phi", "tau_theta", "tau_psi")
RATES, ANGLES = ("p", "q", "r"), ("phi", "theta", "psi")
LOOP_HZ, ANGLE_P = 400.0, 4.5
RATE_P = dict(zip(COMMANDS, (-0.05, -0.05, 0.2), strict=True))
FEEDBACK = {
    command: {rate: RATE_P[command], angle: RATE_P[command] * ANGLE_P}
    for command, rate, angle in zip(COMMANDS, RATES, ANGLES, strict=True)
}
FIRST, SECOND, THIRD = (RateGains(p=abs(p), i=0.0, d=0.0) for p in RATE_P.values())
AUTOPILOT = Autopilot(rate=(FIRST, SECOND, THIRD), gyro_filter_hz=0.0)
"""The published structure has no gyro filter."""
UNCOUPLED = {"Lttheta": 0.0, "Mtphi": 0.0}
NOISY = {"p": 0.1024**0.5, "q": 0.06807**0.5}
"""Deviations of residuals as large as the published mean square errors, rad/s."""
# Doublets of the rate targets, in the mixer's unit: command, start after the last sweep, size.
DOUBLETS = (("tau_phi", 5.0, 0.1), ("tau_theta", 12.0, 0.1), ("tau_psi", 19.0, 0.3))
SWEEP_S, PAUSE_S, HALF_S, WATCHED_S = 132.0, 8.0, 0.5, 6.0


def vehicle() -> fid.StateSpaceModel:
    """Roll, pitch and yaw of the library in one model, with the published values."""
    plain, yaw = (fid.load_model(f"quadrotor_{name}").to_dict() for name in ("roll_pitch", "yaw"))
    for key in ("states", "inputs", "outputs", "parameters", "equations"):
        plain[key] |= yaw[key]
    return fid.StateSpaceModel.from_dict(
        {key: value for key, value in plain.items() if key not in ("schema", "responses")}
    )


@cache
def schedule() -> Flight:
    """Sweeps of table 2 on the rig of `flightid.vehicles`, which lends timing and chirps."""
    runs = [
        replace(run, start_s=5.0 + (SWEEP_S + PAUSE_S) * place, leave_after_s=SWEEP_S)
        for place, run in enumerate(published_runs())
    ]
    last = runs[-1].end_s
    moves = [
        PilotDoublet(axis, last + start, 0.2)
        for axis, (_, start, _) in zip(("roll", "pitch", "yaw"), DOUBLETS, strict=True)
    ]
    return fly(runs=runs, doublets=moves, duration_s=last + DOUBLETS[-1][1] + WATCHED_S)


def flown(
    seed: int,
    *,
    changes: Mapping[str, float] | None = None,
    noise_rad_s: Mapping[str, float] | None = None,
    closed: bool = True,
    every: int = 1,
) -> fid.Record:
    """Sweeps and doublets in a loop of 400 Hz over `every`; `closed` means roll and pitch."""
    base = schedule()
    chirps, axes = base["sid_applied"], base["sid_axis"]
    added = np.array([np.where(axes == 10 + k, chirps, 0.0) for k in range(3)]) + _doublets(base)
    loop_s = every / LOOP_HZ
    feedback = FEEDBACK if closed else {"tau_psi": FEEDBACK["tau_psi"]}
    usual = dict.fromkeys(RATES, Sensors().gyro_noise_rad_s)
    return fly_closed_loop(
        vehicle().with_values(changes or {}),
        CrudePilot(feedback, delay_s=loop_s, lag_s=0.0),
        Excitation(added[:, ::every], loop_s, COMMANDS, "1", "sweeps", (0.3, 31.4)),
        conditions=FlightConditions(noise=usual | dict(noise_rad_s or {})),
        hold="zero",
        seed=seed,
    )


def sweeps_at_once(seed: int, every: int = 4) -> list[fid.Record]:
    """The three sweeps without a log, for many flights."""
    base, record = schedule(), flown(seed, every=every)
    return [
        record.segment(*base.span(run), name=f"{command} sweep")
        for run, command in zip(base.runs, COMMANDS, strict=True)
    ]


def write_log(record: fid.Record, seed: int, path: Path, log_every: int = 1) -> None:
    """Put what flew into the rows of a log; controllers hold one P term."""
    base = schedule()
    rows, columns = base.rows.copy(), base.columns
    put: dict[str, NDArray[np.float64]] = {}
    for place, (axis, command, rate, angle, letter) in enumerate(
        zip(("roll", "pitch", "yaw"), COMMANDS, RATES, ANGLES, "xyz", strict=True)
    ):
        put |= {command: record[command], rate: record[rate], angle: record[angle]}
        put |= {f"gyro_{kind}{letter}": record[rate] for kind in ("", "mean_", "filtered_")}
        term = record[command] - np.where(base["sid_axis"] == 10 + place, base["sid_applied"], 0.0)
        error, zero = term / RATE_P[command], np.zeros_like(term)
        put |= {f"{axis}_pid_{name}": zero for name in ("i", "d", "ff", "d_ff")}
        put |= {f"{axis}_pid_p": term, f"{axis}_pid_error": error, f"{angle}_ref": zero}
        put |= dict.fromkeys((f"{axis}_pid_target", f"{rate}_ref"), error + record[rate])
    for name, values in put.items():
        rows[:, columns.index(name)] = values
    made = replace(base, rows=rows[::log_every], autopilot=AUTOPILOT, seed=seed)
    write_ardupilot_log(replace(made, log_every=log_every), path)


def _doublets(base: Flight) -> NDArray[np.float64]:
    time_s, last = base.time_s, base.runs[-1].end_s
    rows = np.zeros((3, len(time_s)))
    for row, (_, start, size) in zip(rows, DOUBLETS, strict=True):
        since = time_s - (last + start)
        row[(since >= 0.0) & (since < HALF_S)] = size
        row[(since >= HALF_S) & (since < 2.0 * HALF_S)] = -size
    return rows


def main(*words: str) -> None:
    """Fly, and write the logs."""
    seed = int(next((word for word in words if word.isdigit()), "1"))
    rig = flown(seed)
    write_log(rig, seed, Path("rig.BIN"))
    if "all" in words:
        write_log(rig, seed, Path("rig100.BIN"), log_every=4)
        write_log(flown(seed + 1, closed=False), seed + 1, Path("controllers_off.BIN"))
        write_log(flown(seed + 2, noise_rad_s=NOISY), seed + 2, Path("noisy.BIN"))
        write_log(flown(seed + 3, changes=UNCOUPLED), seed + 3, Path("uncoupled.BIN"))


if __name__ == "__main__":
    main(*sys.argv[1:])
