"""Regression on records of two rates, 130 s at 100 Hz with 8 parameters, against a NumPy recipe.

The recipe of the textbooks: central differences of the measured rates, one least squares for each
equation, white residuals. Same records for all; errors are means over flights with other noise, as
a share of the parameters, and tell what the time is spent on.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import flightid as fid
from benchmarks.output_error import NAMES, REPEATS, TRUTH, two_rates, two_rates_record
from flightid.table import Column, Table

Array = NDArray[np.float64]
FLIGHTS = 4
METHODS = ("equation_error", "fourier_regression", "fourier_output_error", "filter_error")


def _numpy_recipe(record: fid.Record) -> Array:
    rates = np.array([record["p"], record["r"]])
    known = np.vstack([rates, record["aileron"], record["rudder"]]).T
    slopes = np.gradient(rates, record.sample_time_s, axis=1)
    found = np.linalg.lstsq(known, slopes.T, rcond=None)[0]
    (lp, lr, la, ld), (np_, nr, na, nd) = found.T
    return np.array([lp, lr, np_, nr, la, ld, na, nd])


def _by(method: str) -> Callable[[fid.Record], Array]:
    model = two_rates()

    def fitted(record: fid.Record) -> Array:
        fit = fid.identify(model, record, method=method)
        return np.array([fit.parameters[name].value for name in NAMES])

    return fitted


def run() -> Table:
    """Time of one fit and error of its estimates, by method."""
    flights = [two_rates_record(seed) for seed in range(FLIGHTS)]
    ways = {"NumPy recipe": _numpy_recipe, **{name: _by(name) for name in METHODS}}
    seconds, errors = {}, {}
    for name, way in ways.items():
        errors[name] = float(np.sqrt(np.mean([(way(f) / TRUTH - 1.0) ** 2 for f in flights])))
        times = []
        for _ in range(REPEATS):
            start = time.perf_counter()
            way(flights[0])
            times.append(time.perf_counter() - start)
        seconds[name] = min(times)
    rows = tuple(
        (name, 1e3 * seconds[name], seconds[name] / seconds["NumPy recipe"], 100.0 * errors[name])
        for name in ways
    )
    columns = (
        Column("method"),
        Column("time", "ms", 4),
        Column("time / NumPy", digits=3),
        Column("rms error", "%", 3),
    )
    return Table("Regression on records of 130 s", columns, rows)


if __name__ == "__main__":
    print(run())
