"""Claims of logs: one run alone holds one, and none is lost to a run that has ended."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest

from flightid.errors import DataError
from flightid.fleet.addresses import LogAddress
from flightid.fleet.catalogue.store import FolderStore, store_at
from flightid.fleet.engine.claims import (
    CLAIMS,
    STALE_S,
    ClaimWatch,
    LogClaims,
    can_claim,
    new_claimant,
    read_claim,
)
from flightid.fleet.engine.order import CLAIMED, LogOrder, RunOrder
from flightid.fleet.engine.sandbox import Sandbox


def test_of_two_runs_one_has_a_log_until_it_gives_it_back(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    one, other = (LogClaims(store, new_claimant()) for _ in range(2))
    assert (one.take("a"), other.take("a"), other.take("b")) == (True, False, True)
    other.leave("a")  # not its own
    assert not other.take("a")
    assert one.take("a"), "a second try of the same run"
    one.leave("a")
    assert other.take("a")
    assert LogClaims(store, "").take("a"), "without a name nothing is asked"


def test_a_claim_is_free_a_minute_after_its_last_renewal(tmp_path: Path) -> None:
    store, clock = FolderStore(tmp_path), [0.0]
    holder = LogClaims(store, new_claimant())
    assert holder.take("a")
    told = json.loads(read_claim(store, "a") or b"")
    for host in (told["host"], "far away"):  # a living process here, and one that nobody sees
        store.write(f"{CLAIMS}/a.json", json.dumps({**told, "host": host}).encode())
        watch, clock[0] = ClaimWatch(store, lambda: clock[0]), 0.0
        assert not watch.is_free("a")
        clock[0] = STALE_S - 1.0
        assert not watch.is_free("a")
        holder.renew("a")
        clock[0] = STALE_S + 1.0
        assert not watch.is_free("a"), "it was renewed"
        clock[0] += STALE_S
        assert watch.is_free("a")
        assert read_claim(store, "a") is None


@pytest.mark.skipif(os.name == "nt", reason="there is no such question to a process there")
def test_a_claim_of_a_process_that_was_killed_here_waits_for_no_clock(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    killed = LogClaims(store, "killed")
    assert killed.take("a")
    told = json.loads(read_claim(store, "a") or b"")
    store.write(f"{CLAIMS}/a.json", json.dumps({**told, "pid": 1 << 30}).encode())
    assert ClaimWatch(store).is_free("a")
    store.write(f"{CLAIMS}/a.json", json.dumps({**told, "pid": 1 << 30}).encode())
    assert LogClaims(store, new_claimant()).take("a")
    killed.leave("a")
    assert read_claim(store, "a") is not None, "it is another's by now"
    # One that lives a moment longer than its run; nobody has asked how it ended.
    with subprocess.Popen(["sleep", "60"]) as late:
        store.write(f"{CLAIMS}/a.json", json.dumps({**told, "pid": late.pid}).encode())
        watch = ClaimWatch(store, lambda: 0.0)
        assert not watch.is_free("a")
        late.kill()
        os.waitid(os.P_PID, late.pid, os.WEXITED | os.WNOWAIT)
        assert watch.is_free("a")
    for broken in (b"", b"[]", b"\xff", b'{"pid": -1}', b'{"pid": "x"}'):
        store.write(f"{CLAIMS}/b.json", broken)
        assert not LogClaims(store, new_claimant()).take("b")


def test_what_another_run_holds_starts_no_process(tmp_path: Path) -> None:
    address = LogAddress(str(tmp_path / "a.bin"), 0, "1")
    assert LogClaims(store_at(str(tmp_path)), "other").take(address.digest)
    with Sandbox(RunOrder({}, "fleet.toml", str(tmp_path), claimant="mine")) as box:
        assert box.run(LogOrder(address)).outcome == CLAIMED
        assert box.pid is None


def test_a_store_is_asked_whether_it_can_claim(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = FolderStore(tmp_path)
    assert can_claim(store)
    assert not list(store.names(CLAIMS))
    pytest.importorskip("fsspec")
    objects = store_at("memory://claims")
    # Whatever a store says to a condition that it does not know, it is seen.
    for said in (TypeError("mode"), OSError(501, "NotImplemented"), None):

        def put(path: str, content: bytes, mode: str = "", said: Exception | None = said) -> None:
            if said is not None:
                raise said

        with monkeypatch.context() as patch:
            patch.setattr(objects.fs, "pipe_file", put)  # type: ignore[attr-defined]
            assert not can_claim(objects)
    away = tmp_path / "far"
    away.mkdir()
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / CLAIMS).symlink_to(away)
    with pytest.raises(DataError, match="leads elsewhere"):
        can_claim(FolderStore(tmp_path / "in"))
