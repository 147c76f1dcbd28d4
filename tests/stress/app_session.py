"""A session on the page in Chromium that somebody kills, and what it was told is done."""

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
from contextlib import suppress
from pathlib import Path
from typing import Any

from playwright.sync_api import BrowserContext, Locator, Playwright
from playwright.sync_api import Error as BrowserError

from tests.stress.app_kept import Kept
from tests.sweep_log import SweepFlight

MODEL = """
kind = "transfer"
name = "Roll rate, first order"
source = "an exercise"

[inputs]
tau_phi = "1"

[outputs]
p = "rad/s"

[responses]
"p/tau_phi" = { gain = "Ltphi", numerator = [], denominator = ["s - Lp"] }

[parameters]
Ltphi = { value = 100.0, unit = "rad/s^2", min = 0.1, max = 10000.0, status = "free" }
Lp = { value = -3.0, unit = "1/s", min = -100.0, max = 10.0, status = "free" }
"""
PATIENCE_MS = 180_000
FORKS, SPAWNED = "multiprocessing.forkserver", "spawn_main"
"""Words of Python's own processes of either kind."""
EDITS = 6
ASK = """async ([path, options]) => {
  const told = await fetch(path, options);
  return [told.status, await told.text()];
}"""


class RefusedError(Exception):
    """The server answered that it will not, or the work it began has failed."""


def kill(process: int) -> None:
    """End a process without a word."""
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)


def descendants(process: int) -> list[tuple[int, str]]:
    """Processes that one has started, they too, with their words."""
    parents: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
            parents.setdefault(parent, []).append(int(stat.parent.name))
    family = list(parents.get(process, []))
    for each in family:
        family += parents.get(each, [])
    told = []
    for each in family:
        with suppress(OSError):
            words = Path(f"/proc/{each}/cmdline").read_bytes().replace(b"\0", b" ")
            told.append((each, words.decode(errors="replace")))
    return told


def parent_of(process: int) -> int:
    """Which process has started one; 0 where it has ended."""
    with suppress(OSError):
        stat = Path(f"/proc/{process}/stat").read_text()
        return int(stat.rpartition(")")[2].split()[1])
    return 0


def forkers(server: int) -> list[int]:
    """Of a server, the process that has imported once and is forked for each worker."""
    return [p for p, words in descendants(server) if FORKS in words and parent_of(p) == server]


def workers(server: int) -> list[int]:
    """Processes that work for a server: forks of that one, or begun each for itself."""
    begun = forkers(server)
    return [p for p, words in descendants(server) if parent_of(p) in begun or SPAWNED in words]


class Server:
    """`flightid app` on a folder, in a process of its own."""

    def __init__(self, folder: Path) -> None:
        words = (sys.executable, "-m", "flightid", "app", str(folder), "--no-browser")
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.pid = self._process.pid
        self.address = ""
        said = []
        assert self._process.stdout is not None
        for line in self._process.stdout:
            said.append(line.decode())
            if line.startswith(b"http"):
                self.address = line.decode().strip()
                break
        assert self.address, "".join(said)
        self.workers: list[int] = []

    def close(self) -> None:
        """End it, where it was not killed."""
        self._process.terminate()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(20.0)
        self._process.kill()
        self._process.wait()


class Session:
    """A browser of one window; every answer is written to `kept` when the page has it."""

    def __init__(self, tools: Playwright, server: Server, kept: Kept) -> None:
        before = {pid for pid, _ in descendants(os.getpid())}
        self._browser = tools.chromium.launch(
            executable_path=shutil.which("chromium") or shutil.which("google-chrome"),
            args=["--no-sandbox", "--disable-gpu", "--disable-background-networking"],
        )
        made = [(p, words) for p, words in descendants(os.getpid()) if p not in before]
        self.pid = next(p for p, words in made if "chrom" in words and "--type=" not in words)
        self.kept, self.step = kept, "start"
        self.problems: list[str] = []
        self._stop = threading.Event()
        self._context: BrowserContext | None = None
        self.attach(server)

    def attach(self, server: Server) -> None:
        """Open the page of a server."""
        if self._context is not None:
            self._context.close()
        self._server = server
        self._context = self._browser.new_context()
        self._page = self._context.new_page()
        self._page.on("pageerror", lambda error: self.problems.append(f"page: {error}"))
        self._page.set_default_timeout(PATIENCE_MS)
        self._page.goto(server.address)
        self._page.wait_for_selector(".drop")

    def close(self) -> None:
        """End the browser, where it was not killed."""
        with suppress(BrowserError):
            self._browser.close()

    def round(self, stop: threading.Event) -> None:
        """Drop a log, edit its study, look at a field, keep a model, run the study."""
        self._stop = stop
        steps = (self.drop, self.look, self.thin, self.edit, self.model, self.run)
        for step in steps:
            if stop.is_set():
                return
            self.step = step.__name__
            self._server.workers = [p for p, _ in descendants(self._server.pid)]
            step()

    def drop(self) -> None:
        """Drop a log that nobody has dropped."""
        kept = self.kept
        kept.number += 1
        self._page.goto(self._server.address.partition("?")[0] + "#/")
        self._page.wait_for_selector(".drop")
        flight = SweepFlight(sweep_s=20.0, rate_hz=100.0, amplitude=0.1 + 1e-4 * kept.number)
        with tempfile.TemporaryDirectory() as name:
            self._page.set_input_files("input[type=file]", flight.write(Path(name)))
            self._until(self._page.locator("main:not(:has(.drop))"))
        self.log = self._page.evaluate("location.hash").rpartition("/")[2]
        kept.logs.append(self.log)
        kept.begun["overview", self.log] = ""

    def look(self) -> None:
        """See the verdict, and a field of the log."""
        self._until(self._page.locator(".cards"))
        self.kept.overviews.append(self.log)
        self.kept.begun.pop(("overview", self.log), None)
        study = self.ask(f"/api/studies/{self.log}")
        self.kept.studies[self.log] = [study["text"]]
        query = "series=IMU.GyrX&start_s=0&stop_s=60&columns=800"
        self._page.evaluate(ASK, [f"/api/logs/{self.log}/view?{query}", {}])

    def thin(self) -> None:
        """Take two of three models out of the study."""
        self.change([{"path": ["model", k], "value": None} for k in (2, 1)])

    def edit(self) -> None:
        """Drag a band."""
        for k in range(EDITS):
            band = [2.0 + 0.1 * k, 20.0]
            self.change([{"path": ["model", 0, "band_rad_s"], "value": band}])

    def change(self, edits: list[dict[str, Any]]) -> None:
        """Change keys of the study; until the answer comes both versions may be there."""
        versions = self.kept.studies[self.log]
        now = self.ask(f"/api/studies/{self.log}")
        self.kept.changing = self.log
        told = self.ask(
            f"/api/studies/{self.log}", "PATCH", {"edits": edits}, {"if-match": now["etag"]}
        )
        self.kept.changing = ""
        versions[:] = [told["text"]]

    def model(self) -> None:
        """Keep a model file."""
        text = f"# {self.kept.number}\n{MODEL}"
        body = {"name": "mine", "text": text, "keep": True}
        told = self.ask(f"/api/models/{self.log}/own", "POST", body)
        assert told["template"], told
        self.kept.models[str(told["template"]).rpartition("/")[2]] = text

    def run(self) -> None:
        """Run the study to its end."""
        etag = self.ask(f"/api/studies/{self.log}")["etag"]
        self.ask(f"/api/runs/{self.log}", "POST", {})
        self.kept.begun["run", self.log] = etag
        while True:
            told = self.ask(f"/api/runs/{self.log}")
            if told["run"] is not None and told["run"]["etag"] == etag:
                break
            if told["jobs"] and told["jobs"][0]["state"] != "waiting":
                raise RefusedError(told["jobs"][0]["reason"])
            self._page.wait_for_timeout(200)
        self.kept.begun.pop(("run", self.log), None)
        self.kept.runs[self.log] = etag

    def _until(self, place: Locator) -> None:
        """Wait for what the page will show, unless somebody was killed meanwhile."""
        until = time.monotonic() + PATIENCE_MS / 1e3
        while not place.count():
            if self._stop.is_set() or time.monotonic() > until:
                raise RefusedError("it was not shown")
            self._page.wait_for_timeout(100)

    def shows(self, log: str) -> bool:
        """Whether the screen of a flight is drawn whole."""
        self._page.goto(self._server.address.partition("?")[0] + f"#/flight/{log}")
        self._page.wait_for_selector(".cards")
        return self._page.locator(".cards > *").count() == 3

    def offers(self, log: str) -> bool:
        """Whether the screen Report tells of a run that goes on, was cut short, or has ended."""
        self._page.goto(self._server.address.partition("?")[0] + f"#/report/{log}")
        self._page.wait_for_selector(".bar")
        told = self._page.locator(".working, .bar .error, .links")
        with suppress(BrowserError):
            told.first.wait_for(timeout=10_000)
        return told.count() > 0

    def ask(
        self,
        path: str,
        method: str = "GET",
        body: object = None,
        more: dict[str, str] | None = None,
    ) -> Any:
        """An answer, as the page gets it.

        Raises
        ------
        RefusedError
            It is a refusal.
        """
        options: dict[str, object] = {"method": method}
        if body is not None:
            options["headers"] = {"content-type": "application/json"} | (more or {})
            options["body"] = json.dumps(body)
        status, text = self._page.evaluate(ASK, [path, options])
        if status != 200:
            raise RefusedError(f"{path}: {status} {text[:200]}")
        return json.loads(text) if text[:1] in '{["n' else text
