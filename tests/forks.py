"""Run collected tests in forked processes: `pytest -p tests.forks --forks 2`.

Processes that `pytest -n` starts import and collect everything again, each for itself, and tell of
every phase of every test by itself. Forked ones share what was imported and collected once, take
whole files of tests from one queue, and tell of a file at once. Where there is no fork (Windows),
or it is not safe (macOS' own libraries), `pytest -n` runs the same tests.
"""

from __future__ import annotations

import os
import pickle
import selectors
import signal
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from _pytest.capture import CaptureManager

    Groups = list[list[pytest.Item]]

PLACE = struct.Struct("=I")
AT_ONCE = 1 << 20
SHARING = {"contract", "guide"}  # trees of all sources and a fit of every kind; the demo's flight


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--forks", help="processes to run tests in: a number, or auto for the cores")


def _count(config: pytest.Config) -> int:
    asked = config.getoption("forks")
    if asked is None or config.option.collectonly or config.option.usepdb:
        return 1
    return len(os.sched_getaffinity(0)) if asked == "auto" else int(asked)


def _together(item: pytest.Item) -> Path:
    """What one process runs whole: a file, or a folder whose files share what they make."""
    return item.path.parent if item.path.parent.name in SHARING else item.path


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Run the tests in forks where more than one is asked for; else pytest's own loop does."""
    count = _count(session.config)
    if count < 2 or session.testsfailed:
        return None
    groups = [list(items) for _, items in groupby(session.items, key=_together)]
    session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined] - one for all
    sys.stdout.flush()
    queue, fill = os.pipe()
    os.set_blocking(fill, False)
    os.write(fill, b"".join(PLACE.pack(place) for place in range(len(groups))))
    os.close(fill)
    forks = [_Fork.start(session, groups, queue) for _ in range(count)]
    os.close(queue)
    told = _listen(session, forks)
    lost = [item.nodeid for item in session.items if item.nodeid not in told]
    if lost:
        raise RuntimeError(f"a process ended before it told of {len(lost)} tests: {lost[:5]}")
    return True


def _listen(session: pytest.Session, forks: list[_Fork]) -> set[str]:
    """Hand on what forks report until they are done, and reap them; tests that were told of."""
    hook, told = session.config.hook, set()
    with selectors.DefaultSelector() as ready:
        for fork in forks:
            ready.register(fork.reader, selectors.EVENT_READ, fork)
        try:
            while ready.get_map():
                for key, _ in ready.select():
                    reports = key.data.reports()
                    if reports is None:
                        ready.unregister(key.fileobj)
                        continue
                    for data in reports:
                        report = hook.pytest_report_from_serializable(
                            config=session.config, data=data
                        )
                        told.add(report.nodeid)
                        hook.pytest_runtest_logreport(report=report)
                    if session.shouldfail:
                        raise session.Failed(session.shouldfail)
        finally:
            for fork in forks:
                fork.end()
    return told


@dataclass
class _Fork:
    """One process that runs tests, seen from the one that collected them."""

    pid: int
    reader: int
    held: bytearray = field(default_factory=bytearray)

    @classmethod
    def start(cls, session: pytest.Session, groups: Groups, queue: int) -> _Fork:
        reader, writer = os.pipe()
        pid = os.fork()
        if pid:
            os.close(writer)
            return cls(pid, reader)
        done = 1
        try:
            _run(session, groups, queue, writer)
            done = 0
        finally:
            os._exit(done)

    def reports(self) -> list[dict[str, Any]] | None:
        """Whole batches that have arrived; None when there will be no more."""
        part = os.read(self.reader, AT_ONCE)
        if not part:
            return None
        self.held += part
        found: list[dict[str, Any]] = []
        while len(self.held) >= PLACE.size:
            (size,) = PLACE.unpack_from(self.held)
            if len(self.held) < PLACE.size + size:
                break
            found += pickle.loads(self.held[PLACE.size : PLACE.size + size])
            del self.held[: PLACE.size + size]
        return found

    def end(self) -> None:
        """End it where it still runs, and reap it."""
        os.close(self.reader)
        os.kill(self.pid, signal.SIGTERM)
        os.waitpid(self.pid, 0)


def _run(session: pytest.Session, groups: Groups, queue: int, writer: int) -> None:
    """Run files from the queue, in the fork."""
    config = session.config
    capture: CaptureManager = config.pluginmanager.get_plugin("capturemanager")
    capture.stop_global_capturing()  # its files are those of the parent
    capture.start_global_capturing()
    config.pluginmanager.unregister(name="terminalreporter")
    teller = _Teller(config)
    config.pluginmanager.register(teller)
    taken = _taken(groups, queue)
    group = next(taken, None)
    while group:
        following = next(taken, None)
        after = [*group[1:], following[0] if following else None]
        for item, later in zip(group, after, strict=True):
            config.hook.pytest_runtest_protocol(item=item, nextitem=later)
        teller.send(writer)
        group = following


def _taken(groups: Groups, queue: int) -> Iterator[list[pytest.Item]]:
    while len(place := os.read(queue, PLACE.size)) == PLACE.size:
        yield groups[PLACE.unpack(place)[0]]


class _Teller:
    """Keeps reports of a file and sends them together."""

    def __init__(self, config: pytest.Config) -> None:
        self.config, self.kept = config, []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        hook = self.config.hook
        self.kept.append(hook.pytest_report_to_serializable(config=self.config, report=report))

    def send(self, writer: int) -> None:
        content = pickle.dumps(self.kept)
        content = memoryview(PLACE.pack(len(content)) + content)
        while content:
            content = content[os.write(writer, content) :]
        self.kept = []
