"""SQLite storage of ROS 2 bags (.db3): tables of topics and messages, opened for reading alone.

What a recorder has not yet written into the file (its write-ahead log) is read from a copy, so that
neither is touched. Reference: sqlite.org, "Write-Ahead Logging" and "Database File Format".
"""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from sys import getsizeof
from tempfile import TemporaryDirectory

from flightid.errors import FileFormatError
from flightid.reading import memory_budget
from flightid.record.formats.ros.content import LONGEST, OVERHEAD, BagContent, Topic
from flightid.record.formats.ros.definitions import short_name

JOURNAL_MAGIC = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
STEPS = 200_000_000
"""Instructions of the database after which a query is no reading of a bag."""
LONGEST_VALUE = 1_000_000_000
READ = ("messages", "topics", "message_definitions")


def gather(path: Path, content: BagContent) -> None:
    """Add the messages of a file to the content of a bag.

    Raises
    ------
    FileFormatError
        It is no bag, or still written; values are more than the memory budget.
    """
    with _opened(path.resolve(), content) as db:
        kinds = _tables(db, path.name)
        texts: dict[str, str] = {}
        if "message_definitions" in kinds:
            asked = "SELECT topic_type, encoding, encoded_message_definition"
            for kind, way, text in db.execute(f"{asked} FROM message_definitions"):
                if way == "ros2msg":
                    content.hold(OVERHEAD + getsizeof(kind) + getsizeof(text))
                    texts[short_name(kind)] = text
        asked = "SELECT id, name, type, serialization_format FROM topics"
        for number, name, long_name, way in db.execute(asked):
            kind = short_name(str(long_name))
            topic = Topic(str(name), kind, texts.get(kind, ""), str(way))
            content.declare((path, number), topic)
        asked = "SELECT topic_id, timestamp, substr(data, 1, ?) FROM messages ORDER BY rowid"
        for number, stamp, data in db.execute(asked, (LONGEST + 1,)):
            content.add((path, number), int(stamp), bytes(data))


@contextmanager
def _opened(path: Path, content: BagContent) -> Iterator[sqlite3.Connection]:
    """The database, of which nothing is run and no value is longer than the memory budget.

    Raises
    ------
    FileFormatError
        Its last change was not ended, or it changes while it is copied.
    """
    journal = path.with_name(f"{path.name}-journal")
    if journal.is_file() and journal.stat().st_size and _head(journal) == JOURNAL_MAGIC:
        raise FileFormatError(
            f"{path.name} was left in the middle of a change",
            found=journal.name,
            needed="a bag whose recorder ended",
            action=f"end the recorder; else `sqlite3 {path.name} .tables` undoes the change",
        )
    with TemporaryDirectory(prefix="flightid-") as folder:
        source = path
        log = path.with_name(f"{path.name}-wal")
        if log.is_file() and log.stat().st_size:
            source = _copied(path, log, Path(folder), content)
        way = "mode=ro&immutable=1" if source is path else "mode=ro"
        with closing(sqlite3.connect(f"{source.as_uri()}?{way}", uri=True)) as db:
            db.execute("PRAGMA trusted_schema=OFF")
            db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(memory_budget(), LONGEST_VALUE))
            db.set_progress_handler(lambda: 1, STEPS)
            yield db


def _head(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(len(JOURNAL_MAGIC))


def _copied(path: Path, log: Path, folder: Path, content: BagContent) -> Path:
    """A copy of a database with its log, beside which SQLite may write."""
    before = _state(path), _state(log)
    content.require(before[0][0] + before[1][0])
    made = folder / "bag.db3"
    shutil.copyfile(path, made)
    shutil.copyfile(log, folder / "bag.db3-wal")
    if (_state(path), _state(log)) != before:
        raise FileFormatError(
            f"{path.name} is still written",
            found=f"{log.name} changes",
            needed="a bag whose recorder ended",
            action="end the recorder, or copy the bag when it rests",
        )
    return made


def _state(path: Path) -> tuple[int, int]:
    found = path.stat()
    return found.st_size, found.st_mtime_ns


def _tables(db: sqlite3.Connection, name: str) -> set[str]:
    """Tables of a bag: stored ones, whose values are in the file.

    Raises
    ------
    FileFormatError
        Those of a bag are not there, or hold what is computed as it is asked for.
    """
    asked = "SELECT substr(name, 1, 40), rootpage FROM sqlite_master WHERE type = 'table'"
    stored = dict(db.execute(asked).fetchmany(100))
    if not (stored.get("messages") and stored.get("topics")):
        raise FileFormatError(
            f"{name} is a database and no ROS 2 bag",
            found="tables " + ", ".join(map(str, stored))[:80] if stored else "no table",
            needed="tables topics and messages",
            action="export what it holds as CSV or Parquet",
        )
    for table in READ:
        columns = db.execute(f"PRAGMA table_xinfo({table})").fetchmany(1000)
        computed = [str(column[1])[:40] for column in columns if column[6]]
        if computed or (table in stored and not stored[table]):
            raise FileFormatError(
                f"{name} computes what a bag stores",
                found=f"table {table}" + (f", column {computed[0]}" if computed else ""),
                needed="a bag as ros2 bag writes it",
                action="ros2 bag convert rewrites it",
            )
    return set(stored)
