"""Vehicles of a folder on the screen Fly: their seats, their scenery, and what does not fly."""

from __future__ import annotations

import os
import threading
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("fastapi", reason="the extra app is not installed")

from scipy.spatial.transform import Rotation

import flightid as fid
from flightid.app.fly_deck import PilotedFlight
from flightid.app.fly_journal import kept_flights
from flightid.app.fly_loop import FlySwitches, PilotedVehicle
from flightid.app.fly_schemas import FlyNews, FlyStart, FlyStick
from flightid.app.fly_seat import FULL, PULLED, SHOWN, vehicle_of
from flightid.app.fly_shelf import ModelFile, choice_of, make_shelf, model_files
from flightid.app.fly_track import GroundTrack
from flightid.app.fly_vehicles import fly_vehicle
from flightid.app.run_schemas import RunPart
from flightid.app.schemas import StudyParts
from flightid.app.workspace import Workspace
from flightid.simulation.stepper import Stepper
from flightid.units import conversion_factor
from tests.closeness import assert_close
from tests.unit.test_app_fly import StepClock

LIBRARY = Path(str(files("flightid.models"))) / "library"
RATE = """
kind = "transfer"
name = "{name}"
source = "an exercise"
[inputs]
u = "V"
[outputs]
{output} = "{unit}"
[responses]
"{output}/u" = {{ gain = "K", numerator = [], denominator = ["s + a"] }}
[parameters]
K = {{ value = -20.0, unit = "{unit}/s/V", status = "free" }}
a = {{ value = 3.0, unit = "1/s", status = "free" }}
"""


def test_every_model_of_the_library_gets_hands_that_move_it_where_they_point() -> None:
    names = [path.stem for path in sorted(LIBRARY.glob("*.toml"))]
    shelf = make_shelf([ModelFile(name, name, str(LIBRARY / f"{name}.toml")) for name in names])
    assert shelf.left_out.keys() == {"phugoid"}
    for vehicle in shelf.vehicles:
        if vehicle.note.startswith("In the seat"):
            continue
        for hand, (name, most) in vehicle.travel.items():
            stepper = Stepper(vehicle.model, 0.01)
            moved = {name: stepper.rest[name] + 1e-3 * most}
            rows = [stepper.step(moved) for _ in range(101)]
            channel, unit = next(each for each in SHOWN[hand] if each[0] in rows[0])
            to_si = conversion_factor(vehicle.model.units[channel], unit)
            made = 1e3 * np.array([row[channel] - rows[0][channel] for row in rows]) * to_si
            most_made = made[np.argmax(np.abs(made))]
            assert abs(most_made) == pytest.approx(FULL[hand], rel=0.1), (vehicle.name, hand)
            first = made[np.argmax(np.abs(made) >= 0.5 * abs(most_made))]
            assert PULLED[hand] * first > 0.0, (vehicle.name, hand)


def test_a_model_with_the_inputs_of_the_apache_sits_in_its_seat() -> None:
    kin = fly_vehicle("ah64_hover")
    changed = fid.load_model("ah64_hover").with_values({"Xu": -0.03})
    vehicle = vehicle_of(changed, "ah64_hover", "Mine", "")
    assert (vehicle.travel, vehicle.law, vehicle.gusts) == (kin.travel, "dase", kin.gusts)
    told = choice_of(vehicle, own=True)
    assert (told.gusts, told.law_sensors) == (True, choice_of(kin).law_sensors)
    # Without the rate that the law hears it flies without the law.
    deaf = changed.with_outputs(*(each for each in changed.outputs if each != "q"))
    assert vehicle_of(deaf, "a", "a", "").law == ""


def test_a_folder_tells_which_models_fly_and_why_others_do_not(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    (tmp_path / "models").mkdir()
    told = {
        "0123456789abcdef-my-arm-89abcdef": RATE.format(name="Arm", output="y", unit="V"),
        "quad": RATE.format(name="Quad", output="q", unit="deg/s"),
        "broken": "kind = ",
    }
    for name, text in told.items():
        (tmp_path / "models" / f"{name}.toml").write_text(text)
    run = tmp_path / ".flightid" / "results" / ("ab" * 8)
    (run / "run-0123456789abcdef" / "models").mkdir(parents=True)
    (run / "run-0123456789abcdef" / "models" / "roll_rate.toml").write_text(
        RATE.format(name="Roll", output="p", unit="rad/s")
    )
    part = RunPart(
        etag="1", parts=StudyParts(models="1", gains="1"), folder="run-0123456789abcdef",
        title="Tuesday", verdict="green", tally="", seconds=1.0, figures=0, sections=[],
    )  # fmt: skip
    workspace.keep_result("ab" * 8, "run", part.model_dump())
    if os.name != "nt":
        (tmp_path / "models" / "secret.toml").symlink_to(LIBRARY / "r50_hover.toml")
    shelf = make_shelf(model_files(workspace))
    assert [each.title for each in shelf.vehicles] == [
        "Roll rate, identified: Tuesday", "Quad, models/",
    ]  # fmt: skip
    assert shelf.left_out.keys() == {"My arm, models/", "Broken, models/"}
    assert "tells nothing that an attitude" in shelf.left_out["My arm, models/"]
    roll, quad = shelf.vehicles
    # −20 / (s + 3) for a second: −6.33 rad/s, or deg/s, for a volt.
    assert roll.travel == {"roll": ("u", -0.16)}
    assert quad.travel == {"pitch": ("u", -9.0)}
    # It is named by its place in the folder, flown, and kept under its title.
    assert fid.load_model(tmp_path / roll.name).outputs == ("p",)
    news: list[FlyNews] = []
    ready, beat = threading.Event(), StepClock()
    flight = PilotedFlight(
        tmp_path, FlyStart(vehicle=roll.name), news.append, clock=beat, vehicle=roll
    )
    beat.at[100] = lambda: flight.hold(FlyStick(number=1, stick={"roll": 1.0}))
    beat.at[250] = ready.set
    flight.begin()
    assert ready.wait(30.0)
    flight.end()
    (item,) = kept_flights(tmp_path)
    assert (item["title"], item["finished"]) == (roll.title, True)
    (record,) = fid.read_records(tmp_path / item["path"])
    assert record.inputs == ("u",)
    # The model tells no attitude: that of the scenery is the integral of its rate.
    frames = [each.frame for each in news if each.frame]
    summed = 0.01 * np.cumsum([each.outputs["p"] for each in frames])
    assert summed[-1] > 1.0
    assert_close(np.unwrap([each.pose.phi for each in frames]), summed, atol=1e-9, why="one axis")


def test_an_own_vehicle_rests_at_its_trim() -> None:
    model = fid.load_model("quadrotor_6dof")
    vehicle = vehicle_of(model, "quadrotor_6dof", "Quadrotor", "")
    loop = PilotedVehicle(vehicle, 0.01, switches=FlySwitches(gusts=True))
    seen = [loop.step({}) for _ in range(200)][-1]
    assert loop.driven["F"] == model.trim["F"] > 0.0
    assert max(map(abs, seen.values())) < 1e-9
    raised = [loop.step(vehicle.inputs({"heave": 1.0})) for _ in range(60)][-1]
    assert raised["w"] < -0.5


def test_scenery_follows_eulers_kinematics() -> None:
    """Beside rotation matrices multiplied: attitude and place of a tumbling flight."""
    step_s, n = 1e-4, 20_000
    time_s = step_s * np.arange(n)
    rates = np.array([0.4 * np.cos(time_s), 0.3 * np.sin(2 * time_s), 0.2 + 0 * time_s])
    track = GroundTrack(
        {"p": "rad/s", "q": "rad/s", "r": "rad/s", "u": "ft/s", "w": "ft/s"}, step_s,
        speed_m_s=10.0,
    )  # fmt: skip
    turned, place = Rotation.identity(), np.zeros(3)
    for k in range(n):
        p, q, r = rates[:, k]
        pose = track.moved({"p": p, "q": q, "r": r, "u": 5.0, "w": 2.0})
        turned *= Rotation.from_rotvec(step_s * rates[:, k])
        place += step_s * turned.apply([10.0 + 5.0 * 0.3048, 0.0, 2.0 * 0.3048])
    psi, theta, phi = turned.as_euler("ZYX")
    assert_close(
        np.array([pose.phi, pose.theta, pose.psi]), np.array([phi, theta, psi]), atol=1e-4,
        why="Euler's step, 0.1 ms",
    )  # fmt: skip
    assert_close(
        np.array([pose.north_m, pose.east_m, 40.0 - pose.height_m]),
        place,
        atol=2e-3,
        why="as above",
    )
