"""What the status of a fleet says of logs that nobody took, that were cut, or lie in quarantine."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from flightid.cli.fleet import command
from flightid.fleet import ask_fleet, fleet_status, run_fleet
from flightid.fleet.catalogue.parts import read_parts
from flightid.fleet.catalogue.store import Store, store_at
from flightid.fleet.opening import current_store
from flightid.fleet.settings import read_fleet

WORDS = "[fleet]\ntitle = 't'\nlogs = ['logs']\n[vehicles]\nby = 'folder'\ntype = 'quad'\n"


def test_the_status_of_a_fleet_before_a_run_cut_and_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before a run it was an error; the record of a cut log "gone"; a part in quarantine 13."""
    pytest.importorskip("duckdb")
    monkeypatch.setattr("flightid.fleet.run.find_spec", lambda _: None)
    fleet, logs = tmp_path / "fleet.toml", tmp_path / "logs"
    fleet.write_text(WORDS)
    logs.mkdir()
    assert [each.code for each in fleet_status(fleet).findings] == ["no-logs"]
    for number in range(3):
        (logs / f"{number}.bin").write_bytes(b"no log %d" % number)
    early = fleet_status(fleet)
    assert early.shares is not None
    assert (early.found, len(early.shares.waiting), early.outcomes) == (3, 3, {})
    said = CliRunner().invoke(command, ["status", str(fleet)])
    assert said.exit_code == 0
    assert "[not judged] nothing was run yet — flightid fleet run takes all of them" in said.output
    run_fleet(fleet, workers=1)
    (logs / "1.bin").write_bytes(b"cut")
    (logs / "2.bin").unlink()
    for found in (fleet_status(fleet).findings, ask_fleet(fleet).outdated):
        assert [each.code for each in found] == ["altered-logs", "gone-logs"]
        assert found[0].message == "1 record is of a log that has other bytes by now"
        assert found[1].message.startswith("1 record of a log that is gone")
    cut = fleet_status(fleet)
    rows = dict(cut.summary().rows)
    assert rows["records of files that are gone"] == 1
    assert rows["records of files that have other bytes now"] == 1
    assert cut.shares is not None
    assert rows["not taken yet"] == len(cut.shares.waiting) == 1
    _damage(current_store(read_fleet(fleet)))
    assert fleet_status(fleet).summary().rows[-2] == ("records and parts in quarantine", 1)
    done = run_fleet(fleet, workers=1)
    assert done.findings[0].message == (
        "1 part of the catalogue was damaged: it lies in quarantine, its logs were taken again"
    )
    assert fleet_status(fleet).summary().rows[-2] == ("records and parts in quarantine", 1)


def _damage(store: Store) -> None:
    (part,) = read_parts(store)[0]
    file = part.file("logs")
    content = store_at(store.root).read(file)
    store.write(file, content[:-9])
