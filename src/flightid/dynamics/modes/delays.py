"""Poles at the origin of the z plane: delays, which differ in nothing and stand in one row."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol, TypeVar

from flightid.models.sampled.discrete_modes import AT_ORIGIN

EACH_ONE_SAMPLE = "delays of one sample each"


class Lacking(Protocol):
    """A mode that says why it has no numbers."""

    @property
    def reason(self) -> str:
        """Empty where it has them."""


Found = TypeVar("Found", bound=Lacking)


def delays_apart(found: Iterable[Found]) -> tuple[list[Found], list[Found]]:
    """Modes that move, and poles at the origin, which tables show in one row.

    Example
    -------
    >>> delays_apart([])
    ([], [])
    """
    modes = list(found)
    return (
        [mode for mode in modes if mode.reason != AT_ORIGIN],
        [mode for mode in modes if mode.reason == AT_ORIGIN],
    )
