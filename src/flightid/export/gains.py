"""Tuned gains as files: an autopilot's parameters, numbers in TOML, or C of a PID of its own."""

from __future__ import annotations

from pathlib import Path

from flightid.control.tuning.pid_design import require_gains
from flightid.control.tuning.result import Tuning
from flightid.errors import OptionError
from flightid.export.names import identifier
from flightid.export.pid_source import export_pid
from flightid.export.to_file import plain_loop


def write_gains(
    tuning: Tuning, path: Path, *, overwrite: bool = False, accept_red: bool = False
) -> tuple[Path, ...]:
    """Write the gains of every sound axis or loop; the suffix ``.c`` chooses code.

    Parameters
    ----------
    tuning : Tuning
    path : Path
        ``gains.param`` of ArduPilot, ``gains.params`` of PX4, ``gains.txt`` of
        Betaflight, ``gains.toml`` or ``gains.c`` of a
        PID of its own. Of several loops each gets a C file of its own, ``gains_<loop>.c``.
    overwrite : bool
        Whether files that exist may be replaced.
    accept_red : bool
        Write in spite of red findings, which then stand at the top of every file.

    Returns
    -------
    tuple of Path

    Raises
    ------
    DataError
        There are no gains, or a finding is red.
    ExportError
        The gains of an autopilot, or a controller without a rate, as C.
    OptionError
        A file is already there.
    """
    if path.suffix != ".c":
        return tuning.write(path, overwrite=overwrite, accept_red=accept_red)
    designs, left = tuning.writable(accept_red=accept_red)
    findings = tuning.findings if accept_red else ()
    notes = [*left, *require_gains(designs, findings, accept_red=accept_red)]
    loops = [plain_loop(each) for each in designs]
    several = len(tuning.designs) > 1
    stems = [f"{path.stem}_{each.axis}" if several else path.stem for each in designs]
    places = [path.with_name(f"{identifier(stem)}.c") for stem in stems]
    for place in (path, *places):
        if place.exists() and not overwrite:
            raise OptionError(
                "a file of gains is there already",
                found=str(place),
                needed="another name, or overwrite=True",
            )
    made = [
        export_pid(loop, place, place.stem, notes)
        for loop, place in zip(loops, places, strict=True)
    ]
    return tuple(file for one in made for file in one.files)
