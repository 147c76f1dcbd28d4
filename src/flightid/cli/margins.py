"""``flightid margins``: what a loop may gain, lose or lag before it is unstable."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from flightid.cli.model_commands import model_command
from flightid.cli.option_fields import flags_of

if TYPE_CHECKING:
    from flightid.options import Options
    from flightid.result import Result


def _fields() -> type[Options]:
    from flightid.control.margins.options import MarginOptions

    return MarginOptions


def _around(
    source: Any,  # noqa: ANN401 — any model
    gains: dict[str, dict[str, float]],
    given: dict[str, Any],
) -> tuple[Result, ...]:
    from flightid import close_loop

    for name in given.keys() - {"band_rad_s"}:
        raise click.UsageError(f"{flags_of(name)[-1]} is of a broken loop, not of --feedback")
    closed = close_loop(source, gains)
    return closed, *closed.margins(**given).values()


command = model_command(
    "margins",
    "Margins",
    "Margins of MODEL as a broken loop; with --feedback of the loops closed around it.",
    _fields,
    _around,
)
