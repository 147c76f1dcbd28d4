"""The process that takes logs, where its parent is gone."""

from __future__ import annotations

import io
import shutil
from pathlib import Path

import pytest

from flightid.fleet.addresses import find_logs
from flightid.fleet.catalogue.loose import loose_logs
from flightid.fleet.catalogue.store import FolderStore
from flightid.fleet.engine import child
from flightid.fleet.engine.order import RunOrder, orders, run_order
from flightid.fleet.identity import read_tables
from flightid.fleet.settings import read_fleet

EXAMPLE = Path(__file__).parents[2] / "examples" / "fleet"


def _order(folder: Path) -> RunOrder:
    """The example over an empty log."""
    for name in ("fleet.toml", "study.toml"):
        shutil.copy(EXAMPLE / name, folder)
    (folder / "logs").mkdir()
    (folder / "logs" / "V00-2026-01-05.bin").write_bytes(b"")
    settings = read_fleet(folder / "fleet.toml")
    return run_order(settings, read_tables(settings), str(folder / "catalogue"))


def test_nothing_is_kept_of_a_log_that_failed_when_the_parent_was_gone(tmp_path: Path) -> None:
    """Its folder goes with the parent: the log stood as failed, "a fault of flightid"."""
    order = _order(tmp_path)
    settings = read_fleet(tmp_path / "fleet.toml")
    (asked,) = orders(find_logs([str(tmp_path / "logs")]), read_tables(settings))
    (tmp_path / "unpacked").mkdir()
    take = child._ready(order.to_dict(), tmp_path / "unpacked", io.StringIO())
    store = FolderStore(order.place)
    child.GONE.set()
    try:
        with pytest.raises(SystemExit):
            take(asked.to_dict())
        assert not loose_logs(store)
    finally:
        child.GONE.clear()
    assert take(asked.to_dict())["outcome"] == "refused"
    assert len(loose_logs(store)) == 1


def test_a_process_that_nobody_can_end_ends_by_its_own_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order = _order(tmp_path)
    asked_for: list[tuple[float, bool]] = []
    monkeypatch.setattr(
        "flightid.fleet.engine.child.faulthandler.dump_traceback_later",
        lambda after_s, *, exit: asked_for.append((after_s, exit)),
    )
    settings = read_fleet(tmp_path / "fleet.toml")
    (asked,) = orders(find_logs([str(tmp_path / "logs")]), read_tables(settings))
    (tmp_path / "unpacked").mkdir()
    child._ready(order.to_dict(), tmp_path / "unpacked", io.StringIO())(asked.to_dict())
    assert asked_for == [(order.time_s + child.LONGER_S, True)]
