"""Models from files: bounded in size, read as data, never run."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path

from flightid.errors import ModelError, OptionError, UnknownNameError
from flightid.models.kinds import GreyBoxModel, model_from_description
from flightid.models.model import Model
from flightid.models.saved_files import model_in_json, only_model
from flightid.models.state_space.model import StateSpaceModel
from flightid.models.transfer.model import TransferFunctionModel
from flightid.reading import parse_toml, read_toml

_LIBRARY_NAME = re.compile(r"[a-z0-9_]+")
_DEFAULT_AXIS = "roll"


def library_names() -> list[str]:
    """Names of the models that come with flightid.

    Returns
    -------
    list of str

    Raises
    ------
    Nothing.

    Reference
    ---------
    Each file names its source.

    Example
    -------
    >>> "rate_first_order" in library_names()
    True
    """
    folder = files("flightid.models") / "library"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_model(path: str | Path, *, axis: str | None = None) -> Model:
    """Load a model from a file, a study's results, or the library by its name.

    Parameters
    ----------
    path : str or Path
        Path of a ``.toml`` file; of the ``.json`` of a fit; of the output folder of a study with
        one model; or a name such as ``"rate_first_order"``, which the axis may follow, as in
        ``"rate_first_order_pitch"``.
    axis : str, optional
        ``"roll"`` (default), ``"pitch"`` or ``"yaw"``, for a library model written for any axis.

    Returns
    -------
    Model
        TransferFunctionModel or StateSpaceModel; from a file any kind of `models.kinds.KINDS`.

    Raises
    ------
    UnknownNameError
        There is no such library model.
    OptionError
        The model is not written for that axis.
    FileFormatError
        The file is too large, not UTF-8, not TOML or not JSON.
    ModelError
        The model contradicts itself; JSON without a fit; a folder with no model or several.

    Example
    -------
    >>> model = load_model("rate_first_order", axis="pitch")
    >>> print(model)
    q/tau_theta = Mttheta / (s - Mq) * exp(-(tau) s)
    """
    name = str(path)
    if name.endswith(".json"):
        return _build(model_in_json(Path(path)), axis, name)
    if name not in library_names() and Path(path).is_dir():
        return load_model(only_model(Path(path)), axis=axis)
    if isinstance(path, Path) or name.endswith(".toml"):
        return _build(read_toml(Path(path), "a model file"), axis, name)
    if not _LIBRARY_NAME.fullmatch(name):
        raise _no_model(name)
    stem, _, tail = name.rpartition("_")
    if name not in library_names() and stem in library_names():
        name, axis = stem, axis or tail
    if name not in library_names():
        raise _no_model(name)
    text = (files("flightid.models") / "library" / f"{name}.toml").read_text(encoding="utf-8")
    return _build(parse_toml(text, "a model file", name), axis, name)


def _no_model(name: str) -> UnknownNameError:
    """Of data in place of a model, the way to one."""
    if Path(name).suffix in (".param", ".params", ".parm"):
        return UnknownNameError(
            "a file of parameters holds gains, no model", found=name,
            needed="a model's .toml, or a study's folder", action=f"name it as --gains {name}",
        )  # fmt: skip
    if Path(name).is_file():
        return UnknownNameError(
            "this file holds no model", found=name, needed="a model's .toml, or a study's folder",
            action=f"make its model first: flightid run {name}",
        )  # fmt: skip
    return UnknownNameError(
        "there is no such library model",
        found=repr(name),
        needed=f"a .toml file, or one of {', '.join(library_names())}",
    )


def load_structure(source: str | Path, *, axis: str | None = None) -> GreyBoxModel:
    """As `load_model`, for a model with named parameters that a fit can start from.

    Raises
    ------
    ModelError
        The file holds a black-box model or bare matrices.
    """
    model = load_model(source, axis=axis)
    if not isinstance(model, TransferFunctionModel | StateSpaceModel):
        raise ModelError(
            "this model has no named parameters to fit",
            found=f"{source}: {type(model).__name__}",
            needed="kind 'transfer' or 'state-space'",
        )
    return model


def _build(content: dict[str, object], axis: str | None, name: str) -> Model:
    axes = content.pop("axes", None)
    if not isinstance(axes, dict):
        if axis is not None:
            raise OptionError(
                f"model {name} is written for one vehicle, not for an axis", found=axis
            )
        return model_from_description(content)
    chosen = axis or _DEFAULT_AXIS
    words = axes.get(chosen)
    if not isinstance(words, dict):
        raise OptionError(
            f"model {name} is not written for that axis",
            found=repr(chosen),
            needed=f"one of {', '.join(axes)}",
        )
    filled = _fill(content, {f"<{key}>": str(value) for key, value in words.items()})
    return model_from_description(filled if isinstance(filled, dict) else content)


def _fill(item: object, words: dict[str, str]) -> object:
    """Replace each <word> of a template by the axis's own, in keys and texts."""
    if isinstance(item, dict):
        return {_fill(key, words): _fill(value, words) for key, value in item.items()}
    if isinstance(item, list):
        return [_fill(value, words) for value in item]
    if isinstance(item, str):
        for word, text in words.items():
            item = item.replace(word, text)
    return item
