"""``flightid lower-order``: the equivalent system of low order that standards speak of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flightid.cli.model_commands import model_command

if TYPE_CHECKING:
    from flightid.options import Options


def _fields() -> type[Options]:
    from flightid.dynamics.lower_order.options import LowerOrderOptions

    return LowerOrderOptions


command = model_command(
    "lower_order",
    "Equivalent system",
    "Fit an equivalent system of low order with delay to MODEL, and rate it.",
    _fields,
)
