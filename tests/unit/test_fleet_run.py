"""A fleet from logs to answers: nine logs of four vehicles, and processes that misbehave."""

from __future__ import annotations

import datetime
import errno
import hashlib
import importlib.util
import os
import shutil
import signal
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

import pytest
from click.testing import CliRunner

from flightid.cli.fleet import command
from flightid.errors import DataError, StudyError
from flightid.fleet import ask_fleet, fleet_status, run_fleet
from flightid.fleet.addresses import LogAddress, find_logs
from flightid.fleet.catalogue.loose import write_loose
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.engine import plain
from flightid.fleet.engine.interrupts import interrupts_held
from flightid.fleet.engine.order import (
    KILLED,
    STORAGE,
    LogOrder,
    LogOutcome,
    RunOrder,
    run_order,
)
from flightid.fleet.engine.sandbox import DEAD, MEMORY, TIME, Sandbox
from flightid.fleet.identity import FleetTables, read_tables
from flightid.fleet.missing import missing_logs
from flightid.fleet.opening import current_store, open_catalogue
from flightid.fleet.page import fleet_words
from flightid.fleet.run_one import NAMING, LogTask, run_one
from flightid.fleet.settings import read_fleet
from flightid.fleet.shares import copy_lines

EXAMPLE = Path(__file__).parents[2] / "examples" / "fleet"


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example with eight flights of four vehicles and an empty log, not run yet."""
    folder = tmp_path_factory.mktemp("fleet")
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(EXAMPLE / name, folder)
    _example().main(folder / "logs", 4, 2)
    (folder / "logs" / "V03-2026-01-29.bin").write_bytes(b"")
    return folder / "fleet.toml"


def _example() -> Any:
    """The script of the example."""
    specification = importlib.util.spec_from_file_location("fly", EXAMPLE / "fly.py")
    assert specification is not None
    assert specification.loader is not None
    fly = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(fly)
    return fly


@pytest.fixture
def order(fleet: Path, tmp_path: Path) -> RunOrder:
    settings = read_fleet(fleet)
    return run_order(settings, read_tables(settings), str(tmp_path / "catalogue"))


@pytest.fixture
def hanging(tmp_path: Path) -> Iterator[LogAddress]:
    """A log that never ends: a pipe to which nobody writes."""
    pipe = tmp_path / "V01-hangs.bin"
    os.mkfifo(pipe)
    yield LogAddress(str(pipe), 0, "1", 0.0)
    pipe.unlink()


def test_one_log_gives_the_same_record_every_time(fleet: Path) -> None:
    task = LogTask(read_fleet(fleet))
    (address, *_) = find_logs([str(fleet.parent / "logs")])
    first, second = (run_one(address, task) for _ in range(2))
    assert first is not None
    assert second is not None
    for name, rows in first.rows.items():
        for one, other in zip(rows, second.rows[name], strict=True):
            changed = {key for key in one if one[key] != other[key]}
            assert changed <= {"processor_s", "memory_bytes"}
    row = {each["name"]: each for each in first.rows["parameters"]}["T_m"]
    truth = _example().vehicle(0, 0, datetime.date(2026, 1, 5)).motor_lag_s
    assert abs(row["value"] - truth) < 3.0 * row["stderr"] < 0.5 * truth
    assert (row["vehicle"], row["type"]) == ("V00", "450 mm quadrotor")
    places = [each["position"] for each in first.rows["parameters"]]
    (covariance,) = first.rows["covariances"]
    names = [each["name"] for each in first.rows["parameters"]]
    assert [covariance["names"][place] for place in places] == names
    diagonal = [covariance["lower"][i * (i + 3) // 2] for i in places]
    told = [each["stderr"] ** 2 for each in first.rows["parameters"]]
    assert diagonal == pytest.approx(told)
    assert {each["name"] for each in first.rows["margins"]} >= {"phase margin", "gain margin"}
    assert run_one(address, replace(task, known=lambda log: log == first.log)) is None


def test_a_fleet_is_run_once_and_then_only_for_what_is_missing(
    fleet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    done = run_fleet(fleet, workers=1)
    assert (done.found, done.kept, done.outcomes) == (9, 0, {"fitted": 8, "refused": 1})
    # A copy under another name is known by its bytes; nothing else is read again.
    logs = fleet.parent / "logs"
    shutil.copy(logs / "V00-2026-01-05.bin", logs / "V00-copy.bin")
    monkeypatch.setattr("flightid.fleet.engine.sandbox.ONE_THREAD", ())
    again = run_fleet(fleet, workers=1)
    assert (again.found, again.kept, again.outcomes) == (10, 10, {})
    status = fleet_status(fleet)
    assert status.outcomes == {"fitted": 8, "refused": 1}
    pytest.importorskip("duckdb")
    with open_catalogue(fleet) as catalogue:
        sql = "SELECT vehicle, count(*) FROM parameters WHERE name = 'T_m' GROUP BY ALL ORDER BY 1"
        assert catalogue.query(sql).fetchall() == [("V00", 2), ("V01", 2), ("V02", 2), ("V03", 2)]
        ((reason, message),) = catalogue.query(
            "SELECT reason, message FROM logs WHERE outcome = 'refused'"
        ).fetchall()
    assert reason == "empty-file"
    assert "empty file" in message


def test_a_log_that_hangs_is_ended_by_the_clock(
    order: RunOrder, hanging: LogAddress, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with Sandbox(replace(order, time_s=1.0)) as box:
        outcome = box.run(LogOrder(hanging))
        assert (outcome.outcome, outcome.reason, outcome.stage) == (KILLED, TIME, "address")
        assert "1 s" in outcome.message
        assert box.pid is None
    assert not list(Path(tempfile.gettempdir()).glob("flightid-order-*"))


def test_a_process_that_dies_is_named_by_its_signal(order: RunOrder, hanging: LogAddress) -> None:
    with Sandbox(order) as box:
        ended = threading.Thread(target=_kill, args=(box,))
        ended.start()
        outcome = box.run(LogOrder(hanging))
        ended.join()
    assert (outcome.outcome, outcome.reason) == (KILLED, DEAD)
    assert outcome.signal == signal.SIGKILL
    assert "SIGKILL" in outcome.message


def _kill(box: Sandbox) -> None:
    while box.pid is None:
        time.sleep(0.01)
    time.sleep(0.5)
    os.kill(box.pid, signal.SIGKILL)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="limits of address space are Linux's")
def test_a_log_that_eats_memory_costs_itself_alone(fleet: Path, order: RunOrder) -> None:
    (address, *_) = find_logs([str(fleet.parent / "logs")])
    with Sandbox(replace(order, memory_mib=256)) as box:
        outcome = box.run(LogOrder(address))
    assert outcome.outcome in ("failed", KILLED)
    assert outcome.reason == MEMORY


def test_a_process_is_replaced_when_it_is_worn(order: RunOrder, fleet: Path) -> None:
    empty = LogAddress(str(fleet.parent / "logs" / "V03-2026-01-29.bin"), 0, "1", 0.0)
    with Sandbox(replace(order, recycle=2)) as box:
        seen = []
        for number in range(3):
            outcome = box.run(LogOrder(replace(empty, stamp=str(number))))
            seen.append((outcome.outcome, box.pid))
    # The second and third are the bytes of the first.
    assert [outcome for outcome, _ in seen] == ["refused", "known", "known"]
    assert seen[0][1] == seen[1][1] != seen[2][1]


def test_a_log_that_killed_twice_is_recorded_with_its_vehicle(
    fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(fleet.parent / name, tmp_path)
    (tmp_path / "logs").mkdir()
    shutil.copy(fleet.parent / "logs" / "V02-2026-01-07.bin", tmp_path / "logs")
    text = (tmp_path / "fleet.toml").read_text().replace("time_s = 300", "time_s = 0.001")
    (tmp_path / "fleet.toml").write_text(text)
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    assert run_fleet(tmp_path / "fleet.toml", workers=1).outcomes == {"failed": 1}
    assert run_fleet(tmp_path / "fleet.toml", workers=1).kept == 1
    (tmp_path / "fleet.toml").write_text(text.replace("0.001", "300"))
    retried = run_fleet(tmp_path / "fleet.toml", workers=1, retry=True)
    assert (retried.kept, retried.outcomes) == (0, {"fitted": 1})
    assert fleet_status(tmp_path / "fleet.toml").outcomes == {"fitted": 1}


def test_the_window_keeps_a_long_list_from_being_read_ahead(
    order: RunOrder, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Idle(Sandbox):
        def run(self, order: LogOrder) -> object:  # type: ignore[override]
            return order

    monkeypatch.setattr(plain, "Sandbox", Idle)
    taken = []

    def logs() -> Iterator[LogOrder]:
        for number in range(100):
            taken.append(number)
            yield LogOrder(LogAddress(f"{number}.bin", 0, ""))

    results = plain.run_plain(order, logs(), 2)
    next(iter(results))
    assert len(taken) <= 2 * plain.WINDOW + 1
    assert len(list(results)) == 99
    assert FleetTables().told("V1", "a.bin") == ""


def test_a_full_disk_ends_the_run_and_blames_no_log(
    fleet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    (address, *_) = find_logs([str(fleet.parent / "logs")])
    with monkeypatch.context() as patch:
        patch.setattr("flightid.fleet.run_one.read_log", full)
        with pytest.raises(OSError, match="No space left"):
            run_one(address, LogTask(read_fleet(fleet)))
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(fleet.parent / name, tmp_path)
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "V01-20260301.bin").write_bytes(b"no log")
    said = LogOutcome(LogOrder(address), STORAGE, "", message="No space left on device")
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    monkeypatch.setattr("flightid.fleet.run.run_plain", lambda *_: iter([said]))
    with pytest.raises(DataError, match="run the fleet again"):
        run_fleet(tmp_path / "fleet.toml")
    monkeypatch.setattr("flightid.fleet.run.current_store", full)
    with pytest.raises(DataError, match="run the fleet again"):
        run_fleet(tmp_path / "fleet.toml")


def test_what_is_no_file_is_a_failure_of_its_own(fleet: Path, tmp_path: Path) -> None:
    Path(tmp_path, "good.bin").write_bytes(b"no log")
    Path(tmp_path, "dangling.bin").symlink_to(tmp_path / "gone")
    Path(tmp_path, "zero.bin").symlink_to("/dev/zero")
    os.mkfifo(tmp_path / "pipe.bin")
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.bin")).write_bytes(b"no log")
    found = {each.name: each for each in find_logs([str(tmp_path)])}
    problems = {name: each.problem for name, each in found.items()}
    assert problems.pop("good.bin") == ""
    assert set(problems) == {"dangling.bin", "zero.bin", "pipe.bin", "\\xff.bin"}
    task = LogTask(read_fleet(fleet))
    for name, problem in problems.items():
        made = run_one(found[name], task)
        assert made is not None
        assert problem
        assert problem in made.rows["failures"][0]["message"]
        # Counted with files that are no logs, a broken link had their next step.
        row = made.rows["logs"][0]
        assert (row["reason"], row["action"]) == ("not-readable", "mend or remove it")
        assert LogRecord.from_bytes(made.to_bytes()).outcome == "refused"


def test_a_log_longer_than_the_fleet_allows_is_refused(fleet: Path, tmp_path: Path) -> None:
    with (tmp_path / "long.bin").open("wb") as file:
        file.truncate((1 << 20) + 1)
    settings = read_fleet(fleet)
    task = LogTask(replace(settings, limits=replace(settings.limits, log_mib=1)))
    made = run_one(find_logs([str(tmp_path)])[0], task)
    assert made is not None
    assert "at most 1 MiB" in made.rows["failures"][0]["message"]


def test_a_pattern_that_backtracks_is_named_and_blamed_on_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each log took all its time, and stood as one that is not done after time_s."""
    (tmp_path / f"{'a' * 60}.bin").write_bytes(b"no log")
    text = "[fleet]\ntitle = 't'\nlogs = ['.']\n[vehicles]\nby = 'name'\npattern = '^(a*)*_'\n"
    (tmp_path / "fleet.toml").write_text(text)
    monkeypatch.setattr("flightid.fleet.pattern_clock.LEAST_S", 0.05)
    with pytest.raises(StudyError, match=r"pattern does not come to an end: found '\^\(a\*\)\*_'"):
        run_fleet(tmp_path / "fleet.toml")
    assert signal.getsignal(signal.SIGVTALRM) == signal.SIG_DFL
    assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0.0, 0.0)
    # Where there is no such clock the process of the log has one, and says what it was at.
    monkeypatch.setattr("flightid.fleet.pattern_clock._has_clock", lambda: False)
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    monkeypatch.setattr("flightid.fleet.identity.re.search", never)
    monkeypatch.setattr("flightid.fleet.run.run_plain", killed)
    assert run_fleet(tmp_path / "fleet.toml").outcomes == {"failed": 1}
    with open_catalogue(tmp_path / "fleet.toml") as catalogue:
        ((told,),) = catalogue.query("SELECT action FROM logs").fetchall()
    assert told.startswith("write the pattern of [vehicles] so that it comes to an end")


def never(*_: object) -> None:
    raise AssertionError("a pattern of the user in the parent")


def killed(_: RunOrder, logs: list[LogOrder], __: int | None) -> Iterator[LogOutcome]:
    return (LogOutcome(log, KILLED, log.address.digest, TIME, stage=NAMING) for log in logs)


def test_an_address_has_one_record_that_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.bin").write_bytes(b"first")
    (tmp_path / "fleet.toml").write_text("[fleet]\ntitle = 't'\nlogs = ['.']\n")
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    store = current_store(read_fleet(tmp_path / "fleet.toml"))

    def taken(_: RunOrder, logs: list[LogOrder], __: int | None) -> Iterator[LogOutcome]:
        for log in logs:
            made = run_one(log.address, LogTask(read_fleet(tmp_path / "fleet.toml")))
            assert made is not None
            write_loose(store, made)
            yield LogOutcome(log, made.outcome, made.log)

    monkeypatch.setattr("flightid.fleet.run.run_plain", taken)
    seen = os.stat(tmp_path / "a.bin")
    assert run_fleet(tmp_path / "fleet.toml").outcomes == {"refused": 1}
    (tmp_path / "a.bin").write_bytes(b"first and more")  # as `cp -p` leaves it: at the same instant
    os.utime(tmp_path / "a.bin", ns=(seen.st_mtime_ns, seen.st_mtime_ns))
    again = run_fleet(tmp_path / "fleet.toml")
    assert (again.kept, again.outcomes) == (0, {"refused": 1})
    assert [each.code for each in again.findings] == ["replaced-records", "nothing-fitted"]
    assert fleet_status(tmp_path / "fleet.toml").outcomes == {"refused": 1}
    assert run_fleet(tmp_path / "fleet.toml").kept == 1


def test_one_content_under_three_names_is_one_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "fleet.toml").write_text("[fleet]\ntitle = 't'\nlogs = ['.']\n")
    for name in ("a.bin", "b.bin", "c.bin"):
        (tmp_path / name).write_bytes(b"the same")
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    # Two at once may both be taken, the third then is known: either way there is one.
    done = run_fleet(tmp_path / "fleet.toml", workers=1)
    assert (done.found, done.kept, done.outcomes) == (3, 0, {"refused": 1})
    assert [each.code for each in done.findings] == ["copied-logs", "nothing-fitted"]
    assert done.findings[0].message.startswith("2 logs with the bytes of another")
    assert done.found == done.kept + sum(done.outcomes.values()) + len(done.copies)
    again = run_fleet(tmp_path / "fleet.toml", workers=1)
    assert (again.found, again.kept, again.outcomes) == (3, 3, {})
    # Three files of which one was refused and nothing was said of the others did not add up.
    (tmp_path / "d.bin").write_bytes(b"another")
    status = fleet_status(tmp_path / "fleet.toml")
    assert status.outcomes == {"refused": 1}
    shares = status.shares
    assert shares is not None
    assert (shares.outcomes, len(shares.copies), len(shares.waiting)) == ({"refused": 1}, 2, 1)
    assert status.found == 4
    (line,) = copy_lines(shares)
    assert line.startswith("  2 copies: ")
    first = PurePosixPath(next(iter(shares.copies.values()))).name
    assert f".bin is {first}, " in line
    # One that was moved keeps its record; one that is gone is no copy of it.
    (tmp_path / first).rename(tmp_path / "moved.bin")
    (tmp_path / next(name for name in ("a.bin", "b.bin") if name != first)).unlink()
    after = fleet_status(tmp_path / "fleet.toml").shares
    assert after is not None
    assert (after.outcomes, len(after.copies), len(after.waiting)) == ({"refused": 1}, 1, 1)
    for name in ("moved.bin", "c.bin", "b.bin", "a.bin"):
        (tmp_path / name).unlink(missing_ok=True)
    none = fleet_status(tmp_path / "fleet.toml")
    assert none.shares is not None
    assert (none.shares.outcomes, len(none.shares.gone), none.reasons) == ({}, 1, ())
    # A fleet without one model is as red when nothing is left to take.
    assert [(each.code, each.light) for each in again.findings] == [("nothing-fitted", "red")]


def test_a_renamed_log_counts_under_its_new_name_and_a_deleted_one_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It kept its old vehicle for ever, and nothing said so; nor that deleted ones count."""
    pytest.importorskip("duckdb")
    fleet, logs = tmp_path / "fleet.toml", tmp_path / "logs"
    words = (
        "[fleet]\ntitle = 't'\nlogs = ['logs']\n[vehicles]\nby = 'name'\n"
        "pattern = '^(V[0-9]+)'\ntype = 'quad'\nflight_table = 'flights.csv'\n"
    )
    fleet.write_text(words)
    (tmp_path / "flights.csv").write_text("log,load_kg\nV01-20260105.bin,2\nV09-20260105.bin,3\n")
    logs.mkdir()
    for number in range(1, 5):
        (logs / f"V0{number}-20260105.bin").write_bytes(b"no log %d" % number)
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    assert run_fleet(fleet, workers=1).outcomes == {"refused": 4}
    (logs / "V01-20260105.bin").rename(logs / "V09-20260105.bin")
    (logs / "V02-20260105.bin").rename(logs / "V02-20260106.bin")
    (logs / "V04-20260105.bin").unlink()
    said = "2 logs have another name, 1 of them another vehicle than in the catalogue: "
    for found in (fleet_status(fleet).findings, ask_fleet(fleet).outdated):
        assert [each.code for each in found] == ["renamed-logs", "gone-logs"]
        assert found[0].message.startswith(said)
        assert "V01-20260105.bin is V09-20260105.bin now (vehicle V01, now V09)" in found[0].message
        assert found[0].action == "flightid fleet run takes the new ones"
        assert found[1].message.startswith("1 record of a log that is gone from the places")
    # The record follows though no log is read for it: of a part as of loose files.
    monkeypatch.setattr("flightid.fleet.identity.log_start", never)
    done = run_fleet(fleet, workers=1)
    assert (done.found, done.kept, done.outcomes) == (3, 3, {})
    assert [each.code for each in done.findings][:2] == ["renamed-logs", "gone-logs"]
    assert "now, and so in the catalogue: V01-" in done.findings[0].message
    with open_catalogue(fleet) as catalogue:
        rows = catalogue.query("SELECT vehicle, flown_at, id FROM logs ORDER BY 1").fetchall()
        load = catalogue.query("SELECT vehicle, value FROM covariates").fetchall()
        failed = catalogue.query("SELECT DISTINCT vehicle FROM failures ORDER BY 1").fetchall()
    assert [(v, at.day, own) for v, at, own in rows] == [
        ("V02", 6, "V02"), ("V03", 5, "V03"), ("V04", 5, "V04"), ("V09", 5, "V09"),
    ]  # fmt: skip
    assert load == [("V09", 3.0)]
    assert failed == [("V02",), ("V03",), ("V04",), ("V09",)]
    assert [each.code for each in fleet_status(fleet).findings] == ["gone-logs"]
    told = run_fleet(fleet, workers=1, forget_gone=True)
    assert "taken out of the catalogue" in told.findings[0].message
    assert fleet_status(fleet).outcomes == {"refused": 3}
    # Another vehicle by the table: told before the next run takes it; other rules, too.
    (tmp_path / "flights.csv").write_text("log,vehicle\nV03-20260105.bin,N1\n")
    (told,) = fleet_status(fleet).findings
    assert "V03-20260105.bin (vehicle V03, now N1)" in told.message
    fleet.write_text(words.replace("quad", "hexa"))
    assert [each.code for each in fleet_status(fleet).findings] == [
        "earlier-records",
        "renamed-logs",
    ]


def test_swapped_logs_follow_their_bytes_and_touched_ones_are_as_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both names of a swap were there, so nothing followed; a touched log was renamed for ever."""
    pytest.importorskip("duckdb")
    fleet, logs = tmp_path / "fleet.toml", tmp_path / "logs"
    rules = "[vehicles]\nby = 'name'\npattern = '^(V[0-9]+)'\ntype = 'quad'\n"
    fleet.write_text("[fleet]\ntitle = 't'\nlogs = ['logs']\n" + rules)
    logs.mkdir()
    one, other, copied = (logs / f"V0{n}-20260105.bin" for n in (1, 2, 3))
    for n, path in enumerate((one, other, copied)):
        path.write_bytes(b"no log %d" % n)
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    assert run_fleet(fleet, workers=1).outcomes == {"refused": 3}
    before = hashlib.sha256(one.read_bytes()).hexdigest()
    for path, to in ((one, logs / "t"), (other, one), (logs / "t", other)):
        path.rename(to)
    # The original of a copy is touched: its record is not the copy's.
    shutil.copy(copied, logs / "V00-20260105.bin")
    os.utime(copied, (1.0, 1.0))
    said = fleet_status(fleet)
    assert said.shares is not None
    assert {(each.vehicle_before, each.vehicle_now) for each in said.shares.renamed} == {
        ("V01", "V02"), ("V02", "V01"),
    }  # fmt: skip
    assert [PurePosixPath(each).name for each in said.shares.copies] == ["V00-20260105.bin"]
    assert fleet_words(ask_fleet(fleet)).startswith("3 logs and 1 copy of them, 0 with a model")
    # No process is begun for bytes that have a record, and no bar.
    monkeypatch.setattr("flightid.fleet.run._Run._taken", never)
    monkeypatch.setattr("flightid.fleet.run.progress", never)
    done = run_fleet(fleet, workers=1)
    assert (done.found, done.kept, done.outcomes) == (4, 4, {})
    assert done.findings[0].message.startswith("2 logs have another vehicle now")
    with open_catalogue(fleet) as catalogue:
        rows = catalogue.query("SELECT log, vehicle FROM logs ORDER BY 2").fetchall()
    assert [vehicle for _, vehicle in rows] == ["V01", "V02", "V03"]
    assert rows[1][0] == before
    said = CliRunner().invoke(command, ["run", str(fleet)]).output
    assert said.startswith("4 logs, all in the catalogue before: nothing new\n")
    for found in (fleet_status(fleet).findings, run_fleet(fleet, workers=1).findings):
        assert "renamed-logs" not in [each.code for each in found]
    settings = read_fleet(fleet)
    tables = read_tables(settings)
    left = missing_logs(current_store(settings), find_logs([str(logs)]), tables, retry=False)
    assert [each.name for each in left.addresses] == ["V00-20260105.bin"], "the copy alone"


def test_tables_of_vehicles_and_flights_reach_every_log(fleet: Path, tmp_path: Path) -> None:
    """A worker has no tables beside it: their lines come with each log."""
    (log, *_) = sorted((fleet.parent / "logs").glob("V00-*.bin"))
    (tmp_path / "logs").mkdir()
    shutil.copy(log, tmp_path / "logs")
    shutil.copy(fleet.parent / "study.toml", tmp_path)
    (tmp_path / "tails.csv").write_text("id,vehicle,payload_kg\nV00,N\x1b[31m1,0.4\n")
    (tmp_path / "flights.csv").write_text(f"log,flown_at\n{log.name},2026-02-03T10:00\n")
    words = (
        '[fleet]\ntitle = "t"\nlogs = ["logs"]\nstudy = "study.toml"\n[vehicles]\nby = "name"\n'
        'pattern = "(V[0-9]+)"\ntable = "tails.csv"\nflight_table = "flights.csv"\n'
    )
    (tmp_path / "fleet.toml").write_text(words)
    assert run_fleet(tmp_path / "fleet.toml", workers=1).outcomes == {"fitted": 1}
    with open_catalogue(tmp_path / "fleet.toml") as catalogue:
        answer = catalogue.answer("select vehicle, flown_at from logs")
    assert answer.rows[0][0] == "N\x1b[31m1"
    assert "2026-02-03 10:00" in str(answer)
    assert "\x1b" not in str(answer)  # a terminal obeys no name


def test_a_run_in_which_all_fails_says_so(fleet: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def dead(order: RunOrder, logs: list[LogOrder], workers: int | None) -> list[LogOutcome]:
        return [LogOutcome(each, "failed", each.address.address) for each in logs]

    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda name: None)
    monkeypatch.setattr("flightid.fleet.run.run_plain", dead)
    # Copies of what is known are no logs that are taken: one that is none of them.
    (fleet.parent / "logs" / "V03-2026-02-05.bin").write_bytes(b"another")
    done = run_fleet(fleet)
    assert [each.code for each in done.findings if each.light == "red"] == ["all-failed"]


def test_an_interrupt_tells_how_far_it_came_and_reaches_no_worker(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C printed where Dask and every worker stood, and nothing of what is kept."""
    blocked = []

    def held() -> None:
        """What a thread has, and so each process that it begins."""
        with interrupts_held():
            os.kill(os.getpid(), signal.SIGINT)
            asked = threading.Thread(
                target=lambda: blocked.extend(signal.pthread_sigmask(signal.SIG_BLOCK, []))
            )
            asked.start()
            asked.join()

    # Behind a shell's `&` the tests themselves run with it ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            held()
        assert signal.SIGINT in blocked
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        held()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
    for name in ("a.bin", "b.bin", "c.bin"):
        (tmp_path / name).write_bytes(name.encode())
    (tmp_path / "fleet.toml").write_text("[fleet]\ntitle = 't'\nlogs = ['.']\n")

    def stopped(order: RunOrder, logs: list[LogOrder], _: int | None) -> Iterator[LogOutcome]:
        yield LogOutcome(logs[0], "refused", order.claimant)
        raise KeyboardInterrupt

    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    monkeypatch.setattr("flightid.fleet.run.run_plain", stopped)
    with pytest.raises(KeyboardInterrupt, match="1 of 3 logs in the catalogue; the same command"):
        run_fleet(tmp_path / "fleet.toml")


def _claimed(monkeypatch: pytest.MonkeyPatch, folder: Path, name: str) -> tuple[Any, LogAddress]:
    """A fleet of three logs of which another run, on another machine, is at one."""
    (folder / "fleet.toml").write_text("[fleet]\ntitle = 't'\nlogs = ['.']\n")
    for number in range(3):
        (folder / f"{number}.bin").write_bytes(b"no log %d" % number)
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    store = current_store(read_fleet(folder / "fleet.toml"))
    address = next(e for e in find_logs([str(folder)]) if e.name == name)
    told = b'{"run": "other", "host": "far away", "pid": 1, "n": 1}'
    store.write(f"claims/{address.digest}.json", told)
    return store, address


def test_a_log_that_another_run_takes_is_left_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store, address = _claimed(monkeypatch, tmp_path, "1.bin")
    task = LogTask(read_fleet(tmp_path / "fleet.toml"))

    def meanwhile(_: float) -> None:  # The other run is done with it.
        made = run_one(address, task)
        assert made is not None
        write_loose(store, made)
        store.remove(f"claims/{address.digest}.json")

    monkeypatch.setattr("flightid.fleet.run.sleep", meanwhile)
    done = run_fleet(tmp_path / "fleet.toml", workers=1)
    assert (done.found, done.kept, done.outcomes) == (3, 1, {"refused": 2})
    assert fleet_status(tmp_path / "fleet.toml").outcomes == {"refused": 3}
    assert not list(store.names("claims")), "a run leaves no claim behind"


def test_a_log_whose_run_is_gone_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _claimed(monkeypatch, tmp_path, "1.bin")
    waited = list[float]()
    monkeypatch.setattr("flightid.fleet.run.sleep", waited.append)
    monkeypatch.setattr("flightid.fleet.engine.claims.STALE_S", 1e-3)
    done = run_fleet(tmp_path / "fleet.toml", workers=1)
    assert (done.found, done.kept, done.outcomes) == (3, 0, {"refused": 3})
    assert waited
