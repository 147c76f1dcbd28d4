"""The page of a fleet: what it says of vehicles whose truth is known."""

from __future__ import annotations

import datetime
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from flightid.cli.fleet import command
from flightid.conventions import Light
from flightid.fleet.catalogue.compaction import compact
from flightid.fleet.catalogue.loose import write_loose
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.normality import quiet_light
from flightid.fleet.opening import current_store
from flightid.fleet.page import fleet_document, fleet_vehicles, lights_counted
from flightid.fleet.pictures import type_picture
from flightid.fleet.settings import read_fleet
from flightid.fleet.statistics.answers import FleetAnswers, TypeAnswers, answer_questions
from flightid.fleet.statistics.drift import find_drift
from flightid.fleet.statistics.events import FleetEvent
from flightid.fleet.statistics.flight_estimates import FlightEstimates
from flightid.fleet.statistics.outliers import find_outliers
from flightid.fleet.statistics.population import estimate_population
from flightid.report.content import Figure, TableBlock
from flightid.report.html import to_html
from flightid.report.text import to_text
from tests.fleet_rows import START, Rows, fleet_rows

MOTOR = FleetEvent(
    "motor replaced",
    datetime.datetime(2026, 1, 23, tzinfo=datetime.UTC).timestamp(),
    ("v02",),
)


@pytest.fixture(scope="module")
def answers() -> FleetAnswers:
    return answer_questions(fleet_rows(3), events=[MOTOR], covariates=["battery"])


def test_each_vehicle_has_the_light_that_its_truth_asks_for(answers: FleetAnswers) -> None:
    lights = {
        each.message.partition(":")[0]: each
        for each in fleet_document(answers).findings
        if each.code == "vehicle"
    }
    assert len(lights) == 12
    assert lights["v00"].light is Light.RED
    assert "roll control power changed by -15 % (-" in lights["v00"].message
    assert lights["v01"].light is Light.AMBER
    assert "v01: roll control power " in lights["v01"].message
    assert " % above the type, " in lights["v01"].message
    assert "roll damping normal" in lights["v01"].message
    # What was told is no reason to look: README's fleet was red for a new motor.
    assert lights["v02"].message.startswith("v02: roll control power changed by +")
    assert re.search(
        r" at the event “motor replaced”; beyond that no change \(80 % of such steps, 3 flights "
        r"or more on either side, would be found: roll damping \d+ %, roll control power "
        r"\d+(\.\d)? %\), like its type \(80 % of such differences would be found: roll damping "
        r"\d+ %, roll control power \d+ %\)$",
        lights["v02"].message,
    )
    sound = [each for name, each in lights.items() if name not in ("v00", "v01")]
    assert all(each.light is Light.GREEN for each in sound), sound
    # The worst first, and of one light the least likely.
    least: dict[str, float] = {}
    for history in (h for each in answers.types if each.drift for h in each.drift.judged):
        least.setdefault(history.vehicle, history.chance or 0.0)
    listed = [*fleet_vehicles(answers)]
    assert listed[:2] == ["v00", "v01"]
    assert listed[2:] == sorted(listed[2:], key=lambda name: least[name])


def test_logs_with_a_model_of_no_vehicle_are_counted() -> None:
    rows = fleet_rows(3, 3, 4)
    for row in (e for key in rows for e in rows[key] if e.get("vehicle") == "v02"):
        row["vehicle"] = None
    found = [e for e in fleet_document(answer_questions(rows)).findings if e.code == "no-vehicle"]
    assert [each.light for each in found] == [Light.AMBER]
    assert "4 logs with a model count nowhere" in found[0].message


def test_a_parameter_that_never_scatters_and_an_event_of_nobody_are_told() -> None:
    rows = fleet_rows(3, 4, 24)
    for row in rows["parameters"]:
        if row["name"] == "Ltphi":
            row["value"] = 150.0
    early = FleetEvent("painted", (START - datetime.timedelta(days=9)).timestamp(), ("v02",))
    nobody = FleetEvent("new arms", MOTOR.time_s, ("v2",))
    document = fleet_document(answer_questions(rows, events=[early, nobody]))
    told = [each.message for each in document.findings]
    assert sum(each.startswith("v0") for each in told) == 4
    assert not any("beside what its events explain" in each for each in told)
    (unknown,) = [each for each in document.findings if each.code == "event-of-nobody"]
    assert unknown.light is Light.AMBER
    assert "“new arms” is of v2, of which no flight with a model is known" in unknown.message


def test_a_parameter_that_was_never_judged_is_named_and_not_green() -> None:
    """Five flights of 24 told it: green, "no change"; and what would have shown was not said."""
    rows = fleet_rows(3, 4)
    few = {each["log"] for each in rows["logs"] if each["vehicle"] == "v03"}
    few = {log for n, log in enumerate(sorted(few)) if n > 4}
    rows["parameters"] = [
        each for each in rows["parameters"] if each["name"] != "Lp" or each["log"] not in few
    ]
    for each in rows["parameters"]:
        if each["vehicle"] == "v02":
            each["stderr"] *= 9.0
    found = answer_questions(rows, covariates=["battery"])
    lights = fleet_vehicles(found)
    assert lights["v03"].light is Light.UNKNOWN
    assert "whether roll damping changed (5 flights tell it, 6 are needed)" in (
        lights["v03"].message
    )
    assert re.search(r"found: roll control power [\d.]+ %\)", lights["v03"].message)
    # Errors of which no step that leaves anything would stand out answer nothing either.
    assert lights["v02"].light is Light.UNKNOWN
    assert re.search(r"roll damping changed \(only steps above \d+ %", lights["v02"].message)
    tables = [b for s in fleet_document(found).sections for b in s.blocks if hasattr(b, "table")]
    (least,) = [b.table for b in tables if b.table.title == "What would have been seen"]
    assert "v03" in {row[0] for row in least.rows}


def test_few_vehicles_that_all_moved_alike_are_amber() -> None:
    """Season in a fleet of three made 120 of 120 vehicles red."""
    rows = fleet_rows(3, 3)
    late = str(START + datetime.timedelta(days=21))[:10]
    for row in rows["parameters"]:
        if row["vehicle"] != "v00" and row["name"] == "Ltphi" and row["flown_at"][:10] >= late:
            row["value"] *= 0.8
    document = fleet_document(answer_questions(rows, covariates=["battery"]))
    lights = [each.light for each in document.findings if each.code == "vehicle"]
    assert lights == [Light.AMBER] * 3
    (told,) = [each for each in document.findings if each.code == "moved-alike"]
    assert "all 3 vehicles moved alike: of the type (season, firmware) or of each" in told.message
    assert "where flights go on alike on all vehicles beside" in " ".join(to_text(document).split())
    # One that went far further than the others moved by itself too.
    for row in rows["parameters"]:
        if row["vehicle"] == "v01" and row["name"] == "Ltphi" and row["flown_at"][:10] >= late:
            row["value"] *= 0.4
    lights = {
        each.message[:3]: each.light
        for each in fleet_document(answer_questions(rows, covariates=["battery"])).findings
        if each.code == "vehicle"
    }
    assert lights == {"v00": Light.AMBER, "v01": Light.RED, "v02": Light.AMBER}


def test_vehicles_too_few_to_be_judged_are_grey_and_not_green() -> None:
    rows = fleet_rows(3)
    mine = [row for row in rows["parameters"] if row["vehicle"] in ("v03", "v04")]
    logs = set({row["vehicle"]: row["log"] for row in mine}.values())
    few = {key: [e for e in rows[key] if e.get("log") in logs] for key in rows}
    found = fleet_document(answer_questions(few)).findings
    (drawn,) = [e for e in fleet_document(answer_questions(few)).walk() if isinstance(e, Figure)]
    assert "shaded" not in drawn.caption, "two vehicles say nothing of the next"
    lights = [each for each in found if each.code == "vehicle"]
    assert [each.light for each in lights] == [Light.UNKNOWN, Light.UNKNOWN]
    for each in lights:
        assert "cannot tell whether it changed (of its 1 flight with model" in each.message
        assert "” 1 counts, 6 are needed)" in each.message
        assert "cannot tell whether it is like its type (" in each.message
        assert "no change" not in each.message


def test_flights_too_few_for_change_leave_a_sentence_and_no_empty_picture() -> None:
    few = answer_questions(fleet_rows(3, 6, 4), covariates=["battery"])
    document = fleet_document(few)
    titles = [b.table.title for b in document.walk() if isinstance(b, TableBlock)]
    assert "What changed" not in titles
    assert sum(isinstance(block, Figure) for block in document.walk()) == 1, "of the type alone"
    said = " ".join(to_text(document).split())
    assert "Not answered: whether a vehicle changed: that takes 6 flights of it" in said
    assert "and the most is 4." in said
    told = "standard errors of 1 parameter not borne out by flights"
    assert f"(all 6 not judged; {told})" in said
    # No heading claims of vehicles what is true of a few.
    assert "Changed, or unlike" not in said
    alike = answer_questions(fleet_rows(3, 4, 7), covariates=["battery"])
    quiet = replace(alike, types=tuple(
        replace(t, drift=find_drift(t.data.chosen(t.data.member_of > 1))) for t in alike.types
    ))  # fmt: skip
    assert "Nothing changed: 4 histories asked" in " ".join(to_text(fleet_document(quiet)).split())


def test_tables_of_a_type_fit_a_page(answers: FleetAnswers) -> None:
    """In one table they took 200 letters, and scrolled on a screen of 1440 px."""
    text = to_text(fleet_document(answers))
    start = text.index("In common: type")
    assert max(map(len, text[start : text.index("[Figure")].split("\n"))) <= 100


def test_a_long_history_without_a_type_is_no_green_light() -> None:
    rows = fleet_rows(3)
    logs = {e["log"] for e in rows["parameters"] if e["vehicle"] in ("v03", "v04")}
    some = {key: [e for e in rows[key] if e.get("log") in logs] for key in rows}
    found = fleet_document(answer_questions(some)).findings
    (first, _) = [each for each in found if each.code == "vehicle"]
    assert first.light is Light.UNKNOWN
    assert first.message.startswith("v03: no change (80 % of such steps, 3 flights or more")
    assert "%); cannot tell whether it is like its type (" in first.message


def test_the_correlation_of_a_fit_is_carried_on(answers: FleetAnswers) -> None:
    data = answers.types[0].data
    matrix = data.covariances[0]
    assert data.names == ("Lp", "Ltphi")
    assert matrix[0, 1] == pytest.approx(0.5 * (matrix[0, 0] * matrix[1, 1]) ** 0.5)


def test_the_page_tells_events_slopes_and_refused_logs(answers: FleetAnswers) -> None:
    document = fleet_document(answers, "Survey fleet")
    tables = {b.table.title: b.table for b in document.walk() if isinstance(b, TableBlock)}
    event = next(row for row in tables["Events"].rows if row[2] == "roll control power")
    assert event[:2] == ("motor replaced", "v02")
    low, high = event[4], event[5]
    assert isinstance(low, float)
    assert isinstance(high, float)
    assert low < 10.0 < high
    refused = tables["By reason"]
    assert refused.rows[0][:3] == (2, "refused", "rate too low")
    assert "set LOG_BITMASK to log RATE at 400 Hz" in refused.rows[0]
    slope = next(r for r in tables["What covariates explain"].rows if r[0] == "roll control power")
    assert slope[2] == "rad/s^2"
    assert slope[3] == pytest.approx(0.02 * 140.0, rel=0.25)
    assert sum(isinstance(block, Figure) for block in document.walk()) == 2
    page = to_html(document)
    assert "Survey fleet" in page
    assert "291 logs, 288 with a model, of 12 vehicles" in to_text(document)


def test_red_models_and_flights_without_a_date_are_left_out_where_they_do_not_belong() -> None:
    rows = fleet_rows(4, 5, 8)
    for each in rows["parameters"]:
        if each["vehicle"] == "v00":
            each["light"] = "red"
        if each["vehicle"] == "v01":
            each["flown_at"] = None
    answers = answer_questions(rows)
    found = answers.types[0]
    assert answers.undated == 8
    # Each of these flights would have another model that counts: what is left out is listed.
    said = " ".join(to_text(fleet_document(answers)).split())
    assert "Model “roll” is red in 8 logs more, and is left out there: flightid run" in said
    assert found.data.members == ("v01", "v02", "v03", "v04")
    assert found.drift is not None
    assert {each.vehicle for each in found.drift.histories} == {"v02", "v03", "v04"}


def test_one_vehicle_has_a_history_but_no_type() -> None:
    rows = fleet_rows(5, 1, 12)
    found = answer_questions(rows).types[0]
    assert found.population is None
    assert "a population needs several vehicles" in found.reasons[0]
    assert found.drift is not None
    assert "Not answered" in to_text(fleet_document(answer_questions(rows)))


def test_a_catalogue_without_models_says_so() -> None:
    rows = fleet_rows(6, 0)
    said = to_text(fleet_document(answer_questions(rows)))
    assert "3 logs, 0 with a model, of vehicles that nothing names" in said
    assert "No vehicle has a model with intervals: see below what to change." in said
    for each in rows["logs"]:
        each["vehicle"] = "v07"
    said = to_text(fleet_document(answer_questions(rows)))
    assert "3 logs, 0 with a model, of 1 vehicle" in said
    assert lights_counted(answer_questions(rows)) == "not judged"
    assert "[not judged] v07: none of its 3 logs gave a model that counts" in said


def test_vehicles_stand_worst_first_and_no_line_is_wider_than_a_screen() -> None:
    rows = fleet_rows(3)
    rows["logs"] = [*rows["logs"], {**rows["logs"][-1], "vehicle": "aa", "message": "why " * 200}]
    document = fleet_document(answer_questions(rows))
    found = [each.light for each in document.findings if each.code == "vehicle"]
    order = [Light.RED, Light.AMBER, Light.UNKNOWN, Light.GREEN]
    assert found == sorted(found, key=order.index)
    assert {Light.RED, Light.UNKNOWN} < set(found)
    text = to_text(document)
    refused = text[text.index("Logs that could not be used") :]
    assert max(map(len, refused.split("\n"))) <= 100


def test_the_command_answers_a_fleet_file_from_its_catalogue(tmp_path: Path) -> None:
    pytest.importorskip("duckdb")
    pytest.importorskip("pyarrow")
    path = tmp_path / "fleet.toml"
    path.write_text(
        '[fleet]\ntitle = "Survey"\nlogs = ["logs"]\n'
        '[questions]\ncovariates = ["battery"]\nparameters = ["Ltphi"]\n'
        '[[event]]\ndate = "2026-01-23"\nvehicle = "v02"\nwhat = "new propellers"\n'
    )
    rows = fleet_rows(3, 5)
    store = current_store(read_fleet(path))
    for log in [each["log"] for each in rows["logs"]]:
        own = {name: [e for e in table if e["log"] == log] for name, table in rows.items()}
        write_loose(store, LogRecord(log, own))
    compact(store)
    page = tmp_path / "fleet.html"
    found = CliRunner().invoke(command, ["report", str(path), "--html", str(page)])
    assert found.exit_code == 1, found.output
    assert "<title>Survey" in page.read_text()
    text = CliRunner().invoke(command, ["report", str(path)]).output
    assert "v00: roll control power changed by -1" in text
    assert "new propellers  v02      roll control power" in text
    assert "roll damping" not in text


def test_the_page_speaks_in_words_and_says_how_a_level_changed() -> None:
    rows = fleet_rows(3)
    for each in rows["parameters"]:
        each["meaning"] = {"Lp": "roll damping", "Ltphi": "push of the motors"}[each["name"]]
    document = fleet_document(answer_questions(rows, covariates=["battery"]))
    said = " ".join(to_text(document).split())
    assert "v00: push of the motors changed by -15 % (-" in said
    assert ") at once" in said
    assert re.search(
        "v01: push of the motors [0-9]+ % above the type, .*; roll damping normal", said
    )
    # A symbol stands once, beside its words in the table of the type, and in no picture.
    assert said.count("Ltphi") == 1
    pictures = [str(each.spec) for each in document.walk() if isinstance(each, Figure)]
    assert all("push of the motors" in each and "Ltphi" not in each for each in pictures)
    assert re.search(r"\d[ %]* < 0.0001 (a step|drift|changed)", said), "a chance of 1e-50"


def test_sentences_of_small_and_of_red_fleets_stand() -> None:
    def said(rows: Rows, *, outliers: bool = True) -> str:
        return " ".join(to_text(fleet_document(answer_questions(rows, outliers=outliers))).split())

    two = said(fleet_rows(3, 2, 2), outliers=False)
    assert "the next vehicle lies between" not in two
    assert "fewer than 3 vehicles say nothing of the next." in two
    assert "errors of 2 parameters" not in two, "each flew twice a day"
    once = fleet_rows(1, 2, 12)
    for table in once.values():
        table[:] = [each for each in table if "T09" in (each["flown_at"] or "")]
    untested = "taken as stated, for no vehicle flew twice a day)"
    borne = (
        "standard errors of 1 parameter not borne out by flights; standard errors of 1 parameter"
    )
    assert f"{borne} {untested}" in said(once)
    rows = fleet_rows(3, 2, 8)
    for table in rows.values():
        for each in table:
            if each["vehicle"] and each["log"] != rows["logs"][0]["log"]:
                each["light"] = "red"
    assert "of its 8 flights with model “roll” 7 are red and 1 counts, 6 are needed" in said(
        rows, outliers=False
    )
    for table in rows.values():
        for each in table:
            each["light"] = "red"
    rows["logs"] = [each for each in rows["logs"] if each["outcome"] == "fitted"]
    red = said(rows)
    assert (
        "v00: none of its 8 logs gave a model that counts, all of them red — see below why" in red
    )
    assert "Every log gave a model; red ones count nowhere." in red
    assert "by reason" not in red


def test_a_parameter_that_one_vehicle_tells_leaves_the_type_of_the_others() -> None:
    rows = fleet_rows(3, 4, 1)
    alone = [e | {"name": "tau"} for e in rows["parameters"] if e["vehicle"] == "v03"][::2]
    rows["parameters"] = [*rows["parameters"], *alone]
    found = answer_questions(rows, drift=False).types[0]
    assert found.population is not None
    assert found.population.names == ("Lp", "Ltphi")
    assert found.outliers is not None
    assert len(found.outliers.vehicles) == 4
    assert found.reasons == ("what is common in tau, which v03 alone tells",)


def test_rows_of_each_log_are_looked_up_once() -> None:
    """Its first row was sought among all: 1.8 s of 4,000 logs, the square of their number."""

    class Counted(dict[str, Any]):
        asked = 0

        def __getitem__(self, key: str) -> Any:
            Counted.asked += key == "log"
            return super().__getitem__(key)

    reads = []
    for flights in (20, 40):
        rows = fleet_rows(3, 2, flights)
        rows = {name: [Counted(each) for each in table] for name, table in rows.items()}
        Counted.asked = 0
        answer_questions(rows, population=False, drift=False, outliers=False)
        reads.append(Counted.asked)
    assert reads[1] < 2.2 * reads[0]


@pytest.mark.filterwarnings("error")
def test_equal_estimates_and_panels_of_one_order() -> None:
    values = [[-3.4, 140.0]] * 5
    data = FlightEstimates.of(["Lp", "Ltphi"], [*"edcba"], values, [np.diag([0.01, 16.0])] * 5)
    alike = estimate_population(data)
    ends = alike.parameters["Lp"].spread.interval(0.95)
    assert ends == (0.0, 0.0)
    assert "vehicles that are all equal say nothing of the next." in str(alike.summary().notes)
    rng = np.random.default_rng(2)
    apart = replace(data, values=data.values * (1.0 + 0.1 * rng.normal(size=(5, 2))))
    spec = type_picture(estimate_population(apart)).to_dict()
    shown = [each for each in spec["data"] if each.get("mode") == "markers"]
    assert [list(each["text"]) for each in shown] == [[*"abcde"]] * 2
    axes = [value for key, value in spec["layout"].items() if key.startswith("xaxis")]
    assert [list(each["ticktext"]) for each in axes] == [[*"abcde"]] * 2
    # Below its panel a title lay inside the panel of the next row.
    notes = spec["layout"]["annotations"]
    assert [(each["text"], each["y"], each["yanchor"]) for each in notes] == [
        ("Lp", 1.0, "bottom"),
        ("Ltphi", 1.0, "bottom"),
    ]
    assert not any("title" in axis for axis in axes)


@pytest.mark.parametrize(("odd", "light"), [(1.6, Light.UNKNOWN), (1.0, Light.GREEN)])
def test_two_that_are_odd_alike_are_not_called_like_their_type(odd: float, light: Light) -> None:
    """Each widened what is normal for the other: both were green, in 40 fleets of 40."""
    rng = np.random.default_rng(11)
    values = 140.0 * (1.0 + 0.08 * rng.normal(size=8)) * np.where(np.arange(8) > 5, odd, 1.0)
    data = FlightEstimates.of(["k"], [*"abcdefgh"], values[:, None], np.full((8, 1, 1), 2.0))
    outliers = find_outliers(estimate_population(data))
    answered = TypeAnswers("quad", "roll", data, None, outliers, None)
    found = {name: quiet_light(name, [answered]) for name in "afgh"}
    assert [found[name].light for name in "gh"] == [light] * 2
    assert {found[name].light for name in "af"} == {Light.GREEN}
    if light is Light.UNKNOWN:
        assert "(it and h are alike in k, and apart from all others)" in found["g"].message
