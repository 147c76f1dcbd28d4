"""Responses of a model, each on frequencies of its own: one evaluation serves all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flightid.models import GreyBoxModel

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def curves_of(
    model: GreyBoxModel, grids: Sequence[Array], free: Array | None = None
) -> list[Complex]:
    """Each response of the model, in their order, on its own frequencies, rad/s.

    `free` are values of the free parameters; default: the model's.

    Raises
    ------
    DataError
        The model has no response at one of the frequencies.
    """
    omega = np.unique(np.concatenate(grids))
    values = model.parameters.independent_values()
    if free is not None:
        values[model.parameters.free_indices] = free
    found = model.native.response(values, omega)
    return _chosen(found, omega, grids)


def log_slopes_of(model: GreyBoxModel, grids: Sequence[Array]) -> list[Complex]:
    """Derivatives of the logarithm of each response, shape (n, n_free), as `curves_of`."""
    omega = np.unique(np.concatenate(grids))
    parameters = model.parameters
    values, free = parameters.independent_values(), parameters.free_indices
    return _chosen(model.native.log_gradient(values, free, omega), omega, grids)


def slopes_of(model: GreyBoxModel, grids: Sequence[Array]) -> list[Complex]:
    """Derivatives of each response itself, shape (n, n_free), as `curves_of`."""
    pairs = zip(curves_of(model, grids), log_slopes_of(model, grids), strict=True)
    return [curve[:, None] * slope for curve, slope in pairs]


def _chosen(found: Complex, omega: Array, grids: Sequence[Array]) -> list[Complex]:
    return [row[np.searchsorted(omega, grid)] for row, grid in zip(found, grids, strict=True)]
