"""PX4's log before ULog (sdlog2), written by hand: FMT rows, TIME before each group of messages."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

FORMATS = {
    "TIME": (129, "Q", "StartTime"),
    "VER": (130, "NZ", "Arch,FwGit"),
    "PARM": (131, "Nf", "Name,Value"),
    "ATT": (2, "ffffff", "Roll,Pitch,Yaw,RollRate,PitchRate,YawRate"),
    "IMU": (4, "fffffffff", "AccX,AccY,AccZ,GyroX,GyroY,GyroZ,MagX,MagY,MagZ"),
    "ATTC": (9, "ffff", "Roll,Pitch,Yaw,Thrust"),
    "STAT": (10, "BBB", "MainState,NavState,ArmState"),
    "ARSP": (17, "fff", "RollRateSP,PitchRateSP,YawRateSP"),
}
WIDTHS = {"Q": "Q", "N": "16s", "Z": "64s", "f": "f", "B": "B"}
STEP_US = 5000


def rates(n_rows: int) -> np.ndarray:
    """Roll rate, rad/s."""
    return np.sin(0.05 * np.arange(n_rows))


def write_sdlog2(path: Path, n_rows: int = 600, *, pause_s: float = 0.0) -> Path:
    """A copter's log at 200 Hz: attitude and inertial sensors each time, commands each second.

    Nothing is written in a pause half way.
    """
    content = b"".join(_format(name) for name in FORMATS)
    content += _row("VER", b"PX4FMU_V2", b"0123456789abcdef")
    content += _row("PARM", b"MAV_TYPE", 2.0) + _row("PARM", b"MC_ROLLRATE_P", 0.15)
    for k, rate in enumerate(rates(n_rows)):
        paused_us = round(1e6 * pause_s) if 2 * k >= n_rows else 0
        content += _row("TIME", 10_000_000 + k * STEP_US + paused_us)
        content += _row("ATT", 0.1, 0.2, 0.3, rate, 2 * rate, -rate)
        content += _row("IMU", 0.0, 0.0, -9.81, rate, 2 * rate, -rate, 0.2, 0.0, 0.4)
        if k % 2 == 0:
            content += _row("ATTC", 0.01 * rate, 0.0, 0.0, 0.5) + _row("ARSP", rate, 0.0, 0.0)
        if k in (0, n_rows // 2):
            content += _row("STAT", 0, 0, 1 if k == 0 else 2)
    path.write_bytes(content)
    return path


def _format(name: str) -> bytes:
    number, letters, labels = FORMATS[name]
    size = 3 + struct.calcsize("<" + "".join(WIDTHS[letter] for letter in letters))
    row = struct.pack("<BB4s16s64s", number, size, name.encode(), letters.encode(), labels.encode())
    return b"\xa3\x95\x80" + row


def _row(name: str, *values: object) -> bytes:
    number, letters, _ = FORMATS[name]
    packed = struct.pack("<" + "".join(WIDTHS[letter] for letter in letters), *values)
    return b"\xa3\x95" + bytes([number]) + packed
