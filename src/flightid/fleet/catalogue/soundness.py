"""Whether the numbers of a log can be computed with: one that somebody has broken costs itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.conventions import Light
from flightid.fleet.catalogue.schema import from_lower_triangle
from flightid.uncertainty.quantiles import LEVEL, half_width

Rows = Mapping[str, Sequence[Mapping[str, Any]]]
LARGEST = 1e100
"""Numbers beyond, and errors below its inverse, overflow where they are squared and divided."""
ROUNDING = 1e-8
"""How far below zero an eigenvalue of correlations may lie by rounding alone."""
NUMBERS = {"logs": "duration_s", "covariates": "value"}
"""What else is computed with, by table."""


def flaw_of(rows: Rows) -> str:
    """What of a log's rows cannot be computed with, in words; empty where all can.

    Parameters
    ----------
    rows : mapping of str to sequence of mapping
        Rows of one log by table; tables that are not there have none.

    Example
    -------
    >>> flaw_of({"parameters": [{"model": "m", "name": "Lp", "value": -3.0, "stderr": math.nan}]})
    'stderr of Lp is nan'
    """
    return next(_flaws(rows), "")


def _flaws(rows: Rows) -> Iterator[str]:
    for table, column in NUMBERS.items():
        for row in rows.get(table, ()):
            value = row.get(column)
            if value is not None and not abs(value) <= LARGEST:
                yield f"{column} of {row.get('name') or table} is {value:g}"
    for row in rows.get("parameters", ()):
        yield from _parameter_flaws(row)
    for row in rows.get("covariances", ()):
        if flaw := _covariance_flaw(row):
            yield f"the covariance of {row.get('model')} {flaw}"


def _parameter_flaws(row: Mapping[str, Any]) -> Iterator[str]:
    name, value, error = row.get("name"), row.get("value"), row.get("stderr")
    if not (name and row.get("model")):
        yield "a parameter has no name, or no model"
    if value is not None and not abs(value) <= LARGEST:
        yield f"value of {name} is {value:g}"
    if error is None:
        return
    if not 0.0 <= error <= LARGEST:
        yield f"stderr of {name} is {error:g}"
    elif error:
        freedom = row.get("freedom")
        size = error * _wider(freedom)
        if not 1.0 / LARGEST <= size <= LARGEST:
            yield f"stderr of {name} is {error:g} with {freedom} degrees of freedom"


def _wider(freedom: float | None) -> float:
    """What degrees of freedom add to a standard error; not finite where they are none."""
    if freedom is None:
        return 1.0
    try:
        return half_width(LEVEL, freedom) / half_width(LEVEL) if freedom > 0.0 else math.inf
    except (ArithmeticError, ValueError):
        return math.inf


def _covariance_flaw(row: Mapping[str, Any]) -> str:
    names, lower = row.get("names") or (), row.get("lower") or ()
    if len(lower) != len(names) * (len(names) + 1) // 2:
        return f"has {len(lower)} numbers for {len(names)} parameters"
    if not all(value is not None and math.isfinite(value) for value in lower):
        return "holds what is no number"
    # Nothing is computed with a red model.
    is_counted = bool(lower) and row.get("light") != str(Light.RED)
    return _matrix_flaw(np.array(from_lower_triangle(lower))) if is_counted else ""


def _matrix_flaw(matrix: NDArray[np.float64]) -> str:
    variances = np.diag(matrix)
    if variances.min() < 0.0:
        return "has a variance below zero"
    places = np.flatnonzero(variances)
    scale = np.sqrt(variances[places])
    alike = matrix[np.ix_(places, places)] / scale / scale[:, None]
    is_one = np.isfinite(alike).all() and np.all(np.linalg.eigvalsh(alike) >= -ROUNDING)
    return "" if is_one else "is none: correlations beyond one"


def unsound_logs(rows: Rows) -> dict[str, str]:
    """Logs of many whose rows cannot be computed with, and why.

    Parameters
    ----------
    rows : mapping of str to sequence of mapping
        Whole tables of a catalogue.
    """
    checked = ("logs", "covariates", "parameters", "covariances")
    found: dict[str, str] = {}
    for table in checked:
        for row in rows.get(table, ()):
            if row["log"] not in found and (flaw := flaw_of({table: (row,)})):
                found[row["log"]] = flaw
    return found
