"""A fleet file for a folder of logs that has none: what was chosen, and why, beside each line."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from flightid.errors import FlightidError, StudyError
from flightid.files import write_atomically
from flightid.fleet.addresses import LogAddress, find_logs
from flightid.fleet.identity import DATES, FleetTables, identify_log
from flightid.fleet.settings import VehicleRules
from flightid.frozen import dataclass
from flightid.logs import read_log

NAMED = re.compile(r"^([A-Za-z]+[-_]?[0-9]+)[-_.]")
PATTERN = "^([A-Za-z]+[-_]?[0-9]+)[-_.]"
"""What file names begin with that name their vehicle: V07-2026-03-01.bin."""
MOST_NAME = 200
"""Bytes of a folder's name: the file beside it has a longer one, of 255 at most."""
LOOKED_AT = 3
"""Logs that are read for the id inside them."""


@dataclass(frozen=True)
class FleetProposal:
    """The fleet file of a folder, before it is written.

    Attributes
    ----------
    path : Path
        Where it belongs: beside the folder, as its catalogue will be.
    text : str
        TOML with comments.
    said : tuple of str
        What was chosen and why.

    Example
    -------
    >>> import flightid as fid
    >>> fid.fleet.propose_fleet("logs").write().name
    'logs-fleet.toml'
    """

    path: Path
    text: str
    said: tuple[str, ...]

    def write(self) -> Path:
        """Write it where it belongs.

        Raises
        ------
        StudyError
            There is a file already that says something else.
        """
        content = self.text.encode()
        if self.path.exists() and self.path.read_bytes() != content:
            raise StudyError(
                "there is a fleet file for this folder already",
                found=str(self.path),
                action=f"run it: flightid fleet run {self.path}",
            )
        write_atomically(self.path, content)
        return self.path


def propose_fleet(place: str | Path) -> FleetProposal:
    """A fleet file for a folder of logs.

    Vehicles are told apart by an id inside the logs where a few of them have one, else by the
    folders that they lie in, else by what their names begin with.

    Parameters
    ----------
    place : str or Path
        The folder.

    Returns
    -------
    FleetProposal

    Raises
    ------
    StudyError
        There is no log in it.

    Example
    -------
    >>> import flightid as fid
    >>> made = fid.fleet.propose_fleet("logs")
    >>> made.path.name, made.said[0]
    ('logs-fleet.toml', '2 logs')
    """
    folder = Path(place).absolute()
    _require_name(folder)
    logs = find_logs([str(folder)])
    if not logs:
        raise StudyError(
            "there is no log in this folder",
            found=str(folder),
            needed=".bin, .ulg, .bbl and others",
        )
    rule, why = _rule(folder, logs)
    dated = sum(DATES.search(each.name) is not None for each in logs)
    n = len(logs)
    said = (
        f"{n} log{'s' * (n != 1)}",
        f"vehicles by {why}",
        f"dates by the first fix in the log, else by the name ({dated} of {n} have one), "
        "else by the file",
        "the study that each log asks for (name one in [fleet] study to take all alike)",
    )
    return FleetProposal(
        folder.with_name(f"{folder.name}-fleet.toml"), _text(folder, rule, said), said
    )


def _require_name(folder: Path) -> None:
    """A fleet file is named by its folder."""
    encoded = os.fsencode(folder.name)
    try:
        encoded.decode("utf-8")
        told = 0 < len(encoded) <= MOST_NAME
    except UnicodeDecodeError:
        told = False
    if not told:
        raise StudyError(
            "this folder has no name to call a fleet by",
            found=os.fsencode(folder).decode("utf-8", "replace"),
            needed=f"a name in UTF-8 of 1 to {MOST_NAME} bytes",
            action="rename it, or put its logs into a folder that has one",
        )


def _rule(folder: Path, logs: Sequence[LogAddress]) -> tuple[VehicleRules, str]:
    seen = logs[:LOOKED_AT]
    ids = [found for each in seen if (found := _id_inside(each))]
    if ids:
        told = f"{len(ids)} of the {len(seen)} looked at have one, such as {ids[0]}"
        return VehicleRules(), f"the id inside the logs ({told})"
    folders = Counter(PurePosixPath(each.address).parent for each in logs)
    if len(folders) > 1 and Path(next(iter(folders))) != folder:
        return VehicleRules(by="folder"), f"the {len(folders)} folders that they lie in"
    names = [named[1] for each in logs if (named := NAMED.match(each.name))]
    if len(names) > len(logs) // 2:
        vehicles = len(set(names))
        rule = VehicleRules(by="name", pattern=PATTERN)
        return rule, f"what file names begin with ({vehicles} vehicles, such as {names[0]})"
    return VehicleRules(), "the id inside the logs, though the first have none"


def _id_inside(address: LogAddress) -> str | None:
    try:
        log = read_log(Path(address.address))
    except (FlightidError, OSError):
        return None
    identity = identify_log(log, address.address, None, VehicleRules(), FleetTables())
    return identity.own


def _text(folder: Path, rule: VehicleRules, said: Sequence[str]) -> str:
    name = json.dumps(folder.name, ensure_ascii=False).replace("\x7f", "\\u007f")
    lines = [
        "# Written by flightid fleet run; docs/fleet.md describes every key. Change it freely."
    ]
    lines += [f"# Chosen: {' '.join(each.split())}." for each in said]
    lines += [
        "",
        "[fleet]",
        f"title = {name}",
        f"logs = [{name}]  # folders, globs and addresses",
        '# study = "study.toml"  # every log goes through it; flightid new LOG writes one',
        "# reports = true  # keep the page of every log",
        "",
        "[vehicles]",
        f'by = "{rule.by}"  # log, folder or name',
    ]
    if rule.pattern is not None:
        lines.append(f"pattern = '{rule.pattern}'  # its first group is the id")
    lines += [
        '# type = "X500"  # default: autopilot and kind of vehicle',
        '# flight_table = "flights.csv"  # columns log, and any of vehicle, flown_at, pilot, …',
        "",
        "[limits]",
        "time_s = 600  # for one log",
        "memory_mib = 4096  # address space of the process that takes it",
        "",
        "[questions]",
        '# covariates = ["battery_start_v", "firmware"]  # taken out before drift is looked for',
        "",
        "# [[event]]",
        '# date = "2026-03-01"',
        '# what = "new propellers"',
    ]
    return "\n".join(lines) + "\n"
