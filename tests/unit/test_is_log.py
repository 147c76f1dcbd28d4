"""Logs and records are told apart by what they contain, whatever their names end in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.logs import is_log

RECORD = fid.Record.from_arrays(np.arange(50) * 0.1, inputs={"u": np.arange(50.0)})


@pytest.mark.parametrize("suffix", [".nc", ".parquet"])
def test_records_are_no_logs(suffix: str, tmp_path: Path) -> None:
    assert not is_log(fid.write_records(RECORD, tmp_path / f"flight{suffix}"))


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        (b"\xa3\x95\x80" + bytes(86), True),
        (b"\x00\x00\xa3\x95\x80" + bytes(86), True),  # its beginning is damaged
        (b"ULog\x01\x12\x35\x01" + bytes(8), True),
        (b"FMT, 128, 89, FMT", True),  # a log that read_log refuses and names
        (b"time,u\n0,1\n", False),
    ],
)
@pytest.mark.parametrize("name", ["flight.dat", "flight.bin", "flight.csv"])
def test_bytes_decide(head: bytes, expected: bool, name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(head)
    assert is_log(path) is expected
