"""Rows of a catalogue about a made-up fleet, whose truth is known."""

from __future__ import annotations

import datetime
import hashlib
from typing import Any

import numpy as np

from flightid.fleet.catalogue.schema import TABLES, lower_triangle

NAMES = ("Lp", "Ltphi")
MEAN = np.array([-3.4, 140.0])
START = datetime.datetime(2026, 1, 5, 9, tzinfo=datetime.UTC)
Rows = dict[str, list[dict[str, Any]]]


def fleet_rows(seed: int, vehicles: int = 12, flights: int = 24) -> Rows:
    """Two flights every third day; v00 loses 15 % of Ltphi, v01 is 40 % above its type throughout.

    v02 gets a motor on 2026-01-23 that adds 10 %. Every log's battery moves Ltphi by 2 % a volt.
    The last three logs gave nothing: two were logged too slowly, one is empty.
    """
    rng = np.random.default_rng(seed)
    rows: Rows = {name: [] for name in TABLES}
    root = np.linalg.cholesky(np.array([[1.0, 0.5], [0.5, 1.0]]))
    errors = np.array([0.05, 0.02]) * np.abs(MEAN)
    covariance = np.outer(errors, errors) * (root @ root.T)
    for vehicle in range(vehicles):
        truth = MEAN * (1.0 + 0.06 * rng.normal(size=2))
        truth[1] *= 1.4 if vehicle == 1 else 1.0
        for flight in range(flights):
            at = START + datetime.timedelta(days=3 * (flight // 2), hours=2 * (flight % 2))
            battery = float(rng.uniform(14.0, 17.0))
            values = truth + errors * (root @ rng.normal(size=2))
            values[1] *= 1.0 + 0.02 * (battery - 15.5)
            values[1] *= 0.85 if vehicle == 0 and flight >= 14 else 1.0
            values[1] *= 1.1 if vehicle == 2 and flight >= 12 else 1.0
            log = _digest(f"{vehicle:02}{flight:03}")
            common = {
                "log": log, "vehicle": f"v{vehicle:02}", "type": "quad",
                "flown_at": at.replace(tzinfo=None).isoformat(), "light": "green",
            }  # fmt: skip
            _fitted(rows, common, values, covariance, battery)
    for number, reason in enumerate(("rate-too-low", "rate-too-low", "empty")):
        rows["logs"].append(
            {
                "log": _digest(f"bad{number}"),
                "vehicle": None,
                "type": None,
                "flown_at": None,
                "light": "red",
                "address": f"logs/bad{number}.bin",
                "outcome": "refused",
                "reason": reason,
                "message": "RATE is logged at 10 Hz",
                "action": "set LOG_BITMASK to log RATE at 400 Hz",
                "firmware": None,
            }
        )
    return rows


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _fitted(
    rows: Rows, common: dict[str, Any], values: np.ndarray, covariance: np.ndarray, battery: float
) -> None:
    rows["logs"].append(
        common
        | {"address": f"logs/{common['log'][:6]}.bin", "outcome": "fitted", "reason": None}
        | {"message": None, "action": None, "firmware": "4.6"}
    )
    model = common | {"model": "roll"}
    for place, name in enumerate(NAMES):
        stderr = float(np.sqrt(covariance[place, place]))
        rows["parameters"].append(
            model
            | {"name": name, "value": float(values[place]), "stderr": stderr}
            | {"unit": ("1/s", "rad/s^2")[place], "status": "free", "position": place}
        )
    rows["covariances"].append(
        model | {"names": list(NAMES), "lower": lower_triangle(covariance.tolist())}
    )
    told = {"name": "battery", "value": battery, "text": None, "unit": "V", "source": "log"}
    rows["covariates"].append(common | told)
