"""The command that was meant, for an error that names a file or a verb that is not there."""

from __future__ import annotations

import re
from pathlib import Path

PARAMETERS = (".param", ".params", ".parm")
"""Endings of files of an autopilot's parameters."""
MEANT = {
    "help": "flightid --help",
    "analyze": "flightid run LOG",
    "analyse": "flightid run LOG",
    "fit": "flightid run LOG",
    "gains": "flightid tune LOG",
    "pid": "flightid tune LOG",
    "sweep": "flightid plan LOG",
    "open": "flightid app",
    "gui": "flightid app",
}
"""Words of other programs, and the command here."""
_MISSING = re.compile(r"'([^']+)' does not exist")


def missing_hint(said: str, verb: str) -> str:
    """What may have been meant by a path that does not exist; empty where nothing tells.

    Parameters
    ----------
    said : str
        The error.
    verb : str
        Command that was typed, ``"flightid plan"``.

    Example
    -------
    >>> missing_hint("File 'quadrotor' does not exist.", "flightid plan")
    'a kind of vehicle is an option: flightid plan --vehicle quad'
    """
    found = _MISSING.search(said)
    if found is None:
        return ""
    path = Path(found[1])
    try:
        beside = [each for each in path.parent.iterdir() if _alike(each.name, path.name)]
    except OSError:
        beside = []
    if beside:
        return f"there is {beside[0]}: {verb} {beside[0]}"
    kinds = {"quadrotor": "quad", "copter": "quad", "multirotor": "quad", "helicopter": "heli"}
    kind = kinds.get(found[1], found[1])
    if verb.endswith(" plan") and kind in ("quad", "heli", "plane", "quadplane"):
        return f"a kind of vehicle is an option: {verb} --vehicle {kind}"
    return ""


def _alike(one: str, other: str) -> bool:
    return one != other and one.lower() == other.lower()
