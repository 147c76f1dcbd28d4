"""Margins above the identified band are the model's word alone, and are said to be."""

from __future__ import annotations

import re

import pytest

import flightid as fid
from flightid.conventions import Light


@pytest.mark.parametrize(("top", "said"), [(15.0, True), (3000.0, False)])
def test_margins_above_the_band_are_named_with_their_frequency(top: float, said: bool) -> None:
    plant = fid.load_model("rate_motor_lag").with_values(
        {"Ltphi": 140.0, "Lp": -4.0, "T_m": 0.05, "tau": 0.02}
    )
    asked = fid.ControllerOptions(controller="pi", loop_rate_hz=200.0)
    design = fid.tune_controller(plant, controller=asked, nominal=True, band_rad_s=(0.1, top))
    found = [each for each in design.findings if each.code == "margin-beyond-band"]
    assert bool(found) is said
    promised = design.worst_case("loop", "gain margin")
    assert (promised.worst is None) is said, "of what is read above the band nothing is promised"
    for each in found:
        assert each.light is Light.AMBER
        highest = float(re.search(r"up to ([\d.]+) rad/s", each.message).group(1))
        assert highest > top
        margin = promised.nominal
        room = float(re.search(r"by ([\d.]+) dB", each.message).group(1))
        assert 0.0 < room <= margin + 0.1, "the margin is taken above the band: it is room too"
