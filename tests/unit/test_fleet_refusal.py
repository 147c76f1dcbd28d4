"""Every log without a model says why in words, and what to do; no class of an error is a reason."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightid import errors
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.fleet import refusal as room
from flightid.fleet.identity import read_tables
from flightid.fleet.reasons import STOPPED as MARK
from flightid.fleet.reasons import grouped_reasons, reason_lines
from flightid.fleet.refusal import refusal
from flightid.fleet.run_one import _verdict
from flightid.fleet.settings import read_fleet
from flightid.inspection import inspect_log
from flightid.logs import Log, read_log
from tests.sweep_log import SweepFlight

FELL = Finding("tipped-over", Light.AMBER, "the vehicle falls over at 4.0 s", "look for the cause")
SHORT = Finding("too-short", Light.RED, "16 s in the air", "fly at least 34 s an axis")
STOPPED = errors.DataError("channel 'tau_phi' has no samples", needed="samples from 52 to 60 s")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    flown = SweepFlight(sweep_s=4.0, rate_hz=50.0).write(tmp_path_factory.mktemp("log"))
    return read_log(flown)


def own_errors() -> list[type[errors.FlightidError]]:
    found = [each for each in vars(errors).values() if isinstance(each, type)]
    return [each for each in found if issubclass(each, errors.FlightidError)]


@pytest.mark.parametrize("kind", [*own_errors(), KeyError, MemoryError, RuntimeError])
def test_no_error_is_told_by_its_class_or_without_what_to_do(kind: type[Exception]) -> None:
    told = refusal(kind("it went wrong"), None)
    assert told["reason"] == str(told["reason"]).lower()
    assert kind.__name__ not in told["reason"]
    assert "it went wrong" in told["message"] or kind is MemoryError
    assert told["action"]
    assert told["outcome"] == ("refused" if kind in own_errors() else "failed")


def test_an_empty_file_is_told_from_a_file_of_another_kind(tmp_path: Path) -> None:
    for content, code in ((b"", "empty-file"), (b"time,roll rate\n0.0,0.1\n", "not-a-log")):
        path = tmp_path / "V07.bin"
        path.write_bytes(content)
        with pytest.raises(errors.LogFormatError) as told:
            read_log(path)
        assert refusal(told.value, None)["reason"] == code


def test_what_an_inspection_finds_comes_before_where_the_study_stopped(
    log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = inspect_log(log)
    for findings, code in (((SHORT,), "too-short"), ((SHORT, FELL), "tipped-over")):
        told = seen.with_findings(findings)
        monkeypatch.setattr(room, "inspect_log", lambda _, told=told: told)
        found = refusal(STOPPED, log)
        assert found["reason"] == code
        first = FELL if code == "tipped-over" else SHORT
        assert found["message"].startswith(f"{first.message}. The study stopped at this: channel")
        assert first.action in found["action"]
        # One piece of advice: what stopped the study, and what to fly, follow from the length.
        one = f"copy the log again where it is cut off, else {SHORT.action}"
        assert found["action"] == {"too-short": one, "tipped-over": FELL.action}[code]
    monkeypatch.setattr(room, "inspect_log", lambda _: seen.with_findings(()))
    assert refusal(STOPPED, log)["reason"] == "data-unusable"


def test_an_inspection_that_cannot_be_made_hides_no_refusal(
    log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: Log) -> None:
        raise errors.DataError("nothing to inspect")

    monkeypatch.setattr(room, "inspect_log", broken)
    assert refusal(STOPPED, log)["reason"] == "data-unusable"


def test_a_span_beyond_the_log_says_where_the_log_ends(log: Log, tmp_path: Path) -> None:
    with pytest.raises(errors.DataError, match=r"found RATE from [\d.]+ to [\d.]+ s") as told:
        log.record(names=["p"], span_s=(900.0, 910.0))
    assert "samples from 900 to 910 s" in str(told.value)
    # A log that is cut off is the usual cause, and comes first.
    assert "copy the log again where it is cut off, else name a span" in str(told.value)


def test_reasons_are_counted_with_an_example_and_what_to_do() -> None:
    row = {"outcome": "refused", "reason": "not-a-log", "message": "an empty file"}
    rows = [{**row, "action": "copy it again", "address": f"/far/{n}.bin"} for n in range(3)]
    rows += [{**row, "outcome": "fitted"}, {**rows[0], "outcome": "failed", "reason": "time"}]
    found = grouped_reasons(rows)
    assert [(each.outcome, each.words, each.logs) for each in found] == [
        ("refused", "not a log", 3),
        ("failed", "out of time", 1),
    ]
    assert room.joined(["set X 1 and fly again", "fly", "set X 1", "fly"]) == "; ".join(
        ("set X 1 and fly again", "fly")
    )
    other = {**rows[0], "action": "unpack it", "address": "zip.bin"}  # Of one alone: said of all.
    assert [each.action for each in grouped_reasons([other, *rows[:3]])][1] == "unpack it"
    # Advice that names its own log is that of others: a row a log stood for each of 30.
    own = [{**each, "action": f"flightid plan {each['address'][5:]}"} for each in rows[:3]]
    assert [(e.logs, e.action) for e in grouped_reasons(own)] == [(3, "flightid plan 0.bin")]
    # Where studies stop alike one of them says it: a fleet of spoilt logs said it of each reason.
    stops = [f"Cut. {MARK}segment 2 of 3.5 s", f"No sweep. {MARK}segment 4 of 1 s"]
    cut = [{**row, "reason": f"r{n}", "message": each} for n, each in enumerate(stops)]
    assert [each.message for each in grouped_reasons(cut)] == [stops[0], "No sweep."]
    lines = reason_lines(found)
    assert lines[:2] == [
        "  3 refused: not a log (such as 0.bin: an empty file)",
        "      do: copy it again",
    ]


@pytest.mark.parametrize(
    ("reason", "message", "said"),
    [
        ("not-a-log", "a.bin is not a log: found text", "a.bin: found text"),
        ("empty-file", "a.bin is an empty file: none", "a.bin: none"),
        ("not-a-log", "a.bin is longer than it may be", "a.bin, which is longer than it may be"),
        ("too-short", "16 s in the air", "a.bin: 16 s in the air"),
    ],
)
def test_an_example_says_neither_its_name_nor_the_reason_twice(
    reason: str, message: str, said: str
) -> None:
    row = {"outcome": "refused", "reason": reason, "message": message, "action": ""}
    (line,) = reason_lines(grouped_reasons([{**row, "address": "logs/a.bin"}]))
    assert line.endswith(f"(such as {said})")


def test_nothing_is_repeated_of_a_file_that_is_not_the_fleets(tmp_path: Path) -> None:
    """A stranger's fleet file names what it likes; its errors and records may go to them."""
    own, secret = tmp_path / "own", b"root:x:0:0:hunter2"
    own.mkdir()
    for path in (tmp_path / "id_rsa", tmp_path / "told.csv", own / "told.csv"):
        path.write_bytes(secret)
    with pytest.raises(errors.LogFormatError, match="found text of no known kind") as told:
        read_log(tmp_path / "id_rsa")
    assert not any(piece in str(told.value) for piece in ("hunter", secret[:8].hex(" ")))
    for place, is_told in (("told.csv", True), ("../told.csv", False)):
        (own / "f.toml").write_text(
            f'[fleet]\ntitle = "t"\nlogs = ["."]\n[vehicles]\ntable = "{place}"\n'
        )
        with pytest.raises(errors.StudyError, match="names no column 'id'") as found:
            read_tables(read_fleet(own / "f.toml"))
        assert ("hunter" in str(found.value)) == is_told


def test_a_red_light_refuses_a_flight_with_its_reason() -> None:
    def model(light: Light) -> SimpleNamespace:
        verdict = Finding("record-too-short", light, "three windows", "fly longer")
        evidence = SimpleNamespace(light=light, verdict=verdict, reason=verdict)
        fit = SimpleNamespace(evidence=evidence, covariance=np.eye(1))
        return SimpleNamespace(fit=fit, left_out=(), findings=())

    red, good = model(Light.RED), model(Light.AMBER)
    for models, outcome, light in (([red], "refused", "red"), ([red, good], "fitted", "amber")):
        study: Any = SimpleNamespace(identified=models, review=None)
        told = _verdict(study)
        assert (told["outcome"], told["light"], told["models"]) == (outcome, light, len(models) - 1)
        if outcome == "refused":
            expected = ("record-too-short", "three windows", "fly longer")
            assert (told["reason"], told["message"], told["action"]) == expected
