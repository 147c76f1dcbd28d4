"""The file of a PID's own numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from flightid.control.autopilots.pid_loop import PidLoop
from flightid.errors import OptionError
from flightid.files import write_atomically
from flightid.models.save import toml_value


def write_settings(
    loops: Sequence[PidLoop], path: Path, notes: Sequence[str], *, overwrite: bool
) -> tuple[Path, ...]:
    """Numbers of controllers, one table each."""
    if path.suffix != ".toml" or (path.exists() and not overwrite):
        raise OptionError(
            "the gains of a PID are written to a new TOML file",
            found=path.name,
            needed="a name that ends in .toml, of no file that is there",
            action="name another file, or export the design as C",
        )
    lines = [f"# {' '.join(note.split())}" for note in notes]
    for loop in loops:
        told = loop.settings().items()
        lines += [f"# {each}" for each in loop.remarks()]
        lines += ["[[controller]]", *(f"{key} = {toml_value(value)}" for key, value in told), ""]
    return (write_atomically(path, "\n".join(lines)),)
