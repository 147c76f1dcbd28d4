"""Responses of a model, each on frequencies of its own: one evaluation serves all of them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flightid.errors import DataError
from flightid.frozen import dataclass
from flightid.identification.shared_work import Itself, shared
from flightid.models import GreyBoxModel

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Places = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Grids:
    """Frequencies of several responses, found among all of them once for many evaluations.

    Attributes
    ----------
    own : sequence of ndarray
        Those of each response, rad/s.

    Example
    -------
    >>> grids = Grids([np.array([1.0, 3.0]), np.array([2.0, 3.0])])
    >>> grids.omega, grids.places
    (array([1., 2., 3.]), array([0, 2, 4, 5]))
    """

    own: Sequence[Array]

    @cached_property
    def omega(self) -> Array:
        """All frequencies, none twice."""
        return np.unique(np.concatenate(self.own))

    @cached_property
    def places(self) -> Places:
        """Of each response's frequencies in the responses on all of them, row after row."""
        rows = len(self.omega) * np.arange(len(self.own))
        each = np.searchsorted(self.omega, np.concatenate(self.own))
        return np.repeat(rows, [len(own) for own in self.own]) + each

    def joined(self, model: GreyBoxModel, free: Array | None = None) -> Complex:
        """The model's responses on their own frequencies, one after another; see `curves_of`."""
        values = model.parameters.independent_values()
        if free is not None:
            values[model.parameters.free_indices] = free
        return np.asarray(model.native.response(values, self.omega).ravel()[self.places])

    def apart(self, joined: Complex) -> list[Complex]:
        """Values of each response."""
        return np.split(joined, np.cumsum([len(own) for own in self.own])[:-1])


def curves_of(model: GreyBoxModel, grids: Sequence[Array]) -> list[Complex]:
    """Each response of the model, in their order, on its own frequencies, rad/s.

    Raises
    ------
    DataError
        The model has no response at one of the frequencies.
    """
    known = Grids(grids)
    return known.apart(known.joined(model))


def looks_of(curves: Sequence[Complex]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Of each curve, whether it is not zero throughout, and whether it has logarithms throughout.

    Example
    -------
    >>> looks_of([np.array([0j, 1j]), np.array([0j]), np.array([2j])])
    (array([ True, False,  True]), array([False, False,  True]))
    """
    if not curves:
        return np.zeros(0, dtype=bool), np.zeros(0, dtype=bool)
    joined, first = np.concatenate(curves), np.cumsum([0, *map(len, curves)])[:-1]
    some = joined != 0.0
    sound = some & np.isfinite(joined)
    return np.logical_or.reduceat(some, first), np.logical_and.reduceat(sound, first)


def curves_at(model: GreyBoxModel, starts: Array, grids: Sequence[Array]) -> Complex:
    """Responses for free parameters in each row of `starts`, one grid after another in a row.

    NaN in rows where the model has no response at one of the frequencies.
    """
    known = Grids(grids)
    found = np.full((len(starts), len(known.places)), np.nan, dtype=np.complex128)
    for row, start in zip(found, starts, strict=True):
        with suppress(DataError), np.errstate(all="ignore"):
            row[:] = known.joined(model, start)
    return found


def start_curves(model: GreyBoxModel, grids: Sequence[Array]) -> list[Complex]:
    """`curves_of` a model that many fits have in common: evaluated once for all of them."""
    return shared(
        lambda: ("curves", Itself(model), *(each.tobytes() for each in grids)),
        lambda: curves_of(model, grids),
    )


def log_slopes_of(model: GreyBoxModel, grids: Sequence[Array]) -> list[Complex]:
    """Derivatives of the logarithm of each response, shape (n, n_free), as `curves_of`."""
    known, parameters = Grids(grids), model.parameters
    values, free = parameters.independent_values(), parameters.free_indices
    found = model.native.log_gradient(values, free, known.omega)
    return known.apart(found.reshape(-1, len(free))[known.places])


def slopes_of(model: GreyBoxModel, grids: Sequence[Array]) -> list[Complex]:
    """Derivatives of each response itself, shape (n, n_free), as `curves_of`."""
    pairs = zip(curves_of(model, grids), log_slopes_of(model, grids), strict=True)
    return [curve[:, None] * slope for curve, slope in pairs]
