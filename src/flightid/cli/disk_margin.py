"""``flightid disk-margin``: gain and phase that loops stand at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flightid.cli.model_commands import model_command

if TYPE_CHECKING:
    from flightid.options import Options
    from flightid.result import Result


def _fields() -> type[Options]:
    from flightid.control.margins.options import DiskMarginOptions

    return DiskMarginOptions


def _around(
    source: Any,  # noqa: ANN401 — any model
    gains: dict[str, dict[str, float]],
    given: dict[str, Any],
) -> tuple[Result, ...]:
    import numpy as np

    from flightid import LinearSystem, disk_margin

    read = tuple(dict.fromkeys(name for row in gains.values() for name in row))
    law = [[row.get(name, 0.0) for name in read] for row in gains.values()]
    states = np.zeros((0, 0)), np.zeros((0, len(read))), np.zeros((len(gains), 0))
    controller = LinearSystem(*states, law, read, tuple(gains))
    return (disk_margin(source, controller=controller, **given),)


command = model_command(
    "disk_margin",
    "Disk margin",
    "Gain and phase that the loops of MODEL stand at once; with --feedback of gains around it.",
    _fields,
    _around,
)
