"""What strangers may lay beside a fleet: links, files and tables that are made to hurt."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from flightid.errors import DataError, StudyError
from flightid.fleet import identity
from flightid.fleet.addresses import find_logs
from flightid.fleet.catalogue.store import FolderStore
from flightid.fleet.identity import read_tables
from flightid.fleet.settings import read_fleet


@pytest.mark.skipif(os.name == "nt", reason="links need a right of their own there")
def test_nothing_is_written_through_a_link_in_a_catalogue(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "a.json").write_text("mine")
    store = FolderStore(tmp_path / "catalogue")
    store.write("kept/a.json", b"{}")
    (tmp_path / "catalogue" / "loose").symlink_to(victim)
    for harm in (lambda: store.write("loose/b.json", b"{}"), lambda: store.remove("loose/a.json")):
        with pytest.raises(DataError, match="a link in a catalogue"):
            harm()
    store.remove("loose")  # the link itself
    assert [path.name for path in victim.iterdir()] == ["a.json"]


@pytest.mark.parametrize(
    "words",
    [
        '[fleet]\ntitle="t"\nlogs=["l"]\n[vehicles]\nby="name"\npattern="(a{99999999999999})"',
        '[fleet]\ntitle="t"\nlogs=["l"]\n[vehicles]\nby="name"\npattern="'
        + "(" * 3000
        + ")" * 3000
        + '"',
        '[fleet]\ntitle="t"\nlogs=["l"]\n[[event]]\ndate="0001-01-01T00:00+23:59"\nwhat="x"',
        '[fleet]\ntitle="t"\nlogs=["l"]\ncatalogue="a\\u0000b"',
        '[fleet]\ntitle="t"\nlogs=["a\\u0000b"]',
        "[fleet]\n" + ".".join("a" * 20_000) + "=1",
    ],
)
def test_hostile_fleet_files_are_refused_in_words(words: str, tmp_path: Path) -> None:
    (tmp_path / "fleet.toml").write_text(words)
    with pytest.raises(StudyError):
        read_fleet(tmp_path / "fleet.toml")


@pytest.mark.parametrize(
    "lines", ["id,vehicle\n7," + "x" * 200_000, "id,a,b\n" + "\n".join(map(str, range(40)))]
)
def test_hostile_tables_are_refused_in_words(
    lines: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(identity, "TABLE_CELLS", 100)
    (tmp_path / "t.csv").write_text(lines)
    words = '[fleet]\ntitle="t"\nlogs=["zzz://x"]\n[vehicles]\ntable="t.csv"'
    (tmp_path / "fleet.toml").write_text(words)
    with pytest.raises(StudyError, match=r"no table of a fleet|too long"):
        read_tables(read_fleet(tmp_path / "fleet.toml"))
    with pytest.raises(StudyError, match="no way to this address"):
        find_logs(["zzz://x"])
