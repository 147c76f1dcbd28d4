"""Blackbox logs as a `LogSource` (native half: `crates/logs/src/blackbox/mod.rs`).

Numbers come in the units that the firmware's own viewer shows, by the header: rates in
deg/s, accelerations in g, throttle and commands as logged. They carry no declared unit; the channel
map knows them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from flightid import _native
from flightid.conventions import Light
from flightid.errors import LogFormatError
from flightid.findings import Finding, counted
from flightid.logs.blackbox.firmware import BETAFLIGHT, INAV, REVISION, firmware_of
from flightid.logs.blackbox.loop_rows import LOOP, gaps_of, with_set_points
from flightid.logs.blackbox.scales import scales_of
from flightid.logs.blackbox.settings import settings_of
from flightid.logs.log_cut import log_cut
from flightid.logs.source import ByteRange, Event
from flightid.logs.table_source import Array, MessageRows, TableSource
from flightid.reading import bounded_bytes, memory_budget, within_memory

PRODUCT = b"H Product:Blackbox flight data recorder"
EVENTS = {0: "beep", 15: "disarmed", 255: "end of log"}
DISARMED, FLIGHT_MODE = 15, 30
"""Events of Betaflight and INAV (`blackbox_fielddefs.h`)."""
MODES = {1: "ANGLE", 2: "HORIZON"}
"""Bits of Betaflight's active modes that tell what levels the vehicle (`rc_modes.h`)."""
INAV_MODES = {
    8: "RTH", 19: "WP", 9: "POSHOLD", 10: "MANUAL", 1: "ANGLE", 2: "HORIZON",
    3: "ALTHOLD",
}  # fmt: skip
"""The same of INAV, of which several are on at a time: the first counts."""
WING = ("fwAltP", "fwPosP")
"""Fields that INAV logs of fixed wings alone."""


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
    # Of a file without flights one that is not there: the refusal says how the file begins.
    taken = int(np.argmax(sizes)) if sizes else len(sizes)
    with within_memory(path.name):
        native = _native.Blackbox(data, taken, memory_budget())
    header = dict(native.headers())
    firmware = firmware_of(header.get(REVISION, ""))
    scales, untold = scales_of(header)
    tables = dict(_tables(native, scales, untold))
    if LOOP not in tables:
        raise LogFormatError(
            f"{path.name} holds no frame of the loop",
            found=f"a header and {len(data):,} bytes",
            needed="main frames behind it",
            action="take the log off the board anew: this one ends before the flight",
        )
    tables, sticks = with_set_points(tables, header)
    lost = [ByteRange(*part) for part in native.skipped()]
    return TableSource(
        INAV if firmware.is_inav else BETAFLIGHT,
        None if any(name in tables[LOOP].units for name in WING) else "copter",
        header.get(REVISION, "blackbox"),
        tables,
        settings_of(header),
        events=_events(native, INAV_MODES if firmware.is_inav else MODES),
        skipped=lost,
        gaps=gaps_of(tables[LOOP].time_s),
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


def _events(native: _native.Blackbox, modes: Mapping[int, str]) -> list[Event]:
    found = []
    for stamp_us, kind, first, second in native.events():
        time_s = None if stamp_us is None else stamp_us / 1e6
        if kind == FLIGHT_MODE:
            names = [name for bit, name in modes.items() if first >> bit & 1]
            found.append(Event(time_s, "mode", names[0] if names else "ACRO"))
        elif kind == DISARMED:
            found.append(Event(time_s, "arming", f"disarmed (reason {first})"))
        else:
            text = EVENTS.get(kind, f"event {kind}: {first}, {second}")
            found.append(Event(time_s, "event", text))
    return found


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
        yield log_cut("the log does not end as the firmware ends it (cut, or without power)")
