"""Flights of vehicles of a type, each with the file of its fitted model, in a catalogue."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flightid.fleet.catalogue.loose import write_loose
from flightid.fleet.catalogue.record import LogRecord
from flightid.fleet.catalogue.schema import TABLES, lower_triangle
from flightid.fleet.opening import current_store
from flightid.fleet.settings import read_fleet
from flightid.identification.frequency_domain.model_curves import curves_of
from flightid.identification.model_error import ModelErrorBound
from flightid.models.estimated import EstimateProvenance
from flightid.models.load import load_model
from flightid.models.save import model_as_toml

NAMES = ("Ltphi", "Lp", "T_m", "tau")
MEAN = np.array([140.0, -3.4, 0.045, 0.012])
ERRORS = 0.03 * np.abs(MEAN)
VEHICLES, FLIGHTS = 8, 2


def values() -> np.ndarray:
    """Estimates of every flight: 10 % between vehicles, 3 % errors."""
    rng = np.random.default_rng(5)
    truth = np.repeat(MEAN * (1 + 0.1 * rng.normal(size=(VEHICLES, 4))), FLIGHTS, axis=0)
    return np.asarray(truth + ERRORS * rng.normal(size=truth.shape))


def record(number: int, row: np.ndarray, type_name: str, light: str = "green") -> LogRecord:
    """One flight as a run keeps it; its band begins the higher the later it flew."""
    band = (0.5 + 0.05 * number, 90.0)
    omega = np.geomspace(*band, 9)
    known = EstimateProvenance(
        NAMES, np.diag(ERRORS**2), "frequency_domain", "", {"p/tau_phi": band}, {},
        {"options": {"hold": "zoh"}},
        {"p/tau_phi": ModelErrorBound(omega, np.full(9, 0.05)).to_dict()},
    )  # fmt: skip
    plain = load_model("rate_motor_lag", axis="roll")
    model: Any = plain.with_values(dict(zip(NAMES, map(float, row), strict=True)))
    file = model_as_toml(replace(model, estimated=known))
    log = f"{type_name}{number:02}".encode().hex().ljust(64, "0")
    common = {
        "log": log, "vehicle": f"{type_name}{number // FLIGHTS}", "type": type_name,
        "flown_at": None, "light": light,
    }  # fmt: skip
    of_model = common | {"model": "Roll"}
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in TABLES}
    rows["logs"] = [common | {"outcome": "fitted", "address": f"{number}.bin"}]
    rows["models"] = [of_model | {"file": file}]
    rows["parameters"] = [
        of_model
        | {"name": name, "value": float(row[i]), "stderr": float(ERRORS[i]), "position": i}
        | {"unit": plain.parameters[name].unit, "status": "free"}
        for i, name in enumerate(NAMES)
    ]
    lower = lower_triangle(np.diag(ERRORS**2).tolist())
    (points,) = curves_of(model, [omega])
    rows["responses"] = [
        of_model
        | {"output": "p", "input": "tau_phi", "unit": "rad/s", "omega_rad_s": omega.tolist()}
        | {"real": points.real.tolist(), "imag": points.imag.tolist()}
        | {"random_error": np.full(9, 0.02).tolist()}
    ]
    rows["covariances"] = [of_model | {"names": list(NAMES), "lower": lower}]
    return LogRecord(log, rows)


def fleet_of(folder: Path, *types: str, name: str = "fleet.toml") -> Path:
    fleet = folder / name
    fleet.write_text('[fleet]\ntitle = "F"\nlogs = ["logs"]\n')
    store = current_store(read_fleet(fleet))
    for type_name in types:
        for number, row in enumerate(values()):
            write_loose(store, record(number, row, type_name))
        # A red one counts nowhere, whatever it says.
        write_loose(store, record(90, 5.0 * MEAN, type_name, "red"))
    return fleet
