"""Responses to and from netCDF, with nothing lost.

Complex arrays are kept as real and imaginary parts, since netCDF has no complex numbers. The error
covariance is built and kept where it exists and is small enough; what a reader gets back answers
`covariance_at` with the same numbers.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.errors import FileFormatError
from flightid.files import write_atomically
from flightid.findings import Finding
from flightid.reading import decoding
from flightid.record.digest import RecordDigest
from flightid.record.formats.hdf5 import plain_datasets, read_dataset
from flightid.record.history import Step
from flightid.record.hold import InputShape
from flightid.responses.errors.random_error import StoredCovariance
from flightid.responses.injected_power import InjectedPower
from flightid.responses.response import AXES, FrequencyResponse
from flightid.uncertainty.feedback_result import FeedbackTest

SCHEMA = "flightid.frequency_response/1"
WHOLE = "a netCDF file of a frequency response"
DIMENSIONS = {"o": "output", "i": "input", "f": "omega_rad_s"}


def write_response(response: FrequencyResponse, path: str | Path) -> Path:
    """Write a response to a netCDF file, whole or not at all.

    Parameters
    ----------
    response : FrequencyResponse
    path : str or Path
        File to write. Dimensions are ``output``, ``input``, ``input_2``, ``omega_rad_s`` and, for
        the covariance, ``part`` and ``part_2``.

    Returns
    -------
    pathlib.Path
        The file.

    Example
    -------
    >>> import tempfile
    >>> response = FrequencyResponse.from_values([1.0], [1j], inputs=["u"], outputs=["p"])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     read_response(write_response(response, Path(folder) / "p.nc"))
    FrequencyResponse(1 output x 1 input, 1 frequencies 1 to 1 rad/s, mean coherence 1.00)
    """
    import h5netcdf  # noqa: PLC0415 - whoever writes none does without
    from h5py import string_dtype  # noqa: PLC0415 - as above

    variables = _variables(response)
    lengths = {
        key: n for keys, each in variables.values() for key, n in zip(keys, each.shape, strict=True)
    }
    about = {
        "units": dict(response.units),
        "n_windows": list(response.n_windows),
        "window_s": list(response.window_s),
        "loop": None if response.loop is None else response.loop.to_dict(),
        "input_shape": response.input_shape.to_dict(),
        "digests": [each.to_dict() for each in response.digests],
        "injected_rad_s": response.injected_rad_s,
        "injected": {name: each.to_dict() for name, each in response.injected.items()},
        "findings": [finding.to_dict() for finding in response.findings],
        "history": [
            {"operation": s.operation, "options": dict(s.options), "version": s.version}
            for s in response.history
        ],
    }

    def write(target: Path) -> None:
        with h5netcdf.File(target, "w") as file:
            attributes = {"schema": SCHEMA, "estimator": response.estimator}
            file.attrs.update({**attributes, "about": json.dumps(about)})
            file.dimensions = lengths
            for name, (dimensions, values) in variables.items():
                kind = string_dtype() if values.dtype == object else values.dtype
                file.create_variable(name, dimensions, kind, data=values)

    return write_atomically(path, write)


def _variables(response: FrequencyResponse) -> dict[str, tuple[tuple[str, ...], NDArray[Any]]]:
    """Arrays of a response with the names of their dimensions."""
    made: dict[str, tuple[tuple[str, ...], NDArray[Any]]] = {
        "output": (("output",), np.array(response.outputs, dtype=object)),
        "input": (("input",), np.array(response.inputs, dtype=object)),
    }
    for name, letters in AXES.items():
        array = getattr(response, name)
        if array is None:
            continue
        keys = tuple(DIMENSIONS[letter] for letter in letters)
        if letters.startswith("ii"):
            keys = (keys[0], "input_2", *keys[2:])
        if np.iscomplexobj(array):
            made[f"{name}_real"] = (keys, array.real)
            made[f"{name}_imaginary"] = (keys, array.imag)
        else:
            made[name] = (keys, np.asarray(array))
    covariance = response.covariance
    if covariance is not None:
        made["covariance"] = (("output", "part", "part_2"), covariance)
    return made


def read_response(path: str | Path) -> FrequencyResponse:
    """Read a response that `write_response` wrote.

    Raises
    ------
    FileFormatError
        The file is not netCDF, or holds no frequency response, or lacks a part of it.
    """
    source = Path(path)
    with plain_datasets(source) as datasets, decoding(source.name, WHOLE):
        root = next(iter(datasets.values())).file if datasets else None
        attributes = {} if root is None else {key: root.attrs[key] for key in root.attrs}
        if attributes.get("schema") != SCHEMA:
            raise FileFormatError(
                "not a frequency response", found=attributes.get("schema"), needed=SCHEMA
            )
        values = {name: read_dataset(source, dataset) for name, dataset in datasets.items()}
    try:
        return _response(values, attributes)
    except (KeyError, TypeError, AttributeError, json.JSONDecodeError) as error:
        raise FileFormatError(
            "a frequency response is incomplete", found=str(error), needed=SCHEMA
        ) from error


def _span(told: Sequence[float] | None) -> tuple[float, float] | None:
    return None if told is None else (float(told[0]), float(told[1]))


def _response(
    values: Mapping[str, NDArray[Any]], attributes: Mapping[str, Any]
) -> FrequencyResponse:
    about = json.loads(str(attributes["about"]))
    covariance = _array(values, "covariance")
    return FrequencyResponse(
        **{name: _array(values, name) for name in AXES},
        inputs=tuple(name.decode() for name in values["input"]),
        outputs=tuple(name.decode() for name in values["output"]),
        units={str(key): str(value) for key, value in about["units"].items()},
        n_windows=tuple(int(one) for one in about["n_windows"]),
        window_s=tuple(float(one) for one in about["window_s"]),
        estimator=str(attributes["estimator"]),
        findings=tuple(_finding(one) for one in about["findings"]),
        # Files of earlier versions do not say.
        loop=FeedbackTest(**about["loop"]) if about.get("loop") else None,
        input_shape=InputShape(**about.get("input_shape", {})),
        digests=tuple(map(RecordDigest.from_dict, about.get("digests", ()))),
        injected_rad_s=_span(about.get("injected_rad_s")),
        injected={
            name: InjectedPower.from_dict(each) for name, each in about.get("injected", {}).items()
        },
        history=tuple(
            Step(one["operation"], one["options"], one["version"]) for one in about["history"]
        ),
        errors=None
        if covariance is None
        else StoredCovariance(covariance, values["omega_rad_s"].size),
    )


def _array(values: Mapping[str, NDArray[Any]], name: str) -> Any:  # noqa: ANN401
    if f"{name}_real" in values:
        return values[f"{name}_real"] + 1j * values[f"{name}_imaginary"]
    return values.get(name)


def _finding(values: Mapping[str, str]) -> Finding:
    return Finding(values["code"], Light(values["light"]), values["message"], values["action"])
