"""Blackbox files as the firmware writes them: for tests of the reader, which shares no code.

Reference: Betaflight ``src/main/blackbox/blackbox.c`` and ``blackbox_encoding.c``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

START = "H Product:Blackbox flight data recorder by Nicholas Sherlock"
END = b"E\xffEnd of log\0"
INTERVAL = 32
AXES = range(3)


@dataclass(frozen=True)
class Field:
    """Name, sign, and predictor and encoding in whole and in difference frames."""

    name: str
    signed: int
    whole: tuple[int, int]
    line: tuple[int, int]


FIELDS = (
    Field("loopIteration", 0, (0, 1), (6, 9)),
    Field("time", 0, (0, 1), (2, 0)),
    *(Field(f"axisP[{i}]", 1, (0, 0), (1, 0)) for i in AXES),
    *(Field(f"axisI[{i}]", 1, (0, 0), (1, 7)) for i in AXES),
    *(Field(f"axisD[{i}]", 1, (0, 0), (1, 10)) for i in AXES),
    *(Field(f"rcCommand[{i}]", 1, (0, 0), (1, 8)) for i in AXES),
    Field("rcCommand[3]", 0, (4, 1), (1, 8)),
    *(Field(f"setpoint[{i}]", 1, (0, 0), (1, 8)) for i in range(4)),
    Field("vbatLatest", 0, (9, 3), (1, 6)),
    Field("amperageLatest", 1, (0, 0), (1, 6)),
    Field("rssi", 0, (0, 1), (1, 6)),
    *(Field(f"gyroADC[{i}]", 1, (0, 0), (3, 0)) for i in AXES),
    *(Field(f"accSmooth[{i}]", 1, (0, 0), (3, 0)) for i in AXES),
    Field("motor[0]", 0, (11, 1), (3, 0)),
    *(Field(f"motor[{i}]", 0, (5, 0), (3, 0)) for i in range(1, 4)),
)
SETTINGS = {
    "Data version": "2",
    "I interval": str(INTERVAL),
    "P interval": "1/2",
    "Firmware type": "Cleanflight",
    "Firmware revision": "Betaflight 4.4.2 (abcdef) STM32F405",
    "minthrottle": "1070",
    "gyro_scale": "0x3f800000",
    "motorOutput": "158,2047",
    "acc_1G": "2048",
    "vbatref": "1620",
    "looptime": "250",
    "rollPID": "45,80,30",
}


def unsigned(value: int) -> bytes:
    """Seven bits a byte, least first."""
    out = bytearray()
    value &= 0xFFFFFFFF
    while value > 127:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def signed(value: int) -> bytes:
    """The same with the sign in the last bit."""
    return unsigned((value << 1) ^ (value >> 31))


def _fits(values: Sequence[int], bits: Sequence[int]) -> bool:
    return all(-(1 << n - 1) <= v < 1 << n - 1 for v, n in zip(values, bits, strict=True))


def _packed(lead: int, values: Sequence[int], bits: Sequence[int]) -> bytes:
    number = lead
    for value, n in zip(values, bits, strict=True):
        number = number << n | value & (1 << n) - 1
    return number.to_bytes((2 + sum(bits)) // 8, "big")


def _whole_bytes(values: Sequence[int]) -> bytes:
    sizes = [next(n for n in (1, 2, 3, 4) if _fits([v], [8 * n])) for v in values]
    lead = 0xC0 | sum(size - 1 << 2 * place for place, size in enumerate(sizes))
    parts = (
        (v & (1 << 8 * n) - 1).to_bytes(n, "little") for v, n in zip(values, sizes, strict=True)
    )
    return bytes([lead]) + b"".join(parts)


def three(values: Sequence[int]) -> bytes:
    """Encoding 7."""
    if _fits(values, (2, 2, 2)):
        return _packed(0, values, (2, 2, 2))
    if _fits(values, (4, 4, 4)):
        return bytes([0x40 | values[0] & 15, (values[1] & 15) << 4 | values[2] & 15])
    if _fits(values, (6, 6, 6)):
        return bytes([0x80 | values[0] & 63, values[1] & 63, values[2] & 63])
    return _whole_bytes(values)


def three_variable(values: Sequence[int]) -> bytes:
    """Encoding 10."""
    for lead, bits in ((0, (2, 2, 2)), (1, (5, 5, 4)), (2, (8, 7, 7))):
        if _fits(values, bits):
            return _packed(lead, values, bits)
    return _whole_bytes(values)


def four(values: Sequence[int]) -> bytes:
    """Encoding 8 of data version 2: fields of 0, 4, 8 or 16 bits, one after the other."""
    digits, tags = "", 0
    for place, value in enumerate(values):
        kind = next(
            k for k, n in enumerate((0, 4, 8, 16)) if value == 0 or (n and _fits([value], [n]))
        )
        tags |= kind << 2 * place
        n = (0, 1, 2, 4)[kind]
        digits += f"{value & (1 << 4 * n) - 1:0{n}x}" if n else ""
    return bytes([tags]) + bytes.fromhex(digits + "0" * (len(digits) % 2))


def tag8(values: Sequence[int]) -> bytes:
    """Encoding 6."""
    if len(values) == 1:
        return signed(values[0])
    flags = sum(1 << place for place, value in enumerate(values) if value)
    return bytes([flags]) + b"".join(signed(value) for value in values if value)


_GROUPS: dict[int, tuple[int, Callable[[Sequence[int]], bytes]]] = {
    6: (8, tag8), 7: (3, three), 8: (4, four), 10: (3, three_variable),
}  # fmt: skip
_ALONE: dict[int, Callable[[int], bytes]] = {
    0: signed, 1: unsigned, 3: lambda value: unsigned(-value & 0x3FFF), 9: lambda value: b"",
}  # fmt: skip


def _wrapped(value: int) -> int:
    """The firmware counts in 32 bits."""
    return (value + 2**31) % 2**32 - 2**31


def _halved(total: int) -> int:
    return int(total / 2)


MOTOR = next(i for i, known in enumerate(FIELDS) if known.name == "motor[0]")


def _guess(predictor: int, place: int, rows: Sequence[Sequence[int]]) -> int:
    now, last, older = rows
    if predictor in (0, 4, 9, 11):
        return {0: 0, 4: 1070, 9: 1620, 11: 158}[predictor]
    if predictor in (5, 6):
        return now[MOTOR if predictor == 5 else place]
    if predictor == 1:
        return last[place]
    return 2 * last[place] - older[place] if predictor == 2 else _halved(last[place] + older[place])


def frame(letter: str, rows: Sequence[Sequence[int]], fields: Sequence[Field] = FIELDS) -> bytes:
    """One frame of the loop: this row, the one before and the one before that."""
    rules = [known.whole if letter == "I" else known.line for known in fields]
    left = [
        _wrapped(int(rows[0][place]) - _guess(predictor, place, rows))
        for place, (predictor, _) in enumerate(rules)
    ]
    out, place = letter.encode(), 0
    while place < len(rules):
        encoding = rules[place][1]
        if encoding in _ALONE:
            out += _ALONE[encoding](left[place])
            place += 1
            continue
        most, write = _GROUPS[encoding]
        count = 1
        while count < most and place + count < len(rules) and rules[place + count][1] == encoding:
            count += 1
        out += write(left[place : place + count])
        place += count
    return out


def header(settings: Mapping[str, str] = SETTINGS, fields: Sequence[Field] = FIELDS) -> bytes:
    """The text before the frames."""
    lines = [START, *(f"H {name}:{value}" for name, value in settings.items())]
    lines += [
        "H Field I name:" + ",".join(known.name for known in fields),
        "H Field I signed:" + ",".join(str(known.signed) for known in fields),
        "H Field I predictor:" + ",".join(str(known.whole[0]) for known in fields),
        "H Field I encoding:" + ",".join(str(known.whole[1]) for known in fields),
        "H Field P predictor:" + ",".join(str(known.line[0]) for known in fields),
        "H Field P encoding:" + ",".join(str(known.line[1]) for known in fields),
        "H Field S name:flightModeFlags,stateFlags",
        "H Field S signed:0,0",
        "H Field S predictor:0,0",
        "H Field S encoding:1,1",
    ]
    return "\n".join(lines).encode() + b"\n"


def blackbox(
    columns: Mapping[str, np.ndarray],
    settings: Mapping[str, str] = SETTINGS,
    fields: Sequence[Field] = FIELDS,
) -> bytes:
    """A flight with every second loop of a controller logged, as ``P interval:1/2`` says.

    Fields that are not given are zero; ``loopIteration`` is made here. The motors stand where
    those of `FIELDS` do.
    """
    n = len(columns["time"])
    table = np.zeros((n, len(fields)), np.int64)
    for place, known in enumerate(fields):
        if known.name in columns:
            table[:, place] = columns[known.name]
    table[:, 0] = 2 * np.arange(n)
    rows = table.tolist()
    out = [header(settings, fields), b"S" + unsigned(2) + unsigned(0)]
    last = older = rows[0]
    for row in rows:
        whole = row[0] % INTERVAL == 0
        out.append(frame("I" if whole else "P", (row, last, older), fields))
        last, older = row, row if whole else last
    return b"".join([*out, END])
