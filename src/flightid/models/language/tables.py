"""Tables as functions in formulas (native: `lookup_table.rs`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightid import _native
from flightid.errors import FlightidError, ModelError
from flightid.formula import require_name
from flightid.frozen import dataclass
from flightid.models.language.reading import read_number, read_text, require_keys
from flightid.units import canonical

MAXIMUM_TABLES = 100
INTERPOLATIONS = ("linear", "pchip", "cubic")
OUTSIDE = ("hold", "linear", "refuse")
_KEYS = {"axes", "values", "unit", "interpolation", "outside", "note"}


@dataclass(frozen=True)
class TableAxis:
    """Breakpoints of a table along one axis.

    Attributes
    ----------
    points : tuple of float
        Rising, in `unit`.
    unit : str
        Unit.

    Example
    -------
    >>> TableAxis((0.0, 0.1), "radian").unit
    'rad'
    """

    points: tuple[float, ...]
    unit: str = "1"

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", tuple(float(point) for point in self.points))
        object.__setattr__(self, "unit", canonical(self.unit))


@dataclass(frozen=True)
class TableFunction:
    """A table that formulas call by its name, with one or two arguments.

    Attributes
    ----------
    axes : tuple of TableAxis
        One or two.
    values : tuple of float
        In `unit`, row by row: the last axis runs fastest.
    unit : str
        Unit of the values.
    interpolation : str
        ``"linear"``; ``"pchip"``, monotone between monotone points, one continuous derivative; or
        ``"cubic"``, the not-a-knot spline, two of them.
    outside : str
        Beyond the breakpoints: ``"hold"`` the edge, go on ``"linear"`` from it, or ``"refuse"``.
    note : str
        Where it comes from.

    Raises
    ------
    ModelError
        Breakpoints do not rise, numbers are missing, not finite or too many, a word is not known.

    Reference
    ---------
    Fritsch & Butland, *SIAM J. Sci. Stat. Comput.* 5 (1984), eq. 2: monotone slopes.
    de Boor, *A Practical Guide to Splines* (1978), ch. IV: not-a-knot.

    Example
    -------
    >>> incidence = TableAxis((-0.2, 0.0, 0.2), "rad")
    >>> lift = TableFunction((incidence,), (-0.6, 0.3, 1.0), outside="hold")
    >>> lift
    TableFunction(3 values in 1, linear, outside hold)
    >>> lift([0.1, 0.5])
    array([0.65, 1.  ])
    """

    axes: tuple[TableAxis, ...]
    values: tuple[float, ...]
    unit: str = "1"
    interpolation: str = "linear"
    outside: str = "refuse"
    note: str = ""
    native: _native.LookupTable = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", tuple(self.axes))
        object.__setattr__(self, "values", tuple(float(value) for value in self.values))
        object.__setattr__(self, "unit", canonical(self.unit))
        for word, known in ((self.interpolation, INTERPOLATIONS), (self.outside, OUTSIDE)):
            if word not in known:
                raise ModelError(
                    "a table has an unknown word", found=repr(word), needed=", ".join(known)
                )
        points = [list(axis.points) for axis in self.axes]
        try:
            native = _native.LookupTable(
                points, list(self.values), self.interpolation, self.outside
            )
        except FlightidError as error:
            raise ModelError("a table contradicts itself", found=str(error)) from error
        object.__setattr__(self, "native", native)

    def __call__(self, first: ArrayLike, second: ArrayLike = 0.0) -> NDArray[np.float64]:
        """Values at places, or pairs of places.

        Returns
        -------
        ndarray
            In `unit`, of the shape of the places; NaN outside where the table refuses.
        """
        x, y = np.broadcast_arrays(np.asarray(first, float), np.asarray(second, float))
        flat = self.native.evaluate(x.ravel().copy(), y.ravel().copy())
        return np.asarray(flat.reshape(x.shape))

    def __repr__(self) -> str:
        """Size and kind on one line."""
        size = f"{len(self.values)} values in {self.unit}"
        return f"TableFunction({size}, {self.interpolation}, outside {self.outside})"

    def to_dict(self) -> dict[str, object]:
        """Plain values; `read_table_function` reads them."""
        shape = [len(axis.points) for axis in self.axes]
        return {
            "axes": [{"points": list(axis.points), "unit": axis.unit} for axis in self.axes],
            "values": np.reshape(self.values, shape).tolist(),
            "unit": self.unit,
            "interpolation": self.interpolation,
            "outside": self.outside,
            "note": self.note,
        }


def read_table_function(name: str, item: object) -> TableFunction:
    """A table from its description in a model file.

    Parameters
    ----------
    name : str
    item : object
        ``{axes = [{points = […], unit = "rad"}], values = […], unit, interpolation, outside}``.

    Raises
    ------
    ModelError
        A key is missing, unknown or of the wrong type, or the numbers contradict each other.
    """
    subject = f"table {name}"
    if not isinstance(item, dict):
        raise ModelError(f"{subject} must be a table", found=repr(item)[:80])
    require_keys(item, _KEYS, subject)
    for key in ("axes", "values", "outside"):
        if key not in item:
            raise ModelError(f"{subject} lacks {key!r}", needed="axes, values and outside")
    axes = item["axes"]
    if not isinstance(axes, list | tuple) or not 1 <= len(axes) <= 2:
        raise ModelError(f"{subject} needs one or two axes", found=repr(axes)[:80])
    found = tuple(_axis(subject, axis) for axis in axes)
    return TableFunction(
        found,
        tuple(_numbers(item["values"], f"{subject}.values", len(found))),
        read_text(item.get("unit", "1"), f"{subject}.unit"),
        read_text(item.get("interpolation", "linear"), f"{subject}.interpolation"),
        read_text(item["outside"], f"{subject}.outside"),
        read_text(item.get("note", ""), f"{subject}.note"),
    )


def _axis(subject: str, item: object) -> TableAxis:
    if not isinstance(item, dict) or "points" not in item:
        raise ModelError(f"an axis of {subject} needs points", found=repr(item)[:80])
    require_keys(item, {"points", "unit"}, f"an axis of {subject}")
    points = _numbers(item["points"], f"points of {subject}", 1)
    return TableAxis(tuple(points), read_text(item.get("unit", "1"), f"unit of {subject}"))


def _numbers(item: object, subject: str, depth: int) -> list[float]:
    if not isinstance(item, list | tuple):
        raise ModelError(f"{subject} must be a list", found=repr(item)[:80])
    if depth == 1:
        return [read_number(value, subject) for value in item]
    rows = [_numbers(row, subject, depth - 1) for row in item]
    if len({len(row) for row in rows}) > 1:
        raise ModelError(f"rows of {subject} differ in length")
    return [value for row in rows for value in row]


def check_tables(tables: Mapping[str, TableFunction]) -> None:
    """Refuse too many tables, and names that cannot be called.

    Raises
    ------
    ModelError
    """
    if len(tables) > MAXIMUM_TABLES:
        raise ModelError("too many tables", found=len(tables), needed=f"at most {MAXIMUM_TABLES}")
    for name in tables:
        require_name(name, "a table")
