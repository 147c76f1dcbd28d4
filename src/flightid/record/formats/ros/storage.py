"""SQLite storage of ROS 2 bags (.db3): tables of topics and messages, opened for reading alone."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from pathlib import Path

from flightid.errors import FileFormatError
from flightid.record.formats.ros.content import LONGEST, BagContent, Topic
from flightid.record.formats.ros.definitions import short_name

MAGIC = b"SQLite format 3\x00"
STEPS = 200_000_000
"""Instructions of the database after which a query is no reading of a bag."""


def gather(path: Path, content: BagContent) -> None:
    """Add the messages of a file to the content of a bag.

    Raises
    ------
    FileFormatError
        It is no bag; values are more than the memory budget.
    """
    with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as db:
        db.execute("PRAGMA trusted_schema=OFF")
        db.set_progress_handler(lambda: 1, STEPS)
        kinds = dict(db.execute("SELECT name, type FROM sqlite_master").fetchmany(100))
        if kinds.get("messages") != "table" or kinds.get("topics") != "table":
            raise FileFormatError(
                f"{path.name} is a database and no ROS 2 bag",
                found="tables " + ", ".join(map(str, kinds))[:80] if kinds else "no table",
                needed="tables topics and messages",
                action="export what it holds as CSV or Parquet",
            )
        texts: dict[str, str] = {}
        if kinds.get("message_definitions") == "table":
            asked = "SELECT topic_type, encoding, encoded_message_definition"
            rows = db.execute(f"{asked} FROM message_definitions")
            texts = {short_name(kind): text for kind, way, text in rows if way == "ros2msg"}
        asked = "SELECT id, name, type, serialization_format FROM topics"
        for number, name, long_name, way in db.execute(asked):
            kind = short_name(str(long_name))
            content.topics[path, number] = Topic(str(name), kind, texts.get(kind, ""), str(way))
        asked = "SELECT topic_id, timestamp, substr(data, 1, ?) FROM messages ORDER BY rowid"
        for number, stamp, data in db.execute(asked, (LONGEST + 1,)):
            content.add((path, number), int(stamp), bytes(data))
