"""Flights on the rig with the published sweeps, and their ArduPilot logs, read back as records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from vehicles import ANGLES, COMMANDS, RATES, vehicle

import flightid as fid
from flightid.conventions import Role
from flightid.excitation import Excitation
from flightid.record import Channel, Step
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

POWER_UP_S = 10.0
"""The autopilot's clock is ahead of the flight's by this."""
LOOP_HZ = 400.0
ANGLE_P = 4.5
RATE_P = {"tau_phi": -0.05, "tau_theta": -0.05, "tau_psi": 0.2}
"""Gains of the rate loops. Roll and pitch are negative since the published effectiveness is."""
GYRO_NOISE_RAD_S = Sensors().gyro_noise_rad_s
# Doublets of the rate targets, in the mixer's unit: command, start after the last sweep, size.
DOUBLETS = (("tau_phi", 5.0, 0.1), ("tau_theta", 12.0, 0.1), ("tau_psi", 19.0, 0.3))
HALF_S, WATCHED_S = 0.5, 6.0
SWEEP_S, PAUSE_S = 132.0, 8.0
"""Each sweep with a second around its 130 s, and the time from one to the next."""

FEEDBACK = {
    command: {rate: RATE_P[command], angle: RATE_P[command] * ANGLE_P}
    for command, rate, angle in zip(COMMANDS, RATES, ANGLES, strict=True)
}
AUTOPILOT = Autopilot(
    rate=(
        RateGains(p=RATE_P["tau_phi"], i=0.0, d=0.0),
        RateGains(p=RATE_P["tau_theta"], i=0.0, d=0.0),
        RateGains(p=RATE_P["tau_psi"], i=0.0, d=0.0),
    )
)


@cache
def schedule(kept_sweeps: tuple[int, ...] = (0, 1, 2)) -> Flight:
    """Fly the rig of `flightid.simulation` with the sweeps of table 2: nonlinear, motors and gusts.

    It lends its timing and its chirps to the flights of the published model, and is a vehicle
    of its own for what the published structure makes of a frame that has no couplings.
    """
    runs = [
        replace(run, start_s=5.0 + (SWEEP_S + PAUSE_S) * place, leave_after_s=SWEEP_S)
        for place, run in enumerate(published_runs()[number] for number in kept_sweeps)
    ]
    last = runs[-1].end_s
    moves = [
        PilotDoublet(axis, last + start, 0.2)
        for axis, (_, start, _) in zip(("roll", "pitch", "yaw"), DOUBLETS, strict=True)
    ]
    return fly(runs=runs, doublets=moves, duration_s=last + DOUBLETS[-1][1] + WATCHED_S)


def fly_published(
    values: Mapping[str, float],
    seed: int,
    *,
    noise_rad_s: Mapping[str, float] | None = None,
    closed: bool = True,
    sweeps: tuple[int, ...] = (0, 1, 2),
) -> Flight:
    """Fly a vehicle with the published structure through sweeps and doublets.

    Parameters
    ----------
    values : mapping of str to float
        Its parameters.
    seed : int
        Of the gyro's noise.
    noise_rad_s : mapping of str to float, optional
        Standard deviation of the white noise of a rate; the rig's gyro where left out.
    closed : bool
        Whether the rate and attitude controllers fly, as they do in that mode.
    sweeps : tuple of int
        Which of the three sweeps, from 0.
    """
    base = schedule(sweeps)
    return _as_flight(base, _flown(base, values, seed, 1, noise_rad_s or {}, closed), seed)


def sweeps_at_once(values: Mapping[str, float], seed: int, every: int = 4) -> list[fid.Record]:
    """Fly the three sweeps in a loop of 400 Hz over `every`; no log, for many flights."""
    base = schedule()
    flown = _flown(base, values, seed, every, {}, True)
    spans = [base.span(run) for run in base.runs]
    return [
        flown.segment(*span, name=f"{command} sweep")
        for span, command in zip(spans, COMMANDS, strict=True)
    ]


def _flown(
    base: Flight,
    values: Mapping[str, float],
    seed: int,
    every: int,
    noise_rad_s: Mapping[str, float],
    closed: bool,
) -> fid.Record:
    chirps, axes = base["sid_applied"], base["sid_axis"]
    added = np.array([np.where(axes == 10 + k, chirps, 0.0) for k in range(3)]) + _doublets(base)
    loop_s = every / LOOP_HZ
    return fly_closed_loop(
        vehicle().with_values(values),
        CrudePilot(FEEDBACK if closed else {}, delay_s=loop_s, lag_s=0.0),
        Excitation(added[:, ::every], loop_s, COMMANDS, "1", "sweeps", (0.3, 31.4)),
        conditions=FlightConditions(
            noise={rate: noise_rad_s.get(rate, GYRO_NOISE_RAD_S) for rate in RATES}
        ),
        hold="zero",
        seed=seed,
    )


def _doublets(base: Flight) -> NDArray[np.float64]:
    time_s, last = base.time_s, base.runs[-1].end_s
    rows = np.zeros((3, len(time_s)))
    for command, start, size in DOUBLETS:
        since = time_s - (last + start)
        row = rows[COMMANDS.index(command)]
        row[(since >= 0.0) & (since < HALF_S)] = size
        row[(since >= HALF_S) & (since < 2.0 * HALF_S)] = -size
    return rows


def _as_flight(base: Flight, flown: fid.Record, seed: int) -> Flight:
    """Put what flew into the rows that the log is written from; controllers hold one P term."""
    rows, columns = base.rows.copy(), base.columns
    applied, axes = base["sid_applied"], base["sid_axis"]
    put: dict[str, NDArray[np.float64]] = {}
    for place, (axis, command, rate, angle, letter) in enumerate(
        zip(("roll", "pitch", "yaw"), COMMANDS, RATES, ANGLES, "xyz", strict=True)
    ):
        put |= {command: flown[command], rate: flown[rate], angle: flown[angle]}
        put |= {f"gyro_{kind}{letter}": flown[rate] for kind in ("", "mean_", "filtered_")}
        term = flown[command] - np.where(axes == 10 + place, applied, 0.0)
        error = term / RATE_P[command]
        zero = np.zeros_like(term)
        put |= {f"{axis}_pid_{name}": zero for name in ("i", "d", "ff", "d_ff")}
        put |= {f"{axis}_pid_p": term, f"{axis}_pid_error": error}
        put |= {f"{axis}_pid_target": error + flown[rate], f"{angle}_ref": zero}
        put |= {f"{rate}_ref": error + flown[rate]}
    for name, values in put.items():
        rows[:, columns.index(name)] = values
    return replace(base, rows=rows, autopilot=AUTOPILOT, seed=seed)


def read_back(flight: Flight, path: Path, log_every: int = 1) -> fid.Log:
    """Write the flight's DataFlash log, 400 Hz over 1, 2, 4 or 8, and read it."""
    kept = replace(flight, rows=flight.rows[::log_every], log_every=log_every)
    return fid.read_log(write_ardupilot_log(kept, path))


def sweeps_of(log: fid.Log) -> list[fid.Record]:
    """A record for each sweep, its chirp under the name of the command that it moved."""
    records = []
    for number, run in enumerate(log.sid_runs):
        command = COMMANDS[run.axis - 10]
        record = log.record(sid_run=number, names=(*COMMANDS, *RATES), name=f"{command} sweep")
        chirps = {f"sweep_{name}": np.zeros(record.n_samples) for name in COMMANDS}
        chirps[f"sweep_{command}"] = record["excitation"]
        records.append(_with_chirps(record, chirps))
    return records


def _with_chirps(record: fid.Record, chirps: Mapping[str, NDArray[np.float64]]) -> fid.Record:
    channels = [record.channels[name] for name in (*COMMANDS, *RATES)]
    channels += [Channel(name, "1", Role.EXCITATION) for name in chirps]
    return record.replace(chirps, channels=channels, step=Step("chirps by command", {}))


def doublets_of(log: fid.Log) -> list[fid.Record]:
    """A record for each doublet, from a second before it; no fit sees them."""
    last = schedule(tuple(run.axis - 10 for run in log.sid_runs)).runs[-1].end_s + POWER_UP_S
    return [
        log.record(
            names=(*COMMANDS, *RATES),
            span_s=(last + start - 1.0, last + start + WATCHED_S - 1.0),
            name=f"{command} doublet",
        )
        for command, start, _ in DOUBLETS
    ]
