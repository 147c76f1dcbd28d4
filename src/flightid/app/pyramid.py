"""Long channels as blocks of minimum and maximum, so that any zoom costs the same.

Blocks of 64 samples, then of 512, 4096 …: what a view needs is read from the level whose blocks
are short beside its columns. Nothing is averaged: a spike of one sample shows at every zoom, a
value that is missing stays missing, and a silence of the stream parts the line.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightid.files import write_atomically
from flightid.frozen import dataclass

Array = NDArray[np.float64]
BASE, FACTOR = 64, 8
FORMAT = 2
FINE = 4
"""A block is at most this part of a column, so that no sample is drawn a column away."""
GAP_FACTOR = 8.0
"""Silence longer than this many usual steps is a gap."""
SAMPLED = 100_000
"""Steps between stamps that tell the usual one."""
SKIPPED = np.inf
"""In a view: this series has no sample here, and its line goes on. NaN: the line is broken."""


@dataclass(frozen=True, eq=False)
class Pyramid:
    """One channel with its levels.

    Attributes
    ----------
    time_s, values : ndarray, shape (n,)
        Stamps, increasing, s; values, NaN where missing.
    breaks : ndarray of int, shape (n_breaks,)
        Samples behind which the line ends, increasing: one is missing, or a gap follows.
    levels : tuple of ndarray, shape (3, n_blocks)
        Least value, largest value, and whether the line is broken, by block of each level.
    """

    time_s: Array
    values: Array
    breaks: NDArray[np.int64]
    levels: tuple[Array, ...]

    @classmethod
    def of(cls, time_s: Array, values: Array) -> Pyramid:
        """Build the levels of a channel.

        Stamps that are not numbers are left out, and disordered ones are sorted; infinite values
        count as missing.

        Example
        -------
        >>> made = Pyramid.of(np.arange(1000.0), np.arange(1000.0) % 7)
        >>> [level.shape[1] for level in made.levels]
        [16, 2]
        """
        time_s, values = np.asarray(time_s, np.float64), np.asarray(values, np.float64)
        stamped = np.isfinite(time_s)
        if not stamped.all():
            time_s, values = time_s[stamped], values[stamped]
        steps = np.diff(time_s)
        if steps.size and steps.min() < 0.0:
            order = np.argsort(time_s, kind="stable")
            time_s, values = time_s[order], values[order]
            steps = np.diff(time_s)
        known = np.isfinite(values)
        broken = ~known
        if broken.any():
            values = np.where(known, values, np.nan)
        usual = float(np.median(steps[:: 1 + steps.size // SAMPLED])) if steps.size else 0.0
        if usual > 0.0:
            broken[:-1] |= steps > GAP_FACTOR * usual
        breaks = np.flatnonzero(broken)
        levels: list[Array] = []
        low, high, size = values, values, BASE
        while low.size > FACTOR:
            factor = FACTOR if levels else BASE
            low = _blocks(low, factor, np.minimum, np.fmin)
            high = _blocks(high, factor, np.maximum, np.fmax)
            ends = np.zeros(low.size)
            ends[breaks // size] = 1.0
            levels.append(np.stack([low, high, ends]))
            size *= FACTOR
        return cls(time_s, values, breaks, tuple(levels))

    def write(self, path: Path) -> Path:
        """Write the channel and its levels as one array of doubles, row after row."""
        rows = [self.time_s, self.values, self.breaks.astype(np.float64), *self.levels]
        sizes = np.array([FORMAT, len(rows), *(row.shape[-1] for row in rows)], np.float64)
        count = sizes.size + sum(row.size for row in rows)
        head = {"descr": "<f8", "fortran_order": False, "shape": (count,)}

        def put(temporary: Path) -> None:
            with temporary.open("wb") as file:
                np.lib.format.write_array_header_1_0(file, head)
                for row in (sizes, *rows):
                    file.write(np.ascontiguousarray(row, "<f8").data)

        return write_atomically(path, put)

    @classmethod
    def read(cls, path: Path) -> Pyramid:
        """Open what was written; parts are read from the disk as they are looked at.

        Raises
        ------
        ValueError
            It was written by another version, or not whole.
        """
        flat = np.load(path, mmap_mode="r", allow_pickle=False)
        if flat[0] != FORMAT:
            raise ValueError(f"not a channel of this format: {path.name}")
        count = int(flat[1])
        sizes = [int(size) for size in flat[2 : 2 + count]]
        place, rows = 2 + count, []
        for number, size in enumerate(sizes):
            height = 1 if number < 3 else 3
            row = flat[place : place + height * size]
            rows.append(row if height == 1 else row.reshape(3, size))
            place += height * size
        return cls(rows[0], rows[1], rows[2].astype(np.int64), tuple(rows[3:]))

    def broken_in(self, start: int, stop: int) -> NDArray[np.bool_]:
        """Whether the line ends behind each of some samples, shape (stop − start,)."""
        first, last = np.searchsorted(self.breaks, (start, stop))
        broken = np.zeros(stop - start, np.bool_)
        broken[self.breaks[first:last] - start] = True
        return broken

    def samples_in(self, start_s: float, stop_s: float) -> tuple[int, int]:
        """First sample of a span, and the one behind its last; a neighbour on each side too."""
        first = int(np.searchsorted(self.time_s, start_s, side="left")) - 1
        last = int(np.searchsorted(self.time_s, stop_s, side="right")) + 1
        return max(0, first), min(self.time_s.size, last)

    def columns(self, edges_s: Array) -> Array:
        """Least and largest value and whether the line breaks, by column, shape (3, n).

        Parameters
        ----------
        edges_s : ndarray, shape (n + 1,)
            Bounds of the columns, s, increasing.
        """
        index = np.searchsorted(self.time_s, edges_s)
        index[-1] = np.searchsorted(self.time_s, edges_s[-1], side="right")
        mean = (int(index[-1]) - int(index[0])) / max(1, edges_s.size - 1)
        size, level = 1, None
        for number, each in enumerate(self.levels):
            if BASE * FACTOR**number * FINE <= mean:
                size, level = BASE * FACTOR**number, each
        if level is None:
            start, stop = int(index[0]), int(index[-1])
            values = self.values[start:stop]
            level = np.stack([values, values, self.broken_in(start, stop).astype(np.float64)])
            index = index - index[0]
        blocks = np.minimum(-(-index // size), level.shape[1])
        return _reduced(level, blocks)


def _blocks(row: Array, factor: int, fast: np.ufunc, missing: np.ufunc) -> Array:
    """Extremes of blocks of a row, the last one shorter; missing values count only alone."""
    whole = row.size // factor
    made = np.empty(-(-row.size // factor))
    table = row[: whole * factor].reshape(whole, factor)
    made[:whole] = fast.reduce(table, axis=1)
    holes = np.flatnonzero(np.isnan(made[:whole]))
    made[holes] = missing.reduce(table[holes], axis=1)
    if made.size > whole:
        made[whole] = missing.reduce(row[whole * factor :])
    return made


def _reduced(level: Array, edges: NDArray[np.int64]) -> Array:
    """Columns of blocks: missing values count only where a column holds nothing else."""
    filled = np.diff(edges) > 0
    out = np.full((3, edges.size - 1), np.nan)
    out[:2, ~filled] = SKIPPED
    out[2, ~filled] = 0.0
    if np.any(filled):
        cut = np.asarray(level[:, : edges[-1]])
        starts = edges[:-1][filled]
        out[0, filled] = np.fmin.reduceat(cut[0], starts)
        out[1, filled] = np.fmax.reduceat(cut[1], starts)
        out[2, filled] = np.fmax.reduceat(cut[2], starts)
    return out


def view(pyramids: Sequence[Pyramid], span_s: tuple[float, float], n_columns: int) -> Array:
    """Channels over a span on one axis of time, exact where that takes no more points.

    Parameters
    ----------
    pyramids : sequence of Pyramid
    span_s : (float, float)
        First and last instant, s.
    n_columns : int
        Pixels; each gets the least and the largest value that it holds.

    Returns
    -------
    ndarray, shape (1 + n_series, n)
        Time, s, then each channel: NaN where its line is broken, infinity where it has no sample.

    Example
    -------
    >>> slow = Pyramid.of(np.array([0.0, 1.0, 2.0]), np.array([5.0, np.nan, 7.0]))
    >>> view([slow], (0.0, 2.0), 100)
    array([[ 0.,  1.,  2.],
           [ 5., nan,  7.]])
    """
    ranges = [each.samples_in(*span_s) for each in pyramids]
    if sum(stop - start for start, stop in ranges) <= 2 * n_columns:
        return _exact(pyramids, ranges)
    edges = np.linspace(span_s[0], span_s[1], n_columns + 1)
    found = [each.columns(edges) for each in pyramids]
    width = (span_s[1] - span_s[0]) / n_columns
    broken = np.any([each[2] > 0.0 for each in found], axis=0)
    centres = edges[:-1] + 0.25 * width
    time_s = np.stack([centres, centres + 0.4 * width, centres + 0.6 * width], axis=1)
    kept = np.ones(time_s.shape, np.bool_)
    kept[:, 2] = broken
    rows = [time_s[kept]]
    for low, high, ends in found:
        row = np.stack([low, high, np.where(ends > 0.0, np.nan, SKIPPED)], axis=1)
        rows.append(row[kept])
    return np.stack(rows)


def _exact(pyramids: Sequence[Pyramid], ranges: Sequence[tuple[int, int]]) -> Array:
    """Every sample; behind one that ends its line a point that breaks it."""
    parts = []
    for each, (start, stop) in zip(pyramids, ranges, strict=True):
        time_s, values = np.array(each.time_s[start:stop]), np.array(each.values[start:stop])
        ends = np.flatnonzero(each.broken_in(start, stop)[:-1] & ~np.isnan(values[:-1]))
        middles = 0.5 * (time_s[ends] + time_s[ends + 1])
        time_s = np.insert(time_s, ends + 1, middles)
        parts.append((time_s, np.insert(values, ends + 1, np.nan)))
    union = np.unique(np.concatenate([time_s for time_s, _ in parts]))
    rows = [union]
    for time_s, values in parts:
        row = np.full(union.size, SKIPPED)
        row[np.searchsorted(union, time_s)] = values
        rows.append(row)
    return np.stack(rows)
