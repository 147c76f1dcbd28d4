"""Bags that lie, were damaged or are still written: read rightly, or refused at once."""

from __future__ import annotations

import os
import shutil
import sqlite3
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.errors import FileFormatError, OptionError
from flightid.reading import VARIABLE, memory_budget
from flightid.record.formats.ros import read_columns, storage
from flightid.record.formats.ros.content import LONGEST, BagContent, Topic
from tests.bag_builder import (
    NS,
    START_NS,
    Flight,
    bag1_of,
    block_of,
    fields_of,
    mcap_of,
    message_of,
    record_of,
    texts_of,
    topic_of,
    write_bag1,
    write_db3,
    write_mcap,
)

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
    # Of a log that is written into the file nothing is left; SQLite would make one for a while.
    before = path.parent.stat().st_mtime_ns
    assert read_columns(path).lengths[RATE] == 2 * FLIGHT.n_rates
    assert path.parent.stat().st_mtime_ns == before


def test_a_bag_that_grows_while_it_is_copied_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, base = _in_log(tmp_path / "bag")
    full, copied = BagContent("bag", n_bytes=memory_budget()), shutil.copyfile
    with pytest.raises(FileFormatError, match="more than is read"), storage._opened(path, full):
        pass

    def copyfile(source: Path, made: Path) -> None:
        copied(source, made)
        if source == path:
            base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(0, 0, '')")
            base.commit()

    monkeypatch.setattr(shutil, "copyfile", copyfile)
    with pytest.raises(FileFormatError, match=r"bag_0\.db3 is still written"):
        read_columns(path)
    base.close()


def test_a_database_is_opened_to_run_nothing_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_db3(tmp_path / "bag", FLIGHT) / "bag_0.db3"
    monkeypatch.setattr(storage, "STEPS", 1000)
    endless = "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) SELECT max(k) FROM n"
    with storage._opened(path, BagContent("bag")) as db:
        assert db.execute("PRAGMA trusted_schema").fetchone() == (0,)
        with pytest.raises(sqlite3.OperationalError, match="readonly"):
            db.execute("CREATE TABLE more(name)")
        with pytest.raises(sqlite3.OperationalError, match="interrupted"):
            db.execute(endless + " LIMIT 1")


@pytest.mark.parametrize("container", ["mcap", "bag1"])
def test_memory_is_asked_for_before_it_is_taken(
    container: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A message may take all of a large file, a chunk its bytes and twice what it unpacks to."""
    monkeypatch.setenv(VARIABLE, "1")
    if container == "mcap":
        path = mcap_of(tmp_path / "a", topic_of("uint8 v\n") + message_of(0, bytes(600_000)))
    else:
        path = bag1_of(tmp_path / "a")
        head = fields_of(op=b"\x02", conn=bytes(4), time=bytes(8))
        path.write_bytes(path.read_bytes() + block_of(head) + block_of(bytes(1_200_000)))
    with pytest.raises(FileFormatError, match="more than is read into memory"):
        read_columns(path)
    full = BagContent("a", n_bytes=(1 << 20) - 8)
    with pytest.raises(FileFormatError, match="more than is read"), full.inflated("", b"abc", 3):
        pass
    with full.inflated("", b"ab", 2) as inner:
        assert (inner, full.n_bytes) == (b"ab", (1 << 20) - 6)
    assert full.n_bytes == (1 << 20) - 8


def test_definitions_of_ros1_count_and_headers_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chunks = []
    for k in range(12):
        head = fields_of(op=b"\x07", conn=struct.pack("<I", k), topic=b"/a")
        said = fields_of(type=b"a/B", message_definition=b"#" * 100_000)
        chunks.append(block_of(head) + block_of(said))
    path = bag1_of(tmp_path / "a.bag", *chunks)
    monkeypatch.setenv(VARIABLE, "1")
    with pytest.raises(FileFormatError, match="more than is read into memory"):
        read_columns(path)
    many = fields_of(**{f"a{k}": b"" for k in range(102)})
    path.write_bytes(path.read_bytes()[:13] + block_of(many) + block_of(b""))
    with pytest.raises(FileFormatError, match="more than 100 fields"):
        read_columns(path)


def test_chunks_within_chunks_are_passed_over(tmp_path: Path) -> None:
    records = topic_of("float64 v\n") + message_of(0, b"\x00\x01\x00\x00" + bytes(8))
    for _ in range(2):
        head = struct.pack("<QQQI", 0, 0, len(records), 0) + texts_of("")
        records = record_of(6, head + struct.pack("<Q", len(records)) + records)
    path = mcap_of(tmp_path / "a.mcap", records)
    whole = write_bag1(tmp_path / "b.bag", FLIGHT).read_bytes()
    # Behind the magic and the header of the bag: its chunk.
    nested = bag1_of(tmp_path / "b.bag", whole[13 + len(block_of(fields_of(op=b"\x03"))) + 4 :])
    for each in (path, nested):
        with pytest.raises(FileFormatError, match="holds no topic of numbers"):
            read_columns(each)


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
    size = whole.index(b"\x06", 8) + 9 + 16
    (said,) = struct.unpack_from("<Q", whole, size)
    for wrong in (said - 1, said + 1):
        path.write_bytes(whole[:size] + struct.pack("<Q", wrong) + whole[size + 8 :])
        with pytest.raises(FileFormatError, match=r"a\.mcap is not as long as it says"):
            read_columns(path)
    at = whole.index(struct.pack("<d", FLIGHT.rates[20])) + 7
    path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x40]) + whole[at + 1 :])
    with pytest.raises(FileFormatError, match=r"a chunk of a\.mcap is damaged.*checksum"):
        read_columns(path)


def test_a_cut_database_is_refused_whole_and_says_how_to_recover_it(tmp_path: Path) -> None:
    path = write_db3(tmp_path / "bag", FLIGHT) / "bag_0.db3"
    path.write_bytes(path.read_bytes()[:-8192])
    with pytest.raises(FileFormatError, match=r"sqlite3 bag_0\.db3 \.recover"):
        read_columns(path)


EMPTY = f"{'=' * 80}\nMSG: a/E\n# nothing\n"
REPEATED = {
    "one": "a/E[999999999] e\n" + EMPTY,
    "nested": f"a/F[999999999] f\n{'=' * 80}\nMSG: a/F\na/E[999999999] e\n{EMPTY}",
    "none of each": f"a/F[999999999] f\n{'=' * 80}\nMSG: a/F\nuint8[0] x\nstring[0] y\n",
    "long": "uint8 x\n" * 40_000,
}


@pytest.mark.parametrize("text", REPEATED.values(), ids=REPEATED)
def test_definitions_that_repeat_nothing_leave_their_topic_out(text: str, tmp_path: Path) -> None:
    payload = b"\x00\x01\x00\x00" + bytes(8)
    messages = b"".join(message_of(START_NS + k * NS, payload) for k in range(9))
    path = mcap_of(tmp_path / "a.mcap", topic_of("float64 v\n" + text) + messages)
    with _at_once(), pytest.raises(FileFormatError, match=r"which holds nothing|is too long"):
        read_columns(path)


def _numbers(tmp_path: Path, stamps: list[int], head: bytes = b"\x00\x01\x00\x00") -> Path:
    order = ">d" if head[1] == 0 else "<d"
    parts = [message_of(at, head + struct.pack(order, k)) for k, at in enumerate(stamps)]
    return mcap_of(tmp_path / "a.mcap", topic_of("float64 v\n") + b"".join(parts))


def test_stamps_beyond_the_clock_are_refused(tmp_path: Path) -> None:
    last = (1 << 63) - 1
    assert read_columns(_numbers(tmp_path, [last - 1, last])).lengths == {"/a/v": 2}
    with pytest.raises(FileFormatError, match="holds a stamp that is none"):
        read_columns(_numbers(tmp_path, [last, last + 1]))


def test_numbers_are_read_in_the_order_of_their_bytes(tmp_path: Path) -> None:
    path = _numbers(tmp_path, [0, NS, 2 * NS], head=bytes(4))
    assert read_columns(path).column("/a/v").tolist() == [0.0, 1.0, 2.0]


def test_messages_as_they_lie_in_memory_keep_to_the_budget(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = _numbers(tmp_path, list(range(8000)))
    monkeypatch.setenv(VARIABLE, "1")
    assert path.stat().st_size < 1 << 19
    with pytest.raises(FileFormatError, match="more than is read into memory"):
        read_columns(path)


def test_pipes_are_refused_without_waiting(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.mcap")
    for read in (fid.read_records, fid.read_log):
        with pytest.raises(FileFormatError, match=r"a\.mcap is no file"):
            read(tmp_path / "a.mcap")
    with pytest.raises(FileFormatError, match="null is no file"):
        fid.read_records("/dev/null")


def test_grids_without_end_and_filters_without_poles_are_refused() -> None:
    record = fid.Record.from_arrays(np.arange(50) / 50, outputs={"p": np.arange(50.0)})
    with pytest.raises(OptionError, match=r"grid of sample_time_s=1e-12.*memory budget"):
        fid.conditioning.resample(record, 1e-12)
    with pytest.raises(OptionError, match=r"needed 1 of 5e-05 Hz to 25 Hz"):
        fid.conditioning.filter_record(record, 1e-300)
    fid.conditioning.filter_record(record, 5e-5, order=2)


def test_numbers_of_all_topics_keep_to_the_budget(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    head, stamps = b"\x00\x01\x00\x00", range(3000)
    parts = b"".join(message_of(at, head + bytes(64)) for at in stamps)
    path = mcap_of(tmp_path / "a.mcap", topic_of("uint8[64] v\n") + parts)
    table = read_columns(path)
    assert table.column("/a/v[63]").tolist() == [0.0] * len(stamps)
    monkeypatch.setenv(VARIABLE, "2")
    with pytest.raises(FileFormatError, match="more than is read into memory"):
        read_columns(path).column("/a/v[0]")


def test_arrays_of_64_become_columns_and_of_65_do_not(tmp_path: Path) -> None:
    head = b"\x00\x01\x00\x00"
    text = "uint8[64] a\nuint8[65] b\nuint8[] c\n"
    body = head + bytes(64 + 65) + bytes(3) + struct.pack("<I", 65) + bytes(65)
    path = mcap_of(tmp_path / "a.mcap", topic_of(text) + message_of(0, body) + message_of(NS, body))
    found = set(read_columns(path).lengths)
    assert {"/a/a[63]", "/a/c[63]"} < found
    assert not {"/a/b[0]", "/a/c[64]"} & found


def test_an_array_longer_than_its_message_leaves_its_topic_out(tmp_path: Path) -> None:
    body = b"\x00\x01\x00\x00" + struct.pack("<I", 1000) + bytes(8)
    path = mcap_of(tmp_path / "a.mcap", topic_of("string[] v\n") + message_of(0, body))
    with pytest.raises(FileFormatError, match="1000 elements in 8 bytes"):
        read_columns(path)


def test_messages_of_64_kib_are_samples_and_longer_ones_are_not(tmp_path: Path) -> None:
    for size, is_long in ((1 << 16, False), ((1 << 16) + 1, True)):
        body = b"\x00\x01\x00\x00" + bytes(size - 4)
        path = mcap_of(tmp_path / f"{size}.mcap", topic_of("float64 v\n") + message_of(0, body))
        if is_long:
            with pytest.raises(FileFormatError, match="too long for samples"):
                read_columns(path)
        else:
            assert read_columns(path).lengths == {"/a/v": 1}
    path = write_db3(tmp_path / "bag", FLIGHT) / "bag_0.db3"
    with sqlite3.connect(path) as base:
        base.execute("INSERT INTO messages(topic_id, data) VALUES(1, ?)", (body,))
        base.execute("UPDATE messages SET timestamp = 0 WHERE timestamp IS NULL")
    base.close()
    assert "/cmd left out: its messages are too long" in read_columns(path).advice


def test_messages_that_are_left_out_are_no_longer_counted() -> None:
    content = BagContent("a")
    content.declare(1, Topic("/a", "a/B", "", "cdr"))
    empty = content.n_bytes
    for size in (100, 200, LONGEST + 1, 300):
        content.add(1, 0, bytes(size))
    assert (content.n_bytes, content.topics[1].payloads) == (empty, [])


def test_stamps_of_headers_that_stand_are_not_taken(tmp_path: Path) -> None:
    text = f"std_msgs/Header header\nfloat64 v\n{'=' * 80}\nMSG: std_msgs/Header\n"
    text += f"builtin_interfaces/Time stamp\n{'=' * 80}\nMSG: builtin_interfaces/Time\n"
    topic = topic_of(text + "int32 sec\nuint32 nanosec\n")
    parts = [
        message_of(k * NS, b"\x00\x01\x00\x00" + struct.pack("<iId", max(k, 1), 0, k))
        for k in range(4)
    ]
    clock = read_columns(mcap_of(tmp_path / "a.mcap", topic + b"".join(parts))).clock
    assert clock is not None
    assert "those of the headers stand" in clock("/a/v").said
