"""DataFlash logs as firmware without unit tables wrote them, byte by byte."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

FORMATS = {
    "MSG": (2, "QZ", "TimeUS,Message"),
    "RATE": (3, "Qffffffffffff", "TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut,ADes,A,AOut"),
    "IMU": (4, "Qffffff", "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "ATT": (5, "Qcccc", "TimeUS,DesRoll,Roll,Pitch,Yaw"),
    "CTUN": (6, "Qf", "TimeUS,ThO"),
}
CODES = {"Q": "Q", "f": "f", "c": "h", "Z": "64s"}


def write_old_log(
    path: Path, firmware: str, *, rate_scale: float, seconds: float = 120.0, noise: float = 0.002
) -> Path:
    """A flight at 100 Hz that turns about all axes, RATE in so many counts a rad/s."""
    rng = np.random.default_rng(5)
    time_s = np.arange(0.0, seconds, 0.01)
    sweep = 0.3 * np.sin(2 * np.pi * (0.2 * time_s + 2.0 * time_s**2 / (2 * seconds)))
    roll = 0.2 * np.sin(0.9 * time_s)
    rates = np.array([np.gradient(roll, time_s) + 0.1 * sweep, sweep, 0.5 * sweep])
    # The angles turn as the rates say, with p alone about the nose.
    phi = np.concatenate([[0.0], np.cumsum(0.5 * (rates[0, 1:] + rates[0, :-1]) * 0.01)])
    out = bytearray()
    for name, (number, layout, labels) in FORMATS.items():
        size = 3 + struct.calcsize("<" + "".join(CODES[code] for code in layout))
        head = struct.pack("<BB4s16s64s", number, size, name.encode(), layout.encode(),
                           labels.encode())  # fmt: skip
        out += b"\xa3\x95\x80" + head

    def put(name: str, *values: object) -> None:
        number, layout, _ = FORMATS[name]
        packed = struct.pack("<" + "".join(CODES[code] for code in layout), *values)
        out.extend(b"\xa3\x95" + bytes([number]) + packed)

    put("MSG", 0, firmware.encode())
    for k, at in enumerate(time_s):
        stamp = int(1e6 * (at + 5.0))
        p, q, r = rates[:, k] + noise * rng.standard_normal(3)
        scaled = [rate_scale * value for value in (p, q, r)]
        commands = 0.1 * rates[:, k]
        rows = [item for axis in range(3) for item in (0.0, scaled[axis], commands[axis])]
        put("RATE", stamp, *rows, 0.0, 0.0, 0.0)
        put("IMU", stamp, p, q, r, 0.0, 0.0, -9.8)
        if k % 4 == 0:
            put("ATT", stamp, 0, round(np.degrees(phi[k]) * 100), 0, 0)
            put("CTUN", stamp, 0.4)
    path.write_bytes(bytes(out))
    return path
