"""Responses to and from xarray and netCDF, with nothing lost.

Complex arrays are kept as real and imaginary parts, since netCDF has no complex numbers. The error
covariance is built and kept where it exists and is small enough; what a reader gets back answers
`covariance_at` with the same numbers.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from flightid.conventions import Light
from flightid.errors import FileFormatError
from flightid.files import write_atomically
from flightid.findings import Finding
from flightid.reading import decoding
from flightid.record.digest import RecordDigest
from flightid.record.formats.hdf5 import plain_datasets
from flightid.record.history import Step
from flightid.record.hold import InputShape
from flightid.responses.errors.random_error import StoredCovariance
from flightid.responses.response import AXES, FrequencyResponse
from flightid.uncertainty.feedback import FeedbackTest

SCHEMA = "flightid.frequency_response/1"
DIMENSIONS = {"o": "output", "i": "input", "f": "omega_rad_s"}


def to_xarray(response: FrequencyResponse) -> xr.Dataset:
    """Labelled data set of a response.

    Parameters
    ----------
    response : FrequencyResponse

    Returns
    -------
    xarray.Dataset
        Dimensions ``output``, ``input``, ``input_2``, ``omega_rad_s`` and, for the covariance,
        ``part`` and ``part_2``.

    Example
    -------
    >>> response = FrequencyResponse.from_values([1.0, 2.0], [1j, 2j], inputs=["u"],
    ...                                          outputs=["p"])
    >>> to_xarray(response)["response_imaginary"].sel(output="p", input="u").values
    array([1., 2.])
    """
    variables: dict[str, Any] = {}
    for name, letters in AXES.items():
        array = getattr(response, name)
        if array is None or name == "omega_rad_s":
            continue
        dimensions = [DIMENSIONS[letter] for letter in letters]
        if letters.startswith("ii"):
            dimensions[1] = "input_2"
        if np.iscomplexobj(array):
            variables[f"{name}_real"] = (dimensions, array.real)
            variables[f"{name}_imaginary"] = (dimensions, array.imag)
        else:
            variables[name] = (dimensions, array)
    covariance = response.covariance
    if covariance is not None:
        variables["covariance"] = (["output", "part", "part_2"], covariance)
    coordinates = {
        "output": list(response.outputs),
        "input": list(response.inputs),
        "omega_rad_s": response.omega_rad_s,
    }
    attributes = {
        "schema": SCHEMA,
        "estimator": response.estimator,
        "about": json.dumps(
            {
                "units": dict(response.units),
                "n_windows": list(response.n_windows),
                "window_s": list(response.window_s),
                "loop": None if response.loop is None else response.loop.to_dict(),
                "input_shape": response.input_shape.to_dict(),
                "digests": [each.to_dict() for each in response.digests],
                "findings": [finding.to_dict() for finding in response.findings],
                "history": [
                    {"operation": s.operation, "options": dict(s.options), "version": s.version}
                    for s in response.history
                ],
            }
        ),
    }
    return xr.Dataset(variables, coords=coordinates, attrs=attributes)


def from_xarray(dataset: xr.Dataset) -> FrequencyResponse:
    """Response of a data set made by `to_xarray`.

    Raises
    ------
    FileFormatError
        The data set is not one of a frequency response, or lacks a part of it.

    Example
    -------
    >>> response = FrequencyResponse.from_values([1.0], [1j], inputs=["u"], outputs=["p"])
    >>> from_xarray(to_xarray(response))
    FrequencyResponse(1 output x 1 input, 1 frequencies 1 to 1 rad/s, mean coherence 1.00)
    """
    if dataset.attrs.get("schema") != SCHEMA:
        raise FileFormatError(
            "not a frequency response", found=dataset.attrs.get("schema"), needed=SCHEMA
        )
    try:
        about = json.loads(str(dataset.attrs["about"]))
        values = {name: _array(dataset, name) for name in AXES}
        covariance = _array(dataset, "covariance")
        return FrequencyResponse(
            **{**values, "omega_rad_s": np.asarray(dataset["omega_rad_s"].values, dtype=float)},
            inputs=tuple(str(name) for name in dataset["input"].values),
            outputs=tuple(str(name) for name in dataset["output"].values),
            units={str(key): str(value) for key, value in about["units"].items()},
            n_windows=tuple(int(one) for one in about["n_windows"]),
            window_s=tuple(float(one) for one in about["window_s"]),
            estimator=str(dataset.attrs["estimator"]),
            findings=tuple(_finding(one) for one in about["findings"]),
            # Files of earlier versions do not say.
            loop=FeedbackTest(**about["loop"]) if about.get("loop") else None,
            input_shape=InputShape(**about.get("input_shape", {})),
            digests=tuple(map(RecordDigest.from_dict, about.get("digests", ()))),
            history=tuple(
                Step(one["operation"], one["options"], one["version"]) for one in about["history"]
            ),
            errors=None
            if covariance is None
            else StoredCovariance(covariance, dataset.sizes["omega_rad_s"]),
        )
    except (KeyError, TypeError, AttributeError, json.JSONDecodeError) as error:
        raise FileFormatError(
            "a frequency response is incomplete", found=str(error), needed=SCHEMA
        ) from error


def write_response(response: FrequencyResponse, path: str | Path) -> Path:
    """Write a response to a netCDF file, whole or not at all.

    Returns
    -------
    pathlib.Path
        The file.
    """
    dataset = to_xarray(response)
    return write_atomically(path, lambda target: dataset.to_netcdf(target, engine="h5netcdf"))


def read_response(path: str | Path) -> FrequencyResponse:
    """Read a response that `write_response` wrote.

    Raises
    ------
    FileFormatError
        The file is not netCDF, or holds no frequency response.
    """
    source = Path(path)
    with plain_datasets(source), decoding(source.name, "a netCDF file of a frequency response"):
        with xr.open_dataset(source, engine="h5netcdf") as dataset:
            loaded = dataset.load()
        return from_xarray(loaded)


def _array(dataset: xr.Dataset, name: str) -> Any:  # noqa: ANN401
    if f"{name}_real" in dataset:
        return dataset[f"{name}_real"].values + 1j * dataset[f"{name}_imaginary"].values
    return dataset[name].values if name in dataset else None


def _finding(values: Mapping[str, str]) -> Finding:
    return Finding(values["code"], Light(values["light"]), values["message"], values["action"])
