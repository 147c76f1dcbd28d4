"""Files of gains, as `flightid tune` and studies write them, as controllers around a model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flightid.control.autopilots import read_parameters
from flightid.control.stepped.gain_controller import GainController, gain_controller, pid_controller
from flightid.reading import read_toml

USUAL_RATE_HZ = 400.0
"""Of an autopilot's loop, where nothing says another."""
CONTROLLER = "controller.toml"
"""Gains of a PID that a study tuned, in the folder of its results."""


def controller_of(file: Path, model: Any, rate_hz: float) -> GainController:  # noqa: ANN401
    """Controllers of a parameter file of an autopilot, or of the TOML of a PID, around a model.

    Parameters
    ----------
    file : Path
        As `flightid tune --write` makes it.
    model : Model
        Of a PID's file the controllers of its outputs are taken.
    rate_hz : float
        At which the controllers run.
    """
    if file.suffix == ".toml":
        tables = [each for each in _tables(file) if each.get("output") in model.outputs]
        return pid_controller(tables or _tables(file), model, rate_hz)
    return gain_controller(read_parameters(file), model, rate_hz)


def own_rate(file: Path) -> float | None:
    """Rate that a PID's file tells of its controllers, Hz; None where it tells none."""
    own = [each["sample_time_s"] for each in _tables(file) if "sample_time_s" in each]
    return 1.0 / float(own[0]) if own else None


def usual_rate(model: Any) -> float:  # noqa: ANN401 - of any kind
    """Rate of controllers that nobody told, Hz: that of a sampled model, else the usual one."""
    step_s = getattr(model, "sample_time_s", None)
    return 1.0 / step_s if step_s else USUAL_RATE_HZ


def _tables(file: Path) -> list[dict[str, Any]]:
    if file.suffix != ".toml":
        return []
    found: list[dict[str, Any]] = read_toml(file, "a file of gains").get("controller", [])
    return found
