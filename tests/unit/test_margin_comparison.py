"""Margins before and after: against bisection, and with errors that both sides share."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import flightid as fid
from flightid.cli.program import run
from flightid.control.margins.margins import margins
from flightid.control.margins.outside_band import BEYOND
from flightid.conventions import Light
from flightid.errors import DataError
from flightid.plot.compared_loops import compared_loops
from flightid.uncertainty.uncertain import Uncertain
from tests.closeness import assert_close
from tests.strangers.margin_changes import Gains, Rig, compared, fitted, truths

SLOW, QUICK = Gains(), Gains(0.6, 1.0)


def test_margins_before_and_after_are_those_of_the_sampled_loop() -> None:
    # A model's delay holds half a sample of the hold, unless its fit was told of held inputs.
    plant = fid.LinearSystem(
        [[-4.0]], [[40.0]], [[1.0]], [[0.0]], ("tau_phi",), ("p",), [0.035]
    )  # fmt: skip
    found = compared((plant, SLOW), (plant, QUICK))
    old, new = truths(Rig(), SLOW), truths(Rig(), QUICK)
    assert [change.name for change in found.changes] == list(old)
    for change in found.changes:
        name = change.name
        told = [change.before.value, change.after.value, change.difference.value]
        assert_close(told, [old[name], new[name], new[name] - old[name]], atol=2e-4, why=name)
    assert [each.light for each in found.findings[:1]] == [Light.UNKNOWN]
    other = replace(plant, inputs=("u",))
    with pytest.raises(DataError, match="there is no loop that both have"):
        fid.compare_margins((plant, {"tau_phi": {"p": 0.3}}), (other, {"u": {"p": 0.3}}))
    by_feedback = fid.compare_margins(
        (plant, {"tau_phi": {"p": 0.3}}), (plant, {"tau_phi": {"p": 0.6}})
    )
    alone = margins(plant, controller=0.3)
    assert_close(by_feedback["tau_phi, phase margin"].before.value, alone.phase_margin.value,
                 rtol=1e-9, why="one gain closes the same loop")  # fmt: skip


def test_what_is_read_above_the_band_of_the_fit_is_not_judged() -> None:
    plant = fid.LinearSystem(
        [[-4.0]], [[40.0]], [[1.0]], [[0.0]], ("tau_phi",), ("p",), [0.035]
    )  # fmt: skip
    band = Uncertain(np.array([40.0, -4.0]), np.diag([0.2, 0.02]), partial(_roll, plant),
                     valid_rad_s=(0.5, 20.0))  # fmt: skip
    above = fid.compare_margins((band, {"tau_phi": {"p": 0.3}}), (band, {"tau_phi": {"p": 0.6}}))
    judged = {change.name: change.chance is not None for change in above.changes}
    assert judged == {
        "crossover": False, "phase margin": False, "gain margin": False, "delay margin": False,
        "sensitivity peak": False, "disturbance bandwidth": True,
    }  # fmt: skip
    assert above["tau_phi, gain margin"].after.reason == BEYOND
    assert above["tau_phi, disturbance bandwidth"].before.half_width95
    assert [each.light for each in above.findings if each.code == "margin-beyond-band"] == [
        Light.AMBER, Light.AMBER,
    ]  # fmt: skip
    alone = margins(band, controller=0.3)
    assert (alone.gain_margin.interval95, alone.gain_margin.reason) == (None, BEYOND)
    assert alone.gain_margin.value == pytest.approx(above["tau_phi, gain margin"].before.value)
    assert BEYOND not in (alone.crossover.reason, alone.phase_margin.reason)
    (said,) = (each for each in alone.findings if each.code == "margin-beyond-band")
    assert "above the 20 rad/s to which" in said.message
    within = margins(replace(band, valid_rad_s=(15.0, 1e3)), controller=0.3)
    assert within.gain_margin.interval95 is not None
    (low,) = (each for each in within.findings if each.code == "margin-below-band")
    assert "phase margin, delay margin down to 11.3 rad/s, below the 15 rad/s" in low.message
    assert (low.light, low.action) == (Light.AMBER, "sweep from 8.7 rad/s or lower")
    wide = replace(band, valid_rad_s=(0.5, 1e3))
    assert {each.code for each in margins(wide, controller=0.3).findings}.isdisjoint(
        ("margin-beyond-band", "margin-below-band")
    )
    found = fid.compare_margins((wide, {"tau_phi": {"p": 0.3}}), (wide, {"tau_phi": {"p": 0.6}}))
    twice = found["tau_phi, gain margin"]
    width = twice.difference.half_width95
    assert width is not None
    assert width < 1e-6, "what a gain changes no error of the plant does"
    assert twice.chance is not None
    assert twice.chance < 1e-9


def test_a_command_compares_two_files_of_gains(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = fid.load_model("rate_first_order", axis="roll").with_values({"Ltphi": 40.0, "Lp": -4.0})
    fid.write_model(model, tmp_path / "rig.toml")
    files = []
    for name, gains in (("slow", SLOW), ("quick", QUICK)):
        files.append(tmp_path / f"{name}.toml")
        lines = [f"{k} = {v!r}".replace("'", '"') for k, v in gains.table.items()]
        files[-1].write_text("\n".join(["[[controller]]", *lines]))
    page = tmp_path / "page.html"
    asked = ["compare", str(tmp_path / "rig.toml"), "--gains", ",".join(map(str, files))]
    assert run([*asked, "--html", str(page)]) == 0
    said = capsys.readouterr().out
    assert "Margins, slow and quick" in said
    assert "no difference has an interval" in said
    assert "plotly" in page.read_text()
    assert run([*asked, "--feedback", "tau_phi=p:0.3"]) == 2
    assert "give one of them" in capsys.readouterr().err


def _roll(plant: fid.LinearSystem, numbers: NDArray[np.float64]) -> fid.LinearSystem:
    return replace(plant, a=[[numbers[1]]], b=[[numbers[0]]])


@pytest.mark.slow
def test_one_model_shares_its_errors_and_two_do_not() -> None:
    fit = fitted(Rig(), 3)
    found = compared((fit, SLOW), (fit, QUICK))
    twice = found["p / tau_phi, loop, gain margin"]
    assert_close(twice.difference.value, -20.0 * 0.30103, atol=1e-3, why="all gains are doubled")
    assert twice.after.reason == BEYOND
    again = compared((fit, SLOW), (replace(fit), QUICK))
    assert again.one_record
    assert all(change.chance is None for change in again.changes)
    other = fitted(Rig(), 4)
    apart = compared((fit, SLOW), (other, QUICK))["p / tau_phi, loop, crossover"]
    before, after = (each.half_width95 or 0.0 for each in (apart.before, apart.after))
    assert_close(apart.difference.half_width95, (before**2 + after**2) ** 0.5, rtol=1e-6,
                 why="independent errors add as squares")  # fmt: skip
    assert len(compared_loops(found).data) == 12, "a line and two edges of its band in each panel"
