"""Stages that depend on nothing but their inputs, each known by a hash of all of them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, MutableMapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np

from flightid.files import sha256_of_file
from flightid.frozen import dataclass
from flightid.models.kinds import KINDS, model_to_description
from flightid.record.formats.sniff import BAG_SUFFIXES
from flightid.version import VERSION

Value = TypeVar("Value")
MODELS = tuple(kind.model for kind in KINDS.values())
"""Models are told apart by the description that a file would hold."""


@dataclass(frozen=True, eq=False)
class StageResult(Generic[Value]):
    """Result of a stage.

    Attributes
    ----------
    value : object
        The result.
    key : str
        SHA-256 of everything it depends on.
    """

    value: Value
    key: str


class StageRunner:
    """Carries stages out, or takes their results from a cache.

    A stage is a function of settings and of results of earlier stages. Its key is the hash of the
    function's name, of flightid's version, of the settings and of the keys of those results: where
    nothing of that has changed, neither has the result, and the cache holds it.

    Parameters
    ----------
    cache : mutable mapping of str to object, optional
        Results by key; whoever keeps it from study to study saves all that has not changed.

    Example
    -------
    >>> cache = {}
    >>> first, second = StageRunner(cache), StageRunner(cache)
    >>> [run.stage("size of a word", len, "four").value for run in (first, second)]
    [4, 4]
    >>> first.carried_out, second.carried_out, second.from_cache
    (['size of a word'], [], ['size of a word'])
    """

    def __init__(self, cache: MutableMapping[str, Any] | None = None) -> None:
        self._cache = {} if cache is None else cache
        self.carried_out: list[str] = []
        self.from_cache: list[str] = []
        self.keys: list[str] = []

    def stage(self, name: str, work: Callable[..., Value], *inputs: Any) -> StageResult[Value]:  # noqa: ANN401
        """Result of a stage.

        Parameters
        ----------
        name : str
            Of the stage, and of what it is carried out for.
        work : callable
            Takes `inputs`, results of stages as their values.
        *inputs
            `StageResult` results, and settings that `digest` knows; also inside lists, tuples and
            mappings.

        Returns
        -------
        StageResult
        """
        # What it is carried out for is no part of the key: two models may share a response.
        key = digest((VERSION, work.__module__, work.__qualname__, inputs))
        self.keys.append(key)
        if key in self._cache:
            self.from_cache.append(name)
        else:
            self._cache[key] = work(*map(_values, inputs))
            self.carried_out.append(name)
        return StageResult(self._cache[key], key)


def _values(item: Any) -> Any:  # noqa: ANN401 - whatever the stage takes
    """An input with results of stages as their values."""
    if isinstance(item, StageResult):
        return item.value
    if isinstance(item, Mapping):
        return {name: _values(value) for name, value in item.items()}
    if isinstance(item, list | tuple):
        return type(item)(map(_values, item))
    return item


def digest(item: object) -> str:
    """SHA-256 of settings: equal values have equal digests, and no others.

    A path of a file stands for the content of the file.

    Raises
    ------
    TypeError
        What has no plain content cannot be told from another.

    Example
    -------
    >>> digest({"a": 1, "b": (2.0,)}) == digest({"b": (2.0,), "a": 1})
    True
    >>> digest(1) == digest(1.0)
    False
    """
    known = hashlib.sha256()
    for part in _parts(item):
        content = part.encode()
        # The length before each part: no two lists of parts read alike.
        known.update(f"{len(content)}:".encode() + content)
    return known.hexdigest()


def _parts(item: object) -> Iterable[str]:
    """The content of an item as texts, its type first."""
    yield type(item).__name__
    if isinstance(item, StageResult):
        yield item.key
    elif isinstance(item, Path):
        yield sha256_of_file(item) if item.is_file() else str(item)
        if item.is_dir():
            # The folder of a bag: its files are its content.
            files = sorted(each for each in item.iterdir() if each.suffix in BAG_SUFFIXES)
            yield from map(sha256_of_file, files)
    elif isinstance(item, Enum):
        yield str(item.value)
    elif item is None or isinstance(item, bool | int | float | str):
        yield repr(item)
    elif isinstance(item, np.ndarray):
        yield f"{item.dtype} {item.shape}"
        yield hashlib.sha256(np.ascontiguousarray(item).tobytes()).hexdigest()
    elif isinstance(item, Mapping):
        for name, value in sorted(item.items()):
            yield digest((name, value))
    elif isinstance(item, list | tuple):
        yield from map(digest, item)
    elif isinstance(item, MODELS):
        yield digest(model_to_description(item))
    elif is_dataclass(item):
        yield from (digest((each.name, getattr(item, each.name))) for each in fields(item))
    else:
        raise TypeError(f"no stage can depend on a {type(item).__name__}: it has no plain content")
