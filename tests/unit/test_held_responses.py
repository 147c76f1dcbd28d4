"""What responses of many plants hold at once."""

from __future__ import annotations

import tracemalloc

import pytest

import flightid as fid
from flightid.control.autopilots import axis_loop
from flightid.control.tuning.responses import responses
from flightid.control.tuning.sampled_plants import sample_plants


@pytest.mark.slow
def test_steps_of_many_plants_are_made_of_some_at_a_time() -> None:
    """Those of 40 plants held 305 MB, of a tuning's 300 more than two gigabytes."""
    model = fid.load_model("rate_motor_lag", axis="roll")
    plant = model.with_values({"Ltphi": 140.0, "Lp": -3.4, "T_m": 0.045, "tau": 0.012})
    plants = sample_plants([plant] * 40, ["p"], ["tau_phi"], 1 / 400, hold_in_model=True)
    loop = axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    tracemalloc.start()
    made = responses(plants, [loop], 0, "filtered")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert made["rate step"][1].shape == (40, 401)
    assert peak < 180e6
