"""Outputs smooth from sample to sample hide noise that free runs leave: no loop is called open."""

from __future__ import annotations

import numpy as np

import flightid as fid
from flightid.conventions import Light
from flightid.evidence import feedback_test
from tests.strangers import gains as flown

SEED = 9563
"""Gusts around an undamped rate, behind a gyro filter, at 400 Hz: nothing of it is seen in one
sample, and all of it in seconds."""


def test_gusts_behind_a_filter_leave_the_loop_unknown() -> None:
    record = flown.record(flown.drawn(SEED), SEED, 10.0)
    assert feedback_test(record).source == "no noise"
    fit = fid.identify(fid.load_model("rate_motor_lag", axis="roll"), record)
    check = fit.evidence.check("loop")
    assert check is not None
    assert check.light is Light.UNKNOWN
    assert f"the free run leaves {fit.costs['p']:.2g} % of one" in check.what


def test_a_record_without_noise_stays_open() -> None:
    time_s = np.arange(2000) * 0.02
    sweep = fid.Record.from_arrays(time_s, inputs={"tau_phi": 0.1 * np.sin(0.1 * time_s**2)})
    model = fid.load_model("rate_first_order")
    fit = fid.identify(model, fid.simulate(model, sweep, units={"p": "rad/s"}))
    check = fit.evidence.check("loop")
    assert check is not None
    assert check.light is Light.GREEN
