"""A process for logs that may hang, eat memory or die: killed by the clock, replaced, and named."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from queue import Empty, SimpleQueue
from typing import Any, BinaryIO, Self

from flightid.fleet.catalogue.store import store_at
from flightid.fleet.engine.claims import RENEW_S, LogClaims
from flightid.fleet.engine.order import (
    CLAIMED,
    KILLED,
    SCRATCH,
    STORAGE,
    LogOrder,
    LogOutcome,
    RunOrder,
)
from flightid.threads import LINEAR_ALGEBRA

CHILD = "flightid.fleet.engine.child"
START_S = 600.0
"""Longest time until a process is ready: on a machine that others load two minutes were too few."""
ONE_THREAD = (*LINEAR_ALGEBRA, "RAYON_NUM_THREADS")
MEMORY_WORDS = (b"MemoryError", b"memory allocation", b"bad_alloc", b"Cannot allocate memory")
TIME, MEMORY, DEAD = "time", "memory", "killed"
"""Kinds of failure of a process that did not answer."""


class Sandbox:
    """One child process, made when it is needed and replaced when it is worn or gone.

    Parameters
    ----------
    order : RunOrder
    """

    def __init__(self, order: RunOrder) -> None:
        self._order = order
        self._claims = LogClaims(store_at(order.place), order.claimant)
        self._child: subprocess.Popen[bytes] | None = None
        self._lines: SimpleQueue[bytes | None] = SimpleQueue()
        self._errors: BinaryIO | None = None
        self._scratch: str | None = None
        self._taken = 0

    @property
    def pid(self) -> int | None:
        """Process that is there now."""
        return None if self._child is None else self._child.pid

    def run(self, order: LogOrder) -> LogOutcome:
        """Take a log, unless another run is at it; it returns whatever becomes of the process."""
        log = order.address.digest
        if not self._claims.take(log):
            return LogOutcome(order, CLAIMED, log)
        try:
            return self._run(order)
        finally:
            self._claims.leave(log)

    def _run(self, order: LogOrder) -> LogOutcome:
        if self._child is None or self._taken >= self._order.recycle:
            self.close()
            problem, message = self._start()
            if problem == STORAGE:
                self.close()
                return LogOutcome(order, STORAGE, order.address.digest, message=message)
            if problem is not None:
                return self._killed(order, problem, "process", order.address.digest, 0.0)
        self._taken += 1
        begun, stage, log = time.monotonic(), "process", order.address.digest
        self._send(order.to_dict())
        while True:
            left = begun + self._order.time_s - time.monotonic()
            try:
                line = self._lines.get(timeout=max(min(left, RENEW_S), 0.0))
            except Empty:
                if left > RENEW_S:
                    self._claims.renew(order.address.digest)
                    continue
                return self._killed(order, TIME, stage, log, time.monotonic() - begun)
            if line is None:
                return self._killed(order, DEAD, stage, log, time.monotonic() - begun)
            said = json.loads(line)
            if "outcome" in said:
                return _outcome(order, said, log, time.monotonic() - begun)
            stage, log = said["stage"], said["log"]

    def _start(self) -> tuple[str | None, str]:
        """Start a process; why it is not ready, where it is not, and its words for it."""
        # All that it leaves for a while lies here: whatever kills it, the folder goes with it.
        self._scratch = tempfile.mkdtemp(prefix=SCRATCH)
        surroundings = dict.fromkeys(ONE_THREAD, "1") | dict(os.environ)
        surroundings |= dict.fromkeys(("TMPDIR", "TEMP", "TMP"), self._scratch)
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the process
        self._child = subprocess.Popen(
            [sys.executable, "-m", CHILD],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=surroundings,
            start_new_session=True,  # Ctrl-C is for whoever runs the fleet.
        )
        self._lines, self._taken = SimpleQueue(), 0
        assert self._child.stdout is not None
        reader = threading.Thread(
            target=_listen, args=(self._child.stdout, self._lines), daemon=True
        )
        reader.start()
        self._send(self._order.to_dict())
        try:
            line = self._lines.get(timeout=START_S)
        except Empty:
            return TIME, ""
        if line is None:
            return DEAD, ""
        said = json.loads(line)
        return said.get("outcome"), str(said.get("message") or "")

    def _send(self, values: Mapping[str, Any]) -> None:
        assert self._child is not None
        assert self._child.stdin is not None
        try:
            self._child.stdin.write(json.dumps(values).encode() + b"\n")
            self._child.stdin.flush()
        except BrokenPipeError:
            return  # Its end of the other pipe says so too.

    def _killed(
        self, order: LogOrder, kind: str, stage: str, log: str, elapsed_s: float
    ) -> LogOutcome:
        """What is known of a process that gave no answer; it is ended."""
        assert self._child is not None
        code = None
        if kind == DEAD:
            try:
                code = self._child.wait(timeout=10.0)
            except subprocess.TimeoutExpired:
                code = None
        tail = self._tail()
        self.close()
        number = -code if code is not None and code < 0 else None
        kind = MEMORY if kind == DEAD and any(word in tail for word in MEMORY_WORDS) else kind
        return LogOutcome(
            order,
            KILLED,
            log,
            kind,
            _words(kind, self._order, code, tail),
            stage,
            signal.SIGKILL if kind == TIME else number,
            elapsed_s,
        )

    def _tail(self) -> bytes:
        """Last words of the process."""
        assert self._errors is not None
        end = self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(end - 2000, 0))
        return self._errors.read()

    def close(self) -> None:
        """End the process."""
        if self._child is not None:
            self._child.kill()
            self._child.wait()
            for stream in (self._child.stdin, self._child.stdout):
                if stream is not None:
                    _close(stream)
        if self._errors is not None:
            self._errors.close()
        if self._scratch is not None:
            shutil.rmtree(self._scratch, ignore_errors=True)
        self._child = self._errors = self._scratch = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _close(stream: Any) -> None:  # noqa: ANN401 - a pipe
    try:
        stream.close()
    except OSError:
        return  # What could not be sent any more is lost with its reader.


def _listen(stream: Any, lines: SimpleQueue[bytes | None]) -> None:  # noqa: ANN401 - a pipe
    try:
        for line in stream:
            lines.put(line)
    except ValueError:
        pass  # Closed while it was read.
    lines.put(None)


def _outcome(order: LogOrder, said: Mapping[str, Any], log: str, elapsed_s: float) -> LogOutcome:
    return LogOutcome(
        order,
        str(said["outcome"]),
        str(said.get("log") or log),
        str(said.get("reason") or ""),
        str(said.get("message") or ""),
        elapsed_s=elapsed_s,
        memory_bytes=said.get("memory_bytes"),
        action=str(said.get("action") or ""),
        vehicle=str(said.get("vehicle") or ""),
    )


def _words(kind: str, order: RunOrder, code: int | None, tail: bytes) -> str:
    if kind == TIME:
        return f"not done after {order.time_s:g} s (time_s in [limits])"
    if kind == MEMORY:
        return f"more memory than {order.memory_mib} MiB (memory_mib in [limits])"
    last = tail.decode(errors="replace").strip().rpartition("\n")[2][:300]
    if code is not None and code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        return " ".join(filter(None, (f"its process was ended by {name}", last and f"({last})")))
    return f"its process ended with code {code}: {last or 'without a word'}"
