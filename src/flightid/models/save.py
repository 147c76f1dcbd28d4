"""Models to TOML files that `load_model` reads."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

from flightid.errors import ModelError
from flightid.files import as_path, write_atomically
from flightid.models.kinds import model_to_description

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def write_model(source: object, path: str | Path) -> Path:
    """Write a model to a TOML file; `load_model` gives the same model back.

    Parameters
    ----------
    source : Fit or model
        Of any kind. A fit's covariance, evidence and provenance go along: `load_model` gives a
        model with them as `estimated`, so that what is computed from it has intervals.
    path : str or Path
        File ending in ``.toml``; its folder must exist. It is written whole or not at all.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ModelError
        The name of the file does not end in ``.toml``, or this is no model.
    OSError
        The file cannot be written.

    Reference
    ---------
    TOML 1.0, toml.io.

    Example
    -------
    >>> import tempfile
    >>> from flightid.models import load_model
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     model = load_model("short_period").with_values({"Mq": -3.0})
    ...     load_model(write_model(model, Path(folder) / "mine.toml")) == model
    True
    """
    if as_path(path).suffix != ".toml":
        raise ModelError("a model is written as TOML", found=str(path), needed="a name in .toml")
    return write_atomically(path, model_as_toml(source))


def model_as_toml(source: object) -> str:
    """Text of the TOML file.

    Example
    -------
    >>> from flightid.models import load_model
    >>> print(model_as_toml(load_model("quadrotor_yaw")).splitlines()[1])
    name = "Quadrotor on a rig, yaw"
    """
    plain = {key: value for key, value in model_to_description(source).items() if key != "schema"}
    kind = {"kind": plain.pop("kind", "transfer")}
    single = {k: v for k, v in plain.items() if not isinstance(v, Mapping) and v not in ("", [])}
    lines = [f"{_key(key)} = {toml_value(value)}" for key, value in {**kind, **single}.items()]
    for name, table in plain.items():
        if isinstance(table, Mapping) and table:
            lines += ["", f"[{_key(name)}]"]
            lines += [f"{_key(key)} = {toml_value(value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _text(name)


def _text(text: str) -> str:
    # JSON escapes all that TOML wants escaped, save the delete character.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_value(value: object) -> str:
    """A value of a TOML file; a table stands in one line."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return repr(int(value))
    if isinstance(value, float):
        # NumPy's numbers are floats that spell themselves otherwise.
        return repr(float(value))
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, Mapping):
        kept = {key: entry for key, entry in value.items() if entry not in (None, "")}
        return "{ " + ", ".join(f"{_key(k)} = {toml_value(v)}" for k, v in kept.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    raise ModelError("a model holds what TOML cannot", found=type(value).__name__)
