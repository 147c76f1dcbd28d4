"""A rate-feedback augmentation closed around two models, flown through the same doublets."""

from __future__ import annotations

import numpy as np
from flights import AMPLITUDES_IN, SAMPLE_RATE_HZ, truth

import flightid as fid
from flightid.excitation import doublet
from flightid.simulation import FlightConditions, fly_closed_loop
from flightid.table import Column

WASHOUT_RAD_S = 0.5
GAINS = {"lon": ("q", 3.0), "lat": ("p", 1.2), "ped": ("r", 2.0)}
"""Stick inches for a rad/s of the own rate."""
DELAY_S = 0.02
NOISE = FlightConditions(noise={"p": 0.002, "q": 0.002, "r": 0.002})


def rate_feedback() -> fid.LinearSystem:
    """Washed-out rate feedback, -K s/(s + a), one axis each; no authority limit."""
    gains = np.array([gain for _, gain in GAINS.values()])
    n = len(GAINS)
    return fid.LinearSystem(
        -WASHOUT_RAD_S * np.eye(n),
        np.eye(n),
        np.diag(gains * WASHOUT_RAD_S),
        -np.diag(gains),
        tuple(rate for rate, _ in GAINS.values()),
        tuple(GAINS),
        np.full(n, DELAY_S),
    )


def compare(model: fid.StateSpaceModel) -> tuple[fid.Table, dict[str, float]]:
    """Fly the truth and a model with the augmentation on, and compare rates.

    Parameters
    ----------
    model : StateSpaceModel
        The identified model.

    Returns
    -------
    Table and dict
        By stick, and the Theil coefficient by ``"rate/stick"``.
    """
    theil: dict[str, float] = {}
    rows = []
    for name, (rate, _) in GAINS.items():
        shape = doublet(
            amplitude=AMPLITUDES_IN[name],
            step_s=1.0,
            sample_rate_hz=SAMPLE_RATE_HZ,
            tail_s=6.0,
            name=name,
            unit="in",
        )
        flown = fly_closed_loop(truth(), rate_feedback(), shape, conditions=NOISE, seed=7)
        ours = fly_closed_loop(model, rate_feedback(), shape)
        found = float(fid.validation.theil(flown[rate], ours[rate]))
        theil[f"{rate}/{name}"] = found
        peak = float(np.max(np.abs(ours[rate]))), float(np.max(np.abs(flown[rate])))
        rows.append((name, rate, *peak, found))
    columns = (
        Column("stick"),
        Column("rate"),
        Column("peak, model", "rad/s", 3),
        Column("peak, vehicle", "rad/s", 3),
        Column("Theil coefficient", digits=3),
    )
    title = "Doublets with washed-out rate feedback closed around model and vehicle"
    return fid.Table(title, columns, tuple(rows)), theil
