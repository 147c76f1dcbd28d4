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


NAMES = '[fleet]\ntitle="t"\nlogs=["l"]\n[vehicles]\nby="name"\npattern="'
HOSTILE = {
    NAMES + '(a{99999999999999})"': "no regular expression",
    NAMES + "(" * 3000 + ")" * 3000 + '"': "no regular expression",
    '[fleet]\ntitle="t"\nlogs=["l"]\n[[event]]\ndate="0001-01-01T00:00+23:59"\nwhat="x"': "date",
    '[fleet]\ntitle="t"\nlogs=["l"]\ncatalogue="a\\u0000b"': "zero byte",
    '[fleet]\ntitle="t"\nlogs=["a\\u0000b"]': "zero byte",
    "[fleet]\n" + ".".join("a" * 20_000) + "=1": "more than 64 parts",
}
TABLES = ("id,vehicle\n7," + "x" * 200_000, "id,a,b\n" + "\n".join(map(str, range(40))))


def test_hostile_fleet_files_and_tables_are_refused_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, table = tmp_path / "fleet.toml", tmp_path / "t.csv"
    for words, said in HOSTILE.items():
        file.write_text(words)
        with pytest.raises(StudyError, match=said):
            read_fleet(file)
    monkeypatch.setattr(identity, "TABLE_CELLS", 100)
    file.write_text('[fleet]\ntitle="t"\nlogs=["zzz://x"]\n[vehicles]\ntable="t.csv"')
    for lines, said in zip(TABLES, ("no table of a fleet", "too long"), strict=True):
        table.write_text(lines)
        with pytest.raises(StudyError, match=said):
            read_tables(read_fleet(file))
    with pytest.raises(StudyError, match="no way to this address"):
        find_logs(["zzz://x"])
