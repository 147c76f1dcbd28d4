"""Linear systems as files of other tools: MATLAB .mat, JSON and NumPy .npz."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from flightid.errors import ModelError
from flightid.files import as_path, write_atomically
from flightid.models.linear.description import system_from_table
from flightid.models.linear.linear_system import LinearSystem
from flightid.reading import bounded_bytes, decoding, parse_json, require_memory
from flightid.record.formats.matlab_bytes import inflated

FORMATS = (".mat", ".json", ".npz")
MAXIMUM_BYTES = 64 << 20
_MATRICES = ("a", "b", "c", "d")

MATLAB_RECIPE = (
    "m = load('{name}'); k = 1 + (m.Ts > 0)*(m.Ts - 1);",
    "sys = ss(m.A, m.B, m.C, m.D, m.Ts, 'InputDelay', m.input_delay_s(:)/k, ...",
    "    'InputName', m.inputs, 'OutputName', m.outputs, 'StateName', m.states);",
)
"""Three lines of MATLAB: delays are seconds there, samples of a discrete system."""


def write_system(
    system: LinearSystem, path: str | Path, parameters: Mapping[str, object] | None = None
) -> Path:
    """Write a linear system to a ``.mat``, ``.json`` or ``.npz`` file.

    Parameters
    ----------
    system : LinearSystem
        With its delays, names, sample time and units.
    path : str or Path
        The suffix chooses the format.
    parameters : mapping, optional
        What the system came from: lists ``names``, ``values``, ``units``, ``stderr`` and the array
        ``covariance``; written beside the matrices.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    ModelError
        Another suffix.
    OSError
        The file cannot be written.

    Reference
    ---------
    MathWorks, *MAT-File Format* (level 5).

    Example
    -------
    >>> import tempfile
    >>> lag = LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",), [0.1])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     read_system(write_system(lag, Path(folder) / "lag.mat")).delays_s
    array([0.1])
    """
    suffix = as_path(path).suffix.lower()
    if suffix not in FORMATS:
        raise ModelError(
            "a linear system is not written so", found=str(path), needed=", ".join(FORMATS)
        )
    extra = dict(parameters or {})
    if suffix == ".json":
        table = {**system.to_dict(), **({"parameters": _plain(extra)} if extra else {})}
        return write_atomically(path, json.dumps(table, indent=1, allow_nan=False) + "\n")
    if suffix == ".npz":
        return write_atomically(path, _npz(system, extra))
    return write_atomically(path, lambda temporary: _save_mat(system, extra, temporary))


def read_system(path: str | Path) -> LinearSystem:
    """Read a linear system that `write_system` wrote.

    Parameters
    ----------
    path : str or Path
        ``.mat`` (level 5), ``.json`` or ``.npz``.

    Raises
    ------
    FileFormatError
        The file is too large or is not what its name says.
    ModelError
        Another suffix, or contents that make no system.

    Reference
    ---------
    MathWorks, *MAT-File Format* (level 5).

    Example
    -------
    >>> import tempfile
    >>> lag = LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     read_system(write_system(lag, Path(folder) / "lag.json"))
    LinearSystem(1 state, inputs [u], outputs [y])
    """
    place = Path(path)
    suffix = place.suffix.lower()
    if suffix not in FORMATS:
        raise ModelError(
            "a linear system is not read from this", found=str(path), needed=", ".join(FORMATS)
        )
    content = bounded_bytes(place, MAXIMUM_BYTES)
    read = {".json": _from_json, ".npz": _from_npz, ".mat": _from_mat}[suffix]
    with decoding(place.name, f"a {suffix} file as write_system makes it", "write it again"):
        table = read(content)
    return system_from_table(table)


def _plain(extra: Mapping[str, object]) -> dict[str, object]:
    return {
        key: np.asarray(value).tolist() if isinstance(value, np.ndarray) else value
        for key, value in extra.items()
    }


def _npz(system: LinearSystem, extra: Mapping[str, object]) -> bytes:
    table = system.to_dict()
    arrays: dict[str, NDArray[Any]] = {
        key: np.asarray(getattr(system, key)) for key in (*_MATRICES, "delays_s")
    }
    words = {k: v for k, v in table.items() if k not in arrays} | (
        {"parameters": _plain(extra)} if extra else {}
    )
    arrays["description"] = np.array(json.dumps(words, allow_nan=False))
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type] # its stub takes the names for options
    return buffer.getvalue()


def _from_json(content: bytes) -> dict[str, object]:
    table = parse_json(content, "a linear system", "the file")
    if not isinstance(table, dict):
        raise ModelError("the file holds no table", found=type(table).__name__)
    table.pop("parameters", None)
    return table


def _from_npz(content: bytes) -> dict[str, object]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        require_memory("the file", sum(each.file_size for each in archive.infolist()))
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        words = parse_json(str(arrays["description"]), "the description", "the file")
        numbers = {key: arrays[key].tolist() for key in (*_MATRICES, "delays_s")}
    words.pop("parameters", None)
    return {**words, **numbers}


def _cells(names: tuple[str, ...]) -> NDArray[np.object_]:
    """A column of texts, which MATLAB reads as a cell array."""
    column = np.empty((len(names), 1), dtype=object)
    column[:, 0] = names
    return column


def _save_mat(system: LinearSystem, extra: Mapping[str, object], path: Path) -> None:
    a, b, c, d, delays = system.state_space()
    channels = (*system.inputs, *system.outputs, *system.states)
    content: dict[str, Any] = {
        "A": a,
        "B": b,
        "C": c,
        "D": d,
        "Ts": system.sample_time_s or 0.0,
        "input_delay_s": delays[:, None],
        "inputs": _cells(system.inputs),
        "outputs": _cells(system.outputs),
        "states": _cells(system.states),
        "unit_names": _cells(tuple(system.units)),
        "unit_values": _cells(tuple(system.units.values())),
        "channel_units": _cells(tuple(system.units.get(name, "1") for name in channels)),
        "recipe": _cells(tuple(line.format(name="this file") for line in MATLAB_RECIPE)),
    }
    for key, value in extra.items():
        is_texts = isinstance(value, list) and all(isinstance(each, str) for each in value)
        made = _cells(tuple(value)) if is_texts else np.asarray(value, dtype=np.float64)  # type: ignore[arg-type]
        content[f"parameter_{key}"] = made
    scipy.io.savemat(str(path), content, format="5", oned_as="column", appendmat=False)


def _from_mat(content: bytes) -> dict[str, object]:
    found = scipy.io.loadmat(inflated("the file", content)[0])  # type: ignore[arg-type] # its stub knows paths alone
    missing = {"A", "B", "C", "D", "inputs", "outputs"} - set(found)
    if missing:
        raise ModelError("the file lacks variables", found=", ".join(sorted(missing)))
    table: dict[str, object] = {key: np.asarray(found[key.upper()]).tolist() for key in _MATRICES}
    for key in ("inputs", "outputs", "states"):
        table[key] = _texts(found.get(key))
    table["delays_s"] = np.ravel(found.get("input_delay_s", [])).astype(float).tolist()
    table["units"] = dict(
        zip(_texts(found.get("unit_names")), _texts(found.get("unit_values")), strict=True)
    )
    step = float(np.ravel(found.get("Ts", 0.0))[0])
    if step:
        table["sample_time_s"] = step
    return table


def _texts(cells: NDArray[np.object_] | None) -> list[str]:
    if cells is None:
        return []
    return [str(np.ravel(each)[0]) if np.size(each) else "" for each in np.ravel(cells)]
