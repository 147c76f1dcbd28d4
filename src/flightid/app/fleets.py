"""Fleets of the workspace: fleet files and catalogues in its folder, none that leads out of it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath

from flightid.app.own_folders import is_link, read_plain
from flightid.app.workspace import ID, Workspace
from flightid.errors import FlightidError, OptionError
from flightid.fleet import read_fleet
from flightid.fleet.addresses import find_logs
from flightid.fleet.engine.order import study_files
from flightid.fleet.settings import FleetSettings
from flightid.frozen import dataclass

DEEPEST = 3
"""Folders below the workspace that are looked into for fleets."""
MOST_FLEETS = 200
FILE_BYTES = 1 << 20
NOTE = "fleet.json"
HEAD = re.compile(rb"^\s*\[fleet\]\s*(?:#.*)?$", re.MULTILINE)
OURS = ("studies", "models", "flights", "records")
WILD = re.compile(r"[*?\[]")
FEWEST_LOGS = 2


@dataclass(frozen=True)
class FleetPlace:
    """A fleet file, or a catalogue that none of the workspace names.

    Attributes
    ----------
    id : str
        First 16 digits of the SHA-256 of its path below the workspace.
    path : Path
    shown : str
        Path below the workspace.
    is_file : bool
        Whether it is a fleet file, which can be run.
    """

    id: str
    path: Path
    shown: str
    is_file: bool


def known_fleets(workspace: Workspace) -> list[FleetPlace]:
    """Fleet files, then catalogues that belong to none of them; at most `MOST_FLEETS`."""
    folder = workspace.folder
    files: list[Path] = []
    catalogues: list[Path] = []
    for path in _candidates(folder, DEEPEST):
        (catalogues if path.name == NOTE else files).append(path)
        if len(files) + len(catalogues) >= MOST_FLEETS:
            break
    owned = set[Path]()
    for path in files:
        with suppress(FlightidError, OSError, RuntimeError):  # the last: a link to itself
            owned.add(Path(read_fleet(path).catalogue).resolve())
    alone = [each.parent for each in catalogues if each.parent.resolve() not in owned]
    return [
        *(_place(folder, each, is_file=True) for each in sorted(files)),
        *(_place(folder, each, is_file=False) for each in sorted(alone)),
    ]


def fleet_of(workspace: Workspace, fleet: str) -> FleetPlace | None:
    """A fleet by its id; None where the workspace holds no such one."""
    if not ID.fullmatch(fleet):
        return None
    return next((each for each in known_fleets(workspace) if each.id == fleet), None)


def checked_fleet(workspace: Workspace, place: FleetPlace) -> FleetSettings | None:
    """Settings of a fleet file that stays in the workspace; None of a catalogue alone.

    Raises
    ------
    StudyError
        The file is none.
    OptionError
        It names something outside the workspace, or an address.
    """
    if not place.is_file:
        _require_inside(workspace.folder, place.shown, place.path)
        return None
    settings = read_fleet(place.path)
    words, rules = settings.words, settings.vehicles
    named = [settings.catalogue, *(settings.place(each) for each in words.logs)]
    beside = (words.study, rules.table, rules.flight_table)
    named += [str(place.path.parent / each) for each in beside if each is not None]
    for each in named:
        if "://" in each:
            raise _outside(each)
        _require_inside(workspace.folder, each, Path(each))
    for path in study_files(settings):
        _require_inside(workspace.folder, str(path), path)
    return settings


def log_folders(workspace: Workspace) -> dict[str, int]:
    """Folders right below the workspace with logs enough for a fleet, which no fleet file names.

    Logs are counted as a fleet file of the folder would find them.
    """
    tops = {
        PurePosixPath(each.path).parts[0]
        for each in workspace.index.entries()
        if len(PurePosixPath(each.path).parts) > 1
    }
    if not tops:
        return {}
    named = _named_logs(workspace)
    found = dict[str, int]()
    for name in sorted(tops):
        logs = {each.address for each in find_logs([str(workspace.folder / name)])}
        if len(logs - named) >= FEWEST_LOGS:
            found[name] = len(logs)
    return found


def _named_logs(workspace: Workspace) -> set[str]:
    """Addresses of all logs that fleet files of the workspace name."""
    found = set[str]()
    for place in known_fleets(workspace):
        with suppress(FlightidError, OSError, RuntimeError):
            settings = checked_fleet(workspace, place)
            if settings is not None:
                logs = find_logs([settings.place(each) for each in settings.words.logs])
                found |= {each.address for each in logs}
    return found


def _candidates(folder: Path, deep: int) -> Iterator[Path]:
    """Fleet files and notes of catalogues; hidden folders, ours and links are left out."""
    try:
        listed = sorted(folder.iterdir())
    except OSError:
        return
    for path in listed:
        if path.name.startswith(".") or is_link(path):
            continue
        if path.is_dir():
            if deep and not (deep == DEEPEST and path.name in OURS):
                yield from _candidates(path, deep - 1)
        elif path.name == NOTE or (path.suffix == ".toml" and _is_fleet(path)):
            yield path


def _is_fleet(path: Path) -> bool:
    try:
        return HEAD.search(read_plain(path, FILE_BYTES)) is not None
    except OSError:
        return False


def _place(folder: Path, path: Path, *, is_file: bool) -> FleetPlace:
    shown = path.relative_to(folder).as_posix()
    digest = hashlib.sha256(shown.encode("utf-8", "surrogateescape")).hexdigest()[:16]
    return FleetPlace(digest, path, shown, is_file)


def _require_inside(folder: Path, said: str, path: Path) -> None:
    """The part of a path before its first wildcard lies in the workspace, links followed."""
    plain = Path()
    for part in path.parts:
        if WILD.search(part):
            break
        plain /= part
    try:
        is_within = plain.resolve().is_relative_to(folder)
    except (RuntimeError, OSError):  # links that end nowhere
        is_within = False
    if ".." in path.parts[len(plain.parts) :] or not is_within:
        raise _outside(said)


def _outside(said: str) -> OptionError:
    return OptionError(
        "a fleet names what lies outside the folder of the page",
        found=said,
        needed="logs, study and catalogue in the workspace",
        action="open the page on a folder that holds them, or use flightid fleet on the terminal",
    )
