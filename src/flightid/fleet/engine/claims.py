"""Claims: which run is at which log, so that several runs at once share the work.

A claim is a small file that one run alone can create. Its holder writes it anew from time to time;
one that stays as it is for a minute has lost its holder and may be taken over. No clock of another
machine is asked: whoever waits holds the contents beside what they were by a clock of its own.
Claims save work and nothing else: without them, or where two runs take over one at the same time,
a log is taken twice and counts once.
"""

from __future__ import annotations

import json
import os
import secrets
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from flightid.fleet.catalogue.store import Store

CLAIMS = "claims"
RENEW_S = 15.0
"""Time after which a holder writes its claim anew."""
STALE_S = 60.0
"""Time without a change after which a claim has lost its holder."""


def new_claimant() -> str:
    """Name of a run that no other has."""
    return secrets.token_hex(8)


def can_claim(store: Store) -> bool:
    """Whether a store creates a file for one of several alone; some stores of objects do not."""
    name = f"{CLAIMS}/probe-{secrets.token_hex(8)}"
    try:
        return store.create(name, b"1") is True and store.create(name, b"2") is False
    finally:
        store.remove(name)


class LogClaims:
    """Claims of one run, in the process that hands logs to others.

    Parameters
    ----------
    store : Store
        Of the catalogue.
    claimant : str
        Name of the run; empty: nothing is claimed.

    Example
    -------
    >>> import tempfile
    >>> from flightid.fleet.catalogue.store import FolderStore
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     one, other = (LogClaims(FolderStore(folder), new_claimant()) for _ in range(2))
    ...     first = one.take("a"), other.take("a")
    ...     one.leave("a")
    ...     first, other.take("a")
    ((True, False), True)
    """

    def __init__(self, store: Store, claimant: str) -> None:
        self._store = store
        self._claimant = claimant
        self._renewals = 0

    def take(self, log: str) -> bool:
        """Claim a log; False where another run holds it. A claim of the same run is taken over.

        Where nothing can be claimed the log is taken all the same: its record says what is wrong.
        """
        if not self._claimant:
            return True
        try:
            return self._take(log)
        except OSError:
            return True

    def _take(self, log: str) -> bool:
        for _ in range(2):
            if self._store.create(_name(log), self._content()) is not False:
                return True
            held = self._read(log)
            if held is not None:  # else it was given back meanwhile
                break
        else:
            return False
        if _holder(held) == self._claimant or _is_dead(held):
            self._store.write(_name(log), self._content())
            return True
        return False

    def renew(self, log: str) -> None:
        """Say that this run is still at a log."""
        if self._claimant:
            with suppress(OSError):
                self._store.write(_name(log), self._content())

    def leave(self, log: str) -> None:
        """Give a claim back, unless another run has taken it over."""
        if not self._claimant:
            return
        with suppress(OSError):
            held = self._read(log)
            if held is not None and _holder(held) == self._claimant:
                self._store.remove(_name(log))

    def _read(self, log: str) -> bytes | None:
        return read_claim(self._store, log)

    def _content(self) -> bytes:
        self._renewals += 1
        told = {"run": self._claimant, "host": _host(), "pid": os.getpid(), "n": self._renewals}
        return json.dumps(told).encode()


class ClaimWatch:
    """Claims of others, watched until they are given back or have lost their holders.

    Parameters
    ----------
    store : Store
    now : callable
        A clock of this machine, s.
    """

    def __init__(self, store: Store, now: Callable[[], float] = time.monotonic) -> None:
        self._store = store
        self._now = now
        self._seen: dict[str, tuple[bytes, float]] = {}

    def is_free(self, log: str) -> bool:
        """Whether nobody holds a log any more; a claim without a holder is removed."""
        content = read_claim(self._store, log)
        if content is None:
            return True
        known, since = self._seen.get(log, (None, self._now()))
        if content != known:
            since = self._now()
            self._seen[log] = content, since
        # Asked each time: a holder may outlive its run by a moment.
        if self._now() - since < STALE_S and not _is_dead(content):
            return False
        self._store.remove(_name(log))
        return True


def read_claim(store: Store, log: str) -> bytes | None:
    """What a claim says; None where nobody holds the log."""
    try:
        return store.read(_name(log))
    except FileNotFoundError:
        return None


def _name(log: str) -> str:
    return f"{CLAIMS}/{log}.json"


def _told(content: bytes) -> dict[str, object]:
    """What a claim says; nothing of one that is being written."""
    try:
        found = json.loads(content)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def _holder(content: bytes) -> str:
    return str(_told(content).get("run", ""))


def _is_dead(content: bytes) -> bool:
    """Whether the holder ran on this machine and has ended: that needs no minute of waiting."""
    told = _told(content)
    pid = told.get("pid")
    if told.get("host") != _host() or not isinstance(pid, int) or pid <= 0 or os.name == "nt":
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return _is_zombie(pid)


def _is_zombie(pid: int) -> bool:
    """Whether a process has ended and nobody has asked how: containers often have no one to ask."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return stat.rpartition(")")[2].split()[:1] == ["Z"]


def _host() -> str:
    """Name of the machine, and the set of its processes in which a number means one."""
    try:
        return f"{socket.gethostname()} {os.readlink('/proc/self/ns/pid')}"
    except OSError:
        return socket.gethostname()
