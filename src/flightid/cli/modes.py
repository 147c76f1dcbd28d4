"""``flightid modes``: natural frequencies, dampings and time constants of a model."""

from __future__ import annotations

from flightid.cli.model_commands import model_command

command = model_command(
    "modes",
    "Modes",
    "Modes of MODEL; of a fitted one with intervals.",
)
