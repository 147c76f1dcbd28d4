"""Studies without a model: a log that carries none still has filters, plots and a plan."""

from __future__ import annotations

import os
from pathlib import Path

import tomlkit

from flightid.app.kept_parts import kept_overview
from flightid.app.study_edits import VIEWS
from flightid.app.workspace import Workspace
from flightid.models.save import toml_value

UNWRITTEN = '""'
"""Tag of the study of a log that has none yet: an entity tag of no letters (RFC 9110)."""
NOTHING = "\n# Nothing is asked of this log yet but what a plan is by itself.\n[plan]\n"
"""A study asks for something: this stands until there is more."""


def bare_study(workspace: Workspace, log: str) -> str | None:
    """A study that names its log alone; None before it was inspected, which may write one."""
    path = workspace.log_path(log)
    if path is None or kept_overview(workspace, log) is None:
        return None
    place = Path(os.path.relpath(path, workspace.study_path(log).parent)).as_posix()
    title = toml_value(f"Filters, plots and plan of {path.stem}")
    return f"[study]\ntitle = {title}\n\n[log]\npath = {toml_value(place)}\n{NOTHING}"


def opened(text: str) -> str:
    r"""A study without what stood for nothing.

    Example
    -------
    >>> opened("[log]\npath = 'a'\n" + NOTHING)
    "[log]\npath = 'a'\n"
    """
    return text.replace(NOTHING, "")


def completed(text: str) -> str:
    r"""A study of a log that asks for something, be it what stands for nothing.

    Example
    -------
    >>> completed("[log]\npath = 'a'\n").endswith("[plan]\n")
    True
    >>> completed("[log]\npath = 'a'\n[filters]\n").endswith("[filters]\n")
    True
    """
    told = tomlkit.parse(text)
    asks = any(key in told for key in ("model", *VIEWS))
    return text if asks or "log" not in told else text + NOTHING
