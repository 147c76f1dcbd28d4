"""Structures of the AH-64 study: the candidate to reduce, and the model it is compared with."""

from __future__ import annotations

from typing import Any

import numpy as np
from flights import truth

import flightid as fid

# Derivatives that a helicopter could have and this one has not: the reduction must find out.
SUPERFLUOUS = {
    "Xw": ("u'", "w", "1/s"),
    "Yr": ("v'", "r", "ft/s"),
    "Lr": ("p'", "r", "1/s"),
    "Mw": ("q'", "w", "rad/(ft*s)"),
    "Nq": ("r'", "q", "1/s"),
    "Nlat": ("r'", "lat", "rad/(s^2*in)"),
}
SPREAD = 0.4
"""Start values lie within this share of the truth."""


def candidate(seed: int) -> fid.StateSpaceModel:
    """The library's structure with superfluous derivatives, at start values off the truth.

    Parameters
    ----------
    seed : int
        Seed of the start values.

    Returns
    -------
    StateSpaceModel
    """
    vehicle = truth()
    plain: dict[str, Any] = vehicle.to_dict()
    plain.pop("schema")
    plain["responses"] = []
    for name, (left, factor, unit) in SUPERFLUOUS.items():
        plain["equations"][left] += f" + {name}*{factor}"
        plain["parameters"][name] = {"value": 0.0, "unit": unit, "note": "superfluous"}
    model = fid.StateSpaceModel.from_dict(plain)
    draws = np.random.default_rng(seed).uniform(1 - SPREAD, 1 + SPREAD, len(vehicle.parameters))
    starts = {
        name: parameter.value * float(draw)
        for (name, parameter), draw in zip(vehicle.parameters.items(), draws, strict=True)
        if parameter.free and parameter.value is not None
    }
    return model.with_values(starts)


def linearised_full_envelope() -> fid.StateSpaceModel:
    """Stand-in for a linearised full-envelope model, with the faults that the paper reports.

    No inflow state, heave damping of momentum theory, off-axis angular responses out of phase,
    weak roll from the tail rotor, and no delays. On-axis control is right.
    """
    vehicle = truth()
    value = {name: parameter.value or 0.0 for name, parameter in vehicle.parameters.items()}
    opposite = {name: -value[name] for name in ("Lq", "Llon", "Mp", "Mlat")}
    model = vehicle.with_values(
        {
            "Zw": -0.3,
            "Lped": 0.4 * value["Lped"],
            "Lp": 0.8 * value["Lp"],
            "Mq": 1.3 * value["Mq"],
            "Nr": 0.6 * value["Nr"],
            **opposite,
        }
    )
    no_delays = dict.fromkeys(("tau_lon", "tau_lat", "tau_ped", "tau_col"), 0.0)
    return model.with_fixed(tau_lead=0.05, tau_lag=0.05, **no_delays)
