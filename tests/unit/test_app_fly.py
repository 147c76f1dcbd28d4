"""The loop that the page flies: paused, switched, failed, kept, and taken up again after a kill."""

from __future__ import annotations

import json
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

import flightid as fid
from flightid.app.fly_deck import FlightDeck, PauseClock, PilotedFlight
from flightid.app.fly_journal import (
    FLIGHTS,
    JOURNAL,
    RECORD,
    finish_flight,
    journal_record,
    kept_flights,
)  # fmt: skip
from flightid.app.fly_loop import FlySwitches, PilotedVehicle, PilotSeat
from flightid.app.fly_schemas import (
    CooperHarperRating,
    FlyNews,
    FlyStart,
    FlyStick,
    FlySweep,
    FlySwitch,
)  # fmt: skip
from flightid.app.fly_text import rate_flight_study, start_of, write_flight_study
from flightid.app.fly_vehicles import RATE_HZ, VEHICLES, fly_vehicle
from flightid.cli.program import run
from flightid.simulation.stepper import Stepper
from flightid.study.loop_blocks import law_controller
from flightid.study.pilot_settings import pilot_of
from tests.closeness import assert_close

STEP_S = 1.0 / RATE_HZ
AH64 = fly_vehicle("ah64_hover")


class StepClock:
    """As fast as the loop runs; at a given instant something happens."""

    def __init__(self) -> None:
        self.time_s = 50.0
        self.at: dict[int, object] = {}
        self.naps = 0

    def now(self) -> float:
        return self.time_s

    def sleep(self, seconds: float) -> None:
        self.naps += 1
        happens = self.at.pop(self.naps, None)
        if happens is not None:
            happens()  # type: ignore[operator]
        self.time_s += seconds


def test_hands_move_each_vehicle_where_they_point() -> None:
    wanted = {"pitch": ("q", 1), "roll": ("p", 1), "yaw": ("r", 1), "heave": ("w", -1)}
    for vehicle in VEHICLES:
        blown = PilotedVehicle(vehicle, STEP_S, switches=FlySwitches(gusts=True))
        felt = [blown.step({}) for _ in range(300)][-1]
        assert np.abs(list(felt.values())).max() > 0.02
        for axis in vehicle.travel:
            stepper = Stepper(vehicle.model, STEP_S)
            seen = [stepper.step(vehicle.inputs({axis: 0.1})) for _ in range(60)][-1]
            name, sign = wanted[axis]
            assert sign * seen[name] > 0.0, (vehicle.name, axis)
            assert (
                max(map(abs, vehicle.inputs({axis: -7.0}).values()))
                == vehicle.reach[vehicle.travel[axis][0]]
            )


def test_the_loop_is_the_vehicle_with_its_law_and_what_reached_it_is_told() -> None:
    """Against the same parts put together by hand, and a record that repeats the outputs."""
    switches, calm = FlySwitches(), fly_vehicle("ah64_hover")
    quiet = calm.__class__(calm.name, calm.title, calm.travel, law="dase")
    loop = PilotedVehicle(quiet, STEP_S, switches=switches)
    plain = Stepper(quiet.model, STEP_S, controller=law_controller("dase", quiet.model, STEP_S))
    rows = []
    for k in range(400):
        stick = quiet.inputs({"pitch": 0.1 * np.sin(0.03 * k), "roll": 0.05})
        found, wanted = loop.step(stick), plain.step(stick)
        rows.append((loop.driven, found))
        assert_close(
            np.array(list(found.values())), np.array(list(wanted.values())), atol=1e-12,
            why="one law, one vehicle",
        )  # fmt: skip
    alone = Stepper(quiet.model, STEP_S)
    for driven, found in rows:
        assert alone.step(driven) == found
    assert max(abs(each["lon"]) for each, _ in rows) > 0.1


def test_switches_sensors_and_delays_act_in_flight() -> None:
    def flown(
        change: object = None, seat: PilotSeat | None = None
    ) -> tuple[list[Any], PilotedVehicle]:
        switches = FlySwitches()
        loop = PilotedVehicle(AH64, STEP_S, switches=switches, seat=seat, seed=3)
        told = []
        for k in range(300):
            if k == 100 and change is not None:
                change(switches)  # type: ignore[operator]
            seen = loop.step(AH64.inputs({"pitch": 0.1 if k >= 20 else 0.0}))
            told.append((dict(loop.added), dict(loop.driven), seen))
        return told, loop

    usual, _ = flown()
    off, _ = flown(lambda s: setattr(s, "law", False))
    assert all(not any(added.values()) for added, _, _ in off[100:])
    assert usual[:100] == off[:100]
    # Back on after a second it is where its filters have come to, not at their start.
    for kind in ("frozen", "zero", "biased"):
        failed, _ = flown(lambda s, kind=kind: s.failures.update({"q": kind}))
        assert failed[:100] == usual[:100]
        assert failed[110][0]["lon"] != usual[110][0]["lon"], kind
    blown, _ = flown(lambda s: setattr(s, "gusts", True))
    assert blown[99] == usual[99]
    assert abs(blown[250][2]["u"] - usual[250][2]["u"]) > 0.1
    late, _ = flown(seat=PilotSeat(actuator_delay_s=0.05))
    assert all(not any(driven.values()) for _, driven, _ in late[:5])
    # With law and delay, the stick at frame 20 comes out five frames later.
    assert late[24][1]["lon"] < 0.25 < usual[20][1]["lon"] + 0.01
    soft, _ = flown(lambda s: setattr(s, "law", False), PilotSeat(stick_rad_s=20.0))
    w, z = 20.0, 0.7
    t = STEP_S * np.arange(40) + 1e-12
    d = w * np.sqrt(1 - z * z)
    wanted = 0.5 * (1 - np.exp(-z * w * t) * (np.cos(d * t) + z * w / d * np.sin(d * t)))
    moved = np.array([driven["lon"] - added["lon"] for added, driven, _ in soft[20:60]])
    assert_close(moved, wanted, atol=1e-9, why="step of a second-order stick")


def test_a_clock_that_stands_keeps_its_sleepers() -> None:
    beat = StepClock()
    clock = PauseClock(beat)
    begun = clock.now()
    beat.at[2] = clock.stop
    threading.Timer(0.15, clock.start).start()
    clock.sleep(0.2)
    assert clock.now() - begun == pytest.approx(0.2, abs=1e-9)
    clock.stop()
    beat.time_s += 7.0
    assert clock.stands
    assert clock.now() - begun == pytest.approx(0.2, abs=1e-9)
    clock.start()
    assert clock.now() - begun == pytest.approx(0.2, abs=1e-9)


def test_a_flight_is_kept_and_a_killed_one_is_offered(tmp_path: Path) -> None:
    news: list[FlyNews] = []
    begun = threading.Event()
    beat = StepClock()
    flight = PilotedFlight(
        tmp_path, FlyStart(vehicle="ah64_hover", seed=5), news.append, clock=beat
    )
    flight.hold(FlyStick(number=4, stick={"pitch": 0.2}))
    flight.hold(FlyStick(number=3, stick={"pitch": -1.0}))
    beat.at[40] = lambda: flight.sweep(
        FlySweep(input="lat", amplitude=0.3, low_rad_s=2.0, high_rad_s=10.0, duration_s=6.0)
    )
    beat.at[60] = lambda: flight.switch(FlySwitch(law=True, gusts=True))
    beat.at[1500] = begun.set
    flight.begin()
    assert begun.wait(30.0)
    flight.end()
    assert news[-1].state == "ended"
    assert news[-1].kept == flight.id
    assert {each.frame.number for each in news if each.frame} == {4}
    (item,) = kept_flights(tmp_path)
    assert item["finished"]
    # Which stick was swept and which was not, in the air and afterwards; sticks alone sweep none.
    last = [each.frame for each in news if each.frame][-1]
    assert item["swept_s"] == pytest.approx(last.swept_s, abs=0.05)
    assert item["swept_s"] == pytest.approx({"lon": 0, "lat": 6, "ped": 0, "col": 0}, abs=0.05)
    # Its study says the same to the page, with the pilot's rating beside it.
    rate_flight_study(flight.folder, {"controllable": False, "rating": 10, "comment": "“wild”"})
    study = flight.folder / "study.toml"
    asked = start_of(study.read_text("utf-8"), flight.folder, VEHICLES)
    assert asked == FlyStart(vehicle="ah64_hover", seed=5)
    assert "sweeps and switches, as they were flown, are in its record" in study.read_text("utf-8")
    told = pilot_of(study)
    assert told is not None
    assert told.rating is not None
    assert (told.rating.rating, told.rating.comment) == (10, "“wild”")
    (record,) = fid.read_records(tmp_path / item["path"])
    assert not (flight.folder / JOURNAL).exists()
    # What is kept is what reached the vehicle: the model alone repeats it, but for its sensors.
    assert set(record.inputs) == {"lon", "lat", "ped", "col"}
    assert record.unit("lon") == "in"
    swept = record["sweep_lat"]
    assert np.abs(swept).max() == pytest.approx(0.3, rel=0.02)
    # A kill leaves the journal: whole rows of it are the same record.
    lines = (flight.folder / "flight.json").read_text()
    killed = tmp_path / FLIGHTS / "20260101-000000-abcd"
    killed.mkdir()
    (killed / "flight.json").write_text(lines)
    columns = [name for name, _, _ in json.loads(lines)["columns"]]
    matrix = np.array([record[n] if n in record.channels else 0 * swept for n in columns]).T
    text = "".join(",".join(map(repr, row)) + "\n" for row in matrix.tolist())
    (killed / JOURNAL).write_text(text[:-9])
    assert [each["finished"] for each in kept_flights(tmp_path)] == [True, False]
    assert kept_flights(tmp_path)[1]["swept_s"] is None
    made = finish_flight(killed)
    assert kept_flights(tmp_path)[1]["swept_s"] == pytest.approx(item["swept_s"], abs=1e-6)
    assert made.n_samples == record.n_samples - 1
    assert np.array_equal(made["q"], record["q"][:-1])
    assert (killed / RECORD).is_file()
    with pytest.raises((fid.FlightidError, OSError)):
        journal_record(killed)


def test_a_study_is_flown_as_the_page_flies_it(tmp_path: Path) -> None:
    """`flightid fly STUDY`: law, delays, stick, gusts, a failed sensor; the pilot's hands off."""
    started = FlyStart(
        vehicle="ah64_hover", gusts=True, actuator_delay_s=0.03, display_delay_s=0.02,
        stick_rad_s=20.0, seed=3, failures={"q": "zero"},
    )  # fmt: skip
    write_flight_study(tmp_path, started, AH64)
    study, target = tmp_path / "study.toml", tmp_path / "flown.nc"
    assert start_of(study.read_text("utf-8"), tmp_path, VEHICLES) == started
    assert run(["fly", str(study), "--duration-s", "0.2", "--write", str(target)]) == 0
    (record,) = fid.read_records(target)
    switches = FlySwitches(gusts=True, failures={"q": "zero"})
    seat = PilotSeat(0.03, 0.02, 20.0)
    loop = PilotedVehicle(AH64, STEP_S, switches=switches, seat=seat, seed=3)
    rows = [(loop.step(loop.rest), dict(loop.driven)) for _ in range(record.n_samples)]
    assert record.n_samples == 20
    for name in ("q", "theta", "w"):
        assert np.array_equal(record[name], [outputs[name] for outputs, _ in rows])
    assert np.array_equal(record["lon"], [driven["lon"] for _, driven in rows])
    assert np.ptp(record["lon"]) > 0.0
    assert not np.any(record["stick_lon"])
    # What a study of a flight cannot be, or be told beside, is refused; a run names the verb.
    assert run(["fly", str(study), "--augmentation", "dase"]) == 2
    assert run(["run", str(study)]) != 0
    for wrong in ("augmentation = 3", 'vehicle = "no"', "seed = -1", "rating.rating = 12"):
        key = wrong.partition(" ")[0]
        kept = [line for line in study.read_text("utf-8").splitlines() if not line.startswith(key)]
        bad = tmp_path / "bad.toml"
        bad.write_text("\n".join(kept).replace("[pilot]", f"[pilot]\n{wrong}"), "utf-8")
        assert run(["fly", str(bad), "--duration-s", "0.1"]) != 0


def test_an_upset_ends_a_flight_and_an_empty_one_leaves_nothing(tmp_path: Path) -> None:
    news: list[FlyNews] = []
    deck = FlightDeck(tmp_path)
    assert deck.enter("a")
    assert not deck.enter("b")
    flight = PilotedFlight(
        tmp_path, FlyStart(vehicle="ah64_hover", law=False), news.append, clock=StepClock()
    )
    flight.hold(FlyStick(number=1, stick={"roll": 1.0}))
    flight.begin()
    flight.wait()
    assert "Upset: phi" in news[-1].words
    assert news[-1].kept
    aloft: list[str | None] = []

    def tell(told: FlyNews) -> None:
        news.append(told)
        if told.state == "ended":
            aloft.append(deck.flown())

    short = deck.start(FlyStart(vehicle="r50_hover"), tell)
    assert deck.flown() == short.id
    deck.leave("a")
    # Whoever hears of the end and asks for the list at once finds the flight in it.
    assert aloft == [None]
    assert news[-1].state == "ended"
    assert (news[-1].kept is None) == (not short.folder.exists())
    assert deck.enter("b")


@pytest.mark.parametrize(
    ("answers", "rating", "sound"),
    [
        ({"controllable": False}, 10, True),
        ({"controllable": False}, 3, False),
        ({"controllable": True, "adequate": False}, 8, True),
        ({"controllable": True, "adequate": True, "satisfactory": False}, 4, True),
        ({"controllable": True, "adequate": True, "satisfactory": True}, 4, False),
    ],
)
def test_a_rating_lies_in_its_branch(answers: dict[str, Any], rating: int, sound: bool) -> None:
    if sound:
        assert CooperHarperRating(**answers, rating=rating).rating == rating
    else:
        with pytest.raises(ValueError, match="these answers leave"):
            CooperHarperRating(**answers, rating=rating)
