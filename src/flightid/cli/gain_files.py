"""Files of gains that a command closes around a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from flightid.cli.output import note

if TYPE_CHECKING:
    from flightid.control.stepped.gain_controller import GainController

USUAL_RATE_HZ = 400.0
"""Of an autopilot's loop, where nothing says another."""


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
    from flightid.control.autopilots import read_parameters
    from flightid.control.stepped.gain_controller import gain_controller, pid_controller

    if file.suffix == ".toml":
        tables = [each for each in _tables(file) if each.get("output") in model.outputs]
        return pid_controller(tables or _tables(file), model, rate_hz)
    return gain_controller(read_parameters(file), model, rate_hz)


def rate_of(file: Path, model: Any, asked_hz: float | None) -> float:  # noqa: ANN401
    """Rate of a file's controllers, Hz: its own, what was asked, the model's, the usual one."""
    own = [each["sample_time_s"] for each in _tables(file) if "sample_time_s" in each]
    if own:
        return 1.0 / float(own[0])
    step_s = getattr(model, "sample_time_s", None)
    rate_hz = asked_hz or (1.0 / step_s if step_s else USUAL_RATE_HZ)
    if asked_hz is None:
        note(f"{file.name}: controllers run at {rate_hz:g} Hz; --loop-rate-hz takes another")
    return rate_hz


def _tables(file: Path) -> list[dict[str, Any]]:
    from flightid.reading import read_toml

    if file.suffix != ".toml":
        return []
    found: list[dict[str, Any]] = read_toml(file, "a file of gains").get("controller", [])
    return found
