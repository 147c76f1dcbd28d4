"""Windows that a light mode outlasts: said beside the light, with what to do."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flightid as fid
from flightid.cli.program import run
from flightid.identification.frequency_domain.longer_windows import judge_windows
from flightid.uncertainty.response_errors import _squared_hann
from tests.strangers.response_bands import oscillator_record
from tests.strangers.responses import oscillator


@pytest.mark.parametrize(
    ("zeta", "duration_s", "window_s", "said"),
    [
        (0.05, 60.0, "auto", "takes 27 s to die out, the longest window has 12 s: window_s=27.2"),
        (0.05, 20.0, "auto", "outlasts half the record, the longest window has 4 s: a fit of the"),
        (0.05, 60.0, 25.0, ""),
        (0.3, 60.0, "auto", ""),
    ],
)
def test_windows_come_from_the_damping_that_a_fit_finds(
    zeta: float, duration_s: float, window_s: float, said: str
) -> None:
    record = oscillator_record(0, zeta=zeta, duration_s=duration_s, colour=0.0)
    response = fid.estimate_response(record, window_s=window_s)
    limits = fid.identify(oscillator(zeta), response).evidence.limits
    about = [limit for limit in limits if limit.startswith("The mode at 2")]
    assert len(about) == bool(said)
    assert all(said in limit for limit in about)


def test_a_delay_below_zero_ends_no_fit() -> None:
    response = fid.estimate_response(oscillator_record(0, zeta=0.05, duration_s=20.0, colour=0.0))
    path = fid.TransferFunction("y", "u", "K", denominator=("s^2 + d*s + w2",), delay="tau")
    units = {"K": (8.0, "1/s^2"), "d": (0.2, "1/s"), "w2": (4.0, "1/s^2"), "tau": (0.01, "s")}
    known = fid.Parameters([fid.Parameter(name, *each) for name, each in units.items()])
    model = fid.TransferFunctionModel((path,), known)
    assert judge_windows(model, response)
    assert judge_windows(model.with_values({"tau": -0.01}), response) == []


STUDY = """
[study]
title = "A light mode"
[[record]]
name = "sweep"
path = "flight.nc"
[[model]]
name = "light"
template = "light.toml"
identify = ["sweep"]
band_rad_s = [1.0, 12.0]
"""


def test_where_nobody_chose_windows_a_second_pass_takes_longer_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the damping of the first fit, on the command line and in studies; said in both."""
    record = oscillator_record(0, zeta=0.05, duration_s=60.0, colour=0.0)
    flight = str(fid.write_records(record, tmp_path / "flight.nc"))
    model = str(fid.write_model(oscillator(0.05), tmp_path / "light.toml"))
    assert run(["identify", flight, "--model", model, "--json"]) == 0
    made = json.loads(capsys.readouterr().out)
    low, high = made["parameters"]["w2"]["interval95"]
    assert low < 4.09 < high < low + 0.1
    assert (
        "windows_from_damping(mode_rad_s=2.0, dies_out_s=27.2)"
        in made["provenance"]["data_history"][-1]
    )
    said = [each["message"] for each in made["findings"] if each["code"] == "windows-lengthened"]
    assert [each[:41] for each in said] == ["windows of up to 27.2 s, by default 12 s:"]
    assert run(["identify", flight, "--model", model, "--json", "--window-s", "12"]) == 0
    chosen = json.loads(capsys.readouterr().out)
    assert {each["code"] for each in chosen["findings"]} >= {"windows-short"}
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    (item,) = fid.run_study(tmp_path / "study.toml", output=tmp_path / "out").identified
    assert item.response is not None
    assert max(item.response.window_s) > 25.0
    assert any(each.code == "windows-lengthened" for each in item.response.findings)
    assert item.fit is not None
    low, high = item.fit.parameters["w2"].interval95 or (0.0, 0.0)
    assert low < 4.09 < high < low + 0.3


def test_frequencies_share_what_the_squared_window_lets_through() -> None:
    bins = np.linspace(-3.0, 3.0, 25)
    time = (np.arange(4000) + 0.5) / 4000 - 0.5
    power = np.cos(np.pi * time) ** 4
    transform = np.cos(2.0 * np.pi * np.outer(bins, time)) @ power / power.sum()
    assert _squared_hann(bins) == pytest.approx(transform, abs=1e-6)
