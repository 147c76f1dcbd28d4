"""Trial points whose outputs grow out of all bounds do not end or mislead a search."""

from __future__ import annotations

import numpy as np
import pytest

import flightid as fid
from tests.closeness import assert_close


def _flight() -> fid.Record:
    truth = fid.load_model("rate_first_order").with_values({"Lp": -1e-5})
    time_s = np.arange(2000) * 0.01
    command = 0.1 * np.sign(np.sin(2.0 * np.pi * time_s / 1.7))
    driven = fid.Record.from_arrays(time_s, inputs={"tau_phi": command}, units={"tau_phi": "1"})
    flown = fid.simulate(truth, driven, units={"p": "rad/s"})
    noise = np.random.default_rng(4).standard_normal(len(time_s))
    return flown.replace({"p": flown["p"] + 0.05 * noise})


@pytest.mark.parametrize(
    "start", [{}, {"tau": 0.0}, {"Lp": -1.0}, {"Lp": -0.1, "tau": 0.001}, {"Lp": -30.0}]
)
def test_every_start_ends_at_the_same_place(start: dict[str, float]) -> None:
    # With Lp above zero the free initial state and the outputs grow by e^(20 Lp), and what is left
    # of the cost after the initial state is taken out is rounding.
    model = fid.load_model("rate_first_order").with_values(start)
    fit = fid.identify(model, _flight(), method="output_error")
    assert_close(fit.parameters["Ltphi"].value, 100.054, rtol=1e-4, why="the best of all starts")
    assert_close(fit.objective, -5008.26946, rtol=1e-8, why="the best of all starts")
