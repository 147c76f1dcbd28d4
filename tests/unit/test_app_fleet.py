"""The screen Fleet's answers: those of the command, with its limits, and nothing from elsewhere."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")
pytest.importorskip("duckdb", reason="the extra fleet is not installed")

import flightid as fid
from flightid.app import fleet_routes, fleet_work
from flightid.app.fleet_schemas import FleetHappening, FleetPart, FleetRunPart, FleetScreen
from flightid.app.fleets import checked_fleet, fleet_of, known_fleets, log_folders
from flightid.app.server import make_server
from flightid.app.workspace import Workspace
from flightid.errors import OptionError, StudyError
from tests.closeness import assert_close
from tests.fleet_workspace import write_fleet
from tests.sweep_log import SweepFlight

if TYPE_CHECKING:
    from flightid.app.backstage import Backstage


def test_the_page_says_of_a_fleet_what_its_report_says(tmp_path: Path) -> None:
    log = SweepFlight(sweep_s=4.0, rate_hz=50.0).write(tmp_path)
    path = write_fleet(tmp_path, log)
    part = FleetPart(**fleet_work.answer_fleet(path))
    answers = fid.fleet.ask_fleet(path)
    assert (part.title, part.words) == ("Survey", fid.fleet.fleet_report(path).subtitle)
    lights = {each.name: each.finding.light for each in part.vehicles}
    # What the event explains is told, and is neither red nor makes the newest flight odd.
    assert (lights["v00"], lights["v01"], lights["v02"]) == ("red", "unknown", "unknown")
    said = next(each.finding.message for each in part.vehicles if each.name == "v02")
    assert "at the event “new motor”" in said
    (kind,) = part.types
    population = answers.types[0].population
    assert population is not None
    low, high = population.parameters["Ltphi"].next_vehicle.interval95 or (np.nan, np.nan)
    row = dict(zip(kind.tables[0].columns, kind.tables[0].rows[1], strict=True))
    assert (row["next vehicle low"], row["next vehicle high"]) == (low, high)
    assert (row["parameter"], row["symbol"]) == ("roll control power", "Ltphi")
    *_, changes, events, _ = kind.tables
    assert {each[1] for each in changes.rows} <= set(kind.labels.values())
    assert ("new motor", "v02") in {(each[0], each[1]) for each in events.rows}
    drift = answers.types[0].drift
    assert drift is not None
    # Verdict, lights and slopes of the report were nowhere on the page.
    assert part.verdict == fid.fleet.fleet_report(path).counted
    assert "repeats" in {each.code for each in kind.findings}
    assert "What covariates explain" in {each.title for each in kind.tables}
    # Its three refused logs are nowhere, and so are those of its flights.
    assert (
        "records of logs that are gone from the places of the fleet file" in part.refused.notes[-1]
    )
    first = part.histories[0]
    told = next(h for h in drift.histories if (h.vehicle, h.name) == (first.vehicle, first.name))
    assert first.changed
    # What a light speaks of has its picture before the least likely of what it does not.
    place = [(each.vehicle, each.name) for each in part.histories]
    moved = place.index(("v02", "Ltphi"))
    assert "at the event “new motor”" in part.histories[moved].words
    assert set(place[: moved + 1]) <= drift.cited
    assert first.values == told.values.tolist()
    assert_close(
        np.array(first.half), 1.959964 * np.sqrt(told.variances), rtol=1e-6, why="95 %, normal"
    )
    assert part.refused.rows[0][:3] == [2, "refused", "rate too low"]
    own = fleet_work.answer_vehicle(path, "v02")
    assert [each["name"] for each in own["histories"]] == ["Lp", "Ltphi"]
    assert own["histories"][1]["events"] == [(1769126400.0, "new motor")]
    assert not own["histories"][0]["changed"]
    assert own["histories"][0]["words"].startswith("80 % of steps by ")
    # A flight of the vehicle is known by the bytes of its log, as the workspace knows it.
    workspace = Workspace(tmp_path)
    workspace.scan()
    assert workspace.log_path(own["flights"][0]["log"][:16]) == log
    assert own["histories"][1]["logs"][-1] == own["flights"][0]["log"][:16]


def test_a_question_has_the_limits_of_the_command(tmp_path: Path) -> None:
    path = write_fleet(tmp_path, flights=4)
    asked = "select vehicle, count(*) as n, 2::hugeint ^ 70, 'nan'::double from logs group by all"
    told = fleet_work.query_fleet(path, f"{asked} order by 1")
    assert told["columns"][:2] == ["vehicle", "n"]
    assert [row[:2] for row in told["rows"]] == [["v00", 4], ["v01", 4], ["v02", 4], [None, 3]]
    assert told["rows"][0][3] == "nan"
    for sql, said in (
        ("drop table logs", "questions alone"),
        ("select * from read_csv('/etc/passwd')", "cannot answer"),
        ("select a.range from range(400) a, range(400) b", "too long"),
        ("select repeat('x', 20000000)", "too long for the page"),
    ):
        with pytest.raises(OptionError, match=said):
            fleet_work.query_fleet(path, sql)


@pytest.mark.skipif(os.name == "nt", reason="links need a right of their own there")
def test_a_fleet_that_leads_out_of_the_workspace_is_refused(tmp_path: Path) -> None:
    folder, far = tmp_path / "w", tmp_path / "far"
    folder.mkdir()
    far.mkdir()
    (folder / "away").symlink_to(far)
    (folder / "logs").mkdir()
    sound = {
        "whole": 'logs = ["logs"]',
        "glob": 'logs = ["logs/*/[a-z].bin"]\ncatalogue = "kept"',
    }
    leading = {
        "up": 'logs = ["../far"]',
        "link": 'logs = ["logs"]\ncatalogue = "away/kept"',
        "address": 'logs = ["s3://bucket/x"]',
        "absolute": f'logs = ["logs"]\ncatalogue = "{far}"',
        "wild": 'logs = ["logs/*/../../../far"]',
    }
    for name, words in (sound | leading).items():
        (folder / f"{name}.toml").write_text(f'[fleet]\ntitle = "t"\n{words}\n')
    (folder / "planted.toml").symlink_to(folder / "whole.toml")
    (folder / "loop").symlink_to(folder / "loop")
    leading["loop"] = 'logs = ["logs"]\ncatalogue = "loop/x"'
    (folder / "loop.toml").write_text(f'[fleet]\ntitle = "t"\n{leading["loop"]}\n')
    (folder / "bad.toml").write_text('[fleet]\ntitle = "t"\nlogs = ["a\\u0000b"]\n')
    (folder / "study.toml").write_text('[study]\ntitle = "no fleet"\n')
    workspace = Workspace(folder)
    found = {each.path.stem: each for each in known_fleets(workspace)}
    assert set(found) == {*sound, *leading, "bad"}
    with pytest.raises(StudyError, match="zero byte"):  # and harms no other fleet
        checked_fleet(workspace, found.pop("bad"))
    for name, place in found.items():
        assert fleet_of(workspace, place.id) == place
        if name in sound:
            assert checked_fleet(workspace, place) is not None
        else:
            with pytest.raises(OptionError, match="outside the folder"):
                checked_fleet(workspace, place)
    assert fleet_of(workspace, "../../etc/passwd") is None


def test_a_folder_that_a_fleet_names_is_not_proposed_again(tmp_path: Path) -> None:
    (tmp_path / "day").mkdir()
    for number in range(3):
        (tmp_path / "day" / f"V{number}.bin").write_bytes(b"no log" + bytes([number]))
    SweepFlight(sweep_s=2.0, rate_hz=50.0).write(tmp_path / "day")
    workspace = Workspace(tmp_path)
    workspace.scan()
    # What a run finds is counted, not what can be read: it said 1 of these 4 logs.
    assert log_folders(workspace) == {"day": 4}
    fleet = tmp_path / "season.toml"
    for logs, is_named in (("day/V0.bin", False), (".", True), ("day", True), ("d*/*.bin", True)):
        fleet.write_text(f'[fleet]\ntitle = "t"\nlogs = ["{logs}"]\n')
        assert (log_folders(workspace) == {}) == is_named, logs


def test_an_event_is_added_to_the_fleet_file_and_asked_about(tmp_path: Path) -> None:
    path = write_fleet(tmp_path, flights=16)
    path.write_text(path.read_text().rstrip("\n") + "  # kept")
    workspace = Workspace(tmp_path)
    (place,) = known_fleets(workspace)
    routes = make_server(workspace, {}).routes
    happened: Any = next(e for e in routes if getattr(e, "path", "").endswith("/events"))
    said = 'new "blades" \N{DEGREE SIGN}'

    def add(**told: str) -> FleetScreen:
        screen: FleetScreen = asyncio.run(happened.endpoint(place.id, FleetHappening(**told)))
        return screen

    told = add(date="2026-02-01", what=said, vehicle="v00")
    assert [(e.what, e.vehicle) for e in told.events] == [(said, "v00"), ("new motor", "v02")]
    assert "# kept" in told.text
    *_, events, _ = FleetPart(**fleet_work.answer_fleet(path)).types[0].tables
    assert (said, "v00") in {(row[0], row[1]) for row in events.rows}
    kept = path.read_bytes()
    with pytest.raises(StudyError, match="already"):
        add(date="2026-02-01", what=said, vehicle="v00")
    with pytest.raises(StudyError, match="no meaning"):
        add(date="some day", what="x")
    with pytest.raises(ValueError, match="at least 1"):
        add(date="2026-02-01", what="")
    assert path.read_bytes() == kept
    assert not list(tmp_path.glob(".*.toml"))


def test_a_folder_of_logs_becomes_a_fleet_that_a_worker_runs(tmp_path: Path) -> None:
    (tmp_path / "day").mkdir()
    for rate in (50.0, 100.0):
        flight = SweepFlight(sweep_s=2.0, rate_hz=rate).write(tmp_path / "day")
        flight.rename(flight.with_name(f"V{rate:.0f}-1.bin"))
    workspace = Workspace(tmp_path)
    workspace.scan()
    assert log_folders(workspace) == {"day": 2}
    name, said = fleet_work.propose(tmp_path / "day")
    assert (name, said[0]) == ("day-fleet.toml", "2 logs")
    assert log_folders(workspace) == {}
    (place,) = known_fleets(workspace)
    idle = SimpleNamespace(workspace=workspace, workers=SimpleNamespace(of_log=lambda log: []))
    fresh = fleet_routes._screen(cast("Backstage", idle), place)
    assert (fresh.words, fresh.outcomes) == ("", {})  # words would keep it from being run
    # Pools of the page may have daemons for workers: those may not start Dask's processes.
    for each in (tmp_path / "day").iterdir():
        each.write_bytes(b"no log at all: " + each.name.encode())
    done = tmp_path / "done.json"
    work = (tmp_path / name, done)
    worker = multiprocessing.get_context("spawn").Process(
        target=fleet_work.make_fleet, args=work, daemon=True
    )
    worker.start()
    worker.join(120.0)
    part = FleetRunPart.model_validate_json(done.read_text())
    # The words of the command.
    assert part.lines[:2] == ["2 logs, 0 of them in the catalogue before", "2 refused"]
    assert [each.startswith("at most ") for each in part.lines[2:]] in ([], [True])
    # A verdict has its light; the terminal's "[red]" is no word of the page.
    verdict = next(each for each in part.said if each.code == "nothing-fitted")
    assert (verdict.light, "[" in verdict.message) == ("red", False)
