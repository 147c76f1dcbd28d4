"""Telemetry of ground stations as a `LogSource` (native half: `crates/logs/src/mavlink.rs`).

Messages that tell when they were made are stamped by that, on the autopilot's clock; the others by
when they arrived, brought onto that clock.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.conventions import Light
from flightid.errors import LogFormatError
from flightid.findings import Finding
from flightid.logs.dataflash.events import mode_text
from flightid.logs.log_cut import INSIDE, log_cut
from flightid.logs.mavlink.messages import TelemetryMessage, telemetry_messages
from flightid.logs.source import Event, changes_among
from flightid.logs.table_source import Array, MessageRows, TableSource
from flightid.logs.ulog.names import starts_of
from flightid.reading import bounded_bytes, memory_budget, within_memory

ARDUPILOT = 3
"""Of MAV_AUTOPILOT."""
AUTOPILOTS = {ARDUPILOT: "ArduPilot", 12: "PX4"}
VEHICLES = {1: "plane", 2: "copter", 3: "copter", 4: "copter", 10: "rover", 13: "copter",
            14: "copter", 15: "copter", 29: "copter"}  # fmt: skip
"""MAV_TYPE of vehicles whose channels are known."""
ARMED, NO_AUTOPILOT = 0x80, 8
"""MAV_MODE_FLAG_SAFETY_ARMED; MAV_AUTOPILOT of ground stations and cameras (common.xml)."""
STAMPS = {"time_boot_ms": 1e3, "time_usec": 1e6}
"""Stamps of messages that tell when they were made, and their counts a second."""
LATEST_BOOT_S = 1e8
"""Stamps beyond it, s, count from 1970, not from the start of the autopilot."""
RESTART_S = 5.0
"""Fall of the autopilot's clock that no order of arrival explains: it started anew."""
STAMP, CHECKSUM, SIGNED = 8, 2, 1
"""Bytes of the ground station's stamp and of a frame's checksum; flag of a frame with signature."""
HEADS = {0xFE: (6, 0), 0xFD: (10, 13)}
"""Bytes of a frame's head and of its signature, by its first byte (MAVLink 1 and 2)."""
SEVERITIES = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
Table = NDArray[np.void]


def open_telemetry(path: Path) -> TableSource:
    """Read a telemetry log: of the first autopilot that is heard in it, its longest run.

    Raises
    ------
    LogFormatError
        No autopilot is heard in it, or the file is larger than the memory budget.
    FileFormatError
        Its frames take more than that.
    OSError
        The file cannot be read.
    """
    known = telemetry_messages()
    data = bounded_bytes(path, memory_budget(), LogFormatError)
    asked = {number: (m.layout.itemsize, m.seed) for number, m in known.items()}
    with within_memory(path.name):
        frames, lost = _native.telemetry_frames(data, asked, memory_budget())
    sender = _autopilot(frames, known[0])
    heard: dict[str, tuple[Array, Table]] = {}
    for (number, system, component), arrived_s, payloads in frames:
        if (system, component) == sender:
            message = known[number]
            heard[message.name] = (arrived_s, np.frombuffer(payloads, message.layout))
    starts = _starts(heard)
    heard = _longest_run(heard, starts)
    ahead_s = _clock(heard)
    by_name = {message.name: message for message in known.values()}
    tables = {
        name: _rows(by_name[name], rows, _stamps(arrived, rows, ahead_s))
        for name, (arrived, rows) in heard.items()
    }
    first = heard["HEARTBEAT"][1][0]
    vehicle, autopilot = VEHICLES.get(int(first["type"])), int(first["autopilot"])
    # Only ArduPilot's numbers count flight modes from zero; PX4 packs two numbers into one.
    events = _events(tables, vehicle if autopilot == ARDUPILOT else None)
    values = _parameter_values(tables)
    return TableSource(
        "mavlink",
        vehicle,
        f"{AUTOPILOTS.get(autopilot, 'autopilot')}, by telemetry",
        tables,
        {name: value for _, name, value in values},
        changes_among(values),
        sorted(events, key=attrgetter("time_s")),
        findings=tuple(_findings(data, lost, len(starts))),
    )


def _autopilot(frames: list[Any], beat: TelemetryMessage) -> tuple[int, int]:
    for (number, system, component), _, payloads in frames:
        if number == beat.id:
            kinds = np.frombuffer(payloads, beat.layout)["autopilot"]
            if kinds[0] != NO_AUTOPILOT:
                return system, component
    raise LogFormatError(
        "no autopilot is heard in the telemetry",
        found="no heartbeat of one",
        needed="a .tlog that a ground station recorded",
        action="hand in the log of the autopilot itself",
    )


def _starts(heard: dict[str, tuple[Array, Table]]) -> list[float]:
    """Arrivals with which the autopilot's clock begins: the log's, and one of each restart."""
    boots = [
        (arrived, rows["time_boot_ms"] / STAMPS["time_boot_ms"])
        for arrived, rows in heard.values()
        if "time_boot_ms" in (rows.dtype.names or ())
    ]
    if not boots:
        return [-np.inf]
    arrived_s, made_s = (np.concatenate(each) for each in zip(*boots, strict=True))
    order = np.argsort(arrived_s, kind="stable")
    fallen = np.flatnonzero(np.diff(made_s[order]) < -RESTART_S) + 1
    return [-np.inf, *arrived_s[order][fallen].tolist()]


def _longest_run(
    heard: dict[str, tuple[Array, Table]], starts: list[float]
) -> dict[str, tuple[Array, Table]]:
    """What arrived in the run with most heartbeats; parameters stay from one run to the next."""
    ends = [*starts[1:], np.inf]
    beats = np.searchsorted(starts, heard["HEARTBEAT"][0], side="right") - 1
    run = int(np.argmax(np.bincount(beats)))
    kept = {}
    for name, (arrived_s, rows) in heard.items():
        inside = arrived_s < ends[run]
        if name != "PARAM_VALUE":
            inside &= arrived_s >= starts[run]
        if np.any(inside):
            kept[name] = (np.maximum(arrived_s[inside], starts[run]), rows[inside])
    return kept


def _clock(heard: dict[str, tuple[Array, Table]]) -> float:
    """How far the ground station's clock is ahead of the autopilot's, s: by the fastest arrival."""
    gaps = [
        float(np.min(arrived - made))
        for arrived, rows in heard.values()
        if (made := _made_s(rows)) is not None
    ]
    return min(gaps, default=0.0)


def _made_s(rows: Table) -> Array | None:
    for name, per_second in STAMPS.items():
        if rows.dtype.names is not None and name in rows.dtype.names:
            made = rows[name].astype(np.float64) / per_second
            return made if 0.0 < float(made.max()) < LATEST_BOOT_S else None
    return None


def _stamps(arrived_s: Array, rows: Table, ahead_s: float) -> Array:
    """When rows were made, or arrived, on the autopilot's clock; counters of 32 bits turn over."""
    made, here = _made_s(rows), arrived_s - ahead_s
    if made is None:
        return here
    name = next(each for each in STAMPS if each in (rows.dtype.names or ()))
    turn_s = 2.0 ** (8 * rows.dtype[name].itemsize) / STAMPS[name]
    return np.asarray(made + turn_s * np.round((here - made) / turn_s))


def _rows(message: TelemetryMessage, rows: Table, time_s: Array) -> MessageRows:
    units: dict[str, str] = {}
    for name, unit in message.units.items():
        width = message.layout[name].shape
        names = [f"{name}[{i}]" for i in range(*width)] if width else [name]
        units.update(dict.fromkeys(names, unit))
    words = {
        name: [bytes(word).partition(b"\0")[0].decode("utf-8", "replace") for word in rows[name]]
        for name in message.units
        if message.layout[name].kind == "S"
    }
    return MessageRows(units, partial(_column, rows), time_s, words)


def _column(rows: Table, name: str) -> Array:
    base, _, index = name.partition("[")
    values = rows[base][:, int(index.removesuffix("]"))] if index else rows[base]
    return np.asarray(values, np.float64)


def _parameter_values(tables: Mapping[str, MessageRows]) -> list[tuple[float | None, str, float]]:
    if "PARAM_VALUE" not in tables:
        return []
    sent = tables["PARAM_VALUE"]
    values = sent.read("param_value").tolist()
    return list(zip(sent.time_s.tolist(), sent.words["param_id"], values, strict=True))


def _events(tables: Mapping[str, MessageRows], vehicle: str | None) -> Iterator[Event]:
    beats = tables["HEARTBEAT"]
    armed = (beats.read("base_mode").astype(np.int64) & ARMED) != 0
    for at in starts_of(armed):
        yield Event(float(beats.time_s[at]), "arming", "armed" if armed[at] else "disarmed")
    modes = beats.read("custom_mode").astype(np.int64)
    for at in starts_of(modes):
        yield Event(float(beats.time_s[at]), "mode", mode_text(vehicle, int(modes[at]), None))
    if "STATUSTEXT" in tables:
        said = tables["STATUSTEXT"]
        levels = said.read("severity").astype(np.int64)
        for time_s, level, text in zip(said.time_s, levels, said.words["text"], strict=True):
            name = SEVERITIES[min(int(level), len(SEVERITIES) - 1)]
            yield Event(float(time_s), "text", f"{name}: {text}")


def _findings(data: bytes, lost: int, runs: int) -> Iterator[Finding]:
    yield Finding(
        "telemetry",
        Light.AMBER,
        "this is telemetry: a few samples a second, sent over a radio, without the commands to the "
        "motors",
        "hand in the log that the autopilot wrote to its own card",
    )
    if runs > 1:
        yield Finding(
            "autopilot-restarted",
            Light.AMBER,
            f"the autopilot starts anew in this log, {runs} runs in all: the longest is read",
            "save each run to its own file to read the others",
        )
    if lost and _ends_inside(data, lost):
        yield log_cut(f"{INSIDE} a frame")
    elif lost:
        yield Finding(
            "bytes-skipped",
            Light.AMBER,
            f"{lost} of {len(data)} bytes are in no frame whose checksum holds",
            "look for gaps in the span you use",
        )


def _ends_inside(data: bytes, lost: int) -> bool:
    """Whether all bytes in no frame are of one that the file's end cuts.

    Frames are walked by their lengths: inside of one that is cut others may seem to begin.
    """
    at, end = 0, len(data)
    while at < end:
        rest = data[at + STAMP : at + STAMP + 3]
        size = _frame_size(rest)
        if len(rest) > 2 and not size:
            return False
        if not size or at + STAMP + size > end:
            return lost <= end - at
        at += STAMP + size
    return False


def _frame_size(begun: bytes) -> int:
    """Bytes of a frame by its first three; 0 where they are none of one, or too few to tell."""
    if len(begun) < 3 or begun[0] not in HEADS:
        return 0
    head, signature = HEADS[begun[0]]
    return head + begun[1] + CHECKSUM + (signature if begun[2] & SIGNED else 0)
