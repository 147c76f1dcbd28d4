"""What flew: vehicle, firmware, frame, modes with their spans, battery, flown gains."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.from_log import autopilot_of
from flightid.control.autopilots.parameter_table import AXES, parameter_entries
from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.inspection.flight_phases import FlightPhases
from flightid.inspection.signals import Span, inside
from flightid.inspection.stamps import believable, log_span
from flightid.logs import Log, LogTable
from flightid.units import DIMENSIONLESS, convert

GAIN_ROLES = ("p", "i", "d", "ff", "k", "angle_p")
"""What a pilot calls the gains, of all that a controller has."""
CELLS = ("BAT1_N_CELLS", "BAT_N_CELLS")
MOTORS = (
    *("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX", "MOT_PWM_MIN", "MOT_PWM_MAX"),
    *("MOT_PWM_TYPE", "THR_MDL_FAC", "PWM_MAIN_MIN", "PWM_MAIN_MAX"),
)
"""Parameters of ArduPilot and PX4 that make thrust of commands: loops' gains go with them."""
LEAST_VOLTAGE = 1.0
"""Below it no battery is measured, V."""


@dataclass(frozen=True)
class ModeSpan:
    """A flight mode from when to when, s on the autopilot's clock."""

    mode: str
    start_s: float
    stop_s: float


@dataclass(frozen=True)
class Battery:
    """What the battery did.

    Attributes
    ----------
    start_v, least_v, end_v : float
        Voltage at the beginning, the least in the air, and at the end, V.
    cells : int or None
        In series, by the log's parameters.
    mean_a, most_a : float or None
        Current in the air, A; None where it is not measured.
    used_mah : float or None
        Charge that was drawn, mAh.
    """

    start_v: float
    least_v: float
    end_v: float
    cells: int | None
    mean_a: float | None
    most_a: float | None
    used_mah: float | None


@dataclass(frozen=True)
class FlightIdentity:
    """What flew.

    Attributes
    ----------
    frame : str
        Frame as the log tells it; empty where it does not.
    modes : tuple of ModeSpan
        In order.
    battery : Battery or None
        None where no voltage was measured.
    gains : mapping of str to mapping of str to float
        Flown value by the autopilot's name, by axis.
    changed_gains : tuple of str
        Those that changed while the log ran; the value above is the last.
    board : str
        Board and unique number of the autopilot; empty where the log does not tell them.
    motors : mapping of str to float
        Parameters that make commands thrust.
    unfed : tuple of str
        Loops to which parameters feed nothing of the set-point forward, as ``"roll rate"``.
    """

    frame: str
    modes: tuple[ModeSpan, ...]
    battery: Battery | None
    gains: Mapping[str, Mapping[str, float]]
    changed_gains: tuple[str, ...]
    board: str = ""
    motors: Mapping[str, float] = field(default_factory=dict)
    unfed: tuple[str, ...] = ()


def flight_identity(log: Log, phases: FlightPhases) -> FlightIdentity:
    """Read what flew from parameters, events and battery messages."""
    gains = _gains(log)
    known = {name for values in gains.values() for name in values}
    changed = {c.name for c in log.parameter_changes if c.name in known and c.old != c.new}
    motors = {name: log.parameters[name] for name in MOTORS if name in log.parameters}
    battery = _battery(log, phases.airborne)
    return FlightIdentity(
        _frame(log), mode_spans(log), battery, gains, tuple(sorted(changed)), log.board, motors,
        unfed_loops(log),
    )  # fmt: skip


def unfed_loops(log: Log) -> tuple[str, ...]:
    """Loops to which the log's parameters feed nothing of the set-point forward.

    None of those whose parameters the log lacks, or changed while it ran.

    Parameters
    ----------
    log : Log
    """
    try:
        autopilot = autopilot_of(log)
    except DataError:
        return ()
    changed = {each.name for each in log.parameter_changes}
    unfed = []
    for axis in AXES:
        roles = [e for e in parameter_entries(autopilot, axis) if e.role in ("ff", "d_ff")]
        names = [n for each in roles for n in (each.name, *each.older) if n in log.parameters]
        shaped = _shaping(log, autopilot, axis)
        for loop, feeding in (("rate", names or None), ("attitude", shaped)):
            if feeding is not None and not any(log.parameters[n] or n in changed for n in feeding):
                unfed.append(f"{axis} {loop}")
    return tuple(unfed)


def _shaping(log: Log, autopilot: str, axis: str) -> list[str] | None:
    """Parameters by which an attitude's set-point acts on the rate's beside the angle controller.

    None where they are not known. PX4 feeds the yaw stick's rate forward whatever its parameters
    say, roll and pitch by a reference model alone, which not every firmware has: where the angle's
    gain is logged and no MC_REF_FF, nothing is fed.
    """
    if autopilot == "px4_multicopter":
        if axis == "yaw" or f"MC_{axis.upper()}_P" not in log.parameters:
            return None
        return [name for name in ("MC_REF_FF",) if name in log.parameters]
    return [name for name in ("ATC_RATE_FF_ENAB",) if name in log.parameters] or None


BATTERY = {
    "ardupilot": ("BAT", "Volt", "Curr", "CurrTot"),
    "px4": ("battery_status", "voltage_v", "current_a", "discharged_mah"),
    "betaflight": ("main", "vbatLatest", "amperageLatest", ""),
    "inav": ("main", "vbat", "amperage", ""),
}
"""Message, and fields of voltage, current and charge drawn."""


def _frame(log: Log) -> str:
    said = [e.text for e in log.events if e.kind == "text" and e.text.startswith("Frame: ")]
    if said:
        return said[-1].removeprefix("Frame: ")
    parameters, told = log.parameters, []
    if "CA_ROTOR_COUNT" in parameters:
        told.append(f"{parameters['CA_ROTOR_COUNT']:.0f} rotors")
    if "SYS_AUTOSTART" in parameters:
        told.append(f"SYS_AUTOSTART {parameters['SYS_AUTOSTART']:.0f}")
    if "FRAME_CLASS" in parameters:
        told.append(f"FRAME_CLASS {parameters['FRAME_CLASS']:.0f}")
        told.append(f"FRAME_TYPE {parameters.get('FRAME_TYPE', 0.0):.0f}")
    return ", ".join(told)


def mode_spans(log: Log) -> tuple[ModeSpan, ...]:
    """Flight modes in order, each from its event to the next."""
    told = [(e.time_s, re.split(r" \(|, ", e.text)[0]) for e in log.events if e.kind == "mode"]
    begun = [(time_s, mode) for time_s, mode in told if time_s is not None]
    ends = [*(time_s for time_s, _ in begun[1:]), log_span(log)[1]]
    spans: list[ModeSpan] = []
    for (start, mode), stop in zip(begun, ends, strict=False):
        again = bool(spans) and spans[-1].mode == mode
        first = spans.pop().start_s if again else start
        if stop > first:
            spans.append(ModeSpan(mode, first, stop))
    return tuple(spans)


def _battery(log: Log, spans: tuple[Span, ...]) -> Battery | None:
    message, *fields = BATTERY.get(log.kind, BATTERY["ardupilot"])
    if message not in log or fields[0] not in log.messages[message].fields:
        return None
    table = log.table(message, (log.messages[message].instances or (None,))[0])
    good = believable(table.time_s)
    time_s, volts = table.time_s[good], table[fields[0]][good]
    measured = volts > LEAST_VOLTAGE
    if np.count_nonzero(measured) < 2:
        return None
    flying = inside(time_s, spans) if spans else np.ones(time_s.size, dtype=np.bool_)
    low = volts[measured & flying] if np.any(measured & flying) else volts[measured]
    current = _measured(table[fields[1]][good][flying]) if fields[1] in table else None
    drawn = _measured(_milliampere_hours(table, fields[2])[good]) if fields[2] in table else None
    found = (log.parameters.get(name, 0.0) for name in CELLS)
    cells = next((int(n) for n in found if n >= 1.0), None)
    return Battery(
        float(volts[measured][0]),
        float(low.min()),
        float(volts[measured][-1]),
        cells,
        None if current is None else float(current.mean()),
        None if current is None else float(current.max()),
        None if drawn is None else float(drawn[-1] - drawn[0]),
    )


def _milliampere_hours(table: LogTable, field: str) -> NDArray[np.float64]:
    """Charge in mAh: ArduPilot declares its unit, PX4 writes mAh and declares none."""
    declared = table.unit(field)
    return table[field] if declared == DIMENSIONLESS else convert(table[field], declared, "h*mA")


def _measured(values: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Values of a sensor that is there: autopilots write zero or minus one without one."""
    finite = values[np.isfinite(values)]
    return finite if finite.size > 1 and float(finite.max()) > 0.0 else None


def _gains(log: Log) -> dict[str, dict[str, float]]:
    try:
        autopilot = autopilot_of(log)
    except DataError:
        return {}
    found: dict[str, dict[str, float]] = {}
    for axis in AXES:
        entries = {entry.role: entry for entry in parameter_entries(autopilot, axis)}
        for role in (role for role in GAIN_ROLES if role in entries):
            names = (entries[role].name, *entries[role].older)
            name = next((n for n in names if n in log.parameters), None)
            if name is not None:
                found.setdefault(axis, {})[name] = log.parameters[name]
    return found
