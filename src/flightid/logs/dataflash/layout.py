"""Layout of a DataFlash message type for writing: storage, labels, units, multipliers."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache, cached_property
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError, OptionError
from flightid.frozen import dataclass

# Format character -> NumPy storage (AP_Logger/LogStructure.h).
STORAGE: dict[str, str] = {
    "b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4",
    "q": "<i8", "Q": "<u8", "g": "<f2", "f": "<f4", "d": "<f8", "c": "<i2", "C": "<u2",
    "e": "<i4", "E": "<u4", "L": "<i4", "n": "S4", "N": "S16", "Z": "S64", "a": "(32,)<i2",
}  # fmt: skip
OWN_DIVISOR = {"c": 100.0, "C": 100.0, "e": 100.0, "E": 100.0, "L": 1e7}
MAXIMUM_FIELDS, MAXIMUM_SIZE = 16, 255
"""Characters of a format, bytes of a message: FMT has 16 of the one, a byte for the other."""


@dataclass(frozen=True)
class MessageLayout:
    """What the FMT and FMTU rows of a message type say.

    Attributes
    ----------
    name : str
        Message, at most four ASCII characters.
    type : int
        Number in the header.
    format : str
        One storage character a field.
    columns : str
        Labels, separated by commas.
    units, multipliers : str
        One id a field; ``"-"`` where there is none.

    Raises
    ------
    OptionError
        The parts contradict each other or do not fit a log.

    Example
    -------
    >>> MessageLayout("EV", 181, "QB", "TimeUS,Id", "s-", "F-").dtype.itemsize
    12
    """

    name: str
    type: int
    format: str
    columns: str
    units: str
    multipliers: str

    def __post_init__(self) -> None:
        unknown = set(self.format) - set(STORAGE)
        lengths = {len(self.format), len(self.labels), len(self.units), len(self.multipliers)}
        fits = (
            len(lengths) == 1
            and len(self.format) <= MAXIMUM_FIELDS
            and len(self.columns) <= 64
            and 0 < len(self.name) <= 4
            and 0 <= self.type <= 255
        )
        if unknown or not fits or self.dtype.itemsize > MAXIMUM_SIZE:
            raise OptionError(
                f"layout of message {self.name!r} cannot be logged",
                found=f"format {self.format!r}, columns {self.columns!r}, units {self.units!r}, "
                f"multipliers {self.multipliers!r}",
                needed=f"one known character, label, unit and multiplier a field, at most "
                f"{MAXIMUM_FIELDS} fields, 64 characters of labels and {MAXIMUM_SIZE} bytes",
            )

    @property
    def labels(self) -> list[str]:
        """Field names."""
        return self.columns.split(",")

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """Packed storage with the three header bytes."""
        fields = [("header", "u1", (3,))]
        fields += [
            (label, STORAGE[code])  # type: ignore[misc]
            for label, code in zip(self.labels, self.format, strict=True)
        ]
        return np.dtype(fields)

    def divisor(self, label: str, multipliers: Mapping[str, float]) -> float:
        """Number that physical values are multiplied by for storage (1 / multiplier)."""
        place = self.labels.index(label)
        code = self.format[place]
        if code in OWN_DIVISOR:
            return OWN_DIVISOR[code]
        multiplier = multipliers.get(self.multipliers[place], 1.0) or 1.0
        return 1.0 / multiplier

    def empty(self, n_rows: int) -> NDArray[np.void]:
        """Rows of zeros with their header."""
        rows = np.zeros(n_rows, self.dtype)
        rows["header"] = (0xA3, 0x95, self.type)
        return rows


def stored(values: object, storage: np.dtype[Any], divisor: float, field: str) -> NDArray[Any]:
    """Physical values as they are stored.

    Raises
    ------
    DataError
        A value does not fit the storage.
    """
    if storage.kind == "S":
        return _stored_text(values, storage, field)
    numbers = np.asarray(values)
    if storage.base.kind == "f":
        return np.asarray(numbers * divisor if divisor != 1.0 else numbers)
    limits = np.iinfo(storage.base)
    if numbers.dtype.kind in "iub" and divisor == 1.0:
        scaled = numbers
    else:
        scaled = np.rint(np.asarray(numbers, np.float64) * divisor)
    # Written so that NaN fails too.
    if not np.all((scaled >= limits.min) & (scaled <= limits.max)):
        raise DataError(
            f"field {field} holds values that its storage cannot hold",
            found=f"{np.min(numbers)!s} to {np.max(numbers)!s}",
            needed=f"{limits.min / divisor:g} to {limits.max / divisor:g}",
        )
    return scaled


def _stored_text(values: object, storage: np.dtype[Any], field: str) -> NDArray[Any]:
    texts = [values] if isinstance(values, str | bytes) else list(values)  # type: ignore[call-overload]
    encoded = [text.encode() if isinstance(text, str) else bytes(text) for text in texts]
    longest = max(encoded, key=len, default=b"")
    if len(longest) > storage.itemsize:
        raise DataError(
            f"field {field} holds a text that is too long",
            found=f"{len(longest)} bytes: {longest.decode(errors='replace')!r}",
            needed=f"at most {storage.itemsize} bytes",
        )
    return np.array(encoded, dtype=storage)


@cache
def standard_tables() -> tuple[dict[str, str], dict[str, float], dict[str, MessageLayout]]:
    """Units by id, multipliers by id and message layouts by name, as ArduPilot 4.7 logs them."""
    source = files("flightid.logs.dataflash").joinpath("layouts.toml")
    content = tomllib.loads(source.read_text(encoding="utf-8"))
    layouts = {name: MessageLayout(name, **item) for name, item in content["messages"].items()}
    return content["units"], content["multipliers"], layouts
