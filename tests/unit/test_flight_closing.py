"""The end of a flight's review, and what is asked of flights by rates."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

import flightid as fid
from flightid.conventions import Light
from flightid.findings import Finding
from flightid.inspection.flight_phases import FlightPhases
from flightid.report.flight import flight_document
from flightid.report.text import to_text
from flightid.review.identity import Battery
from flightid.review.sticks_to_fly import mode_to_fly, what_to_fly
from flightid.review.tables import battery
from flightid.review.verdicts import judge_flight
from flightid.uncertainty.estimate import Estimate
from tests.ordinary_log import write_ordinary_log


@pytest.fixture(scope="module")
def review(tmp_path_factory: pytest.TempPathFactory) -> fid.FlightReview:
    path = tmp_path_factory.mktemp("ordinary") / "flight.bin"
    write_ordinary_log(path, duration_s=30.0)
    return fid.review_flight(path)


def test_a_review_ends_with_what_it_tells_and_what_is_next(review: fid.FlightReview) -> None:
    end = review.to_text().split("\n\n")[-1]
    assert end.startswith("This flight tells the steps of 2 of 6 loops: ")
    assert "Next: flightid plan flight.bin (sweeps to fly, for models and gains)." in end
    kinds = [type(each).__name__ for each in flight_document(review).sections[0].blocks]
    assert kinds[:3] == ["Paragraph", "Figure", "Lights"], "answer, picture, verdicts"
    assert review.answer in to_text(flight_document(review)).replace("\n", " ")
    assert review.to_dict()["answer"] == review.answer
    swept = replace(review, swept=True)
    assert "Next: flightid tune flight.bin" in replace(swept, carried=("roll",)).answer
    # `tune` had nothing of such sweeps but `flight`, which named `tune`.
    assert "Next: flightid inspect flight.bin (why" in swept.answer
    assert "then flightid plan flight.bin" in swept.answer
    shaken = replace(review, findings=(Finding("vibration", Light.AMBER, "shaken"),))
    assert "Next: mend what is said of vibration first; then" in shaken.answer
    turned = Finding("motors-unbalanced", Light.AMBER, "a yaw moment")
    both = replace(review, findings=(*shaken.findings, turned))
    assert "Next: mend what is said of motors and vibration first; then" in both.answer
    alone = replace(review, findings=(turned,))
    assert "Next: mend what is said of motors first; then" in alone.answer, "nothing shook"
    assert "plan" not in replace(review, vehicle="rover").answer


def test_each_step_is_named_by_its_verdict_or_as_not_told(review: fid.FlightReview) -> None:
    rate, attitude = review["roll rate"], review["roll attitude"]
    doubtful = (Finding("step-roll-rate", Light.AMBER, "poor"),)
    none = replace(attitude, step=attitude.step[:0])
    said = replace(review, findings=doubtful, loops=(rate, none)).answer
    assert said.startswith("This flight tells the steps of 1 of 2 loops: roll rate is in doubt.")
    untold = replace(review, loops=(replace(rate, step=rate.step[:0]), none)).answer
    assert untold.startswith("This flight tells no step of its 2 loops.")
    lone = replace(review, loops=(none,)).answer
    assert lone.startswith("This flight tells no step of its one loop.")


def test_a_battery_on_the_ground_is_not_said_to_be_in_the_air() -> None:
    found = Battery(16.4, 15.9, 16.1, 4, 2.0, 3.0, 40.0)
    for flown, where in ((True, "in the air"), (False, "while logged")):
        told = dict(battery(found, flown=flown))
        assert f"15.9 V least {where}, " in str(told["battery"])
        assert f"2 A mean {where}" in str(told["current"])


def test_what_a_step_does_not_tell_is_not_said_as_none(review: fid.FlightReview) -> None:
    """\"Overshoots by None %\" stood in the review of a real flight."""
    rate = review["roll rate"]
    for name in ("overshoot", "delay to half"):
        without = [
            Estimate(each.name, None, each.unit, reason="no step rises") if each.name == name
            else each
            for each in rate.readings
        ]  # fmt: skip
        doubtful = replace(review, loops=(replace(rate, readings=tuple(without)),))
        (said,) = (e.message for e in judge_flight(doubtful) if e.code == "step-roll-rate")
        assert "None" not in said
        assert "not told (no step rises)" in said


def test_a_fall_comes_first_and_proposes_no_filters(review: fid.FlightReview) -> None:
    """Better filters stood in a table of a flight whose file of them was refused."""
    change = SimpleNamespace(name="INS_GYRO_FILTER", old=42.0, value=21.0)
    choice = SimpleNamespace(changes=(change,), axes=())
    filters = replace(review.filters, choice=choice)  # type: ignore[arg-type]
    flown = replace(review, filters=filters)
    assert any(table.title == "Filters that would serve better" for table in flown.tables())
    fallen = replace(flown, phases=replace(review.phases, tipped_s=20.0))
    assert all(table.title != "Filters that would serve better" for table in fallen.tables())
    assert fallen.answer.startswith("The vehicle falls over at 20.0 s")
    assert "flightid" not in fallen.answer
    ground = replace(review, phases=FlightPhases((), (), None, "motor outputs"))
    assert ground.answer.startswith("This log holds no flight, so it tells nothing")


def test_a_flight_by_rates_is_asked_for_another_mode(review: fid.FlightReview) -> None:
    """Logs flown in ACRO were advised to move sticks by degrees, and amber for it."""
    modes = [SimpleNamespace(kind="mode", time_s=0.0, text="ACRO (1)")]
    flown = SimpleNamespace(
        kind="ardupilot", vehicle="copter", events=modes, messages={}, duration_s=60.0
    )
    log = cast("fid.Log", flown)
    span = ((5.0, 50.0),)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flightid.review.identity.log_span", lambda _: (0.0, 60.0))
        assert mode_to_fly(log, "attitude", span) == "STABILIZE"
        assert mode_to_fly(log, "rate", span) == ""
        flown.kind, flown.vehicle = "ardupilot", "plane"
        assert mode_to_fly(log, "attitude", span) == "FBWA"
        modes.append(SimpleNamespace(kind="mode", time_s=30.0, text="STABILIZE"))
        assert mode_to_fly(log, "attitude", span) == "", "some of it was flown by angles"
        assert mode_to_fly(log, "attitude", ((5.0, 20.0),)) == "FBWA"
    still = replace(
        review["roll attitude"], step=review["roll attitude"].step[:0], reason="not enough motion"
    )
    for where, light in (("", Light.AMBER), ("STABILIZE", Light.UNKNOWN)):
        loop = replace(still, fly_in=where)
        loop = replace(loop, action=what_to_fly(loop))
        found = judge_flight(replace(review, loops=(loop,)))
        (told,) = (each for each in found if each.code == "no-step-roll-attitude")
        assert told.light is light
        assert ("fly a minute in STABILIZE with quick moves" in told.action) is bool(where)
