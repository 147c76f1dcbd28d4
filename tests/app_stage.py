"""A folder with everything in it that the page can show, and a window before it.

Flights with and without sweeps, long names, files that cannot be read, records of a rig with a
fault, a fleet of hundreds, and names that a stranger has chosen.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.fleet_workspace import write_fleet
from tests.reference.test_app_in_browser import Desk, Window
from tests.reference.test_app_screens_in_browser import SLOW_MS, _flown, _saved
from tests.reference.test_rigs_in_browser import rig_tables
from tests.sweep_log import SweepFlight

LONG = "survey-of-the-northern-field-with-the-new-propellers-and-a-second-battery-2026-11-28.bin"
PLANTED = "<img src=x onerror=hit=1>"
MODEL = f"""kind = "transfer"
name = "{PLANTED}"
source = "{PLANTED}"
[inputs]
u = "V"
[outputs]
p = "rad/s"
[responses]
"p/u" = {{ gain = "K", numerator = [], denominator = ["s + a"] }}
[parameters]
K = {{ value = 20.0, unit = "rad/s^2/V", status = "free" }}
a = {{ value = 3.0, unit = "1/s", status = "free" }}
"""
MANY = 500


@dataclass
class Stage:
    """A window, the workspace behind it, and what there is in it by its id."""

    desk: Desk
    window: Window
    folder: Path
    logs: dict[str, str]
    rig: str

    @property
    def page(self) -> Any:
        return self.window.page

    def know(self) -> None:
        """What the list of the folder calls the logs and the rig."""
        self.open("")
        names = {each: f"{each}.bin" for each in ("first", "torn", "calm", "empty")}
        names["long"] = LONG
        for name, file in names.items():
            link = self.page.get_by_role("link", name=file, exact=True)
            self.logs[name] = str(link.get_attribute("href")).rpartition("/")[2]
        rig = self.page.get_by_role("link", name="and 1 more")
        self.rig = str(rig.get_attribute("href")).rpartition("/")[2]

    def open(self, place: str) -> None:
        """A screen by its address, made anew."""
        self.page.goto(self.desk.address.partition("?")[0] + f"#/{place}")
        self.page.reload()

    def button(self, name: str) -> Any:
        return self.page.get_by_role("button", name=name, exact=True)


def furnish(desk: Desk, made: Path) -> Stage:
    """A folder with all that there can be in one, the gains of its first flight tuned."""
    window = desk.open()
    page = window.page
    page.set_default_timeout(SLOW_MS)
    page.wait_for_selector(".drop")
    shutil.copy(SweepFlight(sweep_s=25.0, rate_hz=100.0).write(made), desk.folder / LONG)
    (desk.folder / "torn.bin").write_bytes(b"\xa3\x95\x80" + b"x" * 20)
    (desk.folder / "empty.bin").write_bytes(b"\xa3\x95\x80" + bytes(range(256)) * 8)
    calm = SweepFlight(sweep_s=5.0, rate_hz=50.0, injected=False).write(made)
    shutil.copy(calm, desk.folder / "calm.bin")
    os.close(os.open(os.fsencode(desk.folder) + b"/\xff.bin", os.O_CREAT))
    fleet = write_fleet(desk.folder, flights=2, vehicles=MANY)
    fleet.write_text(fleet.read_text().replace("new motor", PLANTED))
    planted = SweepFlight(sweep_s=6.0, rate_hz=50.0, injected=False).write(made)
    shutil.copy(planted, desk.folder / f"{PLANTED}.bin")
    (desk.folder / "models").mkdir(exist_ok=True)
    (desk.folder / "models" / f"{PLANTED}.toml").write_text(MODEL)
    page.set_input_files("input[type=file]", _flown(made, "first.bin"))
    page.wait_for_selector(".cards")
    stage = Stage(desk, window, made, {}, "")
    stage.open("gains/" + page.url.rpartition("/")[2])
    step = _saved(page, "Download step 1 of 2", made)
    shutil.copy(_flown(made, "second.bin", step), desk.folder / "second.bin")
    stage.open("")
    page.set_input_files("input[type=file]", rig_tables(made))
    page.locator("select[aria-label='Role of drive']").wait_for()
    return stage
