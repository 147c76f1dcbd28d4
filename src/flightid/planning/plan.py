"""The verb of the room: an ordinary log in, what to fly next out."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.from_log import autopilot_of, axis_loop_of
from flightid.control.autopilots.make import axis_loop
from flightid.conventions import Light
from flightid.errors import OptionError
from flightid.excitation import Excitation, Limits, Plan, plan
from flightid.findings import Finding
from flightid.inspection.actuators import find_actuators
from flightid.inspection.advice import LOG_BITS, set_bits
from flightid.inspection.advice import logging as logging_of
from flightid.inspection.flight_phases import flight_phases
from flightid.logs import Log, read_log
from flightid.planning.flight_findings import flight_findings
from flightid.planning.flight_time import flight_time
from flightid.planning.flown_axis import FlownAxis
from flightid.planning.flown_sweeps import FlownSweeps, flown_sweeps, sweep_again
from flightid.planning.loop_check import CAREFULLY, SMALLER
from flightid.planning.options import PlanOptions
from flightid.planning.procedures import PROCEDURES, Procedure, procedure_of
from flightid.planning.result import AxisSweep, SweepPlan
from flightid.planning.settings import SID_AXES, log_family, settings_of, unsized_s
from flightid.planning.sweep_band import crossover_rad_s, ends_too_low, sweep_band, why_so_high
from flightid.planning.told_axes import told_axis
from flightid.review.loops import loop_rate_hz as logged_loop_rate_hz

USUAL_LOOP_HZ = 400.0
CYCLES, SHORTEST_S, LONGEST_S = 20.0, 60.0, 120.0
ENOUGH_COHERENCE, SMALLEST_SHARE = 0.95, 0.5
"""An amplitude that reaches this coherence nearly everywhere will do; never less than this share of
what the limits allow, for the day may be windier than that of the log."""
WAIT_S = {"mode": 31.0, "stick": 20.0, "autotune": 15.0, "chirp": 10.0}
"""Rest before and behind a run, s."""
UNSURE = (
    f"what the axis does is not known yet: the log of {SMALLER} tells "
    "(settings in spite of a no-go: --write-no-go)"
)
QUADPLANE = {"Q_A_RAT_": "ATC_RAT_", "Q_A_ANG_": "ATC_ANG_", "Q_A_ACCEL_": "ATC_ACCEL_"}


def plan_flight(
    log: Log | str | Path | None = None,
    *,
    vehicle: str = "quad",
    autopilot: str = "ardupilot",
    axes: tuple[str, ...] | None = None,
    band_rad_s: tuple[float, float] | None = None,
    amplitude: float | None = None,
    duration_s: float | None = None,
    n_records: int = 2,
    control: float = 0.25,
    rate_rad_s: float = math.radians(60.0),
    attitude_rad: float = math.radians(15.0),
    loop_rate_hz: float | None = None,
) -> SweepPlan:
    """Say what to fly so that the next log can be identified: amplitude, band, length, battery.

    From an ordinary flight: what its closed loops leave of an injected sweep is worked out with the
    autopilot's own controllers, on the axis as that flight showed it; what moves the rate without a
    sweep, gusts and vibration, was there to be measured too. Amplitudes are as large as the limits
    allow and no larger than coherence asks for.

    Parameters
    ----------
    log : Log or path-like, optional
        An ordinary flight of the vehicle. Without one the plan is of a typical vehicle.
    vehicle : {"quad", "heli", "plane", "quadplane"}
        Kind of vehicle where no log tells it.
    autopilot : {"ardupilot", "px4", "betaflight", "inav"}
        Autopilot where no log tells it.
    axes : tuple of str, optional
        Axes to sweep; default: all that the autopilot sweeps but those of which the log can carry
        a model already.
    band_rad_s : tuple of float, optional
        Band to sweep; default: an eighth of the crossover to 2.5 times the frequency at which the
        broken rate loop turns by -180 deg, and what the loop's rate, or a pilot, can do.
    amplitude : float, optional
        Share of full command (mixer), rad or rad/s (set-point); default: by limits and coherence.
    duration_s : float, optional
        Length of one sweep, s; default: twenty cycles of the lowest frequency, 60 to 120 s.
    n_records : int
        Sweeps of each axis.
    control, rate_rad_s, attitude_rad : float
        What the vehicle may do about its trim.
    loop_rate_hz : float, optional
        Rate of the controller, Hz, where the log does not tell it; default: 400 Hz, amber.

    Raises
    ------
    UnknownNameError
        No way to sweep such a vehicle is known.
    DataError
        The log does not tell whose controllers flew.
    OptionError
        A setting outside the autopilot's range.

    Notes
    -----
    Assumes small, linear motion about hover or level flight, axes that do not couple, and air like
    that of the log.

    Reference
    ---------
    Tischler & Remple, *Aircraft and Rotorcraft System Identification*, 2nd ed., sections 5.8 to
    5.11; `flightid.excitation.assess`.

    Example
    -------
    >>> import flightid as fid
    >>> made = fid.plan_flight(vehicle="quad", axes=("roll",))
    >>> made.sweeps[0].changes[0]
    GainChange(name='SID_AXIS', value=10.0, old=None, reason='at the mixer, roll')
    """
    asked = PlanOptions(
        vehicle, autopilot, axes, band_rad_s, amplitude, duration_s, n_records, control,
        rate_rad_s, attitude_rad, loop_rate_hz,
    )  # fmt: skip
    opened = log if isinstance(log, Log) or log is None else read_log(log)
    procedure = procedure_of(vehicle, autopilot) if opened is None else _of_log(opened)
    rate_hz = asked.loop_rate_hz
    assumed = opened is not None and rate_hz is None and not logged_loop_rate_hz(opened)
    if assumed:
        rate_hz = USUAL_LOOP_HZ
    current = {} if opened is None else dict(opened.parameters)
    phases = None if opened is None else flight_phases(opened, find_actuators(opened))
    spans = () if phases is None else phases.airborne
    swept = FlownSweeps() if opened is None or phases is None else flown_sweeps(opened, phases)
    needed = tuple(axis for axis in procedure.axes if axis not in swept.carried)
    chosen = needed if asked.axes is None else tuple(asked.axes)
    sweeps = []
    for axis in chosen:
        if axis not in procedure.axes:
            raise OptionError(
                f"{procedure.title} sweeps no such axis",
                found=axis,
                needed=", ".join(procedure.axes),
            )
        guess, made = None, None
        if procedure.how in ("mode", "stick"):
            loop = _loop(procedure, axis, opened, rate_hz)
            enters = procedure.entry(axis)
            guess = told_axis(axis, loop, procedure.kind, enters, opened, spans)
            vehicle_swept = replace(guess.vehicle, loop=_while_swept(procedure, loop))
            guess = replace(guess, vehicle=vehicle_swept)
            flown_so = _flown_so(procedure, axis, opened, swept, asked)
            made = _sweep(procedure, axis, vehicle_swept, asked, flown_so)
            guess = guess if flown_so is None else None
        excitation = None if made is None else made.excitation
        changes = settings_of(procedure, axis, excitation, current, chosen, asked)
        again = made is not None and guess is None
        sweeps.append(AxisSweep(axis, guess, made, changes, is_flown_again=again))
    flown = [] if opened is None else list(swept.findings(opened, chosen))
    flown += flight_findings(opened, phases, sweeps, USUAL_LOOP_HZ if assumed and sweeps else 0.0)
    own = [each for each in sweeps if not each.is_flown_again]
    tops = {each.axis: each.plan.excitation.band_rad_s[1] for each in own if each.plan}
    if procedure.how == "mode" and asked.band_rad_s is None and tops:
        flown.append(why_so_high(tops))
    crossovers = {e.axis: crossover_rad_s(e.guess.vehicle) for e in own if e.plan and e.guess}
    if low := ends_too_low({axis: tops[axis] for axis in crossovers}, crossovers):
        flown.append(low)
    lengths = [
        each.plan.excitation.duration_s if each.plan else unsized_s(procedure, asked)
        for each in sweeps
    ]
    runs = [length + WAIT_S[procedure.how] for length in lengths]
    return SweepPlan(
        name=vehicle if opened is None else opened.path.name,
        firmware="" if opened is None else opened.firmware,
        procedure=procedure,
        sweeps=tuple(sweeps),
        n_records=asked.n_records,
        flight_time=flight_time(runs, asked.n_records, opened, phases),
        logging=_logging(procedure, opened),
        findings=_findings(procedure, tuple(sweeps), opened, flown) if sweeps else tuple(flown),
        carried=swept.carried,
    )


def _of_log(log: Log) -> Procedure:
    """The way to sweep what wrote a log."""
    if log.kind == "ardupilot" and log.vehicle == "plane" and log.parameters.get("Q_ENABLE"):
        return PROCEDURES["quadplane"]
    return PROCEDURES[autopilot_of(log)]


def _loop(
    procedure: Procedure, axis: str, log: Log | None, rate_hz: float | None = None
) -> AxisLoop:
    """Controllers that stay on, as they fly."""
    if log is None:
        loop = axis_loop(procedure.loops, axis, loop_rate_hz=rate_hz or USUAL_LOOP_HZ)
    elif procedure.name == "quadplane":
        # Its hover controllers are ArduCopter's, under other names.
        named = dict(log.parameters)
        for theirs, ours in QUADPLANE.items():
            found = {n: v for n, v in log.parameters.items() if n.startswith(theirs)}
            named |= {n.replace(theirs, ours, 1): v for n, v in found.items()}
        loop = axis_loop(procedure.loops, axis, named, loop_rate_hz=rate_hz)
    else:
        loop = axis_loop_of(log, axis, loop_rate_hz=rate_hz)
    return loop


def _while_swept(procedure: Procedure, loop: AxisLoop) -> AxisLoop:
    """Without the integrator where the settings take it out for the sweep."""
    if procedure.how == "mode" and procedure.kind == "multirotor":
        return loop.with_gains({loop.names["i"]: 0.0})
    return loop


def _flown_so(
    procedure: Procedure, axis: str, log: Log | None, swept: FlownSweeps, asked: PlanOptions
) -> Excitation | None:
    """The sweep of the log itself, where a model rests on it and nobody asks for another."""
    own = (asked.amplitude, asked.band_rad_s, asked.duration_s) != (None, None, None)
    if log is None or own or procedure.how != "mode" or axis not in swept.carried:
        return None
    return sweep_again(log, axis)


def _sweep(
    procedure: Procedure,
    axis: str,
    vehicle: FlownAxis,
    asked: PlanOptions,
    flown_so: Excitation | None = None,
) -> Plan:
    if flown_so is not None:
        as_flown = replace(
            asked,
            amplitude=float(flown_so.peak[0]),
            band_rad_s=flown_so.band_rad_s,
            duration_s=flown_so.duration_s,
        )
        return replace(_sweep(procedure, axis, vehicle, as_flown), excitation=flown_so)
    by_stick = procedure.how == "stick"
    band = asked.band_rad_s or sweep_band(vehicle, _rate_hz(vehicle), by_stick)
    cycles_s = CYCLES * math.tau / band[0]
    length_s = asked.duration_s or float(np.clip(math.ceil(cycles_s), SHORTEST_S, LONGEST_S))
    limits = Limits(
        control=asked.control * vehicle.full_command,
        rate_rad_s=asked.rate_rad_s,
        attitude_rad=asked.attitude_rad,
    )

    def made(size: float | None) -> Plan:
        return plan(
            "sweep" if by_stick else "ardupilot_chirp", vehicle, band_rad_s=band, amplitude=size,
            duration_s=length_s, sample_rate_hz=_rate_hz(vehicle), limits=limits,
            n_records=asked.n_records, axis=SID_AXES[axis], inputs=(axis,),
            unit={"mixer": "1", "rate": "rad/s", "angle": "rad"}[vehicle.enters],
        )  # fmt: skip

    largest = made(asked.amplitude)
    if asked.amplitude is not None or by_stick:
        return largest
    return made(_enough(largest))


def _rate_hz(vehicle: FlownAxis) -> float:
    return USUAL_LOOP_HZ if vehicle.loop is None else min(vehicle.loop.loop_rate_hz, USUAL_LOOP_HZ)


def _enough(largest: Plan) -> float:
    """Amplitude that coherence asks for, within what the limits allow, to two digits."""
    coherence = largest.axes[0].coherence
    least = float(np.quantile(coherence / np.maximum(1.0 - coherence, 1e-12), 0.05))
    wanted = ENOUGH_COHERENCE / (1.0 - ENOUGH_COHERENCE)
    share = float(np.clip(math.sqrt(wanted / max(least, 1e-12)), SMALLEST_SHARE, 1.0))
    size = share * float(largest.excitation.peak[0])
    digits = 1 - math.floor(math.log10(size))
    return math.floor(size * 10.0**digits) / 10.0**digits


def _logging(procedure: Procedure, log: Log | None) -> str:
    if procedure.how == "chirp":
        return "blackbox at 1 kHz or faster, debug_mode CHIRP"
    if log is not None:
        return logging_of(log)
    if procedure.name.startswith("px4"):
        return "SDLOG_PROFILE 25 is in the file"
    if procedure.name == "inav":
        return "every second loop, by the file"
    said = set_bits(LOG_BITS[log_family(procedure)])
    return f"{said}; the file has no LOG_BITMASK: only a log tells what is set now"


def _findings(
    procedure: Procedure,
    sweeps: tuple[AxisSweep, ...],
    log: Log | None,
    flown: list[Finding],
) -> tuple[Finding, ...]:
    found = flown + _expected(sweeps)
    typical = {each.axis: bool(each.guess and not each.guess.measured) for each in sweeps}
    for each in sweeps:
        # What is flown again showed enough once: nothing is expected of it that was not seen.
        for told in () if each.plan is None or each.is_flown_again else each.plan.findings:
            if told.light in (Light.AMBER, Light.RED) and told.code != "chirp-silent-end":
                unsure = typical.get(each.axis) and told.code == "design-coherence"
                said = told.message.removeprefix(f"{each.axis} ").removeprefix(f"{each.axis}: ")
                action = UNSURE if unsure else told.action
                found.append(replace(told, message=f"{each.axis}: {said}", action=action))
    if procedure.how in ("autotune", "chirp"):
        found.append(
            Finding(
                "sized-by-autopilot",
                Light.UNKNOWN,
                "flightid cannot say what amplitude does here: the autopilot or its defaults size "
                "the sweep",
                "fly one axis, then look at its log: flightid inspect LOG",
            )
        )
    if procedure.how == "mode" and log is not None and "SID_AXIS" not in log.parameters:
        found.append(
            Finding(
                "no-sweep-mode",
                Light.AMBER,
                "the parameters in this log hold no SID_AXIS: the firmware may be built without "
                "the sweep",
                "look for SID_AXIS in the list of parameters before you go out",
            )
        )
    if log is None:
        found.append(
            Finding(
                "no-way-back-file",
                Light.AMBER,
                "no file takes the settings back: without a log nothing tells what flew",
                "save all parameters first, or plan from a log of this vehicle",
            )
        )
    return tuple(found)


def _expected(sweeps: tuple[AxisSweep, ...]) -> list[Finding]:
    """What each axis rests on; axes with one reason in one sentence."""
    by_reason: dict[str, list[str]] = {}
    found = []
    for each in sweeps:
        guess = each.guess
        if guess is None:
            continue
        told = None if guess.check is None else guess.check.finding(each.axis)
        if told is not None:
            found.append(told)
        if told is None or told.light is Light.GREEN or not guess.measured:
            by_reason.setdefault(guess.reason, []).append(each.axis)
    for reason, axes in by_reason.items():
        named = ", ".join(axes)
        if not reason:
            found.append(
                Finding("axis-measured", Light.GREEN, f"{named}: as this flight showed it")
            )
            continue
        found.append(
            Finding(
                "axis-typical",
                Light.AMBER,
                f"{named}: a typical vehicle under these gains stands for yours ({reason})",
                CAREFULLY,
            )
        )
    return found
