"""What a worker does for the screen Model: the library, a model of a study, a prediction."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from flightid.app.model_schemas import OwnModelAnswer, ShownModel, UseEdits
from flightid.app.schemas import Edit
from flightid.app.shown_models import AXES, axes_of, shown_model, shown_parameter
from flightid.app.study_edits import KeyEdit, edited
from flightid.app.study_reach import draft_inside
from flightid.errors import FlightidError
from flightid.models import library_names, load_structure
from flightid.reading import parse_toml
from flightid.study.model_preview import preview_model
from flightid.study.model_settings import AnyModel
from flightid.study.task import source_of

OF_TEMPLATE = ("parameters", "responses", "outputs", "keep", "drop", "values_from")
"""Keys of a model that speak of its equations' names: another template has others."""
STAYS = {each.name for each in fields(AnyModel)} | {"axis", "response", "check", "joint", "fit"}
FITS_RECORDS = "output_error"


def make_library() -> list[dict[str, Any]]:
    """Every model of the library."""
    return [
        shown_model(name, load_structure(name), axes_of(name)).model_dump()
        for name in library_names()
    ]


def make_model(
    study: Path, text: str, edits: Sequence[KeyEdit], name: str
) -> dict[str, Any] | None:
    """A model of a study under edits that are not written yet; None without equations."""
    with draft_inside(study, edited(text, edits) if edits else text) as draft:
        seen = preview_model(draft, name)
    if seen.model is None or seen.settings.template is None:
        return None
    source = source_of(seen.settings.template)
    key = source.stem if isinstance(source, Path) else source
    own = load_structure(source, axis=seen.settings.axis).parameters
    axes = axes_of(source) if isinstance(source, str) else []
    shown = shown_model(key, seen.model, axes)
    rows = [shown_parameter(each, own[each.name]) for each in seen.model.parameters.values()]
    return shown.model_copy(update={"parameters": rows}).model_dump()


def make_use(study: Path, text: str, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Edits that put a model into a study, tried on it first.

    Raises
    ------
    StudyError
        The study could not be carried out with it.
    """
    content = parse_toml(text, "the study file", study.name)
    models: Any = content.get("model", [])
    place = min(int(asked["place"]), len(models))
    own = models[place] if place < len(models) else {}
    name = str(own.get("name") or _new_name(str(asked["template"]), models))
    edits = _edits(content, place, name, asked)
    made = [KeyEdit(tuple(each.path), each.value) for each in edits]
    with draft_inside(study, edited(text, made)) as draft:
        preview_model(draft, name)
    return UseEdits(edits=edits, name=name).model_dump()


def _new_name(template: str, models: Sequence[Mapping[str, Any]]) -> str:
    stem = Path(template).stem.replace("_", " ")
    taken = {each.get("name") for each in models}
    tried = (stem, *(f"{stem} {n}" for n in range(2, 1000)))
    return next(each for each in tried if each not in taken)


def _edits(
    content: Mapping[str, Any], place: int, name: str, asked: Mapping[str, Any]
) -> list[Edit]:
    """Keys of a model that change, those of other equations out first."""
    models: Any = content.get("model", [])
    at: list[str | int] = ["model", place]
    is_new = place == len(models)
    own = {} if is_new else models[place]
    without = "structure" in own

    def key(word: str, value: object) -> Edit:
        return Edit(path=[*at, word], value=value)

    gone = OF_TEMPLATE if not without else [each for each in own if each not in STAYS]
    edits = [key(each, None) for each in gone if each in own]
    if is_new:
        like: Any = models[0] if models else {}
        edits += [key("name", name)]
        beside = ("identify", "verify", "band_rad_s")
        edits += [key(each, like[each]) for each in beside if each in like]
        own = like
    edits.append(key("template", asked["template"]))
    axis = asked.get("axis")
    if axis != (None if is_new else own.get("axis")):
        edits.append(key("axis", axis))
    banded = "band_rad_s" in own or "band_rad_s" in content.get("response", {})
    method = {**content.get("fit", {}), **({} if is_new else own.get("fit", {}))}.get("method")
    if not banded and method is None:
        edits.append(key("fit", {"method": FITS_RECORDS}))
    place_of = ["defaults", "record", "columns"]
    for channel, column in asked.get("columns", {}).items():
        if channel != column:
            edits.append(Edit(path=[*place_of, channel], value=column))
    return edits


def judge_own(text: str) -> OwnModelAnswer:
    """A model file as written: the model, or what is wrong and on which line."""
    try:
        content = parse_toml(text, "the model file", "the editor")
        axis = "roll" if isinstance(content.get("axes"), dict) else None
        return OwnModelAnswer(model=_shown_of(text, axis))
    except FlightidError as error:
        return OwnModelAnswer(error=str(error), line=line_of(str(error), text))


def _shown_of(text: str, axis: str | None) -> ShownModel:
    from tempfile import TemporaryDirectory  # noqa: PLC0415 - of this alone

    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text(text, encoding="utf-8")
        made = load_structure(path, axis=axis)
    return shown_model("", made, list(AXES) if axis else [])


_PLACE = re.compile(r"at line (\d+)|\(line (\d+)")
_QUOTED = re.compile(r"['\"]((?:[^'\"\\]|'(?=\"))+)['\"]")
_NAMED = re.compile(
    r"(?:equation|parameter|tie of parameter|output|state|input|definition|constant|delay of"
    r"(?: input)?|block|table) ['\"]?([\w']+)"
)


def line_of(said: str, text: str) -> int | None:
    r"""Line of a model file, from 1, that a refusal speaks of; None where it speaks of none.

    Example
    -------
    >>> line_of("parameter Lp has no value", "[parameters]\nLp = { unit = '1/s' }")
    2
    """
    if found := _PLACE.search(said):
        return int(found[1] or found[2])
    lines = text.split("\n")
    named = [*re.findall(r'equation "(.+?)" has', said), *_NAMED.findall(said)]
    for word in [*named, *_QUOTED.findall(said)]:
        for number, line in enumerate(lines, start=1):
            key = line.partition("=")[0].strip().strip("\"'")
            if key == word and "=" in line:
                return number
    for word in _QUOTED.findall(said):
        for number, line in enumerate(lines, start=1):
            if word in line and not line.lstrip().startswith("#"):
                return number
    return None
