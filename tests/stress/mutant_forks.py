"""Processes that `tests.stress.mutants` tries its changes in: pytest collects once, each try forks.

One process has collected all tests. A change inside a function is tried in a fork of it, where that
function takes the changed code; one of what runs on import in a fork of the process that has the
libraries imported but nothing of this project. The changed text stands in the file meanwhile, for
tests that read it or start processes. No test begins once those before it have taken so much of the
processor's time, of their own processes too. Every fork has a limit of that time besides, and of
its wall time, for loops that wait.
"""

from __future__ import annotations

import gc
import os
import pickle
import resource
import select
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from itertools import count
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import pytest

from tests.stress.mutations import functions_changed

WAITING = 12
"""Wall time a processor's second may take: a busy machine is not a loop without end."""
MEMORY = 12 << 30
"""Bytes of addresses: a changed size of an array is an error, not a swapping machine."""
QUIET = ("no-data-collected", "module-not-measured", "already-imported", "module-not-imported")
WORDS = ("-p", "no:cacheprovider", "-p", "no:terminal", "-s", "--doctest-modules")
# A watchdog of a pytest that forked is no thread of the fork: to call it off would wait for ever.
WORDS += ("-p", "no:faulthandler")
WORDS += ("-W", "ignore::pytest.PytestAssertRewriteWarning")
LIBRARIES = (
    *("numpy", "hypothesis.extra.numpy", "scipy.integrate", "scipy.interpolate", "scipy.linalg"),
    *("scipy.optimize", "scipy.signal", "scipy.sparse.linalg", "scipy.stats"),
)
CLOCK = count(1)


class Ended(NamedTuple):
    """How a try ended: a test noticed, none did, or no answer came in time.

    With how many tests there was no time for.
    """

    end: str
    by: str = ""
    left_out: int = 0


class Covered(NamedTuple):
    """What the tests of a file reach: lines by file and test, seconds and failures by test."""

    lines: dict[str, dict[int, list[str]]]
    seconds: dict[str, float]
    failed: list[str]


def in_a_fork(work: Callable[[], Any], cpu_s: float) -> Any:
    """What `work` gives in a forked process; None where its time, or it, ended before."""
    reader, writer = os.pipe()
    sys.stdout.flush()
    pid = os.fork()
    if not pid:
        try:
            os.close(reader)
            os.setsid()
            resource.setrlimit(resource.RLIMIT_CPU, (int(cpu_s) + 1, int(cpu_s) + 2))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            nothing = os.open(os.devnull, os.O_RDWR)
            for each in (0, 1) if os.environ.get("MUTANTS_LOUD") else (0, 1, 2):
                os.dup2(nothing, each)
            content = pickle.dumps(work())
            with os.fdopen(writer, "wb") as file:
                file.write(content)
        finally:
            os._exit(0)
    os.close(writer)
    held, until = b"", time.monotonic() + WAITING * cpu_s
    while select.select([reader], [], [], max(0.0, until - time.monotonic()))[0]:
        part = os.read(reader, 1 << 20)
        if not part:
            break
        held += part
    os.close(reader)
    with suppress(ProcessLookupError):
        os.killpg(pid, signal.SIGKILL)  # What a test started and left, too.
    os.waitpid(pid, 0)
    return pickle.loads(held) if held else None


@contextmanager
def standing(place: Path, text: str) -> Iterator[None]:
    """That text in the file; its date is one that no compiled file was made for."""
    before, date = place.read_text(encoding="utf-8"), place.stat().st_mtime
    try:
        place.write_text(text, encoding="utf-8")
        os.utime(place, (date + 2 * next(CLOCK), date + 2 * next(CLOCK)))
        yield
    finally:
        place.write_text(before, encoding="utf-8")
        os.utime(place, (date, date))


class Forks:
    """The process that has collected the tests of a tree, and forks of this one.

    `tests` are all that it found, in pytest's order; `on_import` the lines by file that run before
    any test does.
    """

    def __init__(self, tree: Path, words: Sequence[str], sources: Sequence[str]) -> None:
        self.tree, self.sources = tree, sources
        _at_home(tree)
        self._asked, theirs = Pipe()
        self._pid = os.fork()
        if not self._pid:
            self._asked.close()
            try:
                _serve(tree, words, sources, theirs)
            finally:
                os._exit(0)
        theirs.close()
        self.tests, self.on_import = self._asked.recv()

    def covered(self, tests: Sequence[str], cpu_s: float) -> Covered | None:
        """Run those with coverage."""
        self._asked.send(("cover", list(tests), cpu_s))
        found = self._asked.recv()
        return found and Covered(*found)

    def tried(
        self, path: str, text: str, tests: Sequence[str], most_s: float, cpu_s: float
    ) -> Ended:
        """Run those with that text in the file, until they took `most_s`; `cpu_s` is a limit."""
        before = (self.tree / path).read_text(encoding="utf-8")
        with standing(self.tree / path, text):
            self._asked.send(("try", path, (before, text), list(tests), most_s, cpu_s))
            ended = self._asked.recv()
            if ended is None:
                ended = in_a_fork(lambda: _cold(self.tree, tests, most_s), cpu_s + 60.0)
        return Ended(*(ended or ("endless",)))

    def unchanged(self, tests: Sequence[str], most_s: float, cpu_s: float) -> bool:
        """Whether those pass as things stand, in a process that imports anew."""
        ended = in_a_fork(lambda: _cold(self.tree, tests, most_s), cpu_s + 60.0)
        return ended is not None and ended[0] == "survived"

    def end(self) -> None:
        """Stop it."""
        self._asked.close()
        os.waitpid(self._pid, 0)


def _at_home(tree: Path) -> None:
    """Import from the tree from now on, and the libraries that every test wants at once."""
    for name in LIBRARIES:
        import_module(name)
    os.chdir(tree)
    first = [str(tree), str(tree / "src")]
    sys.path[:0] = first
    os.environ["PYTHONPATH"] = os.pathsep.join(
        [*first, *filter(None, [os.environ.get("PYTHONPATH")])]
    )
    for name in [each for each in sys.modules if each.partition(".")[0] == "tests"]:
        del sys.modules[name]  # They are of another tree.


def _coverage(tree: Path, sources: Sequence[str]) -> Any:
    from coverage import Coverage

    found = Coverage(
        data_file=None, config_file=False, source=[str(tree / each) for each in sources]
    )
    found.set_option("run:disable_warnings", list(QUIET))
    return found


def _lines(tree: Path, found: Any) -> dict[str, dict[int, list[str]]]:
    data = found.get_data()
    return {
        str(Path(file).relative_to(tree)): data.contexts_by_lineno(file)
        for file in data.measured_files()
    }


class _Server:
    """Answers instead of running what was collected."""

    def __init__(self, tree: Path, sources: Sequence[str], asked: Connection, found: Any) -> None:
        self.tree, self.sources, self.asked, self.importing = tree, sources, asked, found
        self.failed: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.append(report.nodeid)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        self.importing.stop()
        lines = _lines(self.tree, self.importing)
        self.on_import = {file: set(of) for file, of in lines.items()}
        self.items = {each.nodeid: each for each in session.items}
        self.asked.send((list(self.items), self.on_import))
        gc.unfreeze()  # What is frozen is not found.
        self.functions: dict[tuple[str, str, int], list[FunctionType]] = {}
        for each in gc.get_objects():
            if type(each) is FunctionType:
                code = each.__code__
                place = (code.co_filename, code.co_qualname, code.co_firstlineno)
                self.functions.setdefault(place, []).append(each)
        gc.collect()
        gc.freeze()
        while True:
            try:
                what, *rest = self.asked.recv()
            except EOFError:
                return True
            self.asked.send(self._cover(*rest) if what == "cover" else self._try(*rest))

    def _run(self, tests: Sequence[str], each_before: Callable[[str], None]) -> Iterator[float]:
        items = [self.items[each] for each in tests]
        for item, later in zip(items, [*items[1:], None], strict=True):
            each_before(item.nodeid)
            start = spent_s()
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=later)
            yield spent_s() - start

    def _cover(self, tests: Sequence[str], cpu_s: float) -> Any:
        def work() -> tuple[Any, ...]:
            found = _coverage(self.tree, self.sources)
            found.start()
            took = list(self._run(tests, found.switch_context))
            found.stop()
            seconds = dict(zip(tests, took, strict=True))
            return _lines(self.tree, found), seconds, list(dict.fromkeys(self.failed))

        return in_a_fork(work, cpu_s)

    def _try(
        self, path: str, texts: Sequence[str], tests: Sequence[str], most_s: float, cpu_s: float
    ) -> Any:
        """How it ended; None where it is not to be tried in a fork of this process."""
        place = str(self.tree / path)
        codes = []
        for each in texts:
            try:
                codes.append(compile(each, place, "exec", dont_inherit=True))
            except SyntaxError:
                return "killed", "the compiler"
        pairs = functions_changed(*codes)
        if pairs is None or any(self._ran(path, old) for old, _ in pairs):
            return None
        if not pairs:
            return "no change", ""
        swaps = []
        for old, new in pairs:
            found = self.functions.get((place, old.co_qualname, old.co_firstlineno), [])
            if not found:
                return None
            swaps += [(each, new) for each in found]

        def work() -> tuple[str, str, int]:
            for function, code in swaps:
                function.__code__ = code
            spent = 0.0
            for k, took in enumerate(self._run(tests, lambda _: None), start=1):
                if self.failed:
                    return "killed", self.failed[0], 0
                spent += took
                if spent > most_s:
                    return "survived", "", len(tests) - k
            return "survived", "", 0

        return in_a_fork(work, cpu_s) or ("endless", "")

    def _ran(self, path: str, code: CodeType) -> bool:
        """Whether a function ran before any test did: what it made then stays."""
        lines = {line for _, _, line in code.co_lines() if line and line > code.co_firstlineno}
        return bool(lines & self.on_import.get(path, set()))


def _serve(tree: Path, words: Sequence[str], sources: Sequence[str], asked: Connection) -> None:
    found = _coverage(tree, sources)
    found.start()
    base = tree / "tmp.warm"
    server = _Server(tree, sources, asked, found)
    code = pytest.main([*WORDS, f"--basetemp={base}", *words], plugins=[server])
    if code not in (0, 5):
        sys.stderr.write(f"pytest ends with {code} before anything is changed\n")


class _Noted:
    """Whether a test, or the collection, failed, and how many were left out when time was up."""

    def __init__(self, most_s: float) -> None:
        self.most_s, self.failed, self.left_out = most_s, "", 0

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self.session, self.start_s, self.begun = session, spent_s(), 0

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid

    def pytest_runtest_logfinish(self) -> None:
        self.begun += 1
        left_out = len(self.session.items) - self.begun
        if left_out and spent_s() - self.start_s > self.most_s:
            self.left_out, self.session.shouldstop = left_out, "time is up"

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed and not self.failed:
            self.failed = f"collecting {report.nodeid}"


def spent_s() -> float:
    """Processor's time of this process and of those that it started and waited for."""
    return sum(os.times()[:4])


def _cold(tree: Path, tests: Sequence[str], most_s: float) -> tuple[str, str, int]:
    noted = _Noted(most_s)
    base = tree / f"tmp.cold{next(CLOCK)}"
    code = pytest.main(["-x", *WORDS, f"--basetemp={base}", *tests], plugins=[noted])
    if noted.failed or (code in (1, 2, 4) and not noted.left_out):
        return "killed", noted.failed or f"pytest's end {int(code)}", 0
    ended = code == 0 or noted.left_out
    return (
        ("survived", "", noted.left_out) if ended else ("not run", f"pytest's end {int(code)}", 0)
    )
