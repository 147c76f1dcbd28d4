"""Bags of ROS written by hand: an IMU with header and covariance, and a command without."""

from __future__ import annotations

import bz2
import sqlite3
import struct
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np

NS = 1_000_000_000
START_NS = 1_700_000_000 * NS + 250_000_000
IMU = """std_msgs/Header header  # stamp and frame
string<=20 label
float64[<=3] some
geometry_msgs/Vector3 rate
float32[2] spread
uint8 KIND=3
bool ok
{separator}
MSG: std_msgs/Header
{sequence}builtin_interfaces/Time stamp
string frame_id
{separator}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{separator}
MSG: builtin_interfaces/Time
{seconds} sec
uint32 nanosec
"""
COMMAND = "float64 data\n"


@dataclass(frozen=True)
class Flight:
    """Messages of two topics: a rate at 100 Hz and a command at 50 Hz."""

    n_rates: int = 400
    late_ns: int = 1_000_000

    @property
    def rates(self) -> np.ndarray:
        return np.sin(0.3 * np.arange(self.n_rates)) + 0.01 * np.arange(self.n_rates)

    @property
    def commands(self) -> np.ndarray:
        return np.repeat([1.0, -1.0], 10)[np.arange(self.n_rates // 2) % 20]

    def messages(self, *, cdr: bool) -> list[tuple[int, str, bytes]]:
        """Stamp of the recorder, topic and payload, in the order of the stamps."""
        made = [
            (START_NS + k * NS // 50, "/cmd", _packed([("d", value)], cdr=cdr))
            for k, value in enumerate(self.commands)
        ]
        for k, rate in enumerate(self.rates):
            stamp = START_NS + k * NS // 100
            head: list[tuple[str, object]] = [] if cdr else [("I", k)]
            head += [("i", stamp // NS), ("I", stamp % NS), ("s", "body" + "x" * (k % 3))]
            parts = [*head, ("s", "imu"), ("I", 2), ("d", 7.0), ("d", 8.0)]
            parts += [("d", rate), ("d", 0.5), ("d", -rate), ("f", 0.25), ("f", 4.0), ("?", True)]
            made.append((stamp + self.late_ns, "/imu", _packed(parts, cdr=cdr)))
        return sorted(made, key=lambda each: each[0])


def _packed(parts: list[tuple[str, object]], *, cdr: bool) -> bytes:
    """Values one after the other; in CDR each aligned to its size, texts with a NUL."""
    body = b""

    def put(letter: str, value: object) -> None:
        nonlocal body
        width = struct.calcsize(letter)
        body += bytes(-len(body) % width) if cdr else b""
        body += struct.pack("<" + letter, value)

    for letter, value in parts:
        if letter == "s":
            text = str(value).encode() + (b"\0" if cdr else b"")
            put("I", len(text))
            body += text
        else:
            put(letter, value)
    return (b"\x00\x01\x00\x00" if cdr else b"") + body


def definition(topic: str, *, ros1: bool) -> tuple[str, str]:
    """Type of a topic and the text that defines it."""
    if topic == "/cmd":
        return "std_msgs/Float64", COMMAND
    words = {"sequence": "uint32 seq\n" if ros1 else "", "seconds": "uint32" if ros1 else "int32"}
    return "sensor_msgs/Imu", IMU.format(separator="=" * 80, **words)


def write_mcap(path: Path, flight: Flight = Flight(), *, chunked: bool = True) -> Path:
    """A bag of ROS 2 in MCAP, not packed."""
    records = b""
    for number, topic in enumerate(("/imu", "/cmd"), 1):
        kind, text = definition(topic, ros1=False)
        name = kind.replace("/", "/msg/")
        records += record_of(3, struct.pack("<H", number) + texts_of(name, "ros2msg", text))
        records += record_of(4, struct.pack("<HH", number, number) + texts_of(topic, "cdr", ""))
    for stamp, topic, payload in flight.messages(cdr=True):
        number = 1 if topic == "/imu" else 2
        records += record_of(5, struct.pack("<HIQQ", number, 0, stamp, stamp) + payload)
    if chunked:
        head = struct.pack("<QQQI", 0, 0, len(records), crc32(records)) + texts_of("")
        records = record_of(6, head + struct.pack("<Q", len(records)) + records)
    return mcap_of(path, records)


def mcap_of(path: Path, records: bytes) -> Path:
    """A file of MCAP with these records."""
    head = b"\x89MCAP0\r\n" + record_of(1, texts_of("ros2", ""))
    path.write_bytes(head + records + record_of(15, bytes(4)))
    return path


def topic_of(text: str, kind: str = "a/msg/B") -> bytes:
    """Records of MCAP that declare a topic, /a, of a type with this definition."""
    schema = record_of(3, struct.pack("<H", 1) + texts_of(kind, "ros2msg", text))
    return schema + record_of(4, struct.pack("<HH", 1, 1) + texts_of("/a", "cdr", ""))


def message_of(stamp: int, payload: bytes) -> bytes:
    """A message of it."""
    return record_of(5, struct.pack("<HIQQ", 1, 0, stamp, stamp) + payload)


def record_of(kind: int, body: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(body)) + body


def texts_of(*texts: str) -> bytes:
    return b"".join(struct.pack("<I", len(each.encode())) + each.encode() for each in texts)


def write_bag1(path: Path, flight: Flight = Flight(), *, packing: str = "none") -> Path:
    """A bag of ROS 1, its chunk packed by bz2 or not."""
    inner = b""
    for number, topic in enumerate(("/imu", "/cmd")):
        kind, text = definition(topic, ros1=True)
        said = fields_of(topic=topic.encode(), type=kind.encode(), message_definition=text.encode())
        head = fields_of(op=b"\x07", conn=struct.pack("<I", number), topic=topic.encode())
        inner += block_of(head) + block_of(said)
    for stamp, topic, payload in flight.messages(cdr=False):
        number = struct.pack("<I", 0 if topic == "/imu" else 1)
        time = struct.pack("<II", stamp // NS, stamp % NS)
        inner += block_of(fields_of(op=b"\x02", conn=number, time=time)) + block_of(payload)
    return bag1_of(path, inner, packing=packing)


def bag1_of(path: Path, *chunks: bytes, packing: str = "bz2") -> Path:
    """A file of ROS 1 with these chunks."""
    content = block_of(fields_of(op=b"\x03")) + block_of(b"")
    for inner in chunks:
        size = struct.pack("<I", len(inner))
        head = fields_of(op=b"\x05", compression=packing.encode(), size=size)
        content += block_of(head) + block_of(bz2.compress(inner) if packing == "bz2" else inner)
    path.write_bytes(b"#ROSBAG V2.0\n" + content)
    return path


def block_of(body: bytes) -> bytes:
    return struct.pack("<I", len(body)) + body


def fields_of(**fields: bytes) -> bytes:
    return b"".join(block_of(key.encode() + b"=" + value) for key, value in fields.items())


def write_db3(folder: Path, flight: Flight = Flight(), *, defined: bool = True) -> Path:
    """A folder of a bag of ROS 2 in SQLite."""
    folder.mkdir()
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 9\n")
    base = sqlite3.connect(folder / "bag_0.db3")
    base.execute("CREATE TABLE topics(id, name, type, serialization_format)")
    base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data BLOB)")
    if defined:
        base.execute(
            "CREATE TABLE message_definitions"
            "(id, topic_type, encoding, encoded_message_definition, type_description_hash)"
        )
    for number, topic in enumerate(("/imu", "/cmd")):
        kind, text = definition(topic, ros1=False)
        name = kind.replace("/", "/msg/")
        base.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr')", (number, topic, name))
        if defined:
            row = (number, name, "ros2msg", text, "")
            base.execute("INSERT INTO message_definitions VALUES(?, ?, ?, ?, ?)", row)
    base.executemany(
        "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)",
        [(0 if t == "/imu" else 1, stamp, data) for stamp, t, data in flight.messages(cdr=True)],
    )
    base.commit()
    base.close()
    return folder
