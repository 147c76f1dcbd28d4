"""``flightid disturbance-rejection``: bandwidth and peak of the answer to disturbances."""

from __future__ import annotations

from operator import methodcaller
from typing import TYPE_CHECKING, Any

from flightid.cli.model_commands import model_command

if TYPE_CHECKING:
    from flightid.options import Options
    from flightid.result import Result


def _fields() -> type[Options]:
    from flightid.control.margins.options import DisturbanceOptions

    return DisturbanceOptions


def _around(
    source: Any,  # noqa: ANN401 — any model
    gains: dict[str, dict[str, float]],
    given: dict[str, Any],
) -> tuple[Result, ...]:
    from flightid import close_loop, disturbance_rejection

    closed = close_loop(source, gains).uncertain
    read = dict.fromkeys(name for row in gains.values() for name in row)
    broken = [closed.then(methodcaller("broken_at", name)) for name in read]
    return tuple(disturbance_rejection(loop, **given) for loop in broken)


command = model_command(
    "disturbance_rejection",
    "Disturbance rejection",
    "How a broken loop, MODEL, rejects disturbances; with --feedback of each output fed back.",
    _fields,
    _around,
)
