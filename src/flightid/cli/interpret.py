"""``flightid interpret``: what poles and zeros of a black box may stand for."""

from __future__ import annotations

from flightid.cli.model_commands import model_command

command = model_command(
    "interpret",
    "Interpretation",
    "Say what poles and zeros of MODEL, identified without equations, may stand for.",
)
