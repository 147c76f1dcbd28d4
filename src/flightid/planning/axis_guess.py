"""What to expect of an axis: measured in an ordinary flight, or typical under its gains."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.errors import DataError, FlightidError
from flightid.frozen import dataclass
from flightid.inspection.signals import Span, find, places, records
from flightid.logs import Log
from flightid.planning.flown_axis import Entry, FlownAxis
from flightid.planning.loop_check import LoopCheck, check_loop
from flightid.planning.still_rate import still_rate
from flightid.record import Record
from flightid.responses import estimate_response
from flightid.review.typical_axes import TYPICAL

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
CHANNELS = {
    "roll": ("tau_phi", "p", "phi_ref"),
    "pitch": ("tau_theta", "q", "theta_ref"),
    "yaw": ("tau_psi", "r", "psi_ref"),
}
"""Command, rate and attitude set-point of each axis."""
WANTED = {"roll": "p_ref", "pitch": "q_ref", "yaw": "r_ref"}
"""Rate that its rate loop is told to fly."""
LOWEST_RAD_S, HIGHEST_RAD_S, N_OMEGA = 2.0, 60.0, 24
SAMPLES_IN_CYCLE = 5.0
SHORTEST_S = 5.0
LARGEST_ERROR, LEAST_ERROR, FEWEST_POINTS = 0.2, 0.04, 6
"""A frequency counts as measured up to this random error; so many make an axis measured; none
weighs more than one of the least error, for shapes are not exact."""
FULL, MOST_AT_LIMIT = 0.995, 0.02
"""A command at its limit, and the share of the time that a linear loop may spend there."""
FARTHEST_CROSSOVER = 1.5
"""What was flown must reach loop gains so near to one, from either side."""
LARGEST_MISS, WIDEST_SHAPE = 0.3, 8.0
"""Root mean square of the fit's logarithm, and of a time over a typical one."""
SHAPE = ("gain", "time_constant_s", "motor_lag_s", "delay_s")
LED = (*SHAPE, "lead_s")
LEAD_S, LEAST_GAIN = 0.1, 0.7
"""Typical lead of yaw, s, and what it must leave of the miss."""
PHASE_MARGIN_RAD = {
    "roll": math.radians(60.0),
    "pitch": math.radians(60.0),
    "yaw": math.radians(85.0),
}
"""At which the gains that fly cross over: yaw is tuned softly."""


@dataclass(frozen=True)
class AxisGuess:
    """An axis as it is expected, and where that comes from.

    Attributes
    ----------
    vehicle : FlownAxis
    measured : bool
        Whether an ordinary flight told it; else it is typical of vehicles with these gains.
    reason : str
        Why it was not measured; empty where it was.
    check : LoopCheck or None
        Its closed loop beside the flight's; None where the flight does not tell it.
    """

    vehicle: FlownAxis
    measured: bool
    reason: str = ""
    check: LoopCheck | None = None


def guess_axis(
    axis: str, loop: AxisLoop, kind: str, enters: Entry, log: Log | None, spans: tuple[Span, ...]
) -> AxisGuess:
    """An axis from the flight in a log, or a typical one where the flight does not tell it.

    Parameters
    ----------
    axis : {"roll", "pitch", "yaw"}
    loop : AxisLoop
        Controllers that stay on meanwhile.
    kind : {"multirotor", "helicopter", "aeroplane"}
        Whose typical lags to take.
    enters : {"mixer", "rate", "angle"}
        Where the sweep is added.
    log : Log, optional
    spans : tuple of (float, float)
        In the air, s.

    Reference
    ---------
    Ljung, *System Identification*, 2nd ed., section 13.5 (joint input-output approach): the
    direct one shows the controller backwards where gusts and noise move the command.
    """
    usual = _typical(loop, kind)
    base = replace(usual, enters=enters)
    if log is None:
        return AxisGuess(base, False, "no log was given")
    pieces = _pieces(log, axis, spans)
    still = still_rate(pieces)
    if still is not None:
        base = replace(base, still_omega_rad_s=still[0], still_density=still[1])
    reason = ""
    try:
        base = _measured(axis, pieces, base, loop)
    except FlightidError as error:
        reason = error.reason
    check = _checked(axis, pieces, base, loop)
    return AxisGuess(base, not reason, reason, check)


def _pieces(log: Log, axis: str, spans: tuple[Span, ...]) -> list[Record]:
    """Unbroken pieces of command, rate and attitude set-point, where they were logged."""
    command, rate, angle = CHANNELS[axis]
    first, streams = find(log, command), places(log, rate)
    if first is None or not streams:
        return []
    message = first.label.split(".")[0]
    same = [each for each in streams if each.label.split(".")[0] == message]
    signals = [first, (same or streams)[0]]
    wanted = WANTED[axis]
    for name in (angle, wanted):
        reference = find(log, name)
        if reference is not None and reference.time_s.size > 1:
            # As an instrument lines between samples will do: they have nothing of the gusts.
            at = first.time_s[
                (first.time_s >= reference.time_s[0]) & (first.time_s <= reference.time_s[-1])
            ]
            lines = np.interp(at, reference.time_s, reference.values)
            signals.append(replace(reference, time_s=at, values=lines))
    made = records(signals, {command, wanted}, spans)
    return [record for record in made if record.duration_s >= SHORTEST_S]


def _checked(
    axis: str, pieces: list[Record], vehicle: FlownAxis, loop: AxisLoop
) -> LoopCheck | None:
    if not pieces or WANTED[axis] not in pieces[0]:
        return None
    _, rate, angle = CHANNELS[axis]
    return check_loop(pieces, (WANTED[axis], rate, angle), vehicle, loop, _grid(pieces))


def _grid(pieces: list[Record]) -> Array:
    """Frequencies that the slowest piece can tell, rad/s."""
    rate_hz = min(record.sample_rate_hz for record in pieces)
    highest = min(HIGHEST_RAD_S, 2.0 * np.pi * rate_hz / SAMPLES_IN_CYCLE)
    return np.geomspace(LOWEST_RAD_S, max(highest, 2.0 * LOWEST_RAD_S), N_OMEGA)


def _measured(axis: str, pieces: list[Record], base: FlownAxis, loop: AxisLoop) -> FlownAxis:
    """Gain and lags of the axis as it flew, by way of the set-point, which gusts do not move.

    Raises
    ------
    FlightidError
        The flight does not tell them.
    """
    command, rate, angle = CHANNELS[axis]
    if not pieces:
        raise DataError(f"no {SHORTEST_S:g} s in the air hold command and rate both")
    limited = np.mean(np.abs(np.concatenate([piece[command] for piece in pieces])) >= FULL)
    if loop.output_unit == "1" and limited > MOST_AT_LIMIT:
        raise DataError("the command was at its limit", found=f"{100 * limited:.0f} % of the time")
    if angle not in pieces[0]:
        raise DataError("no set-point of attitude is logged")
    if all(np.ptp(piece[angle]) == 0.0 for piece in pieces):
        raise DataError(f"the set-point of the {axis} attitude stands still in the air")
    rate_hz = min(record.sample_rate_hz for record in pieces)
    highest = min(HIGHEST_RAD_S, 2.0 * np.pi * rate_hz / SAMPLES_IN_CYCLE)
    if highest < 4.0 * LOWEST_RAD_S:
        raise DataError("the log is too slow for a rate loop", found=f"{rate_hz:.3g} Hz")
    response = estimate_response(
        pieces, inputs=command, outputs=rate, excitations=angle,
        band_rad_s=(LOWEST_RAD_S, highest), n_omega=N_OMEGA, estimator="instrument",
    )  # fmt: skip
    error = response.random_error[0, 0]
    sure = error <= LARGEST_ERROR
    if np.count_nonzero(sure) < FEWEST_POINTS:
        raise DataError(
            "the set-point moves the axis too little",
            found=f"errors below {100 * LARGEST_ERROR:.0f} % in {100 * np.mean(sure):.0f} % of "
            "the band",
        )
    omega, flown = response.omega_rad_s[sure], response.response[0, 0][sure]
    shape = _fitted(base, omega, flown, error[sure])
    opened = shape.response(omega) * loop.feedback(omega, gyro="filtered", with_hold=False)
    if not np.min(np.abs(opened)) < FARTHEST_CROSSOVER or not (
        np.max(np.abs(opened)) > 1.0 / FARTHEST_CROSSOVER
    ):
        found = f"loop gains of {np.min(np.abs(opened)):.2g} to {np.max(np.abs(opened)):.2g}"
        raise DataError("the set-point moves the axis far from its crossover alone", found=found)
    return shape


def _fitted(base: FlownAxis, omega: Array, flown: Complex, error: Array) -> FlownAxis:
    """Gain, time constant, motor lag and delay by least squares of the logarithm; a lead too.

    A lead is there in the yaw of rotors, which push the frame as they speed up: taken where it
    makes the miss a good deal smaller.

    Raises
    ------
    DataError
        No such shape goes through what was flown.
    """
    weight = 1.0 / np.maximum(error, LEAST_ERROR)
    weight /= np.sqrt(np.mean(weight**2))
    shape, left = _searched(base, SHAPE, omega, flown, weight)
    if base.loop is not None and base.loop.axis == "yaw":
        led, closer = _searched(replace(base, lead_s=LEAD_S), LED, omega, flown, weight)
        if closer < LEAST_GAIN * left:
            shape, left = led, closer
    if left > LARGEST_MISS:
        raise DataError(
            "no gain, lag and delay go through what was flown",
            found=f"{100 * left:.0f} % away from it",
        )
    return shape


def _searched(
    base: FlownAxis, names: tuple[str, ...], omega: Array, flown: Complex, weight: Array
) -> tuple[FlownAxis, float]:
    """Best shape near typical times, and the root mean square of its logarithmic miss."""
    scale = float(np.median(np.abs(flown / base.response(omega))))
    start = [getattr(base, name) * (scale if name == "gain" else 1.0) for name in names]

    def shape(logs: Array) -> FlownAxis:
        return replace(base, **dict(zip(names, np.exp(logs).tolist(), strict=True)))

    def miss(logs: Array) -> Array:
        ratio = flown / shape(logs).response(omega)
        return np.concatenate([weight * np.log(np.abs(ratio)), weight * np.angle(ratio)])

    around = np.log(start)
    room = np.log([100.0 if name == "gain" else WIDEST_SHAPE for name in names])
    found = scipy.optimize.least_squares(miss, around, bounds=(around - room, around + room))
    return shape(found.x), float(np.sqrt(np.mean(found.fun**2)))


def _typical(loop: AxisLoop, kind: str) -> FlownAxis:
    """An axis that the flown gains suit: by feed-forward, or by 60 deg of phase margin.

    Feed-forward is the inverse of a steady gain; without it, P is what a multirotor's rate loop
    crosses over with.
    """
    usual = TYPICAL[kind]
    base = FlownAxis(
        1.0, usual.time_constant_s, usual.delay_s, motor_lag_s=usual.motor_lag_s,
        loop=loop, attitude_feedback_per_s=loop.angle_gain_1_s,
    )  # fmt: skip
    omega = np.geomspace(0.5, 100.0, 400)
    terms, names = loop.forward_basis(omega[:1], with_hold=False)
    forward = loop.names.get("ff", "")
    fed = 0.0
    if forward in names:
        fed = loop.gains[forward] * float(abs(terms[names.index(forward), 0]))
    if not kind.endswith("multirotor") and fed > 0.0:
        return replace(base, gain=1.0 / fed, rate_feedback=fed)
    opened = base.response(omega) * loop.feedback(omega, gyro="filtered", with_hold=False)
    phase = np.unwrap(np.angle(opened))
    # Below the corner of P and I the phase passes the margin too, on its way up.
    corner = loop.values["i"] * loop.unit_of("i") / max(loop.values["p"] * loop.unit_of("p"), 1e-12)
    missed = np.abs(phase - (PHASE_MARGIN_RAD[loop.axis] - np.pi))
    place = int(np.argmin(np.where(omega >= min(corner, omega[-1]), missed, np.inf)))
    gain = float(1.0 / abs(opened[place]))
    return replace(
        base, gain=gain, rate_feedback=loop.values["p"] * loop.unit_of("p") or 1.0 / gain
    )
