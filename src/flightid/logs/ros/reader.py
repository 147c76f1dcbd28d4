"""Bags of an autopilot's topics as a `LogSource`: PX4's own messages, or those of MAVROS.

PX4 publishes its own messages, so a bag holds what its log holds, field by field, and the maps of
ULog serve both. MAVROS publishes in the axes of ROS; its map turns them. A bag holds no parameters.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import FileFormatError
from flightid.findings import Finding, counted
from flightid.logs.ros.names import MAVROS_TYPES, PX4_TYPES, PublishedTopic, published
from flightid.logs.source import Event
from flightid.logs.table_source import MessageRows, TableSource
from flightid.logs.ulog.names import ARMED, MODES, VEHICLE_TYPES, changes_of
from flightid.record.formats.ros.columns import NumberTopic, bag_files, read_topics
from flightid.record.formats.sniff import MCAP, ROSBAG, SQLITE

STAMP, SAMPLED = "timestamp", "timestamp_sample"
SAME_CLOCK_US = 0.5e6
"""Median lateness of stamps, µs, beyond which the sampled ones are of another clock."""
MOST_NAMED = 6
"""Topics, and reasons to leave some out, that an error or a finding names."""
PEEKED = 1 << 20
"""Bytes at either end of a file that tell the types of its messages."""
SIGNS = (PX4_TYPES.encode(), MAVROS_TYPES.encode(), b"px4_msgs::msg", b"/mavros/")
STATUS = "vehicle_status"


def is_vehicle_bag(path: Path, head: bytes) -> bool:
    """Whether a bag names messages of an autopilot, by what stands at either end of its file.

    Parameters
    ----------
    path : Path
    head : bytes
        First bytes of a file; none of a folder.
    """
    if head and not head.startswith((MCAP, ROSBAG, SQLITE)):
        return False
    try:
        file = bag_files(path)[0]
    except FileFormatError:
        return False
    with file.open("rb") as stream:
        ends = stream.read(PEEKED)
        stream.seek(max(file.stat().st_size - PEEKED, 0))
        ends += stream.read(PEEKED)
    return any(sign in ends for sign in SIGNS)


def open_bag(path: Path) -> TableSource:
    """Read the topics of an autopilot in a bag; of several vehicles the one with most messages.

    Raises
    ------
    FileFormatError
        The bag is damaged, is more than the memory budget, or holds no such topic of numbers.
    OptionError
        What unpacks it, or knows its messages, is not installed (extra ``ros``).
    """
    topics, said = read_topics(path)
    known = [
        (what, each) for each in topics if each.keys and (what := published(each.name, each.type))
    ]
    if not known:
        raise FileFormatError(
            f"{path.name} holds no topic of an autopilot with numbers",
            found="; ".join([each.name for each in topics][:MOST_NAMED] + said[:MOST_NAMED]),
            needed="messages of px4_msgs, or topics of MAVROS",
            action=f"read its columns: flightid run {path.name} --inputs … --outputs …",
        )
    sizes: Counter[tuple[str, str]] = Counter()
    for what, each in known:
        sizes[what.kind, what.vehicle] += each.n_messages
    kind, vehicle = max(sizes, key=lambda key: (sizes[key], key))
    chosen = _chosen(pair for pair in known if (pair[0].kind, pair[0].vehicle) == (kind, vehicle))
    tables = dict(_px4_tables(chosen) if kind == "px4" else _mavros_tables(chosen))
    return TableSource(
        kind,
        _vehicle(tables),
        "PX4 (bag of ROS 2)" if kind == "px4" else "MAVROS",
        tables,
        events=list(_events(tables)),
        findings=tuple(_findings(said, sizes, vehicle)),
    )


def _chosen(
    known: Iterable[tuple[PublishedTopic, NumberTopic]],
) -> dict[str, NumberTopic]:
    """Topic by message: the autopilot's own before what was asked of it, then the longer."""
    found: dict[str, tuple[PublishedTopic, NumberTopic]] = {}
    for what, each in known:
        best = found.get(what.message)
        if best is None or (what.is_own, each.n_messages) > (best[0].is_own, best[1].n_messages):
            found[what.message] = what, each
    return {name: each for name, (_, each) in sorted(found.items())}


def _px4_tables(chosen: dict[str, NumberTopic]) -> Iterator[tuple[str, MessageRows]]:
    """Messages on PX4's own clock, from the first of all; the sampled stamps where they are too."""
    stamped = {name: each for name, each in chosen.items() if STAMP in each.values}
    starts = [float(each.values[STAMP].min()) for each in stamped.values()]
    origin_us = np.floor(min(starts, default=0.0) / 1e6) * 1e6
    for name, each in stamped.items():
        values = {key: value for key, value in each.values.items() if not key.startswith("header.")}
        for key in (STAMP, SAMPLED):
            if key in values:
                values[key] = values[key] - origin_us
        late = values[STAMP] - values.get(SAMPLED, values[STAMP])
        if abs(float(np.median(late))) > SAME_CLOCK_US:
            # Nobody set it, or it is of another clock.
            del values[SAMPLED]
        units = {key: "µs" if key in (STAMP, SAMPLED) else "1" for key in values}
        stamps = values[STAMP] / 1e6
        yield name, MessageRows(units, values.__getitem__, stamps, instances=(0,))


def _mavros_tables(chosen: dict[str, NumberTopic]) -> Iterator[tuple[str, MessageRows]]:
    for name, each in chosen.items():
        units = {key: each.unit(key) or "1" for key in each.keys}
        yield name, MessageRows(units, each.column, each.clock.time_s)


def _vehicle(tables: dict[str, MessageRows]) -> str | None:
    rows = tables.get(STATUS)
    if rows is None or "vehicle_type" not in rows.units:
        return None
    return VEHICLE_TYPES.get(int(rows.read("vehicle_type")[-1]))


def _events(tables: dict[str, MessageRows]) -> Iterator[Event]:
    rows = tables.get(STATUS)
    if rows is None:
        return
    for field, kind, names in (("nav_state", "mode", MODES), ("arming_state", "arming", ARMED)):
        if field in rows.units:
            values: NDArray[np.int64] = rows.read(field).astype(np.int64)
            yield from changes_of(values, rows.time_s, field, kind, names)


def _findings(
    said: list[str], sizes: dict[tuple[str, str], int], vehicle: str
) -> Iterator[Finding]:
    more = len(said) - MOST_NAMED
    if said:
        yield Finding(
            "topics-left-out",
            Light.AMBER,
            "; ".join([*said[:MOST_NAMED], *([f"and {more} more"] if more > 0 else [])]),
            "record with the definitions of all messages (MCAP), or leave such topics out",
        )
    if len(sizes) > 1:
        yield Finding(
            "several-vehicles",
            Light.AMBER,
            f"the bag holds {counted(len(sizes), 'vehicle')} or bridges; the one with most "
            f"messages, {vehicle or 'without a namespace'}, is read",
            "record each vehicle in a bag of its own",
        )
    yield Finding(
        "no-parameters",
        Light.UNKNOWN,
        "a bag holds no parameters: gains, filters and limits as flown are not known",
        "models and responses need none; for gains hand in the autopilot's own log",
    )
