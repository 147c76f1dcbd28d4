"""Channels that were measured slower than they are stored, on their way to a coarser base."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from flightid.record.interpolation import BETWEEN_NEW, NEW_VALUES, SAME_RATE, is_coarser
from flightid.record.repeats import measured_rows
from flightid.record.stamps import mean_spacing_s
from flightid.table import Cell

Array = NDArray[np.float64]
ROOM = 1.5
"""Spacings of the new values that the longest gap must leave room for."""


def slow_channels(
    rows: Mapping[str, tuple[Array, Array]],
    names: Iterable[str],
    step_s: float,
    max_gap_s: float | None = None,
) -> dict[str, tuple[Array, Array]]:
    """New values, each at its own instant, of the channels that repeat them, for a coarser grid.

    A low-pass of the repetitions would be late by half of their run. Nothing is taken where the
    rows between would be called gaps.

    Parameters
    ----------
    rows : mapping of str to (time_s, values)
        Stamps, s, and samples, shape (n,) each.
    names : iterable of str
        Channels that were measured.
    step_s : float
        Spacing of the grid, s.
    max_gap_s : float, optional
        Longest spacing that is no gap, s.

    Returns
    -------
    dict of str to (time_s, values)

    Example
    -------
    >>> time_s, slow = np.arange(40) / 50, np.repeat(np.arange(20.0) ** 2, 2)
    >>> slow_channels({"y": (time_s, slow)}, ["y"], 0.04)["y"][1][:4]
    array([0., 1., 4., 9.])
    >>> slow_channels({"y": (time_s, slow)}, ["y"], 0.02)
    {}
    """
    found = {}
    for name in names:
        time_s, values = rows[name]
        if values.size < 2 or not is_coarser(step_s, mean_spacing_s(time_s)):
            continue
        new = measured_rows(values)
        if new is None:
            continue
        spacing = mean_spacing_s(time_s[new])
        if max_gap_s is None or ROOM * spacing <= max_gap_s:
            found[name] = time_s[new], values[new]
    return found


def said_of_slow(
    options: Mapping[str, Cell], slow: Mapping[str, tuple[Array, Array]], step_s: float
) -> dict[str, Cell]:
    """What a history says of them: whether each sample of the grid has a value of its own."""
    ends = {
        name: BETWEEN_NEW if step_s * (1 + SAME_RATE) < mean_spacing_s(time_s) else NEW_VALUES
        for name, (time_s, _) in slow.items()
    }
    return {**options, **{name: f"{options[name]}{end}" for name, end in ends.items()}}
