"""Promised worst margins hold for the vehicle itself, as often as they say."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import flightid as fid
from flightid.control.autopilots import axis_loop
from flightid.control.margins.loop_metrics import loop_metrics
from flightid.control.tuning.sampled_plants import loop_grid, sample_plants

N_FLIGHTS = 120
STEP_S = 1 / 400
ERROR = 0.08
"""Random error of each measured frequency, share of its size."""


@pytest.mark.slow
def test_worst_margins_hold_for_the_true_plant() -> None:
    truth = fid.load_model("rate_motor_lag", axis="roll").with_values(
        {"Ltphi": 140.0, "Lp": -3.4, "T_m": 0.045, "tau": 0.012}
    )
    flown = axis_loop("arducopter", "roll", loop_rate_hz=400.0).with_gains(
        ATC_RAT_RLL_P=0.08, ATC_RAT_RLL_I=0.08, ATC_RAT_RLL_D=0.002
    )
    measured_at, grid = np.geomspace(0.7, 80.0, 30), loop_grid(STEP_S, 1500)
    exact = truth.frequency_response(measured_at)
    plant = sample_plants([truth], ["p"], ["tau_phi"], STEP_S, hold_in_model=True)
    response = plant.responses(grid)[0][0, 0, 0]
    generator = np.random.default_rng(5)
    need = fid.TuningRequirements(noise_growth=6.0, band_factor=1.5)
    kept, required, shares = [], [], []
    for seed in range(N_FLIGHTS):
        noise = generator.standard_normal((2, *exact.shape)) * ERROR
        data = fid.FrequencyResponse.from_values(
            measured_at, exact * (1 + noise[0] + 1j * noise[1]), inputs=truth.inputs,
            outputs=truth.outputs, units=truth.units,
            random_error=np.full(exact.shape, ERROR),
        )  # fmt: skip
        fit = fid.identify(truth, data, correct_bias=False)
        design = fid.tune_pid(
            fit, gains=flown, requirements=need, draws=60, seed=seed, angle_loop=False
        )
        assert design.exists
        found = loop_metrics(
            grid, design.loop.feedback(grid, gyro="filtered", with_hold=False) * response
        )
        worst = {
            name: design.worst_case("rate loop", name).worst
            for name in ("phase margin", "gain margin", "sensitivity peak")
        }
        kept.append(
            bool(found.is_stable)
            and float(found.phase_margin_deg) >= (worst["phase margin"] or 0.0)
            and float(found.gain_margin_db) >= (worst["gain margin"] or 0.0)
            and float(found.sensitivity_peak) <= (worst["sensitivity peak"] or np.inf)
        )
        required.append(
            float(found.phase_margin_deg) >= 45.0
            and float(found.gain_margin_db) >= 6.0
            and float(found.sensitivity_peak) <= 2.0
        )
        shares.append(design.share_met)
    told = (
        f"promised worst kept {np.mean(kept):.1%}, requirements met {np.mean(required):.1%}, "
        f"least share promised {np.mean(shares):.1%}, of {N_FLIGHTS}"
    )
    sys.stderr.write(told + "\n")
    assert np.mean(kept) >= 0.95, told
    assert np.mean(required) >= 0.95, told
