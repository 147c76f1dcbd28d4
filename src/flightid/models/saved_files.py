"""Where a saved model stands: in a file of its own, the folder of a study, or the JSON of a fit."""

from __future__ import annotations

from pathlib import Path

from flightid.errors import ModelError
from flightid.reading import bounded_bytes, parse_json

MODELS = "models"
"""Folder of a study's results that holds its models."""
FITS = ("flightid.fit/1", "flightid.reduction/1")
MAXIMUM_JSON = 64 << 20


def models_of(folder: Path) -> list[Path]:
    """Model files of a study's output folder, or of a folder of models, in order of their names.

    Raises
    ------
    ModelError
        It holds none.
    """
    below = folder / MODELS
    found = sorted((below if below.is_dir() else folder).glob("*.toml"))
    if not found:
        raise ModelError(
            "this folder holds no model",
            found=str(folder),
            needed="the output folder of a study with a fitted model",
            action="run a study with a [[model]], or write a model with identify --write",
        )
    return found


def only_model(folder: Path) -> Path:
    """The model file of a study's output folder that holds one.

    Raises
    ------
    ModelError
        It holds none, or several: their paths are listed.
    """
    found = models_of(folder)
    if len(found) == 1:
        return found[0]
    raise ModelError(
        "it is not clear which model is meant",
        found=", ".join(map(str, found)),
        needed="one .toml file, or the output folder of a study with one model",
        action=f"name one, for example {found[0]}",
    )


def model_in_json(path: Path) -> dict[str, object]:
    """Description of the model in the JSON of a fit or of a reduction.

    Raises
    ------
    FileFormatError
        The file is too large or no JSON.
    ModelError
        It holds no fit.
    """
    content = parse_json(bounded_bytes(path, MAXIMUM_JSON), "a saved fit", path.name)
    schema = content.get("schema") if isinstance(content, dict) else None
    fit = content["fit"] if schema == FITS[1] else content
    model = fit.get("model") if schema in FITS and isinstance(fit, dict) else None
    if not isinstance(model, dict):
        raise ModelError(
            "this JSON holds no fitted model",
            found=f"{path}: {schema or 'no schema'}",
            needed="what `flightid identify --json` printed, or a .toml model",
            action="take a file of the models folder beside a study's results.json, or write one "
            "with identify --write",
        )
    known = {key: item for key, item in model.items() if key != "schema"}
    return {key: _told(item) for key, item in (known | _estimated(fit)).items() if item is not None}


def _estimated(fit: dict[str, object]) -> dict[str, object]:
    """What the fit knew of the numbers; absent in the JSON of earlier versions."""
    return {"estimated": fit["estimated"]} if "estimated" in fit else {}


def _told(item: object) -> object:
    """Without what is absent, as TOML has no null."""
    if isinstance(item, dict):
        return {key: _told(value) for key, value in item.items() if value is not None}
    return [_told(value) for value in item] if isinstance(item, list) else item
