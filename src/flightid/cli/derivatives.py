"""``flightid derivatives``: stability and control derivatives of a model."""

from __future__ import annotations

from flightid.cli.model_commands import model_command

command = model_command(
    "derivatives",
    "Derivatives",
    "Stability and control derivatives of MODEL; of a fitted one with intervals.",
)
