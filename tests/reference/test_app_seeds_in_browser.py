"""Rig and helicopter records dropped on the page, by mouse and keyboard to their report.

Whole studies of the examples' records, minutes each: `nightly`. A short one of the same path stays.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest
from benchmarks.app_served import processor_s

from flightid.control.autopilots.parameter_files import read_parameters
from flightid.vehicles import fly_scenario, write_ardupilot_log
from tests.contract.source import ROOT
from tests.reference.test_app_in_browser import Desk, _findings, desk
from tests.reference.test_app_screens_in_browser import _opened, _saved, _watched

__all__ = ["desk"]
RUN_MS = 1_800_000
"""For a whole run; a control that is not there fails sooner."""
R50_SERVOS = {"lat": 15.0, "lon": 15.0, "col": 15.0}
"""Of the swashplate, rad/s, known from the ground; the pedal's is part of the model of yaw."""
WAITED_MS = 120_000
HOVER_OUTPUTS = ("um", "vm", "w", "p", "q", "r", "ax", "ay", "az")


def _records(example: str, folder: Path) -> Path:
    """What the example's script writes, from its simulated vehicle."""
    _run(ROOT / "examples" / example / "fly.py", folder)
    return folder


def _run(*words: str | Path) -> None:
    subprocess.run([sys.executable, *words], check=True, capture_output=True)


def _dropped(desk: Desk, files: list[Path]) -> Any:
    window = _watched(desk)
    page = window.page
    page.wait_for_selector(".drop")
    page.set_input_files("input[type=file]", files)
    page.get_by_role("button", name="Write the study").wait_for()
    page.locator("select[aria-label^='Role of']").first.wait_for()
    window.page.set_default_timeout(WAITED_MS)
    return window


def _roles(page: Any, roles: dict[str, str]) -> None:
    for name, role in roles.items():
        page.get_by_label(f"Role of {name}", exact=True).select_option(role)


def _study(desk: Desk, page: Any) -> dict[str, Any]:
    rig = page.url.rpartition("/")[2]
    text = (desk.folder / "studies" / f"{rig}.toml").read_text("utf-8")
    return tomllib.loads(text)


def _reported(page: Any, folder: Path) -> str:
    """The study is run, and its report opened and taken as one zip; the run's light."""
    page.get_by_role("button", name="Fit and verify").press("Enter")
    page.get_by_role("button", name="Fit again").wait_for(timeout=RUN_MS)
    light = str(page.locator(".bar [role=img]").get_attribute("aria-label"))
    _opened(page, "Report")
    page.get_by_role("link", name="Open the report").wait_for()
    packed = zipfile.ZipFile(_saved(page, "Everything as one zip", folder))
    assert any(each.endswith("report.html") for each in packed.namelist())
    return light


def test_the_study_is_written_with_a_model_and_edited_as_text(desk: Desk, tmp_path: Path) -> None:
    """Roles, a servo, a model of the library for structures, and a key typed into the file."""
    rows = "".join(f"{0.05 * k},{k // 20 % 2},{(k % 7) * 0.01}\n" for k in range(400))
    (tmp_path / "arm.csv").write_text("t,volts,rate_dps\n" + rows)
    window = _dropped(desk, [tmp_path / "arm.csv"])
    page = window.page
    page.get_by_text("Read from the headings: rate_dps as deg/s;").wait_for()
    assert page.get_by_label("Unit of rate_dps").input_value() == "deg/s"
    _roles(page, {"volts": "input", "rate_dps": "output"})
    page.locator("#template option", has_text="first order").first.wait_for(state="attached")
    page.select_option("#template", value="rate_first_order")
    page.get_by_label("Servo of volts, rad/s").fill("12")
    said = _findings(page)
    page.get_by_role("button", name="Write the study").press("Enter")
    page.locator("pre", has_text='template = "rate_first_order"').wait_for()
    units = {"units": {"p": "rad/s"}}
    assert _study(desk, page)["conditioning"] == [units, {"actuators": {"tau_phi": 12.0}}]
    servo = page.get_by_label("Servo of tau_phi, rad/s")
    servo.fill("")
    servo.press("Tab")
    page.locator("pre", has_text="actuators").wait_for(state="detached")
    assert _study(desk, page)["conditioning"] == [units]
    page.get_by_role("button", name="Edit", exact=True).press("Enter")
    field = page.get_by_label("Study file, to be written")
    text = field.input_value()
    field.fill(text.replace("title = ", "tilte = "))
    page.get_by_role("button", name="Save", exact=True).press("Enter")
    page.get_by_role("alert").filter(has_text="tilte").first.wait_for()
    said += _findings(page)
    field.fill(text.replace('title = "', 'title = "By hand, '))
    page.get_by_role("button", name="Save", exact=True).press("Enter")
    page.locator("pre .changed", has_text="By hand").wait_for()
    assert _study(desk, page)["study"]["title"].startswith("By hand, ")
    _left_alone(page, text, tmp_path / "arm.csv")
    _opened(page, "Model")
    page.get_by_label("Reduce structures to what the data determine").check()
    page.locator("pre .changed", has_text="maximum_insensitivity_percent").wait_for()
    page.get_by_label("Another rival").select_option("rate_integrator")
    page.locator("pre .changed", has_text="rivals").wait_for()
    said += _findings(page)
    _opened(page, "Logs")
    page.get_by_role("button", name="Remove from list: arm.csv").press("Enter")
    page.get_by_text("arm.csv is off the list").wait_for()
    page.get_by_text("Off the list: 1").click()
    page.get_by_role("button", name="Put back arm.csv").wait_for()
    said += _findings(page)
    page.keyboard.press("Tab")
    page.get_by_role("button", name="Undo", exact=True).press("Enter")
    page.get_by_text("Off the list:").wait_for(state="detached")
    page.get_by_role("button", name="Remove from list: arm.csv").wait_for()
    assert said == []
    # A refusal of the server is an answer of 422, which the browser writes down.
    assert all("422" in each for each in window.complaints)
    page.close()


def _left_alone(page: Any, text: str, outside: Path) -> None:
    """A file outside the folder is named, and nothing runs; Undo leads back."""
    line = next(each for each in text.splitlines() if each.startswith("path = "))
    page.get_by_role("button", name="Edit", exact=True).press("Enter")
    field = page.get_by_label("Study file, to be written")
    field.fill(text.replace(line, f'path = "{outside}"'))
    page.get_by_role("button", name="Save", exact=True).press("Enter")
    alert = page.get_by_role("alert").filter(has_text="outside this folder")
    alert.filter(has_text=str(outside)).first.wait_for()
    assert page.get_by_role("button", name="Fit and verify").is_disabled()
    page.get_by_role("button", name="Undo", exact=True).press("Enter")
    alert.first.wait_for(state="detached")
    assert page.get_by_role("button", name="Fit and verify").is_enabled()


@pytest.mark.nightly
def test_seed_000_linear_models_of_the_rig(desk: Desk, tmp_path: Path) -> None:
    folder = _records("twin_rotor_linear", tmp_path / "rig")
    files = [folder / f"{each}.csv" for each in ("u1_prbs", "u1_doublet_pitch", "u1_3211_pitch")]
    window = _dropped(desk, files)
    page = window.page
    _roles(page, {"u1": "input", "u2": "left out", "y1": "output", "y2": "output"})
    page.get_by_role("button", name="Write the study").press("Enter")
    page.locator("#content .box").first.wait_for(timeout=RUN_MS)
    page.locator("#content .box").first.get_by_label("Structure").select_option("armax")
    page.locator("pre .changed", has_text="armax").wait_for()
    assert _study(desk, page)["model"][0]["structure"] == "armax"
    _reported(page, tmp_path)
    _controlled(desk, page, tmp_path)
    assert not window.complaints
    page.close()


def _controlled(desk: Desk, page: Any, folder: Path) -> None:
    """A PI around each loop: keys of the study, numbers and code to take along.

    The pitch of 72 s by ARMAX allows plants that no PI holds: its gains stay out, and it is said.
    """
    _opened(page, "Gains")
    page.get_by_role("button", name="gains.toml").wait_for(timeout=RUN_MS)
    page.get_by_label("Form").select_option("pi")
    page.locator("pre .changed", has_text='controller = "pi"').wait_for()
    page.get_by_text("The files follow").wait_for()
    page.get_by_role("button", name="gains.toml").wait_for(timeout=RUN_MS)
    assert _study(desk, page)["tune"] == {"controller": "pi"}
    assert not _findings(page)
    page.get_by_text("y1 is not in the files: no gains were found").first.wait_for()
    for name in ("gains.toml", "gains_y2.c"):
        with page.expect_download() as told:
            page.get_by_role("button", name=name).press("Enter")
        told.value.save_as(folder / name)
    numbers = tomllib.loads((folder / "gains.toml").read_text(encoding="utf-8"))["controller"]
    assert [each["output"] for each in numbers] == ["y2"]
    assert "double" in (folder / "gains_y2.c").read_text(encoding="utf-8")


@pytest.mark.nightly
def test_seed_001_narx_of_the_rig(desk: Desk, tmp_path: Path) -> None:
    folder = _records("twin_rotor_rbf", tmp_path / "rig")
    window = _dropped(desk, [folder / f"{each}.mat" for each in ("noise", "doublet", "3211")])
    page = window.page
    _roles(page, {"t": "time", "voltage": "input", "pitch": "output"})
    page.get_by_role("button", name="Write the study").press("Enter")
    page.locator("#content .box").first.wait_for(timeout=RUN_MS)
    page.locator("#content .box").first.get_by_label("Structure").select_option("narx")
    page.locator("pre .changed", has_text="narx").wait_for()
    _reported(page, tmp_path)
    assert not window.complaints
    page.close()


def _helicopter(
    page: Any,
    model: str,
    outputs: tuple[str, ...],
    inputs: tuple[str, ...],
    servos: dict[str, float] | None = None,
) -> None:
    columns = page.locator("select[aria-label^='Role of']")
    for k in range(columns.count()):
        name = str(columns.nth(k).get_attribute("aria-label")).removeprefix("Role of ")
        injected = name.startswith("sweep_")
        role = "injected" if injected else "input" if name in inputs else "left out"
        columns.nth(k).select_option("output" if name in outputs else role)
    page.select_option("#template", value=model)
    for name, rate in (servos or {}).items():
        page.get_by_label(f"Servo of {name}, rad/s", exact=True).fill(str(rate))
    page.get_by_role("button", name="Write the study").press("Enter")
    page.locator("pre", has_text=f'template = "{model}"').wait_for()


@pytest.mark.nightly
def test_seed_002_the_r50_from_its_flights(desk: Desk, tmp_path: Path) -> None:
    folder = _records("r50", tmp_path / "r50")
    window = _dropped(desk, [folder / "hover_sweeps.nc", folder / "hover_doublets.nc"])
    page = window.page
    _helicopter(page, "r50_hover", HOVER_OUTPUTS, ("lat", "lon", "ped", "col"), R50_SERVOS)
    study = _study(desk, page)
    assert [each["actuators"] for each in study["conditioning"]] == [R50_SERVOS]
    (model,) = study["model"]
    assert len(model["identify"]) == 8
    assert len(model["verify"]) == 4
    # The model that flew is no false one, once its servos are told: without them it is red.
    assert _reported(page, tmp_path) in ("green", "amber")
    assert not window.complaints
    page.close()


@pytest.mark.nightly
def test_seed_003_the_apache_reduced_beside_a_rival(desk: Desk, tmp_path: Path) -> None:
    folder = _records("ah64", tmp_path / "ah64")
    window = _dropped(desk, [folder / "sweeps.nc", folder / "manoeuvres.nc"])
    page = window.page
    outputs = ("u", "v", "p", "q", "r", "ax", "ay", "az")
    _helicopter(page, "ah64_hover", outputs, ("lat", "lon", "ped", "col"))
    _opened(page, "Model")
    page.get_by_label("Reduce structures to what the data determine").check()
    page.locator("pre .changed", has_text="maximum_insensitivity_percent").wait_for()
    page.get_by_label("Another rival").select_option("helicopter_6dof")
    page.locator("pre .changed", has_text="rivals").wait_for()
    _reported(page, tmp_path)
    assert not window.complaints
    page.close()


def _let_go(page: Any, log: Path) -> None:
    """A file let go over the page, as the desktop does it."""
    where = page.locator(".drop").bounding_box()
    session = page.context.new_cdp_session(page)
    for kind in ("dragEnter", "dragOver", "drop"):
        event = {
            "type": kind,
            "x": where["x"] + where["width"] / 2.0,
            "y": where["y"] + where["height"] / 2.0,
            "data": {"items": [], "files": [str(log)], "dragOperationsMask": 1},
        }
        session.send("Input.dispatchDragEvent", event)


def demo_log(folder: Path) -> Path:
    """The flight of `make demo`."""
    return write_ardupilot_log(fly_scenario("advised"), folder / "flight.bin")


def gains_by_mouse(page: Any, log: Path, folder: Path) -> dict[str, float]:
    """From the dropped log to the gains of step 1, whose file and way back are on the disk."""
    page.wait_for_selector(".drop")
    _let_go(page, log)
    page.locator(".cards").wait_for()
    assert "can carry a model of roll, pitch and yaw" in page.inner_text("h1")
    assert page.locator(".sweep").count() == 3
    _opened(page, "Gains")
    first = page.get_by_role("button", name="Download step 1")
    first.wait_for(timeout=RUN_MS)
    new = dict(read_parameters(_saved(page, first.inner_text(), folder)))
    assert set(new) == set(read_parameters(_saved(page, "Its way back", folder)))
    return new


@pytest.mark.nightly
def test_seed_004_from_the_demos_log_to_gains_and_a_report(desk: Desk, tmp_path: Path) -> None:
    """Without typing, in less than two minutes of the machine's time; `benchmarks/app_demo.py`."""
    log = demo_log(tmp_path)
    begun_s = processor_s()
    window = _watched(desk)
    page = window.page
    new = gains_by_mouse(page, log, tmp_path)
    assert new["ATC_RAT_RLL_P"] > 1.1 * 0.09
    assert {"ATC_RAT_PIT_P", "ATC_RAT_YAW_P"} <= set(new)
    _opened(page, "Response")
    page.locator(".uplot canvas").first.wait_for()
    _opened(page, "Plan")
    page.get_by_text("This log already carries roll, pitch and yaw").wait_for()
    _opened(page, "Report")
    assert _reported(page, tmp_path) in ("green", "amber")
    assert processor_s() - begun_s < 120.0
    assert not window.complaints
    page.close()
