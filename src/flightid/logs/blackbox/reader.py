"""Blackbox logs as a `LogSource` (native half: `crates/logs/src/blackbox/mod.rs`).

Numbers come in the units that the firmware's own viewer shows, by the header: rates in
deg/s, accelerations in g, throttle and commands as logged. They carry no declared unit; the channel
map knows them.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from flightid import _native
from flightid.conventions import Light
from flightid.errors import LogFormatError
from flightid.findings import Finding, counted
from flightid.logs.blackbox.settings import settings_of
from flightid.logs.blackbox.stick_rates import stick_rates
from flightid.logs.source import ByteRange, Event, Gap
from flightid.logs.table_source import Array, MessageRows, TableSource
from flightid.reading import bounded_bytes, memory_budget, within_memory

PRODUCT = b"H Product:Blackbox flight data recorder"
GAP_FRAMES = 20.0
"""Median steps without a frame that count as a gap."""
LOOP = "main"
EVENTS = {0: "beep", 15: "disarmed", 255: "end of log"}
DISARMED, FLIGHT_MODE = 15, 30
MODES = {1: "ANGLE", 2: "HORIZON"}
"""Bits of Betaflight's active modes that tell what levels the vehicle (`rc_modes.h`)."""
GRAVITY = "acc_1G"
HIGH_RESOLUTION = 10.0
RATES = ("gyroADC[", "gyroUnfilt[", "gyroRaw[")
WING = ("fwAltP", "fwPosP")
"""Fields that INAV logs of fixed wings alone."""
FINE = (*RATES, "setpoint[", "rcCommand[")
"""Fields that ``blackbox_high_resolution`` stores ten times as fine."""
STICKS = ("rcCommand", "gyroADC", "axisP")
SET_POINTS = ("setpoint[0]", "setpoint[1]", "setpoint[2]")
FORCES, VOLTAGE, CURRENT = "accSmooth[", "vbatLatest", "amperageLatest"
BATTERY = {(4, 0): (0.01, 0.01), (3, 2): (0.1, 0.01), (3, 1): (0.1, None)}
"""V and A of one count since a version of Betaflight, the newest first; before: raw readings."""

_VERSION = re.compile(r"Betaflight\s+(?P<major>\d+)\.(?P<minor>\d+)", re.IGNORECASE)


def open_blackbox(path: Path) -> TableSource:
    """Read a blackbox log; of a file with several flights, the longest.

    Raises
    ------
    LogFormatError
        The header does not say what frames hold, or the file is larger than the memory budget.
    FileFormatError
        Its frames take more than that.
    OSError
        The file cannot be read.
    """
    data = bounded_bytes(path, memory_budget(), LogFormatError)
    data = data[max(data.find(PRODUCT), 0) :]
    flights = _native.blackbox_flights(data)
    sizes = [stop - start for start, stop in flights]
    taken = int(np.argmax(sizes)) if sizes else 0
    with within_memory(path.name):
        native = _native.Blackbox(data, taken, memory_budget())
    header = dict(native.headers())
    scales, untold = _scales(header)
    tables = dict(_tables(native, scales, untold))
    tables, sticks = _with_set_points(tables, header)
    lost = [ByteRange(*part) for part in native.skipped()]
    return TableSource(
        "betaflight",
        None if any(name in tables[LOOP].units for name in WING) else "copter",
        header.get("Firmware revision", "blackbox"),
        tables,
        settings_of(header),
        events=_events(native),
        skipped=lost,
        gaps=_gaps(tables[LOOP].time_s) if LOOP in tables else (),
        findings=(
            *_left_out(native, untold),
            *sticks,
            *_findings(native, lost, len(data), taken, len(flights)),
        ),
    )


def _tables(
    native: _native.Blackbox, scales: Mapping[str, float], untold: Mapping[str, str]
) -> Iterator[tuple[str, MessageRows]]:
    for name, columns, count in native.tables():
        if not count:
            continue
        places = {column: place for place, column in reversed(list(enumerate(columns)))}
        read = partial(_scaled, native, name, places, scales)
        units = {
            column: "µs" if column == "time" else "1"
            for column in columns
            if not column.startswith(tuple(untold))
        }
        yield name, MessageRows(units, read, native.stamps_us(name) / 1e6)


def _with_set_points(
    tables: dict[str, MessageRows], header: Mapping[str, str]
) -> tuple[dict[str, MessageRows], list[Finding]]:
    """Rate set-points made of the sticks, of a Betaflight that logged none."""
    rows = tables.get(LOOP)
    needed = [f"{name}[{axis}]" for name in STICKS for axis in range(3)]
    is_betaflight = _VERSION.search(header.get("Firmware revision", ""))
    if rows is None or not is_betaflight or {*SET_POINTS} & {*rows.units}:
        return tables, []
    if not {*needed} <= {*rows.units}:
        return tables, []
    commands, rates, p_terms = (
        np.array([rows.read(f"{name}[{axis}]") for axis in range(3)]) for name in STICKS
    )
    found = stick_rates(commands, rates, p_terms, settings_of(header))
    if found is None or not found.is_borne_out:
        why = "its header tells no rates" if found is None else (
            f"rates by {found.curve}'s curve explain {100.0 * max(found.explained, 0.0):.0f} % of "
            "its P terms: the vehicle levelled itself, or rates were changed in flight"
        )  # fmt: skip
        lacking = Finding(
            "no-set-points",
            Light.AMBER,
            f"the log holds no rate set-points, and none can be made of rcCommand: {why}",
            "fly in acro with one rate profile, or update to Betaflight 4, which logs set-points",
        )
        return tables, [lacking]
    made = dict(zip(SET_POINTS, found.set_points, strict=True))

    def read(column: str) -> Array:
        return made[column] if column in made else rows.read(column)

    said = (
        f"rate set-points are not logged: they are made of rcCommand by {found.curve}'s rates of "
        f"the header, which explain {100.0 * found.explained:.1f} % of the controller's P terms"
    )
    units = {**rows.units, **dict.fromkeys(made, "1")}
    whole = {**tables, LOOP: replace(rows, units=units, read=read)}
    return whole, [Finding("set-points-of-sticks", Light.GREEN, said)]


def _scaled(
    native: _native.Blackbox,
    table: str,
    places: Mapping[str, int],
    scales: Mapping[str, float],
    column: str,
) -> Array:
    values = native.numbers(table, places[column])
    scale = next((factor for start, factor in scales.items() if column.startswith(start)), 1.0)
    return values if scale == 1.0 else values * scale


def _scales(header: Mapping[str, str]) -> tuple[dict[str, float], dict[str, str]]:
    """Factor by the beginning of a field's name; of fields without one, what the header lacks."""
    fine = 1.0 / HIGH_RESOLUTION if header.get("blackbox_high_resolution") == "1" else 1.0
    gyro, gravity = _gyro_scale(header), settings_of(header).get(GRAVITY, 0.0)
    volts, amperes = _battery_scales(header.get("Firmware revision", ""))
    told = {
        **dict.fromkeys(RATES, ("gyro_scale", gyro and gyro * fine)),
        FORCES: (GRAVITY, 1.0 / gravity if gravity > 0.0 else None),
        VOLTAGE: ("version of Betaflight that logs volts", volts),
        CURRENT: ("version of Betaflight that logs amperes", amperes),
    }
    scales = dict.fromkeys(FINE, fine)
    scales |= {name: scale for name, (_, scale) in told.items() if scale is not None}
    return scales, {name: lacks for name, (lacks, scale) in told.items() if scale is None}


def _battery_scales(revision: str) -> tuple[float | None, float | None]:
    age = _VERSION.search(revision)
    if age is None:
        return None, None
    version = (int(age["major"]), int(age["minor"]))
    return next((each for since, each in BATTERY.items() if version >= since), (None, None))


def _gyro_scale(header: Mapping[str, str]) -> float | None:
    """Degrees per second of one count: the bits of a float, in hexadecimal."""
    text = header.get("gyro_scale", header.get("gyro.scale", ""))
    try:
        scale = struct.unpack(">f", bytes.fromhex(text.removeprefix("0x").rjust(8, "0")))[0]
    except (ValueError, struct.error):
        return None
    if not (np.isfinite(scale) and scale > 0.0):
        return None
    # Baseflight counts in rad/µs.
    return float(np.degrees(scale * 1e6)) if scale < 1e-6 else float(scale)


def _left_out(native: _native.Blackbox, untold: Mapping[str, str]) -> Iterator[Finding]:
    columns = {column for _, names, _ in native.tables() for column in names}
    for lacks in dict.fromkeys(untold.values()):
        starts = tuple(start for start, why in untold.items() if why == lacks)
        fields = sorted(column for column in columns if column.startswith(starts))
        if fields:
            yield Finding(
                "unit-unknown",
                Light.AMBER,
                f"the header tells no {lacks}: {', '.join(fields)} are counts of unknown size, and "
                "left out",
                "update the firmware, or decode the file with its own viewer and hand in a CSV",
            )


def _events(native: _native.Blackbox) -> list[Event]:
    found = []
    for stamp_us, kind, first, second in native.events():
        time_s = None if stamp_us is None else stamp_us / 1e6
        if kind == FLIGHT_MODE:
            names = [name for bit, name in MODES.items() if first >> bit & 1]
            found.append(Event(time_s, "mode", names[0] if names else "ACRO"))
        elif kind == DISARMED:
            found.append(Event(time_s, "arming", f"disarmed (reason {first})"))
        else:
            text = EVENTS.get(kind, f"event {kind}: {first}, {second}")
            found.append(Event(time_s, "event", text))
    return found


def _gaps(time_s: Array) -> list[Gap]:
    steps = np.diff(time_s)
    if not steps.size:
        return []
    places = np.flatnonzero(steps > GAP_FRAMES * np.median(steps))
    why = "the logger lost frames"
    return [Gap(float(time_s[i]), float(time_s[i + 1]), why) for i in places]


def _findings(
    native: _native.Blackbox, lost: list[ByteRange], size: int, taken: int, flights: int
) -> Iterator[Finding]:
    ended, undecodable = native.ending()
    damaged = sum(part.size for part in lost)
    if damaged or undecodable:
        yield Finding(
            "bytes-skipped",
            Light.AMBER,
            f"{damaged} of {size} bytes in {counted(len(lost), 'place')} are no frame, and "
            f"{counted(undecodable, 'frame')} had lost the one before: the logger did not keep up",
            "log at a lower rate, or to a faster card; look for gaps in the span you use",
        )
    if flights > 1:
        yield Finding(
            "several-flights",
            Light.AMBER,
            f"the file holds {flights} flights; the longest, number {taken + 1}, is read",
            "save each flight to its own file to read the others",
        )
    if not ended:
        yield Finding(
            "log-cut",
            Light.AMBER,
            "the log does not end as the firmware ends it: it was cut, or the power was",
            "what came before is read",
        )
