"""Charts from TOML files: our own beside this module, and any that a user writes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.dynamics.handling_qualities.rating_charts import Limits, RatingChart, Region
from flightid.errors import FileFormatError, OptionError, UnknownNameError
from flightid.reading import read_toml
from flightid.table import Column, Table

OWN_FILES = ("rating_charts_ads33.toml", "rating_charts_mil.toml")
"""Bytes; a chart file is a page or two."""
Document = Mapping[str, Any]


def rating_chart(key: str, *, path: str | Path | None = None, **conditions: str) -> RatingChart:
    """Boundaries of one requirement for one case.

    Parameters
    ----------
    key : str
        Requirement, as `rating_charts` lists them.
    path : str or Path, optional
        A chart file of your own in place of ours.
    **conditions : str
        The case, for example ``category="A"``; class is written ``**{"class": "IV"}``. Conditions
        that the requirement does not ask for are passed over.

    Raises
    ------
    UnknownNameError
        There is no such requirement.
    OptionError
        The conditions name no case of it.
    FileFormatError
        The file is no chart file.

    Example
    -------
    >>> chart = rating_chart("spiral", category="B")
    >>> chart.levels({"time_to_double": np.array([25.0, 10.0, 3.0])}).tolist()
    [1, 2, 4]
    """
    charts = _own() if path is None else _read(Path(path))
    if key not in charts:
        raise UnknownNameError("there is no such chart", found=key, needed=", ".join(charts))
    chart = charts[key]
    for case in chart["case"]:
        when: Mapping[str, list[str]] = case["when"]
        if all(conditions.get(name) in allowed for name, allowed in when.items()):
            return _built(chart, case, {name: conditions[name] for name in when})
    needed = " or ".join(_words(case["when"]) for case in chart["case"])
    raise OptionError(
        f"no case of {chart['title']!r} fits",
        found=", ".join(f"{name} {value}" for name, value in conditions.items()) or "nothing",
        needed=needed,
    )


def rating_charts(path: str | Path | None = None) -> Table:
    """Table of the requirements: key, standard, paragraph, whether the numbers are confirmed.

    Example
    -------
    >>> [row[0] for row in rating_charts().rows][:2]
    ['attitude_bandwidth', 'attitude_damping']
    """
    charts = _own() if path is None else _read(Path(path))
    columns = (
        Column("key"),
        Column("standard"),
        Column("requirement"),
        Column("source"),
        Column("confirmed"),
        Column("note"),
    )
    fields = ("standard", "title", "source", "confirmed", "note")
    rows = tuple((key, *(chart[name] for name in fields)) for key, chart in charts.items())
    return Table("Rating charts", columns, rows)


@cache
def _own() -> dict[str, Document]:
    folder = Path(__file__).parent
    return {key: chart for name in OWN_FILES for key, chart in _read(folder / name).items()}


def _read(path: Path) -> dict[str, Document]:
    try:
        document = read_toml(path, "a file of rating charts")
    except OSError as error:
        raise _fault(path, str(error)) from error
    found: dict[str, Document] = {}
    for chart in _tables(path, document.get("chart")):
        _check(path, chart)
        found[str(chart["key"])] = {"worse": "", "axes": [], "note": "", **chart}
    return found


def _check(path: Path, chart: Document) -> None:
    for name in ("key", "standard", "title", "source"):
        if not isinstance(chart.get(name), str):
            raise _fault(path, f"a chart without {name}")
    title = chart["title"]
    if not isinstance(chart.get("confirmed"), bool):
        raise _fault(path, f"{title}: confirmed is neither true nor false")
    quantities = chart.get("quantities")
    if not isinstance(quantities, Mapping) or not all(
        isinstance(each, Mapping) and {"label", "unit"} <= set(each) for each in quantities.values()
    ):
        raise _fault(path, f"{title}: quantities need label and unit")
    axes = chart.get("axes", [])
    if len(axes) not in (0, 2) or not set(axes) <= set(quantities):
        raise _fault(path, f"{title}: axes are two of its quantities, or none")
    for case in _tables(path, chart.get("case")):
        levels = _tables(path, case.get("levels"))
        if not isinstance(case.get("when"), Mapping):
            raise _fault(path, f"{title}: a case without when")
        for limits in (*levels, case.get("valid", {})):
            _check_limits(path, title, limits, set(quantities), bool(axes))


def _check_limits(
    path: Path, title: str, limits: Document, known: set[str], has_axes: bool
) -> None:
    for name, ends in limits.items():
        if name == "boundary" and has_axes:
            if _line(ends) is None:
                raise _fault(path, f"{title}: a boundary is pairs, the second one increasing")
        elif name not in known:
            raise _fault(path, f"{title}: {name} is none of its quantities")
        elif not (isinstance(ends, list) and len(ends) == 2 and _numbers(ends)):
            raise _fault(path, f"{title}: {name} needs [lowest, highest]")


def _tables(path: Path, found: object) -> list[Document]:
    if not (isinstance(found, list) and found and all(isinstance(x, Mapping) for x in found)):
        raise _fault(path, "a chart, its cases or its levels are missing")
    return found


def _numbers(values: Iterable[object]) -> bool:
    return all(
        isinstance(value, int | float) and not isinstance(value, bool) and not math.isnan(value)
        for value in values
    )


def _line(points: object) -> NDArray[np.float64] | None:
    if not (isinstance(points, list) and len(points) > 1):
        return None
    if not all(isinstance(pair, list) and len(pair) == 2 and _numbers(pair) for pair in points):
        return None
    line = np.array(points, dtype=np.float64)
    return line if np.all(np.isfinite(line)) and np.all(np.diff(line[:, 1]) > 0.0) else None


def _fault(path: Path, found: str) -> FileFormatError:
    return FileFormatError("not a chart file", found=f"{path}: {found}", needed="see our own")


def _built(chart: Document, case: Document, conditions: Mapping[str, str]) -> RatingChart:
    quantities = chart["quantities"]
    return RatingChart(
        chart["key"],
        chart["standard"],
        chart["title"],
        chart["source"],
        tuple(Region(_limits(level), _line(level.get("boundary"))) for level in case["levels"]),
        {name: str(each["label"]) for name, each in quantities.items()},
        {name: str(each["unit"]) for name, each in quantities.items()},
        tuple(chart["axes"]),
        dict(conditions),
        chart["worse"],
        _limits(case.get("valid", {})),
        chart["confirmed"],
        chart["note"],
    )


def _limits(level: Document) -> Limits:
    return {
        name: (float(ends[0]), float(ends[1])) for name, ends in level.items() if name != "boundary"
    }


def _words(when: Mapping[str, list[str]]) -> str:
    return ", ".join(f"{name} {'/'.join(allowed)}" for name, allowed in when.items())
