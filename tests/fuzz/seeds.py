"""A small sound file for each reader, and the reader."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import h5py
import numpy as np
import scipy.io
import xarray as xr

import flightid as fid
from flightid.dynamics.handling_qualities import rating_charts_reading
from flightid.logs.channels.channel_map import channel_map
from flightid.responses.store import read_response, write_response
from flightid.study.output import SCHEMA, read_report
from flightid.study.settings import read_settings
from tests.bag_builder import Flight, write_bag1, write_db3, write_mcap

TIME = np.arange(6) * 0.5
RECORD = fid.Record.from_arrays(TIME, inputs={"u": TIME**2}, outputs={"p": -TIME}, name="flown")

CHARTS = next(Path(rating_charts_reading.__file__).parent.glob("*.toml"))


@dataclass(frozen=True)
class Seed:
    """A file that is sound, what reads it, and whether people write it."""

    name: str
    read: Callable[[Path], object]
    content: bytes
    is_text: bool = False


def seeds(folder: Path) -> list[Seed]:
    """Seeds of all readers; the folder serves for writing them."""
    return [*_records(folder), *_texts(folder), *_systems(folder)]


def _records(folder: Path) -> list[Seed]:
    for suffix in ("parquet", "nc"):
        fid.write_records([RECORD, RECORD.replace(name="again")], folder / f"own.{suffix}")
    columns = {name: ("row", values) for name, values in (("time", TIME), ("p", TIME**2))}
    table = xr.Dataset({key: (dim, data, {"units": "s"}) for key, (dim, data) in columns.items()})
    table.to_netcdf(folder / "classic.nc", engine="scipy")
    packed = {"p": {"dtype": "i2", "scale_factor": 0.1, "_FillValue": -1, "zlib": True}}
    table.to_netcdf(folder / "packed.nc", engine="h5netcdf", encoding=packed)
    given = {
        "time": TIME,
        "data": {"p": TIME, "q": np.eye(6)},
        "cells": np.array([[1, "a"]], object),
    }
    for name, compressed in (("plain", False), ("small", True)):
        scipy.io.savemat(folder / f"{name}.mat", given, do_compression=compressed)
    with h5py.File(folder / "new.mat", "w", userblock_size=512) as file:
        for name in ("time", "data/p"):
            file[name] = TIME[None, :]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    names = (
        "own.parquet",
        "own.nc",
        "classic.nc",
        "packed.nc",
        "plain.mat",
        "small.mat",
        "new.mat",
        *_bags(folder),
    )
    made = [Seed(name, fid.read_records, (folder / name).read_bytes()) for name in names]
    return [
        *made,
        *(Seed(f"{key}.csv", fid.read_records, text, True) for key, text in SHEETS.items()),
    ]


def _bags(folder: Path) -> tuple[str, ...]:
    flown = Flight(n_rates=12)
    write_mcap(folder / "chunked.mcap", flown)
    write_mcap(folder / "plain.mcap", flown, chunked=False)
    write_bag1(folder / "plain.bag", flown)
    write_bag1(folder / "packed.bag", flown, packing="bz2")
    (write_db3(folder / "bag", flown) / "bag_0.db3").rename(folder / "bag.db3")
    return "chunked.mcap", "plain.mcap", "plain.bag", "packed.bag", "bag.db3"


SHEETS = {
    "commas": b"# note\ntime [s],p [rad/s],q\n0,0.1,1\n0.5,0.2,2\n1,-0.5e-3,3\n",
    "semicolons": b"time;p;record\ns;deg;\n0;0,1;a\n0,5;0,2;a\n1;0,3;b\n1,5;0,4;b\n",
    "quoted": b'time,"p, left",q\n0,"0.1",1\n0.5,0.2,2\n1,0.4,3\n',
    "dates": b"time,p\n2024-05-01T10:00:00,1\n2024-05-01T10:00:01,2\n2024-05-01T10:00:02,3\n",
}


def _texts(folder: Path) -> list[Seed]:
    library = files("flightid.models") / "library" / "rate_motor_lag.toml"
    shipped = files("flightid.logs") / "channels" / "arducopter.toml"
    study = Path(__file__).parents[2] / "examples" / "quadrotor_rig" / "study.toml"
    report = {"schema": "flightid.document/1", "title": "a", "subtitle": "", "footer": ""}
    section = {"title": "b", "blocks": [{"kind": "text", "text": "c"}], "sections": []}
    results = {"schema": SCHEMA, "report": {**report, "sections": [section]}}
    model = {"schema": "flightid.fit/1", "model": {"kind": "transfer", "parameters": {"K": 1.0}}}
    parameters = b"ATC_RAT_RLL_P 0.1\n# note\nATC_RAT_RLL_I,0.2\n1\t1\tMC_ROLL_P\t6.5\t9\n"
    response = fid.FrequencyResponse.from_values([1.0, 2.0], [1j, 2j], inputs=["u"], outputs=["p"])
    measured = write_response(response, folder / "response.nc").read_bytes()
    return [
        Seed("model.toml", _load, library.read_bytes(), True),
        Seed("fit.json", _load, json.dumps(model).encode(), True),
        Seed("study.toml", read_settings, study.read_bytes(), True),
        Seed("map.toml", channel_map, shipped.read_bytes(), True),
        Seed("charts.toml", rating_charts_reading.rating_charts, CHARTS.read_bytes(), True),
        Seed("results.json", read_report, json.dumps(results).encode(), True),
        Seed("response.nc", read_response, measured),
        Seed("vehicle.parm", fid.read_parameters, parameters, True),
    ]


def _load(path: Path) -> object:
    return fid.load_model(str(path))


def _systems(folder: Path) -> list[Seed]:
    system = fid.LinearSystem([[-5.0]], [[5.0]], [[1.0]], [[0.0]], ("u",), ("y",))
    made = []
    for suffix in ("json", "npz", "mat"):
        path = fid.write_system(system, folder / f"system.{suffix}")
        made.append(Seed(path.name, fid.read_system, path.read_bytes(), suffix == "json"))
    return made
