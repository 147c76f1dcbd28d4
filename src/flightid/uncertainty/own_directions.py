"""Directions of a record's own numbers, of each output those alone that reach it.

A bias moves one output and the start of a state often few: the other rows of such a direction are
zeros, which would cost as much as numbers in all sums over samples.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
MOST_OF_ALL = 0.75
"""Share of the directions up to which those that reach an output are copied out of all."""
LOOKED_AT = 64
"""Every so many samples are looked at first: most directions that reach an output show there."""


@dataclass(frozen=True, eq=False)
class OwnDirections:
    """Directions of one record's own numbers, shape (n_outputs, n, m), zeros left out.

    Attributes
    ----------
    whole : ndarray, shape (n_outputs, n, m)

    Example
    -------
    >>> own = OwnDirections(np.array([[[1.0, 0.0]], [[0.0, 2.0]]]))
    >>> own.places[1].tolist(), own.columns[1].tolist()
    ([1], [[2.0]])
    """

    whole: Array

    @property
    def count(self) -> int:
        """Number of all directions, m."""
        return int(self.whole.shape[2])

    @cached_property
    def places(self) -> tuple[NDArray[np.intp], ...]:
        """Of each output, the directions that reach it."""
        found = []
        for rows in self.whole:
            reaches = np.any(rows[::LOOKED_AT], axis=0)
            unseen = np.flatnonzero(~reaches)
            reaches[unseen] = [bool(np.any(rows[:, place])) for place in unseen]
            few = np.count_nonzero(reaches) <= MOST_OF_ALL * len(reaches)
            found.append(np.flatnonzero(reaches) if few else np.arange(len(reaches)))
        return tuple(found)

    @cached_property
    def columns(self) -> tuple[Array, ...]:
        """Of each output, these alone, shape (n, k)."""
        return tuple(
            rows if places.size == self.count else rows[:, places]
            for rows, places in zip(self.whole, self.places, strict=True)
        )

    def within(self, output: int, *beside: int) -> NDArray[np.intp]:
        """Places of an output's own directions and of others that follow all of them."""
        return np.concatenate([self.places[output], self.count + np.arange(sum(beside))])


def reaching_few_first(own: Array) -> NDArray[np.intp]:
    """Order of columns, shape (n_outputs, n, m): those first that move the fewest outputs.

    Orthogonal to those before them they then keep their zeros.
    """
    if len(own) < 2:
        return np.arange(own.shape[2])
    # Any order will do: what some samples show is enough.
    reached = np.any(own[:, ::LOOKED_AT], axis=1).sum(axis=0)
    return np.argsort(reached, kind="stable")


def spread(found: Array, places: NDArray[np.intp], size: int) -> Array:
    """Products of some directions with all of them, where the others' are zero.

    Example
    -------
    >>> spread(np.array([[5.0]]), np.array([1]), 2)
    array([[0., 0.],
           [0., 5.]])
    """
    if found.shape[0] == size:
        return found
    whole = np.zeros((size, size))
    whole[np.ix_(places, places)] = found
    return whole
