"""Fleet files: every error at once; who flew and when, from logs, names and tables."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import flightid as fid
from flightid.errors import StudyError
from flightid.fleet.addresses import find_logs
from flightid.fleet.engine.cluster import scheduler_finding
from flightid.fleet.identity import identify_log, read_tables
from flightid.fleet.proposal import propose_fleet
from flightid.fleet.settings import FleetSettings, read_fleet
from flightid.logs import DataflashWriter

HEAD = "[fleet]\ntitle = 'f'\nlogs = ['logs']\n"


def fleet(folder: Path, text: str) -> FleetSettings:
    path = folder / "fleet.toml"
    path.write_text(HEAD + text)
    return read_fleet(path)


def test_all_errors_of_a_fleet_file_are_told_at_once(tmp_path: Path) -> None:
    text = (
        "study = 'gone.toml'\n[vehicles]\nby = 'name'\n[limits]\ntime = 3\n[questions]\nlevel = 2\n"
        "drift = 'yes'\n"  # of one table all are told, too
        "[[event]]\ndate = 'soon'\nwhat = 'new motor'\n"
    )
    with pytest.raises(StudyError) as caught:
        fleet(tmp_path, text)
    said = str(caught.value)
    assert "the fleet file has 6 errors" in said
    for part in (
        "gone.toml",
        "pattern belongs to",
        "time_s",
        "level is too large",
        "drift has",
        "'soon'",
    ):
        assert part in said


def test_a_pattern_needs_a_group(tmp_path: Path) -> None:
    with pytest.raises(StudyError, match="no group"):
        fleet(tmp_path, "[vehicles]\nby = 'name'\npattern = 'V[0-9]+'\n")


def log_of(folder: Path, name: str, parameters: dict[str, float], text: str = "") -> Path:
    writer = DataflashWriter()
    for key, value in parameters.items():
        writer.parameter(key, value)
    writer.message(1_000_000, "ArduCopter V4.6.0 (abcdef)")
    if text:
        writer.message(1_000_000, text)
    return writer.write(folder / name)


def test_vehicles_and_dates_come_from_the_log_its_name_and_the_tables(tmp_path: Path) -> None:
    (tmp_path / "tails.csv").write_text("id,vehicle,type,payload\n7,Ida,heavy,2.5\n")
    (tmp_path / "flights.csv").write_text(
        "log,flown_at,pilot\na-20260301.bin,2026-03-02T10:00+02:00,Eve\n"
    )
    text = "[vehicles]\ntable = 'tails.csv'\nflight_table = 'flights.csv'\n"
    settings = fleet(tmp_path, text)
    tables = read_tables(settings)
    board = "CubeOrange 0038003C 31365104 30313731"
    cases = [
        ("a-20260301.bin", {"BRD_SERIAL_NUM": 7.0}, "Ida", "heavy", "2026-03-02 08:00", "table"),
        ("b-20260301.bin", {"BRD_SERIAL_NUM": 8.0}, "8", "ardupilot copter", "2026-03-01", "name"),
        ("c.bin", {}, "0038003C 31365104 30313731", "ardupilot copter", "1970-01-02", "file"),
    ]
    for name, parameters, vehicle, kind, date, source in cases:
        log = fid.read_log(log_of(tmp_path, name, parameters, board))
        found = identify_log(log, str(tmp_path / name), 86400.0, settings.vehicles, tables)
        assert (found.vehicle, found.type, found.flown_at_from) == (vehicle, kind, source)
        assert str(found.flown_at).startswith(date)
    first = identify_log(None, "x/a-20260301.bin", None, settings.vehicles, tables)
    assert first.covariates == {"pilot": "Eve"}
    assert tables.told("7", "a-20260301.bin") != tables.told("7", "b-20260301.bin") != ""


def test_the_first_fix_dates_the_start_of_the_log(tmp_path: Path) -> None:
    """GPS week 2400 began on 2026-01-04, 18 leap seconds before that day in UTC."""
    writer = DataflashWriter()
    writer.message(1_000_000, "ArduCopter V4.6.0 (abcdef)")
    stamps = [1_000_000, 3_000_000]
    writer.add("GPS", stamps, {"GWk": [0, 2400], "GMS": [0.0, 86_420.0]})
    log = fid.read_log(writer.write(tmp_path / "gps.bin"))
    settings = fleet(tmp_path, "")
    found = identify_log(log, "gps.bin", None, settings.vehicles, read_tables(settings))
    assert (str(found.flown_at), found.flown_at_from) == ("2026-01-05 00:00:00", "log")


def test_places_are_searched_and_each_log_stands_once(tmp_path: Path) -> None:
    folder = tmp_path / "logs" / "old"
    folder.mkdir(parents=True)
    for name in ("a.BIN", "b.ulg", "notes.txt"):
        (folder / name).write_bytes(b"x")
    everything = [str(tmp_path / "logs"), str(folder / "*.BIN"), (folder / "b.ulg").as_uri()]
    assert [each.name for each in find_logs(everything)] == ["a.BIN", "b.ulg"]
    assert [each.name for each in find_logs([str(folder / "*.txt")])] == ["notes.txt"]
    with pytest.raises(StudyError, match="does not exist"):
        find_logs([str(tmp_path / "nowhere")])


@pytest.mark.parametrize(
    ("address", "warned"),
    [("tcp://10.0.0.1:8786", True), ("tcp://127.0.0.1:1", False), ("tls://10.0.0.1:8786", False)],
)
def test_an_open_scheduler_of_another_machine_is_warned_of(address: str, warned: bool) -> None:
    assert (scheduler_finding(address) is not None) == warned


def test_a_folder_gets_a_fleet_file_that_says_what_was_chosen(tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    for name in ("V01-2026-03-01", "V01-2026-03-02", "V02-2026-03-01"):
        (logs / f"{name}.bin").write_bytes(name.encode())
    made = propose_fleet(logs)
    assert made.said[0] == "3 logs"
    assert "what file names begin with (2 vehicles, such as V01)" in made.said[1]
    settings = read_fleet(made.write())
    assert (settings.vehicles.by, settings.words.logs) == ("name", ("logs",))
    assert settings.catalogue == str(tmp_path / "logs-fleet-catalogue")
    made.path.write_text(made.text + "# mine")
    with pytest.raises(StudyError, match="a fleet file for this folder already"):
        propose_fleet(logs).write()
    for vehicle in ("a", "b"):
        (tmp_path / "more" / vehicle).mkdir(parents=True)
        (tmp_path / "more" / vehicle / "1.ulg").write_bytes(vehicle.encode())
    assert read_fleet(propose_fleet(tmp_path / "more").write()).vehicles.by == "folder"
    (tmp_path / "none").mkdir()
    with pytest.raises(StudyError, match="no log in this folder"):
        propose_fleet(tmp_path / "none")


@pytest.mark.skipif(sys.platform != "linux", reason="other systems refuse such names themselves")
def test_a_folder_of_any_name_gives_a_file_that_reads(tmp_path: Path) -> None:
    for name in ("a\x7fb", "quo\"te'", "line\nbreak"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "V01-1.bin").write_bytes(b"")
        assert read_fleet(propose_fleet(tmp_path / name).write()).words.title == name
    for refused in ("n" * 245, "a\udcff"):
        (tmp_path / refused).mkdir()
        with pytest.raises(StudyError, match="no name to call a fleet by"):
            propose_fleet(tmp_path / refused)
