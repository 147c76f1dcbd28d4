"""Poles at the origin of the z plane: delays, which differ in nothing and stand in one row."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from flightid.models.sampled.discrete_modes import AT_ORIGIN

if TYPE_CHECKING:
    from flightid.dynamics.modes.result import Mode

EACH_ONE_SAMPLE = "delays of one sample each"


def delays_apart(found: Iterable[Mode]) -> tuple[list[Mode], list[Mode]]:
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
