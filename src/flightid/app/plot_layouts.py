"""Layouts of plots by name, each a file of the workspace that another folder can be given.

``plots/NAME.toml`` holds panes, each with fields (MESSAGE.FIELD) or formulas of fields behind an
equals sign. It says nothing of a log: what a log lacks the page leaves out, and names.
"""

from __future__ import annotations

import json
import tomllib

from pydantic import ValidationError

from flightid.app.own_folders import own_folder, read_plain
from flightid.app.plot_schemas import PlotLayout
from flightid.app.workspace import Workspace
from flightid.files import write_atomically

FOLDER, ENDING = "plots", ".toml"
MOST, MOST_BYTES = 100, 1 << 16
HEAD = "# Plots of flightid's page: fields of a log, or formulas of fields behind an equals sign.\n"


def plot_layouts(workspace: Workspace) -> list[PlotLayout]:
    """All layouts by name; a file that is none is passed over."""
    folder = own_folder(workspace.folder, FOLDER)
    paths = sorted(folder.glob(f"*{ENDING}"))[:MOST]
    return [made for path in paths if (made := _read(path.stem, path)) is not None]


def _read(name: str, path: object) -> PlotLayout | None:
    try:
        found = tomllib.loads(read_plain(path, MOST_BYTES).decode("utf-8"))  # type: ignore[arg-type]
        panes = [each["series"] for each in found["pane"]]
        return PlotLayout(name=name, panes=panes)
    except (OSError, ValueError, LookupError, TypeError, ValidationError, RecursionError):
        return None


def keep_layout(workspace: Workspace, layout: PlotLayout) -> None:
    """Write a layout; one of its name is replaced.

    Raises
    ------
    OptionError
        The folder is a link.
    OSError
        It cannot be written.
    """
    folder = own_folder(workspace.folder, FOLDER)
    # Strings of JSON are strings of TOML, but for a letter that TOML wants escaped.
    lines = [json.dumps(each, ensure_ascii=True) for each in layout.panes]
    text = HEAD + "".join(f"\n[[pane]]\nseries = {each}\n" for each in lines)
    write_atomically(folder / f"{layout.name}{ENDING}", text)


def remove_layout(workspace: Workspace, name: str) -> bool:
    """Remove a layout; tells whether there was one."""
    path = own_folder(workspace.folder, FOLDER) / f"{name}{ENDING}"
    try:
        path.unlink()
    except FileNotFoundError:
        return False
    return True
