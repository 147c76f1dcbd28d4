"""A bag as columns: fields of topics, each topic on its own stamps."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FileFormatError, FlightidError, OptionError
from flightid.reading import bounded_bytes, decoding
from flightid.record.formats.columns import ColumnStamps, ColumnTable
from flightid.record.formats.ros import bag1, mcap, storage
from flightid.record.formats.ros.content import BagContent, Topic
from flightid.record.formats.ros.definitions import parsed, shipped
from flightid.record.formats.ros.layouts import FieldLayout, layout_of
from flightid.record.formats.ros.payloads import decoded, leading_columns
from flightid.record.formats.sniff import BAG_SUFFIXES, MCAP, ROSBAG, SQLITE

CONTAINERS: dict[bytes, tuple[Callable[[Path, BagContent], None], str]] = {
    MCAP: (mcap.gather, "copy it again; `mcap recover {0}` keeps what is whole"),
    ROSBAG: (bag1.gather, "copy it again, or `rosbag reindex {0}`"),
    SQLITE: (
        storage.gather,
        "copy it again; `sqlite3 {0} .recover | sqlite3 whole.db3` keeps what is whole",
    ),
}
"""Reader, and what to do with a damaged file, by its first bytes."""
UNITS = {
    "sensor_msgs/Imu.angular_velocity": "rad/s",
    "sensor_msgs/Imu.linear_acceleration": "m/s^2",
    "sensor_msgs/MagneticField.magnetic_field": "T",
    "sensor_msgs/FluidPressure.fluid_pressure": "Pa",
    "sensor_msgs/BatteryState.voltage": "V",
    "sensor_msgs/BatteryState.current": "A",
    "geometry_msgs/Twist.linear": "m/s",
    "geometry_msgs/Twist.angular": "rad/s",
    "geometry_msgs/Accel.linear": "m/s^2",
    "geometry_msgs/Accel.angular": "rad/s^2",
    "geometry_msgs/Wrench.force": "N",
    "geometry_msgs/Wrench.torque": "N*m",
    "geometry_msgs/Pose.position": "m",
    "geometry_msgs/Transform.translation": "m",
}
"""Units that the definitions of standard messages state (REP 103)."""
METADATA = "metadata.yaml"
ENCODINGS = ("cdr", "ros1")
NS = 1_000_000_000
SAME_CLOCK_S = 0.5
"""Distance of the stamps of a header from those of the recorder within which they are one clock."""


def bag_files(path: Path) -> list[Path]:
    """Files of a bag, in the order of their names and numbers.

    Raises
    ------
    FileFormatError
        A folder without any, or whose files are packed as a whole.
    """
    if not path.is_dir():
        return [path]
    files = sorted(
        (each for each in path.iterdir() if each.suffix in BAG_SUFFIXES and each.is_file()),
        key=lambda each: (len(each.name), each.name),
    )
    about = path / METADATA
    packed = about.is_file() and b"compression_mode: MESSAGE" in bounded_bytes(about, 1 << 24)
    if files and not packed:
        return files
    raise FileFormatError(
        f"{path.name} is a folder and no bag that is read",
        found="messages packed one by one" if packed else f"{len(list(path.iterdir()))} files",
        needed=".mcap or .db3 files",
        action="ros2 bag convert rewrites a bag unpacked; zstd -d unpacks .db3.zstd",
    )


def read_columns(path: Path) -> ColumnTable:
    """Numeric fields of a bag's topics as columns such as ``/imu/angular_velocity.x``.

    Stamps are those of the headers where messages have them and they rise, else those of the
    recorder; zero is the first message. A header's clock that is not the recorder's is moved onto
    it by the least difference.

    Parameters
    ----------
    path : Path
        File, or folder of a ROS 2 bag.

    Raises
    ------
    FileFormatError
        The bag is damaged, holds no numbers, or is more than the memory budget.
    OptionError
        What unpacks it, or knows its messages, is not installed (extra ``ros``).
    """
    return _table(path, _gathered(path))


def read_topics(path: Path) -> tuple[list[NumberTopic], list[str]]:
    """Topics of a bag whose messages are numbers, and what is said of the others.

    Parameters
    ----------
    path : Path
        File, or folder of a ROS 2 bag.

    Raises
    ------
    FileFormatError
        The bag is damaged, or is more than the memory budget.
    OptionError
        What unpacks it, or knows its messages, is not installed (extra ``ros``).
    """
    content = _gathered(path)
    topics, left_out, missing = _topics(content)
    if missing is not None and not topics:
        raise missing
    return topics, _said(content, left_out)


def _gathered(path: Path) -> BagContent:
    content = BagContent(path.name)
    for file in bag_files(path):
        with file.open("rb") as stream:
            head = stream.read(16)
        known = next((each for sign, each in CONTAINERS.items() if head.startswith(sign)), None)
        if known is None:
            raise FileFormatError(f"{file.name} is no bag", found=head[:8].hex(" ") or "nothing")
        gather, recovery = known
        with decoding(file.name, "a whole bag", recovery.format(file.name)):
            gather(file, content)
    return content


def _topics(
    content: BagContent,
) -> tuple[list[NumberTopic], dict[str, str], OptionError | None]:
    """Topics of numbers, why others are left out, and what is not installed for some."""
    topics: dict[str, Topic] = {}
    for topic in content.topics.values():
        known = topics.setdefault(topic.name, topic)
        if known is not topic:
            known.received_ns += topic.received_ns
            known.payloads += topic.payloads
            known.is_long = known.is_long or topic.is_long
    stamps = [topic.received_ns[0] for topic in topics.values() if topic.received_ns]
    made: list[NumberTopic] = []
    left_out: dict[str, str] = {}
    missing: OptionError | None = None
    for topic in topics.values():
        try:
            made.append(NumberTopic(content, topic, _layout(topic), min(stamps, default=0)))
        except FlightidError as fault:
            missing = fault if isinstance(fault, OptionError) else missing
            left_out[topic.name] = f"{fault.problem}, {fault.found}"
    return made, left_out, missing


def _said(content: BagContent, left_out: dict[str, str]) -> list[str]:
    said = [f"{name} left out: {why}" for name, why in left_out.items()]
    return [*said, f"{content.cut} ends within a message: it was cut"] if content.cut else said


def _table(path: Path, content: BagContent) -> ColumnTable:
    topics, left_out, missing = _topics(content)
    of_column = {
        f"{each.name.rstrip('/')}/{key}": (each, key) for each in topics for key in each.keys
    }
    said = _said(content, left_out)
    if missing is not None and not of_column:
        raise missing
    if not of_column:
        raise FileFormatError(
            f"{path.name} holds no topic of numbers",
            found="; ".join(said) or "no message",
            needed="messages of numbers with their definitions",
            action="record it as MCAP, or with ROS 2 Iron or later: such bags hold all definitions",
        )
    return ColumnTable(
        path,
        {name: topic.n_messages for name, (topic, _) in of_column.items()},
        lambda name: of_column[name][0].column(of_column[name][1]),
        {name: unit for name, (topic, key) in of_column.items() if (unit := topic.unit(key))},
        "; ".join(said),
        lambda name: of_column[name][0].clock,
    )


def _layout(topic: Topic) -> FieldLayout:
    """FieldLayout of a topic's messages.

    Raises
    ------
    FlightidError
        They are no numbers that can be read.
    """
    if topic.is_long:
        raise FileFormatError("its messages are too long for samples", found=topic.type)
    if topic.encoding not in ENCODINGS:
        raise FileFormatError("its encoding is not read", found=topic.encoding or "none")
    if not topic.payloads:
        raise FileFormatError("it has no message", found=topic.type)
    known = parsed(topic.type, topic.definition) if topic.definition else shipped(topic.type)
    if known is None:
        raise FileFormatError("the bag does not define its messages", found=topic.type)
    return layout_of(topic.type, known)


class NumberTopic:
    """A topic whose numbers are columns, decoded when one is asked for.

    Attributes
    ----------
    name, type : str
        Such as "/imu" and "sensor_msgs/Imu".
    n_messages : int
    keys : list of str
        Fields that are columns: all but stamps and what else a header holds.
    """

    def __init__(
        self, content: BagContent, topic: Topic, layout: FieldLayout, origin_ns: int
    ) -> None:
        self.content, self.topic, self.layout, self.origin_ns = content, topic, layout, origin_ns
        self.name, self.type, self.n_messages = topic.name, topic.type, len(topic.payloads)
        self.keys = [
            key
            for key in leading_columns(topic, layout, content.name)
            if key in layout.origins or key.rpartition("[")[0] in layout.origins
            if not key.startswith("header.") and key not in layout.stamp
        ]

    def unit(self, key: str) -> str | None:
        """Unit of a field by the message that it belongs to."""
        origins = self.layout.origins
        return UNITS.get(origins.get(key) or origins[key.rpartition("[")[0]])

    @cached_property
    def values(self) -> dict[str, NDArray[np.float64]]:
        """Numbers by field."""
        names, values = decoded(self.topic, self.layout, self.content)
        self.topic.payloads.clear()
        return {name: values[:, index] for index, name in enumerate(names) if name}

    def column(self, key: str) -> NDArray[np.float64]:
        """Numbers of a field, shape (n_messages,)."""
        return self.values[key]

    @cached_property
    def clock(self) -> ColumnStamps:
        """Stamps of the messages, and which they are."""
        whole, rest = divmod(self.origin_ns, NS)
        since_ns = np.array(self.topic.received_ns, dtype=np.int64) - self.origin_ns
        received = since_ns / NS
        name = self.topic.name
        if not self.layout.stamp:
            return ColumnStamps(received, f"{name}: stamps of the recorder, there is no header")
        if len(self.layout.stamp) == 1:
            own = self.values[self.layout.stamp[0]] * 1e-6
        else:
            seconds, ns = (self.values[key] for key in self.layout.stamp)
            own = (seconds - whole) + (ns - rest) / NS
        if not np.all(np.diff(own) > 0):
            return ColumnStamps(
                received, f"{name}: stamps of the recorder, those of the headers stand"
            )
        late = received - own
        if abs(float(np.median(late))) <= SAME_CLOCK_S:
            return ColumnStamps(own, f"{name}: stamps of the headers")
        shift = float(np.min(late))
        return ColumnStamps(own + shift, f"{name}: stamps of the headers, moved by {shift:.6g} s")
