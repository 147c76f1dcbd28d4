"""The catalogue: rows counted once whatever died when, broken files, and what SQL may not do."""

from __future__ import annotations

import hashlib
import json
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("duckdb")
pytest.importorskip("pyarrow")

from flightid.cli.program import run
from flightid.errors import DataError, OptionError
from flightid.fleet.catalogue.catalogue import Catalogue
from flightid.fleet.catalogue.compaction import MOST_SMALL, compact, merge, rewrite, set_aside
from flightid.fleet.catalogue.loose import loose_logs, loose_name, write_loose
from flightid.fleet.catalogue.on_time import TimedConnection
from flightid.fleet.catalogue.parts import MANIFEST, PARTS, KnownLogs, LiveLogs, read_parts
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.catalogue.store import FolderStore
from flightid.fleet.engine.address_space import bounded_memory
from flightid.fleet.opening import open_catalogue, opened_store
from flightid.fleet.status import fleet_status


def record(number: int) -> LogRecord:
    log = hashlib.sha256(str(number).encode()).hexdigest()
    common = {"log": log, "vehicle": f"V{number % 3}", "type": "quad", "light": "green"}
    common["flown_at"] = f"2026-03-{number % 28 + 1:02d}T00:00:00"
    value = {**common, "model": "m", "name": "Lp", "value": -3.0 - number, "stderr": 0.1}
    matrix = {**common, "model": "m", "names": ["Lp"], "lower": [0.01]}
    entry = {**common, "outcome": "fitted", "models": 1, "address": f"{number}.bin"}
    return LogRecord(log, {"logs": [entry], "parameters": [value], "covariances": [matrix]})


def filled(folder: Path, numbers: range) -> FolderStore:
    store = FolderStore(folder)
    for number in numbers:
        write_loose(store, record(number))
    return store


def sums(store: FolderStore) -> tuple[int, float]:
    with Catalogue(store) as catalogue:
        sql = "SELECT count(*), sum(value) FROM parameters"
        n, total = catalogue.query(sql).fetchall()[0]
        assert catalogue.counts() == {"fitted": n}
    return n, total


def test_a_record_keeps_its_values_and_a_broken_one_is_seen() -> None:
    content = record(1).to_bytes()
    again = LogRecord.from_bytes(content)
    assert again.to_bytes() == content
    assert again.rows["parameters"][0]["value"] == -4.0
    for broken in (content[:-20], b"{}", content.replace(b"-4.0", b'"x"'), b"\xff"):
        with pytest.raises(DataError):
            LogRecord.from_bytes(broken)


def test_compaction_changes_no_answer(tmp_path: Path) -> None:
    store = filled(tmp_path, range(7))
    before, live = sums(store), LiveLogs(store)
    part = compact(store)
    assert part is not None
    assert (part.n_logs, part.outcomes) == (7, {"fitted": 7})
    assert loose_logs(store) == []
    write_loose(store, record(7))
    assert sums(store) == (8, before[1] - 10.0)
    known = KnownLogs(store, read_parts(store)[0])
    assert known.in_parts(record(3).log)
    assert not known.in_parts(record(7).log)
    assert known(record(7).log)
    # A process that began before another run compacted would take these again.
    assert live(record(3).log)
    assert not live(record(8).log)
    with Catalogue(store) as catalogue:
        sql = "SELECT DISTINCT typeof(flown_at), typeof(value) FROM parameters"
        assert catalogue.query(sql).fetchall() == [("TIMESTAMP", "DOUBLE")]
        assert catalogue.query("SELECT lower FROM covariances").fetchall()[0] == ([0.01],)


def test_a_crash_between_compaction_and_deletion_counts_no_row_twice(tmp_path: Path) -> None:
    store = filled(tmp_path, range(5))
    expected = sums(store)
    compact(store)
    for number in (1, 4):
        write_loose(store, record(number))
    assert sums(store) == expected
    assert compact(store) is None
    assert loose_logs(store) == []


def test_parts_without_manifest_count_nowhere_and_overlapping_ones_once(tmp_path: Path) -> None:
    store = filled(tmp_path, range(4))
    expected = sums(store)
    first = compact(store)
    assert first is not None
    write_loose(store, record(0))
    write_loose(store, record(9))
    # Another operator of a bucket, who saw no part yet, compacts two of the same logs.
    hidden = store.read(f"{PARTS}/{first.name}/{MANIFEST}")
    store.remove(f"{PARTS}/{first.name}/{MANIFEST}")
    assert sums(store)[0] == 2
    compact(store)
    store.write(f"{PARTS}/{first.name}/{MANIFEST}", hidden)
    assert sums(store) == (5, expected[1] - 12.0)


def test_small_parts_are_merged_and_logs_forgotten(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    assert MOST_SMALL == 8
    for number in range(9):
        write_loose(store, record(number))
        compact(store)
    expected = sums(store)
    (joined,) = merge(store)
    assert [part.name for part in read_parts(store)[0]] == [joined.name]
    assert sums(store) == expected
    rewrite(store, [joined], frozenset({record(2).log}))
    assert sums(store) == (expected[0] - 1, expected[1] + 5.0)


def test_broken_files_go_to_quarantine_and_are_told(tmp_path: Path) -> None:
    store = filled(tmp_path, range(3))
    path = tmp_path / loose_name(record(1).log)
    path.write_bytes(path.read_bytes()[:100])
    with Catalogue(store) as catalogue:
        assert catalogue.counts() == {"failed": 1, "fitted": 2}
        kinds = catalogue.query("SELECT kind FROM failures").fetchall()
    assert kinds == [("record",)]
    assert [name[:64] for name in store.names("quarantine")] == [record(1).log]
    part = compact(store)
    assert part is not None
    assert loose_logs(store) == [record(1).log], "a broken record stays loose, to be run again"
    file = tmp_path / part.file("parameters")
    file.write_bytes(file.read_bytes()[:-9])
    parts, broken = read_parts(store)
    assert (parts, broken) == ([], [part.name])
    (reason,) = fleet_status(_placed(store, tmp_path)).reasons
    assert (reason.reason, reason.action) == ("record", "flightid fleet run takes the log again")


def _placed(store: FolderStore, folder: Path) -> str:
    """A catalogue's place whose present records are those of a store."""
    place = folder / "place"
    (place / "abc").parent.mkdir()
    (place / "abc").symlink_to(store.root)
    (place / "fleet.json").write_text('{"current": "abc"}')
    return str(place)


def test_an_answer_without_damaged_parts_is_red(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store = filled(tmp_path, range(3))
    part = compact(store)
    assert part is not None
    file = tmp_path / part.file("parameters")
    file.write_bytes(file.read_bytes()[:-9])
    place = _placed(store, tmp_path)
    said = "1 part of the catalogue damaged: the logs in it are in no answer"
    assert run(["fleet", "report", place]) == 1
    assert said in " ".join(capsys.readouterr().out.split())
    assert run(["fleet", "query", place, "select count(*), 'nan'::double from logs", "--json"]) == 1
    told = capsys.readouterr()
    assert said in told.err
    assert json.loads(told.out) == [[0, None]]


@pytest.mark.parametrize("at", [0, 40, -10])
def test_a_part_with_a_flipped_byte_goes_to_quarantine_and_the_rest_counts(
    tmp_path: Path, at: int
) -> None:
    store = filled(tmp_path, range(3))
    part = compact(store)
    assert part is not None
    write_loose(store, record(7))
    file = tmp_path / part.file("logs")
    content = bytearray(file.read_bytes())
    content[at] ^= 0xFF
    file.write_bytes(content)
    assert sums(store) == (1, -10.0)
    assert set_aside(store) == [part.name]
    assert read_parts(store) == ([], [])
    assert f"{part.name}.logs.parquet" in set(store.names("quarantine"))
    assert not any(map(KnownLogs(store, []).in_parts, [record(0).log]))


def test_a_manifest_that_lies_costs_its_own_part_alone(tmp_path: Path) -> None:
    store = filled(tmp_path, range(3))
    part = compact(store)
    assert part is not None
    place = f"{PARTS}/{part.name}/{MANIFEST}"
    good = json.loads(store.read(place))
    changes: list[Callable[[dict[str, Any]], object]] = [
        lambda m: m.pop("sizes"),
        lambda m: m.update(sizes={}),
        lambda m: m["sizes"].update({"\ud800": 1}),
        lambda m: m["sizes"].update({"logs.keys": 33}),
        lambda m: m["rows"].update(logs=4),
        lambda m: m.update(name="another"),
        lambda m: m["digests"].update({"logs.keys": "0" * 64}),
    ]
    for change in changes:
        broken = json.loads(json.dumps(good))
        change(broken)
        store.write(place, json.dumps(broken).encode())
        assert read_parts(store) == ([], [part.name])
    for content in (
        b"[" * 100_000,
        json.dumps(good).encode().replace(b'"logs": 3', b'"logs": 1e400'),
    ):
        store.write(place, content)
        assert read_parts(store) == ([], [part.name])
    # One that says that it stands in place of itself stands all the same.
    store.write(place, json.dumps({**good, "replaces": [part.name]}).encode())
    assert [each.name for each in read_parts(store)[0]] == [part.name]
    store.write("fleet.json", b"[" * 100_000)
    with pytest.raises(DataError, match="no catalogue"):
        opened_store(str(tmp_path))


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("duration_s", 10**400),
        ("duration_s", 2**53 + 1),
        ("bytes", 2**70),
        ("flown_at", "2026-03-01T00:00:00+02:00"),
        ("flown_at", "2026-W10-1"),
        ("vehicle", "\ud800"),
    ],
)
def test_a_value_that_no_table_can_hold_goes_to_quarantine(
    tmp_path: Path, column: str, value: object
) -> None:
    store = filled(tmp_path, range(2))
    values = json.loads(record(1).to_bytes())
    values["tables"]["logs"][0][values["columns"]["logs"].index(column)] = value
    store.write(loose_name(record(1).log), json.dumps(values).encode())
    with Catalogue(store) as catalogue:
        assert catalogue.counts() == {"failed": 1, "fitted": 1}


def test_an_answer_has_a_limit_of_time_and_writes_nowhere(tmp_path: Path) -> None:
    with Catalogue(filled(tmp_path, range(2))) as catalogue:
        begun = time.monotonic()
        with pytest.raises(OptionError, match="too long"):
            catalogue.answer(
                "SELECT count(*) FROM range(1e9::BIGINT) a, range(1e9::BIGINT) b", time_s=0.2
            )
        assert time.monotonic() - begun < 20.0
        ((folder, now),) = catalogue.answer("SELECT current_setting('temp_directory'), now()").rows
    assert folder == ""
    assert str(now).startswith("20")


@pytest.mark.parametrize(
    "sql",
    [
        "SELECT * FROM read_csv('/etc/passwd')",
        "SELECT * FROM read_text('/etc/hostname')",
        "COPY (SELECT 1) TO 'out.csv'",
        "INSTALL httpfs",
        "LOAD httpfs",
        "ATTACH 'other.db'",
        "SET enable_external_access = true",
        "SELECT nothing FROM logs",
        "DROP VIEW logs; DELETE FROM loose_logs",
    ],
)
def test_sql_reads_the_catalogue_and_nothing_else(tmp_path: Path, sql: str) -> None:
    store = filled(tmp_path / "own", range(2))
    compact(store)
    with Catalogue(store) as catalogue:
        with pytest.raises(OptionError):
            catalogue.query(sql).fetchall()
        assert catalogue.answer("SELECT count(*) AS n FROM logs").rows == ((2,),)


def test_the_newest_record_of_a_log_counts_over_studies_and_versions(tmp_path: Path) -> None:
    """Two sets under one catalogue: what the present one lacks comes from the one before."""
    note = {"schema": "flightid.fleet_place/1", "current": "b" * 12, "title": ""}
    (tmp_path / "fleet.json").write_text(json.dumps(note))
    old, new = (FolderStore(tmp_path / (letter * 12)) for letter in "ab")
    for number in range(4):
        write_loose(old, record(number))
    compact(old)
    for number, value in ((1, -50.0), (9, -60.0)):
        made = record(number)
        made.rows["parameters"][0]["value"] = value  # type: ignore[index]
        write_loose(new, made)
    compact(new)
    sql = "SELECT sum(value), count(*) FROM parameters"
    with open_catalogue(tmp_path) as catalogue:
        assert catalogue.query(sql).fetchall() == [(-110.0, 2)]
    with open_catalogue(tmp_path, earlier=True) as catalogue:
        assert catalogue.query(sql).fetchall() == [(-110.0 - 3.0 - 5.0 - 6.0, 5)]
        found = dict(catalogue.query("SELECT recipe, count(*) FROM logs GROUP BY 1").fetchall())
    assert found == {"a" * 12: 3, "b" * 12: 2}
    # The older set's record of a log counts again once it is written anew.
    write_loose(old, record(1))
    rewrite(old, read_parts(old)[0], frozenset({record(1).log}))
    with open_catalogue(tmp_path, earlier=True) as catalogue:
        assert catalogue.query(sql).fetchall() == [(-60.0 - 3.0 - 4.0 - 5.0 - 6.0, 5)]


def test_questions_end_in_time_and_answers_at_a_length(tmp_path: Path) -> None:
    store = filled(tmp_path, range(3))
    endless = "SELECT sum(a.range * b.range) FROM range(10000000) a, range(10000000) b"
    with Catalogue(store) as catalogue:
        begun = time.monotonic()
        with pytest.raises(OptionError, match="takes too long"):
            catalogue.query(endless, time_s=0.3)
        assert time.monotonic() - begun < 20.0
        with pytest.raises(OptionError, match="more than 2 rows"):
            catalogue.query("SELECT * FROM logs", most_rows=2)
        found = catalogue.query("SELECT * FROM logs", most_rows=3)
        assert len(found.fetchall()) == len(found.fetchall()) == 3


@pytest.mark.skipif(sys.platform != "linux", reason="no bound elsewhere")
def test_a_question_on_the_command_line_cannot_take_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FLIGHTID_MEMORY_MIB", "200")
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_AS)
    with Catalogue(filled(tmp_path, range(1))) as catalogue, bounded_memory():
        with pytest.raises(MemoryError):
            bytearray(1 << 40)
        with pytest.raises(OptionError, match=r"cannot answer|too long"):
            catalogue.query("SELECT unnest(range(2000000000))", time_s=5.0)
        # DuckDB advises to SET what is locked here, in words that reached whoever asked.
        full = "SELECT string_agg(repeat('x', 1000000), '') FROM range(100000)"
        with pytest.raises(OptionError, match=r"cannot answer.*more memory \(--memory\)") as told:
            catalogue.query(full, time_s=30.0)
        assert "SET" not in str(told.value)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_a_question_that_lets_go_of_nothing_does_not_hold_whoever_asks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """DuckDB looks at an interruption between steps alone; this stands for one endless step."""
    monkeypatch.setattr("flightid.fleet.catalogue.on_time.GRACE_S", 0.05)
    over, said = threading.Event(), []

    class Connection:
        def interrupt(self) -> None:
            said.append("interrupted")

        def close(self) -> None:
            said.append("closed")

    timed = TimedConnection(Connection())
    assert timed.work_out(lambda: 3, 5.0) == 3
    with pytest.raises(ZeroDivisionError):
        timed.work_out(lambda: 1 // 0, 5.0)
    with pytest.raises(TimeoutError, match=r"no answer after 0\.01 s"):
        timed.work_out(over.wait, 0.01)
    assert timed.is_held
    with pytest.raises(TimeoutError, match="still being worked out"):
        timed.work_out(lambda: 3, 5.0)
    timed.close()
    assert said == ["interrupted"]
    over.set()
    for _ in range(500):
        if said[-1] == "closed":
            break
        time.sleep(0.01)
    assert said == ["interrupted", "closed"]
    assert timed.work_out(lambda: 3, 5.0) == 3
