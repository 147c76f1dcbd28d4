"""``flightid rotor-physics``: identified rotor parameters beside theory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flightid.cli.model_commands import model_command

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> type[Options]:
    from flightid.dynamics.rotor.options import RotorOptions

    return RotorOptions


command = model_command(
    "rotor_physics",
    "Rotor physics",
    "Hold the rotor's parameters of MODEL against what its physics says.",
    _fields,
)
