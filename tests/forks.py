"""Run collected tests in forked processes: `pytest -p tests.forks --forks 2`.

Processes that `pytest -n` starts import and collect everything again, each for itself, and tell of
every phase of every test by itself. Forked ones share what was imported and collected once, take
whole files of tests from one queue, and tell of a file at once. While one process collects, another
runs what hardly needs the libraries that the others import. Where there is no fork (Windows), or it
is not safe (macOS' own libraries), `pytest -n` runs the same tests.
"""

from __future__ import annotations

import os
import pickle
import selectors
import signal
import struct
import sys
from collections.abc import Callable, Iterator
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
AHEAD = tuple(  # they read sources, and start processes that import for themselves
    Path(__file__).parent / "contract" / f"test_{name}.py"
    for name in (
        *("new_method", "start_up", "habits", "imports", "options", "public_surface"),
        *("rust_rooms", "size", "surface", "words"),
    )
)
SHARING = {"contract", "guide"}  # trees of all sources and a fit of every kind; the demo's flight


STARTED = pytest.StashKey["_Fork"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--forks", help="processes to run tests in: a number, or auto: cores + 1")


def _count(config: pytest.Config) -> int:
    asked = config.getoption("forks")
    if asked is None or config.option.collectonly or config.option.usepdb:
        return 1
    if asked != "auto":
        return int(asked)
    cores = len(os.sched_getaffinity(0))
    return cores + 1 if cores > 1 else 1  # Tests of browsers and of processes wait for these.


def _together(item: pytest.Item) -> Path:
    """What one process runs whole: a file, or a folder whose files share what they make."""
    return item.path.parent if item.path.parent.name in SHARING else item.path


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Start with what runs ahead, where all of it is asked for."""
    config = session.config
    asked = [config.invocation_params.dir / each for each in config.args]
    if _count(config) > 1 and all(any(map(path.is_relative_to, asked)) for path in AHEAD):
        config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined] - one for all
        config.stash[STARTED] = _Fork.start(lambda writer: _run_ahead(session, writer))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """End what runs ahead of a collection that failed."""
    if fork := session.config.stash.get(STARTED, None):
        fork.end()


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    """Run the tests in forks where more than one is asked for; else pytest's own loop does."""
    count = _count(session.config)
    if count < 2 or session.testsfailed:
        return None
    ahead = session.config.stash.get(STARTED, None)
    groups = _groups([item for item in session.items if not (ahead and item.path in AHEAD)])
    session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined] - one for all
    queue = _queue(len(groups))
    forks = [_Fork.start(lambda writer: _run(session, groups, queue, writer)) for _ in range(count)]
    os.close(queue)
    if ahead:
        forks.append(ahead)
        del session.config.stash[STARTED]
    told = _listen(session, forks)
    lost = [item.nodeid for item in session.items if item.nodeid not in told]
    if lost:
        raise RuntimeError(f"a process ended before it told of {len(lost)} tests: {lost[:5]}")
    return True


def _groups(items: list[pytest.Item]) -> Groups:
    return [list(group) for _, group in groupby(items, key=_together)]


def _queue(count: int) -> int:
    """A pipe that hands out each place once."""
    queue, fill = os.pipe()
    os.set_blocking(fill, False)
    os.write(fill, b"".join(PLACE.pack(place) for place in range(count)))
    os.close(fill)
    return queue


def _listen(session: pytest.Session, forks: list[_Fork]) -> set[str]:
    """Hand on what forks report until they are done, and reap them; tests that were told of."""
    hook, told = session.config.hook, set()
    asked = {item.nodeid for item in session.items}
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
                        if report.nodeid not in asked:
                            continue
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
    def start(cls, work: Callable[[int], None]) -> _Fork:
        reader, writer = os.pipe()
        sys.stdout.flush()
        pid = os.fork()
        if pid:
            os.close(writer)
            return cls(pid, reader)
        done = 1
        try:
            work(writer)
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


def _run_ahead(session: pytest.Session, writer: int) -> None:
    """Collect what runs ahead and run it, in the fork."""
    teller = _silenced(session.config)
    session.perform_collect([str(path) for path in AHEAD])
    groups = _groups(session.items)
    _run_each(session, _taken(groups, _queue(len(groups))), teller, writer)


def _run(session: pytest.Session, groups: Groups, queue: int, writer: int) -> None:
    """Run files from the queue, in the fork."""
    _run_each(session, _taken(groups, queue), _silenced(session.config), writer)


def _silenced(config: pytest.Config) -> _Teller:
    """What keeps reports in a fork, where nothing is printed."""
    capture: CaptureManager = config.pluginmanager.get_plugin("capturemanager")
    capture.stop_global_capturing()  # its files are those of the parent
    capture.start_global_capturing()
    config.pluginmanager.unregister(name="terminalreporter")
    teller = _Teller(config)
    config.pluginmanager.register(teller)
    return teller


def _run_each(
    session: pytest.Session, taken: Iterator[list[pytest.Item]], teller: _Teller, writer: int
) -> None:
    group = next(taken, None)
    while group:
        following = next(taken, None)
        after = [*group[1:], following[0] if following else None]
        for item, later in zip(group, after, strict=True):
            session.config.hook.pytest_runtest_protocol(item=item, nextitem=later)
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
