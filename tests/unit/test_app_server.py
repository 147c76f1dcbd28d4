"""The local page's server on a socket: studies by their tags, jobs, numbers of a run."""

from __future__ import annotations

import asyncio
import http.client
import json
import os
import re
import shutil
import signal
import sys
import threading
import time
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from flightid import FrequencyResponse, run_study
from flightid.app import gain_work, work
from flightid.app.crew import NEEDED, Crew
from flightid.app.guard import POLICY, SANDBOXED, Session
from flightid.app.jobs import Workers
from flightid.app.schemas import Job
from flightid.app.server import make_server
from flightid.app.serving import bound_again, bound_socket, server_of
from flightid.app.study_edits import KeyEdit, edited
from flightid.app.workspace import UNDATED_NS, Workspace
from flightid.errors import OptionError
from flightid.vehicles import fly
from flightid.vehicles.ardupilot_log import write_ardupilot_log
from tests.sweep_log import SweepFlight

Answer = tuple[int, Any, dict[str, str]]


@dataclass
class Browser:
    """Asks as the page does."""

    session: Session
    workspace: Workspace

    def ask(self, path: str, method: str = "GET", body: object = None, **headers: str) -> Answer:
        given = {
            "Cookie": f"{self.session.cookie}={self.session.secret}",
            "Sec-Fetch-Site": "same-origin",
            "Origin": f"http://127.0.0.1:{self.session.port}",
        }
        sent: bytes | None = None
        if body is not None:
            sent = body if isinstance(body, bytes) else json.dumps(body).encode()
            binary = isinstance(body, bytes)
            given["Content-Type"] = "application/octet-stream" if binary else "application/json"
        given |= {name.replace("_", "-"): value for name, value in headers.items()}
        line = http.client.HTTPConnection("127.0.0.1", self.session.port, timeout=60)
        line.request(method, path, body=sent, headers=given)
        answer = line.getresponse()
        content = answer.read()
        told = {name.lower(): value for name, value in answer.getheaders()}
        line.close()
        plain = "json" in told.get("content-type", "")
        return answer.status, json.loads(content) if plain else content, told

    def socket(self, path: str = "/api/live", **more: Any) -> Any:
        given = {"Cookie": f"{self.session.cookie}={self.session.secret}"}
        address = f"ws://127.0.0.1:{self.session.port}{path}"
        options = {"origin": f"http://127.0.0.1:{self.session.port}", **more}
        return connect(address, additional_headers=given, **options)


@dataclass
class Flown:
    """A workspace whose log has been inspected."""

    folder: Path
    log: str
    study: Path


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    folder = tmp_path_factory.mktemp("workspace")
    path = SweepFlight(sweep_s=20.0, rate_hz=100.0).write(folder)
    workspace = Workspace(folder)
    workspace.scan()
    (entry,) = workspace.index.entries()
    study = workspace.study_path(entry.id)
    _, refusal, _ = work.answered(
        work.make_overview, path, study, workspace.result_path(entry.id, "overview.json")
    )
    assert not refusal
    work.make_review(path, workspace.result_path(entry.id, "review.json"))
    workspace.index.close()
    return Flown(folder, entry.id, study)


@pytest.fixture(scope="module")
def browser(flown: Flown) -> Iterator[Browser]:
    workspace = Workspace(flown.folder)
    workspace.scan()
    bound = bound_socket(0)
    session = Session(bound.getsockname()[1])
    page = {"index.html": ("text/html", b"<p>page</p>"), "icon.svg": ("image/svg+xml", b"<svg/>")}
    server = server_of(workspace, page, session)
    thread = threading.Thread(target=lambda: asyncio.run(server.serve(sockets=[bound])))
    thread.start()
    yield Browser(session, workspace)
    server.should_exit = True
    thread.join()


def test_a_flight_is_one_sentence_three_cards_and_a_strip(browser: Browser, flown: Flown) -> None:
    status, flight, headers = browser.ask(f"/api/logs/{flown.log}")
    assert status == 200
    assert headers["content-security-policy"] == POLICY
    shown = flight["overview"]
    assert shown["sentence"].startswith("This log can carry a model of roll, pitch and yaw")
    assert [card["axis"] for card in shown["cards"]] == ["roll", "pitch", "yaw"]
    bands = {each["name"]: each["band_rad_s"] for each in _models(browser, flown)}
    assert {card["model"]: card["band_rad_s"] for card in shown["cards"]} == bands
    sweeps = [block for block in shown["blocks"] if block["kind"] == "sid"]
    assert [block["axis"] for block in sweeps] == ["roll", "pitch", "yaw"]
    by_code = {verdict["code"]: verdict for verdict in shown["verdicts"]}
    roll = sweeps[0]
    assert by_code["band-roll"]["spans_s"] == [[roll["start_s"], roll["stop_s"]]]
    (rates,) = [line for line in shown["lines"] if line["name"] == "p"]
    assert len(rates["low"]) == len(rates["high"]) == 900
    _, listing, _ = browser.ask("/api/workspace")
    assert [(log["id"], log["sweeps"]) for log in listing["logs"]] == [(flown.log, 3)]


def _models(browser: Browser, flown: Flown) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = browser.ask(f"/api/studies/{flown.log}")[1]["settings"]["model"]
    return found


def test_who_has_not_seen_the_last_version_changes_nothing(browser: Browser, flown: Flown) -> None:
    place, before = f"/api/studies/{flown.log}", flown.study.read_text()
    _, seen, headers = browser.ask(place)
    assert headers["etag"] == seen["etag"]
    edit = {"edits": [{"path": ["model", 0, "band_rad_s"], "value": [2.0, 15.0]}]}
    assert browser.ask(place, "PATCH", edit)[0] == 428
    status, changed, _ = browser.ask(place, "PATCH", edit, If_Match=seen["etag"])
    assert (status, changed["settings"]["model"][0]["band_rad_s"]) == (200, [2.0, 15.0])
    status, told, _ = browser.ask(place, "PATCH", edit, If_Match=seen["etag"])
    assert status == 409
    assert told["detail"] == {"text": changed["text"], "etag": changed["etag"]}
    wrong = {"edits": [{"path": ["model", 0, "band"], "value": 1}]}
    status, told, _ = browser.ask(place, "PATCH", wrong, If_Match=changed["etag"])
    assert status == 422
    assert "band_rad_s" in told["error"]
    for sent in ({"path": ["study", "title"], "value": "\ud800"}, {"path": ["\ud800"], "value": 1}):
        assert browser.ask(place, "PATCH", {"edits": [sent]}, If_Match=changed["etag"])[0] == 422
    assert browser.ask(place, "POST", {"text": "\ud800"}, If_Match=changed["etag"])[0] == 422
    whole = {"text": before}
    assert browser.ask(place, "POST", whole, If_Match=changed["etag"])[0] == 200
    assert flown.study.read_text() == before


def test_a_study_that_is_lost_is_told_and_proposed_again(browser: Browser, flown: Flown) -> None:
    """One that is gone and one with a slip: nothing is written over either unasked."""
    place, before = f"/api/studies/{flown.log}", flown.study.read_text()
    slip = 'title = "'
    flown.study.write_text(before.replace(slip, "title = ", 1))
    status, told, _ = browser.ask(place)
    assert (status, told["settings"]) == (200, {})
    assert f"line {before[: before.index(slip)].count(chr(10)) + 1}, col" in told["lack"]
    status, made, _ = browser.ask(f"/api/logs/{flown.log}/study", "POST", {})
    assert status == 200
    assert made["models"]
    assert flown.study.read_text() != made["text"]
    flown.study.unlink()
    told = browser.ask(place)[1]
    assert "not in the folder any more" in told["lack"]
    plot = {"edits": [{"path": ["plot"], "value": [{"series": ["A.B"]}]}]}
    assert browser.ask(place, "PATCH", plot, If_Match=told["etag"])[0] == 404
    assert not flown.study.exists()
    status, told, _ = browser.ask(place, "POST", {"text": made["text"]}, If_Match=told["etag"])
    assert (status, told["lack"]) == (200, "")
    flown.study.write_text(before)
    rig = "c" * 16
    (flown.folder / "records" / rig).mkdir(parents=True)
    (flown.folder / "records" / rig / "a.csv").write_text("time,u,y\n0,1,2\n1,0,3\n2,1,1\n")
    (flown.folder / "studies" / f"{rig}.toml").write_text('title = "a\n')
    asked = {"inputs": ["u"], "outputs": ["y"]}
    status, told, _ = browser.ask(f"/api/records/{rig}/study", "POST", asked)
    assert status == 422
    assert "a study file that cannot be read stands there" in told["error"]
    assert "line 1" in told["error"]
    shutil.rmtree(flown.folder / "records" / rig)
    (flown.folder / "studies" / f"{rig}.toml").unlink()


def test_a_study_that_leads_out_of_the_folder_is_said_and_opened_by_nothing(
    browser: Browser, flown: Flown, tmp_path: Path
) -> None:
    """The page takes the text, says which file, and neither runs it nor looks into it."""
    place, before = f"/api/studies/{flown.log}", flown.study.read_text()
    secret = tmp_path / "secret.bin"
    shutil.copy(next(flown.folder.glob("*.bin")), secret)
    inside = browser.ask(place)[1]
    assert inside["outside"] == []
    link = flown.folder / "link.bin"
    link.symlink_to(secret)
    for named in (str(secret), "../../../secret.bin", "../link.bin"):
        edit = {"edits": [{"path": ["log", "path"], "value": named}]}
        tag = browser.ask(place)[1]["etag"]
        status, told, _ = browser.ask(place, "PATCH", edit, If_Match=tag)
        assert status == 200, told
        (said,) = told["outside"]
        assert said.endswith("secret.bin")
        status, told, _ = browser.ask(f"/api/runs/{flown.log}", "POST", {})
        assert status == 422
        assert "names files outside the folder of the page" in told["error"]
        with browser.socket() as line:
            ask = {"request": 1, "kind": "response", "log": flown.log, "model": "Roll rate"}
            line.send(json.dumps(ask))
            while (heard := json.loads(line.recv(60))).get("request") != 1:
                pass
        assert "outside the folder" in heard["error"]
        status, told, _ = browser.ask(f"/api/gains/{flown.log}", "POST", {})
        assert status == 422
        assert "outside the folder" in told["error"]
    link.unlink()
    tag = browser.ask(place)[1]["etag"]
    assert browser.ask(place, "POST", {"text": before}, If_Match=tag)[1]["outside"] == []


def test_a_log_off_the_list_is_where_it_was_and_comes_back(browser: Browser, flown: Flown) -> None:
    held = sorted(each for each in flown.folder.rglob("*.bin"))

    def listed() -> list[str]:
        return [each["id"] for each in browser.ask("/api/workspace")[1]["logs"]]

    off = {"id": flown.log, "removed": True}
    status, told, _ = browser.ask("/api/removed", "POST", off)
    assert (status, told) == (200, browser.ask("/api/removed")[1])
    (item,) = told
    assert (item["id"], item["kind"], item["name"]) == (flown.log, "log", "sweeps.bin")
    assert flown.log not in listed()
    assert browser.ask(f"/api/logs/{flown.log}")[0] == 200
    assert browser.ask("/api/removed", "POST", off | {"removed": False})[1] == []
    assert flown.log in listed()
    browser.ask("/api/removed", "POST", off)
    body = held[0].read_bytes()  # dropped again: it is meant to be there
    assert browser.ask("/api/logs?name=again.bin", "PUT", body)[1]["id"] == flown.log
    assert flown.log in listed()
    table = b"t,u,y\n0,1,2\n1,0,3\n2,1,1\n"
    rig = browser.ask("/api/records?name=a.csv", "PUT", table)[1]["id"]
    # One file of a set goes and comes alone; the last one goes with its set.
    place, second = f"/api/records/{rig}", f"/api/records?name=b.csv&rig={rig}"
    browser.ask(second, "PUT", table + b"3,0,2\n")
    out = {"name": "b.csv", "out": True}
    assert browser.ask(f"{place}/files", "POST", out)[1]["files"] == 1
    screen = browser.ask(place)[1]
    assert ([each["name"] for each in screen["files"]], screen["left_out"]) == (
        ["a.csv"],
        ["b.csv"],
    )
    assert browser.ask(f"{place}/files", "POST", {"name": "a.csv", "out": True})[0] == 422
    assert browser.ask(f"{place}/files", "POST", {"name": "../x", "out": True})[0] == 404
    assert len(list((flown.folder / "records" / rig).iterdir())) == 2
    assert browser.ask(second, "PUT", table + b"3,0,2\n")[1]["files"] == 2  # dropped again
    browser.ask(f"{place}/files", "POST", out)
    (item,) = browser.ask("/api/removed", "POST", {"id": rig, "removed": True})[1]
    assert (item["kind"], item["name"]) == ("records", "a.csv")
    assert browser.ask("/api/records")[1] == []
    status, told, _ = browser.ask("/api/records?name=letter.txt", "PUT", b"Dear Ann\nit flies.\n")
    assert status == 422
    assert "letter.txt holds no table of numbers" in told["error"]
    assert browser.ask("/api/removed", "POST", {"id": "0" * 16, "removed": True})[0] == 404
    assert sorted(each for each in flown.folder.rglob("*.bin")) == held


def test_a_log_keeps_its_date(tmp_path: Path) -> None:
    """The list said of a dropped log when it was dropped, as the date of the file."""
    body = SweepFlight(sweep_s=2.0, rate_hz=50.0).write(tmp_path).read_bytes()

    async def pieces() -> AsyncIterator[bytes]:
        yield body

    was = 1_600_000_000_000
    for modified_ms, kept in ((was, True), (0, False), (10 * was, False)):
        (tmp_path / str(modified_ms)).mkdir()
        workspace = Workspace(tmp_path / str(modified_ms))
        asyncio.run(workspace.take("old.bin", pieces(), modified_ms))
        (entry,) = workspace.index.entries()
        assert (entry.mtime_ns == was * 1_000_000) == kept
        assert kept or entry.mtime_ns == UNDATED_NS  # the hour of the drop is no date of a flight
        workspace.index.close()


def test_a_folder_has_the_port_that_it_had(tmp_path: Path) -> None:
    """A browser keeps colours and layouts by address."""
    with bound_again(tmp_path) as bound:
        port = bound.getsockname()[1]
        with bound_again(tmp_path) as beside:  # taken: another one
            other = beside.getsockname()[1]
    assert other != port
    with bound_again(tmp_path) as bound:
        assert bound.getsockname()[1] == other
    for words in ("no port", "80", "9" * 40, "70000"):
        (tmp_path / ".flightid" / "port").write_text(words)
        with bound_again(tmp_path) as bound:
            assert bound.getsockname()[1] >= 1024


def test_requests_that_a_stranger_makes_on_the_wire(browser: Browser, flown: Flown) -> None:
    place = f"/api/studies/{flown.log}"
    assert browser.ask(place, Origin="http://127.0.0.1:1")[0] == 403
    assert browser.ask(place, Host="evil.example")[0] == 421
    assert browser.ask(place, Cookie="")[0] == 401
    paths = ("/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/api/logs/..%2f..", "/api/logs/x")
    assert {browser.ask(path)[0] for path in paths} == {404}
    assert browser.ask("/api/logs?name=x.bin", "PUT", b"<script>")[0] == 422
    bound = bound_socket(0)
    assert bound.getsockname()[0] == "127.0.0.1"
    with pytest.raises(OptionError, match="the port cannot be taken"):
        bound_socket(bound.getsockname()[1])
    bound.close()


def test_every_route_is_behind_the_guard(browser: Browser) -> None:
    """Whatever a module of routes adds is refused to strangers before it is asked."""
    app = make_server(browser.workspace, {})
    asked = [
        (method, re.sub(r"{[^}]+}", "x", route.path))
        for route in app.routes
        for method in sorted(getattr(route, "methods", None) or ())
        if route.path not in ("/", "/{name:path}")
    ]
    new = {("POST", "/api/comparisons"), ("POST", "/api/plans"), ("GET", "/api/plans/x/card")}
    assert new | {("POST", "/api/gains/x")} < set(asked)
    tries = {
        403: [{"Origin": "http://127.0.0.1:1"}, {"Sec_Fetch_Site": "cross-site"}],
        421: [{"Host": "evil.example"}],
        401: [{"Cookie": ""}],
    }
    for method, path in asked:
        body = {} if method in ("POST", "PATCH") else b"x" if method == "PUT" else None
        for status, heads in tries.items():
            assert {browser.ask(path, method, body, **head)[0] for head in heads} == {status}, path
        if body is not None:  # a form of a foreign page could send this
            kind = {"Content_Type": "text/plain"}
            assert browser.ask(path, method, body, **kind)[0] == 415, path
    sockets = {route.path for route in app.routes if not hasattr(route, "methods")}
    assert {"/api/live", "/api/fly"} <= sockets
    for path in sockets:
        for origin in (None, "http://127.0.0.1:1", "https://evil.example"):
            with pytest.raises(InvalidStatus), browser.socket(path, origin=origin):
                pass


def test_gains_comparisons_and_plans_refuse_what_is_not_there(
    browser: Browser, flown: Flown
) -> None:
    assert browser.ask(f"/api/gains/{'0' * 16}", "POST", {})[0] == 404
    # Gains that were found before are there at once: those of this text and of these files.
    study = flown.study.read_text()
    version = gain_work.gains_version(flown.study, study)
    known = {"axes": [], "ranges": {}, "preset": "balanced", "form": "pi_d",
             "refused": [], "findings": [], "n_steps": 0, "left_out": {},
             "refusal": "none", "files": [], "loops": []}  # fmt: skip
    browser.workspace.keep_result(flown.log, f"gains-{version}", known)
    told = browser.ask(f"/api/gains/{flown.log}", "POST", {})[1]
    assert (told["gains"], told["jobs"]) == (known, [])
    job = {"id": f"gains-{flown.log}", "kind": "gains", "log": flown.log, "state": "interrupted"}
    assert not [
        each for each in browser.ask("/api/jobs", "POST", job)[1] if each["kind"] == "gains"
    ]
    none = {**job, "log": "0" * 16, "id": f"gains-{'0' * 16}"}
    assert browser.ask("/api/jobs", "POST", none)[0] == 404
    firm = study + '\n[tune]\npreset = "firm"\n'
    assert gain_work.gains_version(flown.study, firm) != version
    here: dict[str, Any] = {"log": flown.log, "span_s": None, "promised": False}
    for before, after, status in (
        ({**here, "log": "none"}, here, 404),
        (here, {**here, "log": "../x"}, 404),
        (here, {"span_s": [0, 1]}, 422),
        ({**here, "span_s": [40.0, 30.0]}, {**here, "span_s": [30.0, 40.0]}, 422),
    ):
        asked = {"before": before, "after": after}
        assert browser.ask("/api/comparisons", "POST", asked)[0] == status, asked
    for wishes, status in (({"amplitude": "x"}, 422), ({"axes": ["sideways"]}, 422)):
        assert browser.ask("/api/plans", "POST", {"log": flown.log, "wishes": wishes})[0] == status
    assert browser.ask("/api/plans", "POST", {"log": "none", "wishes": {}})[0] == 404
    for wishes in ("{", "[]", '{"amplitude": "x"}', "9" * 3000):
        place = f"/api/plans/{flown.log}/card?wishes={quote(wishes)}"
        status, _, headers = browser.ask(place)
        assert (status, headers["content-security-policy"]) == (422, POLICY)


def test_a_card_is_sandboxed_and_a_plan_follows_what_is_typed(
    browser: Browser, tmp_path: Path
) -> None:
    flight = write_ardupilot_log(fly(duration_s=20.0), tmp_path / "a.bin").read_bytes()
    name = quote("<img src=x onerror=alert(1)>.bin")
    log = browser.ask(f"/api/logs?name={name}", "PUT", flight)[1]["id"]
    wishes = {"amplitude": 0.05, "axes": ["roll"]}
    status, plan, headers = browser.ask("/api/plans", "POST", {"log": log, "wishes": wishes})
    assert (status, headers["content-security-policy"]) == (200, POLICY), plan
    ((axis, amplitude),) = [(row["axis"], row["amplitude"]) for row in plan["rows"]]
    assert (axis, amplitude) == ("roll", pytest.approx(0.05, rel=1e-6))
    assert bool(plan["files"]) is not bool(plan["refusal"])
    place = f"/api/plans/{log}/card?wishes={quote(json.dumps(wishes))}"
    status, page, headers = browser.ask(place)
    assert (status, headers["content-security-policy"]) == (200, SANDBOXED)
    assert headers["content-type"].startswith("text/html")
    assert headers["x-content-type-options"] == "nosniff"
    assert not re.search(rb"<script|<img src=x|\son\w+=", page.lower())
    assert b"0.05 of full" in page


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a tuning that waits needs a pipe")
def test_a_tuning_holds_up_neither_a_comparison_nor_a_plan(tmp_path: Path) -> None:
    """The tuning reads a pipe that nobody writes before all others have answered."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)

    async def asked() -> bool:
        workers = Workers(Workspace(tmp_path))
        slow = asyncio.ensure_future(workers.tuned(os.open, str(pipe), os.O_RDONLY))
        try:
            await asyncio.gather(*(f(os.getpid) for f in (workers.compared, workers.planned)))
            await workers.live(os.getpid)
            return slow.done()
        finally:
            os.close(await asyncio.to_thread(os.open, pipe, os.O_WRONLY))
            await slow
            workers.stop()

    assert not asyncio.run(asked())


def test_a_worker_killed_without_work_is_replaced(tmp_path: Path) -> None:
    async def asked(workers: Workers) -> int:
        process, refusal, _ = await workers.live(os.getpid)
        assert not refusal
        return int(process)

    async def killed() -> list[int]:
        workers, processes = Workers(Workspace(tmp_path)), []
        for _ in range(2):
            processes.append(await asked(workers))
            os.kill(processes[-1], signal.SIGKILL)
        processes.append(await asked(workers))
        await asyncio.to_thread(workers.stop)
        return processes

    assert len(set(asyncio.run(killed()))) == 3


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere each imports for itself")
def test_workers_are_forks_of_one_server_that_has_imported_once(tmp_path: Path) -> None:
    """Seven processes had each imported everything: 4.4 s of processor time in place of 1.2."""
    crews = [Crew(tmp_path) for _ in range(2)]
    parents = {crew.schedule(os.getppid).result() for crew in crews}
    loaded = crews[0].schedule(eval, "list(__import__('sys').modules)").result()
    (threads,) = (len(list(Path(f"/proc/{each}/task").iterdir())) for each in parents)
    for crew in crews:
        crew.stop()
        crew.join()
    assert os.getpid() not in parents
    assert threads == 1, "what is forked of a process with threads may wait for a lock for good"
    assert set(NEEDED) <= set(loaded)


def test_any_field_is_drawn_at_any_zoom(browser: Browser, flown: Flown) -> None:
    _, groups, _ = browser.ask(f"/api/logs/{flown.log}/fields")
    (rate,) = [group for group in groups if group["message"] == "RATE"]
    assert rate["fields"]["R"] == "deg/s"
    place = f"/api/logs/{flown.log}/view?series=RATE.R&series=RATE.ROut"
    _, content, _ = browser.ask(f"{place}&start_s=20&stop_s=20.05&columns=100")
    points, rows = (int(each) for each in np.frombuffer(content, count=2))
    table = np.frombuffer(content, offset=16).reshape(rows, points)
    assert rows == 3
    assert points == 8  # six samples in the span, and one on each side
    np.testing.assert_allclose(np.diff(table[0]), 0.01, rtol=1e-6)
    for bad in ("series=RATE", "series=RATE.Nothing", "series=X.Y"):
        query = f"/api/logs/{flown.log}/view?{bad}&start_s=0&stop_s=1&columns=100"
        assert browser.ask(query)[0] == 422
    assert browser.ask(f"{place}&start_s=1&stop_s=nan&columns=100")[0] == 422


def test_only_the_newest_question_of_a_hand_is_answered(browser: Browser, flown: Flown) -> None:
    model = _models(browser, flown)[0]["name"]
    with browser.socket() as line:
        for number in range(20):
            band = [2.0, 10.0 + 0.1 * number]
            edits = [{"path": ["model", 0, "band_rad_s"], "value": band}]
            question = {"request": number, "log": flown.log, "model": model, "edits": edits}
            line.send(json.dumps(question))
        answers = []
        while not answers or answers[-1]["request"] < 19:
            answers.append(json.loads(line.recv(timeout=60)))
        assert len(answers) < 20
        assert answers[-1]["response"]["curves"][0]["omega_rad_s"][-1] == 11.9
        line.send(json.dumps({"request": 20, "log": "../x", "model": model}))
        assert "no study" in json.loads(line.recv(timeout=60))["error"]


def test_a_cancelled_job_and_a_killed_one_can_be_begun_again(
    browser: Browser, flown: Flown, tmp_path: Path
) -> None:
    Workers(Workspace(tmp_path)).stop()
    job = Job(id="review-x", kind="review", log="x", state="waiting")
    (tmp_path / ".flightid" / "jobs" / "review-x.json").write_text(job.model_dump_json())
    left = Workers(Workspace(tmp_path))
    assert [each.state for each in left.all()] == ["interrupted"]
    left.stop()
    browser.workspace.forget(flown.log)
    flight = browser.ask(f"/api/logs/{flown.log}")[1]
    waiting = [job["id"] for job in flight["jobs"] if job["state"] == "waiting"]
    assert waiting == [f"overview-{flown.log}", f"review-{flown.log}"]
    marks = flown.folder / ".flightid" / "jobs"
    assert {path.stem for path in marks.iterdir()} == set(waiting)
    for name in waiting:
        assert browser.ask(f"/api/jobs/{name}", "DELETE")[0] == 200
    states = {job["state"] for job in browser.ask("/api/jobs")[1]}
    assert states == {"cancelled"}
    assert not list(marks.iterdir())
    assert browser.ask("/api/jobs/nothing", "DELETE")[0] == 404
    for job in browser.ask("/api/jobs")[1]:
        browser.ask("/api/jobs", "POST", job)
    until = time.monotonic() + 60.0
    while time.monotonic() < until:
        begun = time.perf_counter()
        flight = browser.ask(f"/api/logs/{flown.log}")[1]
        assert time.perf_counter() - begun < 5.0  # the page answers while they run
        if flight["overview"] and flight["review"]:
            break
        time.sleep(0.05)
    assert flight["overview"]["sentence"].startswith("This log can carry")


def test_the_page_shows_the_numbers_of_a_run_to_the_last_digit(
    flown: Flown, tmp_path: Path
) -> None:
    """Clicks on the page, the study file that they leave behind, and its Python lines."""
    shutil.copy(next(flown.folder.glob("*.bin")), tmp_path)
    text = flown.study.read_text().replace("../", "")
    clicks = [
        KeyEdit(("model", 0, "band_rad_s"), [4.3, 17.1]),
        KeyEdit(("model", 0, "response", "n_omega"), 23),
        KeyEdit(("model", 0, "response", "compare"), ["composite"]),
        KeyEdit(("fit", "starts"), 1),
    ]
    study = tmp_path / "study.toml"
    study.write_text(text)
    shown = work.make_responses(study, text, "Roll rate", clicks, True, True)
    study.write_text(edited(text, clicks))
    ran = run_study(study, output=tmp_path / "out").identified[0].responses
    assert list(ran) == shown["estimators"] == ["instrument", "composite"]
    for curve, response in zip(shown["curves"], ran.values(), strict=True):
        pair = response.shown.pair("p", "tau_phi")
        assert curve["omega_rad_s"] == pair.omega_rad_s.tolist()
        assert curve["gain"] == [abs(each) for each in pair.response.tolist()]
        assert curve["phase_rad"] == pair.phase_rad.tolist()
        assert curve["coherence"] == pair.coherence.tolist()
        assert all(
            low <= high for low, high in zip(curve["gain_low"], curve["gain_high"], strict=True)
        )
    (around,) = shown["around"]
    assert around["omega_rad_s"][0] < 4.3 < 17.1 < around["omega_rad_s"][-1]
    _lines_give(study, tmp_path, next(iter(ran.values())))


def _lines_give(study: Path, folder: Path, expected: FrequencyResponse) -> None:
    from flightid.app.python_lines import python_lines  # noqa: PLC0415
    from flightid.study.settings import read_settings  # noqa: PLC0415

    lines = python_lines(read_settings(study), "Roll rate", folder)
    scope: dict[str, Any] = {}
    lines = lines.replace("read_log('", f"read_log('{folder}/").replace("print(", "str(")
    exec(lines, scope)
    np.testing.assert_array_equal(scope["response"].response, expected.response)
