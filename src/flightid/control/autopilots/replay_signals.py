"""What a log holds of one axis' rate controller: its inputs, its terms and its flags."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from flightid.control.autopilots.axis_loop import AxisLoop
from flightid.control.autopilots.parameter_table import AXES
from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.logs import Log, LogTable
from flightid.logs.blackbox.firmware import BLACKBOX, INAV
from flightid.logs.self_check import paired_rows

Samples = NDArray[np.float64]
LIMIT, PD_LIMIT, RESET, I_SET = 1, 2, 4, 8
"""Bits of PIDR.Flags."""
PID_TERMS = ("P", "I", "D", "FF", "DFF")
SAME_RATE = 0.02
"""Departure of the log's rate from the loop's up to which every loop counts as logged."""
LEAST_ROWS = 20


@dataclass(frozen=True)
class LoggedSignal:
    """Stamped samples, SI units."""

    time_s: Samples
    values: Samples
    source: str

    @property
    def rate_hz(self) -> float:
        """Rows per second from the median interval."""
        return 1.0 / float(np.median(np.diff(self.time_s)))


@dataclass(frozen=True)
class AxisSignals:
    """Inputs and terms of one axis.

    Attributes
    ----------
    setpoint, rate : LoggedSignal
        rad/s.
    filtered_target : bool
        The set-point is taken behind the target's filters.
    setpoint_loops : float
        Loops by which the log is known to note the set-point before it acts.
    terms : mapping of str to LoggedSignal
        Logged terms, and ``output``, their sum, without any injected signal.
    flags : LoggedSignal or None
        Bits of PIDR.Flags.
    thrust, acceleration, landed : LoggedSignal or None
        What else the controller looks at.
    unallocated : LoggedSignal or None
        Torque that the allocation could not give (PX4); zero where it gave all.
    paired : bool
        Set-point, rate and terms stand on the same rows.
    """

    setpoint: LoggedSignal
    rate: LoggedSignal
    terms: Mapping[str, LoggedSignal]
    filtered_target: bool = False
    setpoint_loops: float = 0.0
    flags: LoggedSignal | None = None
    thrust: LoggedSignal | None = None
    acceleration: LoggedSignal | None = None
    landed: LoggedSignal | None = None
    unallocated: LoggedSignal | None = None
    paired: bool = False
    extra: dict[str, str] = field(default_factory=dict)


def every_loop(time_s: Samples, loop: AxisLoop) -> bool:
    """Tell whether rows at these stamps are those of every loop."""
    step = float(np.median(np.diff(time_s)))
    return abs(1.0 / (step * loop.loop_rate_hz) - 1.0) < SAME_RATE


def longest_undisturbed(flags: LoggedSignal) -> tuple[float, float] | None:
    """Longest span in which the autopilot neither set nor reset the integrator, s."""
    broken = (flags.values.astype(int) & (RESET | I_SET)) > 0
    edges = np.flatnonzero(np.diff(np.concatenate([[1], broken.astype(int), [1]])))
    first, last = edges[::2], edges[1::2] - 1
    if first.size == 0:
        return None
    best = int(np.argmax(flags.time_s[last] - flags.time_s[first]))
    if last[best] - first[best] + 1 < LEAST_ROWS:
        return None
    return float(flags.time_s[first[best]]), float(flags.time_s[last[best]])


def read_signals(log: Log, loop: AxisLoop, span_s: tuple[float, float] | None) -> AxisSignals:
    """Signals of an axis, within a span.

    Raises
    ------
    DataError
        The log does not hold what a replay needs; what is missing is named.
    """
    if log.kind == "px4":
        return _px4(log, loop, span_s)
    if log.kind in BLACKBOX:
        return _blackbox(log, loop, span_s)
    return _ardupilot(log, loop, span_s)


def _place(loop: AxisLoop) -> int:
    return AXES.index(loop.axis)


def _rows(table: LogTable, span_s: tuple[float, float] | None) -> NDArray[np.intp]:
    time_s = table.time_s
    keep = np.concatenate([[True], np.diff(time_s) > 0])
    if span_s is not None:
        keep &= (time_s >= span_s[0]) & (time_s <= span_s[1])
    rows = np.flatnonzero(keep)
    if rows.size < LEAST_ROWS:
        raise DataError(
            f"too few rows of {table.name} to replay a controller",
            found=f"{rows.size} in the span",
            needed=f"{LEAST_ROWS} or more",
        )
    return rows


def _ardupilot(log: Log, loop: AxisLoop, span_s: tuple[float, float] | None) -> AxisSignals:
    letter = "RPY"[_place(loop)]
    if f"PID{letter}" not in log:
        raise DataError(
            "the log does not hold the controller's terms",
            found=f"no PID{letter}",
            needed=f"PID{letter}, with RATE at the loop's rate for an exact replay",
            action="set the bits PID, ATTITUDE_FAST and ATTITUDE_MED of LOG_BITMASK",
        )
    pid = log.table(f"PID{letter}")
    if loop.autopilot == "arduplane":
        return _from_pid(pid, _rows(pid, span_s), to_rad=float(np.radians(1.0)), filtered=False)
    if "RATE" not in log:
        return _from_pid(pid, _rows(pid, span_s), to_rad=1.0, filtered=True)
    return _from_rate(log, log.table("RATE"), pid, loop, letter, span_s)


def _from_pid(
    pid: LogTable, rows: NDArray[np.intp], *, to_rad: float, filtered: bool
) -> AxisSignals:
    time_s = pid.time_s[rows]
    names = [name for name in PID_TERMS if name in pid]
    values = pid.arrays([*names, "Tar", "Act"])
    terms = {name: LoggedSignal(time_s, values[name][rows], pid.name) for name in names}
    total = np.sum([signal.values for signal in terms.values()], axis=0)
    terms["output"] = LoggedSignal(time_s, total, f"sum of {pid.name}")
    if "Err" in pid and filtered:
        terms = {"Err": LoggedSignal(time_s, pid["Err"][rows], pid.name), **terms}
    return AxisSignals(
        LoggedSignal(time_s, values["Tar"][rows] * to_rad, f"{pid.name}.Tar"),
        LoggedSignal(time_s, values["Act"][rows] * to_rad, f"{pid.name}.Act"),
        terms,
        filtered_target=filtered,
        flags=_flags(pid, rows),
        paired=True,
    )


def _flags(pid: LogTable, rows: NDArray[np.intp]) -> LoggedSignal | None:
    if "Flags" not in pid:
        return None
    return LoggedSignal(pid.time_s[rows], pid["Flags"][rows], f"{pid.name}.Flags")


def _from_rate(
    log: Log,
    rate: LogTable,
    pid: LogTable,
    loop: AxisLoop,
    letter: str,
    span_s: tuple[float, float] | None,
) -> AxisSignals:
    loop_time_s = 1.0 / loop.loop_rate_hz
    first, second = paired_rows(rate.time_s, pid.time_s, loop_time_s)
    if span_s is not None:
        inside = (rate.time_s[first] >= span_s[0]) & (rate.time_s[first] <= span_s[1])
        first, second = first[inside], second[inside]
    if first.size < LEAST_ROWS:
        raise DataError(
            "RATE and the controller's terms were not logged in the same loops",
            found=f"{first.size} common loops in the span",
            needed=f"{LEAST_ROWS} or more",
        )
    time_s = rate.time_s[first]
    stored = rate.arrays([f"{letter}Des", f"{letter}Out"])
    names = [name for name in ("Tar", "Err", *PID_TERMS) if name in pid]
    values = pid.arrays([*names, "Act"])
    terms = {name: LoggedSignal(time_s, values[name][second], pid.name) for name in names}
    if every_loop(time_s, loop):
        output = stored[f"{letter}Out"][first] - _injected(log, loop, time_s)
        terms["output"] = LoggedSignal(time_s, output, f"RATE.{letter}Out")
    else:
        # Between rows an injected signal cannot be told from the controller's own.
        total = np.sum([terms[name].values for name in names if name in PID_TERMS], axis=0)
        terms["output"] = LoggedSignal(time_s, total, f"sum of {pid.name}")
    setpoint = np.radians(stored[f"{letter}Des"][first])
    flags = _flags(pid, second)
    return AxisSignals(
        LoggedSignal(time_s, setpoint, f"RATE.{letter}Des"),
        LoggedSignal(time_s, values["Act"][second], f"{pid.name}.Act"),
        terms,
        setpoint_loops=float(loop.set_point_delay_loops),
        flags=None if flags is None else LoggedSignal(time_s, flags.values, flags.source),
        paired=True,
    )


def _injected(log: Log, loop: AxisLoop, time_s: Samples) -> Samples:
    """Chirps that system-identification runs added behind the controller, at these loops."""
    injected = np.zeros(time_s.size)
    if "SIDD" not in log:
        return injected
    data = log.table("SIDD")
    loop_time_s = 1.0 / loop.loop_rate_hz
    for run in log.sid_runs:
        if run.point != "mixer" or run.body_axis is None or run.body_axis.value != loop.axis:
            continue
        mine = np.flatnonzero((data.time_s >= run.start_s - 0.05) & (data.time_s <= run.stop_s))
        loops, rows = paired_rows(time_s, data.time_s[mine], loop_time_s)
        # The target is logged at the end of a loop and acts in the next.
        inside = loops + 1 < time_s.size
        injected[loops[inside] + 1] += data["Targ"][mine][rows[inside]]
    return injected


def _px4(log: Log, loop: AxisLoop, span_s: tuple[float, float] | None) -> AxisSignals:
    place = _place(loop)
    setpoint = _first(log, span_s, "set-point", ("vehicle_rates_setpoint", loop.axis))
    output = _first(
        log,
        span_s,
        "output",
        ("vehicle_torque_setpoint", f"xyz[{place}]"),
        ("actuator_controls_0", f"control[{place}]"),
    )
    speed = ("rollspeed", "pitchspeed", "yawspeed")[place]
    modern = ("vehicle_angular_velocity", f"xyz[{place}]")
    rate = _first(log, span_s, "rate", modern, ("vehicle_attitude", speed))
    extra: dict[str, str] = {}
    if rate.source.startswith("vehicle_attitude") and "sensor_combined" in log:
        rate, extra = _debiased(log, span_s, rate, place)
    integral = _optional(log, "rate_ctrl_status", f"{loop.axis}speed_integ")
    acceleration = _optional(log, "vehicle_angular_velocity", f"xyz_derivative[{place}]")
    return AxisSignals(
        setpoint,
        rate,
        ({} if integral is None else {"I": integral}) | {"output": output},
        thrust=_optional(log, "vehicle_rates_setpoint", "thrust"),
        acceleration=acceleration
        or _optional(log, "vehicle_angular_acceleration", f"xyz[{place}]"),
        landed=_optional(log, "vehicle_land_detected", "landed"),
        unallocated=_unallocated(log, place),
        extra=extra,
    )


def _blackbox(log: Log, loop: AxisLoop, span_s: tuple[float, float] | None) -> AxisSignals:
    """Set-point, filtered gyro and PID terms of a blackbox, in the axes of the firmware."""
    place = _place(loop)
    is_inav = log.kind == INAV
    # Betaflight's feed-forward acts on the sticks, which no set-point of the log holds.
    logged = {**{f"axis{term}": term for term in "PID"}, **({"axisF": "FF"} if is_inav else {})}
    names = {f"{term}[{place}]": word for term, word in logged.items()}
    both = [f"{'axisRate' if is_inav else 'setpoint'}[{place}]", f"gyroADC[{place}]"]
    table = log.table("main")
    missing = [name for name in (*both, *list(names)[:2]) if name not in table]
    if missing:
        raise DataError(
            "the log does not hold the controller's terms",
            found="no " + ", ".join(missing),
            needed="set-point, gyro and PID terms in the blackbox",
            action="Betaflight: set blackbox_disable_pids, blackbox_disable_setpoint and "
            "blackbox_disable_gyro to OFF",
        )
    rows = _rows(table, span_s)
    time_s = table.time_s[rows]
    terms = {
        term: LoggedSignal(time_s, table[name][rows] / 1e3, f"main.{name}")
        for name, term in names.items()
        if name in table
    }
    total = np.sum([each.values for each in terms.values()], axis=0)
    wanted, measured = (
        LoggedSignal(time_s, np.radians(table[name][rows]), f"main.{name}") for name in both
    )
    terms["output"] = LoggedSignal(time_s, total, "sum of the terms")
    return AxisSignals(wanted, measured, terms, paired=True)


def _unallocated(log: Log, place: int) -> LoggedSignal | None:
    message = "control_allocator_status"
    missing = _optional(log, message, f"unallocated_torque[{place}]")
    achieved = _optional(log, message, "torque_setpoint_achieved")
    if missing is None or achieved is None:
        return None
    values = np.where(achieved.values > 0, 0.0, missing.values)
    return LoggedSignal(missing.time_s, values, missing.source)


def _table(log: Log, message: str) -> LogTable:
    return log.table(message, min(log.messages[message].instances, default=None))


def _signal(table: LogTable, name: str, rows: NDArray[np.intp]) -> LoggedSignal:
    """Finite samples in order of time; rates are stamped when the sensor was read."""
    time_s, values = table.time_s[rows], table[name][rows]
    if table.name == "vehicle_angular_velocity" and "timestamp_sample" in table:
        scale = 1.0 if table.unit("timestamp_sample") == "s" else 1e-6
        time_s = table["timestamp_sample"][rows] * scale
    good = np.isfinite(values) & np.concatenate([[True], np.diff(time_s) > 0])
    return LoggedSignal(time_s[good], values[good], f"{table.name}.{name}")


def _optional(log: Log, message: str, name: str) -> LoggedSignal | None:
    if message not in log or name not in log.table(message):
        return None
    table = _table(log, message)
    if len(table) < 2:
        return None
    return _signal(table, name, np.arange(len(table)))


def _first(
    log: Log, span_s: tuple[float, float] | None, what: str, *candidates: tuple[str, str]
) -> LoggedSignal:
    for message, name in candidates:
        if message in log and name in log.table(message):
            table = _table(log, message)
            return _signal(table, name, _rows(table, span_s))
    needed = " or ".join(f"{message}.{name}" for message, name in candidates)
    raise DataError(f"the log does not hold the controller's {what}", needed=needed)


def _debiased(
    log: Log, span_s: tuple[float, float] | None, slow: LoggedSignal, place: int
) -> tuple[LoggedSignal, dict[str, str]]:
    """The gyro of every loop, less the bias that the estimator had found."""
    name = f"gyro_rad[{place}]"
    gyro = _first(log, span_s, "gyro", ("sensor_combined", name))
    bias = float(np.median(np.interp(slow.time_s, gyro.time_s, gyro.values) - slow.values))
    note = f"sensor_combined.{name} less a bias of {bias:.2g} rad/s"
    return LoggedSignal(gyro.time_s, gyro.values - bias, gyro.source), {"rate": note}
