"""Blackbox logs that somebody decoded to CSV: by ``blackbox_decode``, or by a Blackbox Explorer.

The Explorers write the header's lines above the columns; ``blackbox_decode --save-headers`` writes
them to a file of their own, ``LOG.01.headers.csv`` beside ``LOG.01.csv``.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid import _native
from flightid.conventions import Light
from flightid.errors import LogFormatError
from flightid.findings import Finding
from flightid.frozen import dataclass
from flightid.logs.blackbox.firmware import BETAFLIGHT, INAV, REVISION, firmware_of
from flightid.logs.blackbox.loop_rows import LOOP, SET_POINTS, gaps_of, with_set_points
from flightid.logs.blackbox.reader import WING
from flightid.logs.blackbox.resolution import (
    FLAG,
    Resolution,
    rates_count_as_set_points,
    resolution_of,
)
from flightid.logs.blackbox.scales import FORCES, GRAVITY, HIGH_RESOLUTION, RATES, scales_of
from flightid.logs.blackbox.settings import settings_of
from flightid.logs.source import Event
from flightid.logs.table_source import Array, MessageRows, TableSource
from flightid.reading import bounded_bytes, memory_budget, within_memory

HEADING = re.compile(rb'^[ \t]*"?loopIteration"?, ?"?time(?: \([a-z]+\))?"?,', re.MULTILINE)
"""How the columns of every decoder begin."""
UNIT = re.compile(r"(?P<name>.*?) \((?P<unit>[^)]*)\)")
LARGEST_HEADING = 1 << 20
"""Bytes in which a decoded file ends its first line, and of the file of its headers."""
HEADERS = ".headers.csv"
A_SECOND = {"us": 1e6, "ms": 1e3, "s": 1.0, "": 1e6}
"""Counts of the column of time in a second, by the unit behind its name."""
WORTH = {"deg/s": 1.0, "rad/s": float(np.degrees(1.0)), "g": 1.0, "m/s/s": 1.0 / 9.80665,
         "m/s2": 1.0 / 9.80665, "V": 1.0, "mV": 1e-3, "A": 1.0, "mA": 1e-3}  # fmt: skip
"""Of the units that decoders write behind a name, those that a field may have: deg/s, g, V, A."""
OF_INAV = ("axisRate[0]", "navState")
MODES = "flightModeFlags"
GYRO_SCALE, DEGREES = "gyro_scale", "0x3f800000"
"""The header's line, and one deg/s a count: the bits of a float."""
NOT_MODES = {"", "0", "ARM", "AIRMODE", "BEEPERON"}


@dataclass(frozen=True)
class _Heading:
    """A heading: its name, the unit behind it, and where it stands."""

    name: str
    unit: str
    place: int


def is_decoded(head: bytes) -> bool:
    """Whether text is a decoded blackbox, by its first bytes.

    Parameters
    ----------
    head : bytes
        Enough of them to hold the header's lines.

    Example
    -------
    >>> is_decoded(b"loopIteration, time (us), axisP[0]"), is_decoded(b"time,u,y")
    (True, False)
    """
    return b"\x00" not in head and HEADING.search(head) is not None


def open_decoded(path: Path) -> TableSource:
    """Read a decoded blackbox.

    Raises
    ------
    LogFormatError
        Its columns do not stand within the first MiB, or a row has other than one cell for each.
    FileFormatError
        What it holds takes more than the memory budget.
    OSError
        The file cannot be read.
    """
    lines, columns, skipped = _above(path)
    beside = path.with_name(path.name.removesuffix(".csv") + HEADERS)
    header = {**_header(_lines_of(beside)), **_header(lines)}
    read, words = _read(path, columns, skipped)
    names = {each.name for each in columns}
    firmware = firmware_of(header.get(REVISION, ""))
    is_inav = firmware.is_inav or (not firmware.name and not names.isdisjoint(OF_INAV))
    resolution = Resolution(is_fine=False) if is_inav else resolution_of(header, read)
    known = {GYRO_SCALE: DEGREES, **header, FLAG: str(int(bool(resolution.is_fine)))}
    scales, untold = scales_of(known, is_inav=is_inav)
    time_s = read["time"] / A_SECOND.get(_unit_of(columns, "time"), 1e6)
    values = {
        each.name: read[each.name] * scale
        for each in columns
        if each.name in read and (scale := _worth(each, scales, untold)) is not None
    }
    _without_ten(values, read, columns, resolution)
    order = np.flatnonzero(np.isfinite(time_s))
    units = {name: "µs" if name == "time" else "1" for name in values}
    rows = MessageRows(
        units, lambda name: values[name][order], time_s[order],
        {name: [texts[row] for row in order] for name, texts in words.items()},
    )  # fmt: skip
    tables, sticks = with_set_points({LOOP: rows}, known)
    return TableSource(
        INAV if is_inav else BETAFLIGHT,
        None if any(name in names for name in WING) else "copter",
        header.get(REVISION, "INAV, version not told" if is_inav else "blackbox, decoded"),
        tables,
        settings_of(header),
        events=_modes(rows),
        gaps=gaps_of(rows.time_s),
        findings=(
            *_findings(header, columns, values),
            *_rate_findings(header, columns, resolution, is_inav=is_inav),
            *sticks,
        ),
    )


def _above(path: Path) -> tuple[Sequence[str], list[_Heading], int]:
    """Lines above the columns, the columns, and how many lines to skip."""
    with path.open("rb") as stream:
        head = stream.read(LARGEST_HEADING)
    found = HEADING.search(head)
    end = -1 if found is None else head.find(b"\n", found.start())
    if found is None or end < 0:
        raise LogFormatError(
            f"{path.name} is no decoded blackbox",
            found="no heading row that begins with loopIteration and time",
            needed="a CSV as blackbox_decode or a Blackbox Explorer writes it",
        )
    above = head[: found.start()].decode("utf-8-sig", "replace").splitlines()
    row = head[found.start() : end].decode("utf-8", "replace").strip()
    cells = next(csv.reader([row], skipinitialspace=True))
    columns = []
    for place, cell in enumerate(cells):
        told = UNIT.fullmatch(cell.strip())
        name, unit = (told["name"], told["unit"]) if told else (cell.strip(), "")
        columns.append(_Heading(name, unit, place))
    return above, columns, head[:end].count(b"\n") + 1


def _lines_of(beside: Path) -> list[str]:
    if not beside.is_file():
        return []
    text = bounded_bytes(beside, LARGEST_HEADING, LogFormatError)
    return text.decode("utf-8-sig", "replace").splitlines()


def _header(lines: Sequence[str]) -> dict[str, str]:
    """Lines of the header: a name and its value, which may hold commas in quotes."""
    rows = csv.reader(lines, skipinitialspace=True)
    return {row[0].strip(): row[1].strip() for row in rows if len(row) >= 2 and row[0]}


def _read(
    path: Path, columns: Sequence[_Heading], skipped: int
) -> tuple[dict[str, Array], dict[str, list[str]]]:
    """Columns of numbers, and those that hold words."""
    try:
        with within_memory(path.name):
            cells = _native.read_delimited(
                str(path), skipped, len(columns), ",", False, memory_budget()
            )
    except ValueError as fault:
        raise LogFormatError(
            f"{path.name} is a decoded blackbox with broken rows",
            found=str(fault),
            needed="one cell for each heading",
            action="decode the log again",
        ) from fault
    numbers, words = dict[str, Array](), dict[str, list[str]]()
    for column, (values, codes, texts) in zip(columns, cells, strict=True):
        if values is not None:
            numbers.setdefault(column.name, values)
        elif column.name == MODES:
            words[column.name] = _texts(codes, texts)
    if "time" not in numbers or not numbers["time"].size:
        raise LogFormatError(
            f"{path.name} holds no stamps",
            found="a decoded blackbox without numbers below time",
            needed="rows of the loop",
        )
    return numbers, words


def _texts(codes: NDArray[np.uint32], texts: Sequence[str]) -> list[str]:
    return [texts[code] for code in codes]


def _unit_of(columns: Sequence[_Heading], name: str) -> str:
    return next((each.unit for each in columns if each.name == name), "")


def _worth(
    column: _Heading, scales: Mapping[str, float], untold: Mapping[str, str]
) -> float | None:
    """What one of a column is worth; None where nobody tells."""
    if column.name == "time":
        return 1.0
    if column.unit in WORTH:
        return WORTH[column.unit]
    if column.name.startswith(tuple(untold)):
        return None
    return next((s for start, s in scales.items() if column.name.startswith(start)), 1.0)


def _modes(rows: MessageRows) -> list[Event]:
    """Changes of what levels the vehicle, by the words of the decoder."""
    events, last = [], ""
    for time_s, text in zip(rows.time_s, rows.words.get(MODES, ()), strict=False):
        if text == last:
            continue
        last = text
        flags = [flag.removesuffix("_MODE") for flag in text.split("|")]
        names = [flag for flag in flags if flag not in NOT_MODES]
        events.append(Event(float(time_s), "mode", names[0] if names else "ACRO"))
    return events


def _findings(
    header: Mapping[str, str], columns: Sequence[_Heading], values: Mapping[str, Array]
) -> Iterator[Finding]:
    if not header:
        yield Finding(
            "settings-unknown",
            Light.AMBER,
            "a decoded blackbox without its header: gains, filters and battery are not known",
            "hand in the log itself (.bbl, .bfl, .TXT), or decode it with --save-headers",
        )
    if any(each.name.startswith(FORCES) for each in columns) and f"{FORCES}2]" not in values:
        yield Finding(
            "unit-unknown",
            Light.AMBER,
            f"the file tells no {GRAVITY}: accelerations are counts of unknown size, and left out",
            "decode with --unit-acceleration g, or hand in the log itself",
        )


def _without_ten(
    values: dict[str, Array],
    read: Mapping[str, Array],
    columns: Sequence[_Heading],
    resolution: Resolution,
) -> None:
    """Take the ten of a high resolution off rates that a decoder gave a unit."""
    rated = [each for each in columns if each.name.startswith(RATES) and each.unit in WORTH]
    if not resolution.is_fine or not rated:
        return
    if rates_count_as_set_points(read, WORTH[rated[0].unit]):
        for each in rated:
            values[each.name] = values[each.name] / HIGH_RESOLUTION


def _rate_findings(
    header: Mapping[str, str],
    columns: Sequence[_Heading],
    resolution: Resolution,
    *,
    is_inav: bool,
) -> Iterator[Finding]:
    """What rates are taken as, where the header does not tell it."""
    rated = [each for each in columns if each.name.startswith(RATES)]
    # Firmware that logs set-points counts in deg/s; a unit behind the name holds the scale.
    scaled = is_inav or any(each.name == SET_POINTS[0] for each in columns)
    scaled = scaled or GYRO_SCALE in header or all(each.unit in WORTH for each in rated)
    if not rated:
        return
    said = ""
    if resolution.is_fine is None:
        said = (
            f"neither header nor sticks nor throttle tell whether the log was made with {FLAG}: "
            "rates are taken as deg/s a count, ten times too large if it was"
        )
    elif not scaled:
        said = (
            f"the file tells no {GYRO_SCALE}: rates are taken as deg/s a count, some 16 times too "
            "large if the firmware is from before 2017"
        )
    if said:
        action = "hand in the log itself (.bbl, .bfl, .TXT), or decode it with --save-headers"
        yield Finding("unit-assumed", Light.AMBER, said, action)
    elif resolution.sign and (resolution.is_fine or REVISION not in header):
        times = "a tenth of a deg/s" if resolution.is_fine else "deg/s"
        yield Finding(
            "unit-of-counts",
            Light.GREEN,
            f"no header tells {FLAG}, but the counts do ({resolution.sign}): one of the rates and "
            f"set-points is {times}",
        )
