"""Tuning: gains for one plant and for three hundred, and what judging one set of gains costs."""

from __future__ import annotations

import time

import numpy as np

import flightid as fid
from flightid.control.autopilots import axis_loop
from flightid.table import Column, Table

REPEATS = 3


def _fit() -> fid.Fit:
    model = fid.load_model("rate_motor_lag", axis="roll").with_values(
        {"Ltphi": 140.0, "Lp": -3.4, "T_m": 0.045, "tau": 0.012}
    )
    omega = np.geomspace(0.5, 90.0, 40)
    data = fid.FrequencyResponse.from_values(
        omega, model.frequency_response(omega), inputs=model.inputs, outputs=model.outputs,
        units=model.units, random_error=np.full((1, 1, 40), 0.03),
    )  # fmt: skip
    return fid.identify(model, data, correct_bias=False)


def run() -> Table:
    """Time `tune_pid` by the plants and loops that take part.

    Returns
    -------
    Table
        Processor time, best of three; the ratio is to the same gains without uncertainty.
    """
    fit, flown = _fit(), axis_loop("arducopter", "roll", loop_rate_hz=400.0)
    need = fid.TuningRequirements(noise_growth=4.0)
    cases = {
        "rate loop, the model alone": {"nominal": True, "angle_loop": False},
        "both loops, the model alone": {"nominal": True},
        "rate loop, 300 + 300 plants": {"angle_loop": False},
        "both loops, 300 + 300 plants": {},
    }
    rows, first = [], {}
    for name, options in cases.items():
        source = fit.model if "nominal" in options else fit
        best = np.inf
        for _ in range(REPEATS):
            start = time.process_time()
            design = fid.tune_pid(
                source, gains=flown, requirements=need, band_rad_s=(0.5, 90.0), **options
            )
            best = min(best, time.process_time() - start)
        kind = name.split(",", maxsplit=1)[0]
        first.setdefault(kind, best)
        rows.append((name, best, best / first[kind], design.exists))
    columns = (Column("case"), Column("time", "s", 3), Column("ratio", digits=3), Column("found"))
    note = "No peer designs over a covariance; the ratio is the price of the uncertainty."
    return Table("Gains of one axis", columns, tuple(rows), (note,))
