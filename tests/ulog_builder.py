"""A small writer of ULog files for tests: every record kind, nothing clever."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

MAGIC = b"ULog\x01\x12\x35"
SYNC = bytes([0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12])


@dataclass
class UlogBuilder:
    """Appends records; `bytes()` gives the file."""

    start_us: int = 1_000
    version: int = 1
    records: list[bytes] = field(default_factory=list)
    appended: tuple[int, ...] = ()
    incompatible: int = 0

    def record(self, kind: str, payload: bytes) -> UlogBuilder:
        self.records.append(struct.pack("<HB", len(payload), ord(kind)) + payload)
        return self

    def format(self, text: str) -> UlogBuilder:
        return self.record("F", text.encode())

    def announce(self, name: str, number: int, instance: int = 0) -> UlogBuilder:
        return self.record("A", struct.pack("<BH", instance, number) + name.encode())

    def sample(self, number: int, layout: str, *values: object) -> UlogBuilder:
        return self.record("D", struct.pack("<H", number) + struct.pack("<" + layout, *values))

    def info(self, key: str, value: bytes) -> UlogBuilder:
        return self.record("I", bytes([len(key)]) + key.encode() + value)

    def multi_info(self, key: str, value: bytes, continues: bool) -> UlogBuilder:
        return self.record("M", bytes([continues, len(key)]) + key.encode() + value)

    def parameter(self, name: str, value: float | int) -> UlogBuilder:
        return self.record("P", _parameter(name, value))

    def default(self, kinds: int, name: str, value: float | int) -> UlogBuilder:
        return self.record("Q", bytes([kinds]) + _parameter(name, value))

    def line(self, stamp_us: int, text: str, level: str = "6") -> UlogBuilder:
        return self.record("L", struct.pack("<BQ", ord(level), stamp_us) + text.encode())

    def tagged_line(self, stamp_us: int, tag: int, text: str, level: str = "4") -> UlogBuilder:
        return self.record("C", struct.pack("<BHQ", ord(level), tag, stamp_us) + text.encode())

    def dropout(self, length_ms: int) -> UlogBuilder:
        return self.record("O", struct.pack("<H", length_ms))

    def sync(self) -> UlogBuilder:
        return self.record("S", SYNC)

    def remove(self, number: int) -> UlogBuilder:
        return self.record("R", struct.pack("<H", number))

    def __bytes__(self) -> bytes:
        offsets = [*self.appended, 0, 0, 0][:3]
        flags = struct.pack("<8sQ3Q", bytes(8), self.incompatible | bool(self.appended), *offsets)
        head = MAGIC + struct.pack("<BQ", self.version, self.start_us)
        return head + struct.pack("<HB", 40, ord("B")) + flags + b"".join(self.records)

    @property
    def size(self) -> int:
        """Bytes so far."""
        return len(bytes(self))


def _parameter(name: str, value: float | int) -> bytes:
    kind, code = ("int32_t", "<i") if isinstance(value, int) else ("float", "<f")
    key = f"{kind} {name}"
    return bytes([len(key)]) + key.encode() + struct.pack(code, value)


def flight(samples: int = 50) -> UlogBuilder:
    """A log with nested arrays, two instances, and every kind of record between the samples."""
    built = UlogBuilder(start_us=1_000)
    built.format("esc:uint16_t rpm;uint8_t[2] _padding0;float volt;")
    built.format("power:uint64_t timestamp;esc[2] esc;char[4] name;bool ok;uint8_t[3] _padding0;")
    built.format("gyro:uint64_t timestamp;float[3] xyz;")
    built.info("char[3] sys_name", b"PX4").info("char[20] sys_uuid", b"00060000000035353237").info(
        "uint32_t ver_sw_release", bytes([255, 3, 14, 1])
    )
    built.multi_info("char[2] perf", b"ab", False).multi_info("char[2] perf", b"cd", True)
    built.parameter("MC_ROLL_P", 6.5).parameter("MAV_TYPE", 2)
    built.default(1, "MC_ROLL_P", 6.0).default(3, "MAV_TYPE", 0)
    built.announce("gyro", 7).announce("gyro", 8, 1).announce("power", 9)
    for index in range(samples):
        stamp = 10_000 + 4_000 * index
        built.sample(7, "Q3f", stamp, index, -index, 0.5)
        built.sample(8, "Q3f", stamp + 5, 2 * index, 0.0, 1.5)
        built.sample(9, "QHHfHHf4sB", stamp, index, 0, 12.0, index + 1, 0, 11.5, b"abc", 1)
        if index % 10 == 4:
            built.sync().dropout(12).line(stamp, "hello").tagged_line(stamp, 3, "tagged")
            built.parameter("MC_ROLL_P", 6.5 + index)
    return built.remove(9)
