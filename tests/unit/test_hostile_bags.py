"""Bags that lie, were damaged or are still written: read rightly, or refused at once."""

from __future__ import annotations

import sqlite3
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from flightid.errors import FileFormatError
from flightid.record.formats.ros import read_columns
from tests.bag_builder import NS, Flight, write_db3, write_mcap

RATE = "/imu/rate.x"
FLIGHT = Flight(n_rates=60)
SECONDS = 2.0


@contextmanager
def _at_once() -> Iterator[None]:
    begun = time.process_time()
    yield
    assert time.process_time() - begun < SECONDS


def _in_log(folder: Path) -> tuple[Path, sqlite3.Connection]:
    """A bag whose second half waits in the write-ahead log, and the recorder that holds it open."""
    path = write_db3(folder, FLIGHT) / "bag_0.db3"
    base = sqlite3.connect(path)
    base.execute("PRAGMA journal_mode=WAL")
    base.execute("PRAGMA wal_autocheckpoint=0")
    rows = base.execute("SELECT topic_id, timestamp + ?, data FROM messages", (NS,)).fetchall()
    base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows)
    base.commit()
    return path, base


def test_what_waits_in_a_write_ahead_log_is_read_and_nothing_is_touched(tmp_path: Path) -> None:
    path, base = _in_log(tmp_path / "bag")
    held = {each.name: each.read_bytes() for each in path.parent.iterdir()}
    table = read_columns(path)
    assert np.array_equal(table.column(RATE), np.tile(FLIGHT.rates, 2))
    assert {each.name: each.read_bytes() for each in path.parent.iterdir()} == held
    base.close()


def test_a_bag_in_the_middle_of_a_change_is_refused(tmp_path: Path) -> None:
    path = write_db3(tmp_path / "bag", FLIGHT) / "bag_0.db3"
    journal = path.with_name("bag_0.db3-journal")
    journal.write_bytes(bytes(512))
    assert read_columns(path).lengths[RATE] == FLIGHT.n_rates
    journal.write_bytes(b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7".ljust(512, b"\0"))
    with pytest.raises(FileFormatError, match=r"middle of a change.*bag_0\.db3-journal"):
        read_columns(path)


@pytest.mark.parametrize("column", ["data", "name"])
def test_a_database_that_computes_what_bags_store_is_refused(column: str, tmp_path: Path) -> None:
    path = tmp_path / "a.db3"
    base = sqlite3.connect(path)
    long = "GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL"
    kinds = {"name": "", "data": "", column: long}
    base.execute(f"CREATE TABLE topics(id, type, serialization_format, name {kinds['name']})")
    base.execute(f"CREATE TABLE messages(topic_id, timestamp, data {kinds['data']})")
    base.close()
    with _at_once(), pytest.raises(FileFormatError, match="computes what a bag stores"):
        read_columns(path)


def test_a_chunk_that_is_not_as_recorded_is_refused(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", FLIGHT)
    whole = path.read_bytes()
    assert np.array_equal(read_columns(path).column(RATE), FLIGHT.rates)
    at = whole.index(struct.pack("<d", FLIGHT.rates[20])) + 7
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x40]) + whole[at + 1 :])
    with pytest.raises(FileFormatError, match=r"a chunk of a\.mcap is damaged.*checksum"):
        read_columns(path)


def test_a_cut_database_is_refused_whole_and_says_how_to_recover_it(tmp_path: Path) -> None:
    path = write_db3(tmp_path / "bag", FLIGHT) / "bag_0.db3"
    path.write_bytes(path.read_bytes()[:-8192])
    with pytest.raises(FileFormatError, match=r"sqlite3 bag_0\.db3 \.recover"):
        read_columns(path)
