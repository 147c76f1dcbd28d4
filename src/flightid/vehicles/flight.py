"""A simulated flight and its arrays (native side: `quadrotor_flight.rs`)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.errors import OptionError, UnknownNameError
from flightid.frozen import dataclass
from flightid.record import Record, Step
from flightid.record.history import FLOWN
from flightid.result import Result
from flightid.table import Column, Table
from flightid.vehicles.autopilot import Autopilot, PilotDoublet, SidActivation
from flightid.vehicles.quadrotor import QuadrotorParameters, Sensors, Turbulence
from flightid.vehicles.truth import AXES, COMMANDS, RATES, AxisName, Gyro, RateTruth, rate_truth

_PREFIX = {"filtered": "gyro_filtered_", "mean": "gyro_mean_", "raw": "gyro_"}
_UNITS = dict.fromkeys(RATES, "rad/s") | dict.fromkeys(("phi", "theta", "psi"), "rad")
MIXER_AXES = (10, 11, 12)


@dataclass(frozen=True)
class Flight(Result, schema="flightid.flight/1", untold={"rows": "time histories"}):
    """Everything that a simulated flight left behind.

    Attributes
    ----------
    rows : ndarray, shape (n_rows, n_columns)
        One row for each logged loop; read a column by its name: ``flight["gyro_x"]``.
    vehicle, autopilot, sensors, turbulence
        What flew, and in what air.
    runs : tuple of SidActivation
        Activations of the system-identification mode.
    doublets : tuple of PilotDoublet
        What the pilot did.
    log_every : int
        Loops between rows.
    seed : int
        Seed of all noise.

    Example
    -------
    >>> flight = fly(duration_s=2.0)
    >>> flight
    Flight(2 s at 400 Hz, 0 sweeps, 0 doublets, seed 0)
    """

    rows: NDArray[np.float64]
    vehicle: QuadrotorParameters
    autopilot: Autopilot
    sensors: Sensors
    turbulence: Turbulence
    runs: tuple[SidActivation, ...]
    doublets: tuple[PilotDoublet, ...]
    log_every: int
    seed: int

    def __repr__(self) -> str:
        """Length and content on one line."""
        rate_hz = self.autopilot.loop_rate_hz / self.log_every
        seconds = len(self.rows) / rate_hz
        return (
            f"Flight({seconds:g} s at {rate_hz:g} Hz, {len(self.runs)} sweeps, "
            f"{len(self.doublets)} doublets, seed {self.seed})"
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(_native.quadrotor_columns())

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A column by name, SI units, shape (n_rows,)."""
        columns = self.columns
        if name not in columns:
            raise UnknownNameError("the flight has no such column", found=name, needed=columns)
        return np.ascontiguousarray(self.rows[:, columns.index(name)])

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time of the rows (gyro samples), s."""
        return self["time_s"]

    def truth(self, axis: AxisName) -> RateTruth:
        """Exact transfer function of a rate axis."""
        return rate_truth(axis, self.vehicle, self.autopilot)

    def span(self, run: SidActivation) -> tuple[float, float]:
        """Time in which a run's chirp is not silent, s."""
        return run.start_s + 1.0, run.start_s + 1.0 + run.record_s

    def record(
        self, span_s: tuple[float, float] | None = None, *, gyro: Gyro = "filtered"
    ) -> Record:
        """Record of a span with canonical channel names.

        Inputs ``tau_phi``, ``tau_theta``, ``tau_psi`` (what the mixer got), outputs ``p``, ``q``,
        ``r`` and attitude, and ``excitation``: the injected target in the loop that used it, which
        is one loop after SIDD logs it.

        Parameters
        ----------
        span_s : tuple of float, optional
            First and last time, s; the whole flight when left out.
        gyro : {"filtered", "mean", "raw"}
            Which gyro signal the outputs are.

        Raises
        ------
        OptionError
            The span holds fewer than two rows.
        """
        time_s = self.time_s
        first, last = span_s or (time_s[0], time_s[-1])
        half = 0.5 * self.log_every / self.autopilot.loop_rate_hz
        keep = np.flatnonzero((time_s >= first - half) & (time_s <= last + half))
        if keep.size < 2:
            raise OptionError("the span is empty", found=span_s, needed="two rows or more")
        part = slice(int(keep[0]), int(keep[-1]) + 1)
        outputs = {
            rate: self[_PREFIX[gyro] + letter][part]
            for rate, letter in zip(RATES, "xyz", strict=True)
        }
        return Record.from_arrays(
            time_s[part],
            inputs={name: self[name][part] for name in COMMANDS},
            outputs=outputs | {name: self[name][part] for name in ("phi", "theta", "psi")},
            excitations={"excitation": self["sid_applied"][part]},
            units=_UNITS,
            name=f"flight, seed {self.seed}",
            history=[Step(FLOWN, {"seed": self.seed, "gyro": gyro})],
        )

    def run_record(self, axis: AxisName, *, gyro: Gyro = "filtered") -> Record:
        """Record of the first mixer sweep on an axis, without its silent ends.

        Raises
        ------
        UnknownNameError
            No mixer sweep of that axis was flown.
        """
        for run in self.runs:
            if run.axis == MIXER_AXES[AXES.index(axis)]:
                return self.record(self.span(run), gyro=gyro)
        raise UnknownNameError(
            "no mixer sweep on this axis", found=axis, needed=[run.axis for run in self.runs]
        )

    def summary(self) -> Table:
        """Truth of the three rate axes."""
        truths = [self.truth(axis) for axis in AXES]
        return Table(
            "Simulated quadrotor: command to rate at hover",
            (
                Column("axis"),
                Column("damping", "1/s"),
                Column("gain", "rad/s^2"),
                Column("motor lag", "s"),
                Column("lead", "s"),
                Column("effective delay", "s"),
            ),
            tuple(
                (
                    t.axis,
                    t.damping_1_s,
                    t.gain_rad_s2,
                    t.motor_lag_s,
                    t.lead_s,
                    t.effective_delay_s(),
                )
                for t in truths
            ),
        )

    def _computed(self) -> dict[str, object]:
        return {"truth": {axis: self.truth(axis) for axis in AXES}}


def fly(
    *,
    runs: Iterable[SidActivation] = (),
    doublets: Iterable[PilotDoublet] = (),
    duration_s: float | None = None,
    vehicle: QuadrotorParameters | None = None,
    autopilot: Autopilot | None = None,
    sensors: Sensors | None = None,
    turbulence: Turbulence | None = None,
    log_every: int = 1,
    seed: int = 0,
) -> Flight:
    """Fly the simulated quadrotor: a nonlinear rigid body under an ArduPilot-like controller.

    The vehicle starts in hover, level, and the pilot keeps it so but for `doublets`. On the rig the
    c.g. does not move; in free flight the pilot also keeps the height. The attitude that the
    controller uses is the true one (the estimator's errors are small at these frequencies).

    Parameters
    ----------
    runs : iterable of SidActivation
        Activations of the system-identification mode, in order of time and not overlapping.
    doublets : iterable of PilotDoublet
        Stick movements.
    duration_s : float, optional
        Length of the flight; by default 5 s more than the last run or doublet.
    vehicle, autopilot, sensors, turbulence : optional
        Parameters; the defaults are a 450 mm quadrotor on a gyroscopic rig.
    log_every : int
        Loops between log rows: 1, 2, 4 or 8 as ArduPilot's LOG_BITMASK allows.
    seed : int
        Seed of all noise; the same seed gives the same flight.

    Raises
    ------
    OptionError
        Runs that overlap, a length without meaning, a parameter out of range.
    DataError
        The flight diverges.

    Reference
    ---------
    Newton–Euler equations: Khudairi et al., gyroscopic rig study, eqs. 1–4; loop order and
    controller: ArduPilot, AC_PID, AC_AttitudeControl and the SystemID mode (Copter 4.6).

    Example
    -------
    >>> flight = fly(doublets=[PilotDoublet("roll", start_s=1.0, amplitude=0.2)])
    >>> flight.record((0.5, 5.0)).outputs[:3]
    ('p', 'q', 'r')
    """
    activations = tuple(sorted(runs, key=lambda run: run.start_s))
    for before, after in pairwise(activations):
        if after.start_s < before.end_s:
            raise OptionError(
                "two sweeps overlap",
                found=f"one ends at {before.end_s:g} s, the next starts at {after.start_s:g} s",
                needed="one after the other",
            )
    moves = tuple(doublets)
    ends = [run.end_s for run in activations] + [move.end_s for move in moves]
    length_s = duration_s if duration_s is not None else max(ends, default=0.0) + 5.0
    loop = autopilot or Autopilot()
    n_loops = round(length_s * loop.loop_rate_hz)
    if not 2 <= n_loops <= 10_000_000:
        raise OptionError("length of the flight", found=f"{length_s} s", needed="up to 10⁷ loops")
    body, errors, air = vehicle or QuadrotorParameters(), sensors or Sensors(), turbulence
    air = air or Turbulence()
    rows = _native.fly_quadrotor(
        body.to_native(),
        loop.to_native(),
        asdict(errors),
        asdict(air),
        _pilot(moves, n_loops, loop.loop_rate_hz),
        [run.to_native() for run in activations],
        log_every,
        seed,
    )
    return Flight(rows, body, loop, errors, air, activations, moves, log_every, seed)


def _pilot(
    moves: tuple[PilotDoublet, ...], n_loops: int, loop_rate_hz: float
) -> NDArray[np.float64]:
    stick = np.zeros((3, n_loops))
    for move in moves:
        row = stick[AXES.index(move.axis)]
        edges = [
            round(loop_rate_hz * t) for t in (move.start_s, move.start_s + move.width_s, move.end_s)
        ]
        row[edges[0] : edges[1]] += move.amplitude
        row[edges[1] : edges[2]] -= move.amplitude
    return stick
