"""Entries of a plain dictionary that describes a model, checked one by one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightid.errors import ModelError

MAXIMUM_ENTRIES = 1_000


def read_operating_point(content: Mapping[str, object]) -> dict[str, float]:
    """Value of each channel about which a sampled model holds; empty where nothing is said.

    Raises
    ------
    ModelError
        It is no table of numbers.
    """
    table = read_table(content, "operating_point", required=False)
    return {name: read_number(value, f"operating_point.{name}") for name, value in table.items()}


def require_keys(item: Mapping[str, object], known: set[str], subject: str) -> None:
    """Refuse a table with keys that nobody reads.

    Raises
    ------
    ModelError
        A key is unknown.
    """
    unknown = set(item) - known
    if unknown:
        raise ModelError(
            f"{subject} has an unknown key",
            found=", ".join(sorted(map(str, unknown))),
            needed=f"one of {', '.join(sorted(known))}",
        )


def read_table(content: Mapping[str, object], key: str, *, required: bool = True) -> dict[str, Any]:
    """A table of a model, bounded in length.

    Raises
    ------
    ModelError
        It is missing though required, no table, or too long.
    """
    item = content.get(key, None if required else {})
    if not isinstance(item, dict) or (required and not item):
        raise ModelError(f"the model has no table [{key}]", needed="a table with entries")
    if len(item) > MAXIMUM_ENTRIES:
        raise ModelError(
            f"table [{key}] is too long", found=len(item), needed=f"at most {MAXIMUM_ENTRIES}"
        )
    return item


def read_text(item: object, subject: str) -> str:
    """A text, or a number as text.

    Raises
    ------
    ModelError
        It is something else.
    """
    if isinstance(item, bool) or not isinstance(item, str | int | float):
        raise ModelError(f"{subject} must be a text", found=repr(item)[:80])
    return str(item)


def read_texts(item: Mapping[str, object], subject: str) -> dict[str, str]:
    """A table of texts.

    Raises
    ------
    ModelError
        An entry is no text.
    """
    return {name: read_text(value, f"{subject}.{name}") for name, value in item.items()}


def read_number(item: object, subject: str) -> float:
    """A number.

    Raises
    ------
    ModelError
        It is something else, or beyond the range of numbers.
    """
    if isinstance(item, bool) or not isinstance(item, int | float):
        raise ModelError(f"{subject} must be a number", found=repr(item)[:80])
    try:
        return float(item)
    except OverflowError as error:
        raise ModelError(f"{subject} is too large", found="an integer beyond 1e308") from error


def read_names(content: Mapping[str, object], key: str) -> tuple[str, ...]:
    """A list of different names.

    Raises
    ------
    ModelError
        It is missing, no list of texts, or names something twice.
    """
    if key not in content:
        raise ModelError(f"the model has no {key}")
    listed = read_list(content[key], key)
    names = tuple(read_text(each, key) for each in listed)
    if len(set(names)) < len(names):
        raise ModelError(f"a name is given twice among the {key}", found=", ".join(names)[:200])
    return names


def read_matrix(item: object, key: str, shape: tuple[int, int]) -> NDArray[np.float64]:
    """A matrix as a list of rows; zeros where it is absent.

    Raises
    ------
    ModelError
        It is no list of rows of numbers, or of another shape.
    """
    if item is None or 0 in shape:
        return np.zeros(shape)
    rows = [[read_number(x, key) for x in read_list(row, key)] for row in read_list(item, key)]
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        raise ModelError(
            f"matrix {key} does not fit the names",
            found=f"{len(rows)} rows of {sorted({len(row) for row in rows})}",
            needed=f"{shape[0]} rows of {shape[1]}",
        )
    return np.array(rows, dtype=np.float64)


def read_list(item: object, key: str) -> list[Any]:
    """A list, bounded in length.

    Raises
    ------
    ModelError
        It is something else, or too long.
    """
    if not isinstance(item, list) or len(item) > MAXIMUM_ENTRIES:
        raise ModelError(
            f"{key} must be a list of at most {MAXIMUM_ENTRIES}", found=repr(item)[:80]
        )
    return item
