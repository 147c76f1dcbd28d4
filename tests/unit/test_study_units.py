"""Records of a study come to the units of its models by themselves, as those of `identify` do."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flightid.study.settings import read_settings
from flightid.study.stage_runner import StageRunner
from flightid.study.taking import take
from flightid.study.task import load_task

STUDY = """
[study]
title = "Feet"
[[record]]
name = "sweep"
path = "sweep.csv"
[[conditioning]]
accelerometers_ft = [1.0, 0.0, 0.0]
consistency = { channels = ["phi"], apply = true, estimate = [] }
[[model]]
name = "Roll"
template = "roll.toml"
identify = "sweep"
band_rad_s = [0.5, 5.0]
"""
MODEL = """
kind = "state-space"
name = "Roll"
[states]
p = "rad/s"
[inputs]
lat = "in"
[outputs]
p = "p"
ay = { expression = "Y*p", unit = "ft/s^2" }
[parameters]
Lp = { value = -2.0, unit = "1/s" }
Llat = { value = 1.0, unit = "rad/(in*s^2)" }
Y = { value = 1.0, unit = "ft/s" }
[equations]
"p'" = "Lp*p + Llat*lat"
"""


def test_degrees_and_g_become_what_the_model_has(tmp_path: Path) -> None:
    time = np.arange(200) * 0.02
    rows = {
        "time": time, "lat [in]": np.sin(time), "p [deg/s]": 10.0 * np.cos(time),
        "q [deg/s]": 0.0 * time, "r [deg/s]": 90.0 + 0.0 * time, "phi [deg]": 10.0 * np.sin(time),
        "ax [g]": 0.1 + 0.0 * time, "ay [g]": 0.2 * np.cos(time), "az [g]": -1.0 + 0.0 * time,
    }  # fmt: skip
    np.savetxt(
        tmp_path / "sweep.csv", np.column_stack([*rows.values()]), delimiter=",",
        header=",".join(rows), comments="", fmt="%.17g",
    )  # fmt: skip
    (tmp_path / "study.toml").write_text(STUDY)
    (tmp_path / "roll.toml").write_text(MODEL)
    settings = read_settings(tmp_path / "study.toml")
    tasks = [load_task(model, ("Roll",)) for model in settings.models]
    (record,) = take(settings, tasks, None, tmp_path, StageRunner()).records["sweep"].value
    assert {name: record.unit(name) for name in ("lat", "p", "ay")} == {
        "lat": "in", "p": "rad/s", "ay": "ft/s^2",
    }  # fmt: skip
    np.testing.assert_allclose(record["p"], np.radians(10.0 * np.cos(time)), atol=1e-12)
    # ω × (ω × r) of one foot ahead: nothing along y at a steady yaw rate but p's share.
    assert np.ptp(record["ay"]) > 6.0
