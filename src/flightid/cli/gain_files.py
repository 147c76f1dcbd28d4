"""Rate of the controllers in a file of gains that a command closes around a model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flightid.cli.output import note


def rate_of(file: Path, model: Any, asked_hz: float | None) -> float:  # noqa: ANN401
    """Rate of a file's controllers, Hz: its own, what was asked, the model's, the usual one."""
    from flightid.control.stepped.controller_files import own_rate, usual_rate

    own_hz = own_rate(file)
    if own_hz is not None:
        return own_hz
    rate_hz = asked_hz or usual_rate(model)
    if asked_hz is None:
        note(f"{file.name}: controllers run at {rate_hz:g} Hz; --loop-rate-hz takes another")
    return rate_hz
