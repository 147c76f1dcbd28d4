"""What was computed of a log, read back as the page is told it; a broken cache is made again."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from flightid.app.fleet_schemas import FleetRunPart
from flightid.app.gain_schemas import GainsPart
from flightid.app.run_schemas import RunPart
from flightid.app.schemas import FieldGroup, Message, Overview, ReviewPart
from flightid.app.workspace import Workspace

PARTS: dict[str, type[Message]] = {
    "overview": Overview,
    "review": ReviewPart,
    "run": RunPart,
    "fleet": FleetRunPart,
    "gains": GainsPart,
}


def kept_overview(workspace: Workspace, log: str) -> Overview | None:
    """The overview of a log; None where there is none that holds."""
    found = kept_part(workspace, log, "overview")
    return found if isinstance(found, Overview) else None


def kept_review(workspace: Workspace, log: str) -> ReviewPart | None:
    """The review of a log; None where there is none that holds."""
    found = kept_part(workspace, log, "review")
    return found if isinstance(found, ReviewPart) else None


def kept_part(workspace: Workspace, log: str, kind: str, of: str = "") -> Message | None:
    """A part by its kind; one that is not as it was written is removed, as if it had not been.

    Parameters
    ----------
    workspace : Workspace
    log, kind : str
    of : str
        Version of what it was made of, where there may be a part for each.
    """
    name = f"{kind}-{of}" if of else kind
    found: dict[str, Any] | None = workspace.result(log, name)
    if found is None:
        return None
    try:
        return PARTS[kind].model_validate(found)
    except ValidationError:
        workspace.drop_result(log, name)
        return None


def kept_fields(workspace: Workspace, log: str) -> list[FieldGroup] | None:
    """The fields of a log's messages; None where there are none that hold."""
    found = workspace.result(log, "fields")
    if found is None:
        return None
    try:
        return [FieldGroup.model_validate(group) for group in found["groups"]]
    except (ValidationError, KeyError, TypeError):
        workspace.drop_result(log, "fields")
        return None
