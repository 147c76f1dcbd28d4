"""Unknown constants of one record that enter its residuals linearly, taken out exactly.

Initial states, biases and what the ends of a record add are estimated for any value of the
parameters by linear least squares, and the slopes by the parameters lose what a change of those
constants would follow: separable least squares.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flightid.frozen import dataclass

Array = NDArray[np.float64]
_RANK = 1e-9
CLEAR = 1e-2
"""Smallest eigenvalue of products over the largest, from which they lose two digits at most."""
SQUARES = 1e-200, 1e200
"""Of directions that neither vanish nor overflow."""


@dataclass(frozen=True)
class Nuisance:
    """Best constants of one record.

    Attributes
    ----------
    values : ndarray, shape (n_constants,)
        Combinations that the residuals do not show are zero.
    space : ndarray, shape (n_rows, rank)
        Orthonormal directions that the constants can follow.

    Reference
    ---------
    Golub & Pereyra (1973), SIAM J. Numerical Analysis 10; Kaufman (1975), BIT 15 (slopes).

    Example
    -------
    >>> found = Nuisance.best(np.ones((4, 1)), np.array([1.0, 2.0, 3.0, 4.0]))
    >>> found.values, found.removed_from(np.array([1.0, 2.0, 3.0, 4.0]))
    (array([2.5]), array([-1.5, -0.5,  0.5,  1.5]))
    """

    values: Array
    space: Array

    @classmethod
    def best(cls, directions: Array, rows: Array) -> Nuisance:
        """Least squares of weighted rows on weighted directions.

        Parameters
        ----------
        directions : ndarray, shape (n_rows, n_constants)
        rows : ndarray, shape (n_rows,)
        """
        return NuisanceDirections.of(directions).best(rows)

    def removed_from(self, rows: Array) -> Array:
        """Rows (n_rows, …) less their part along the directions."""
        along = self.space @ (self.space.T @ rows)
        return np.subtract(rows, along, out=along)


@dataclass(frozen=True)
class NuisanceDirections:
    """Directions of the constants, factored once for all records that have the same.

    Attributes
    ----------
    space : ndarray, shape (n_rows, rank)
        Orthonormal directions that the constants can follow.
    weights : ndarray, shape (n_constants, rank)
        Constants by what rows show along them.
    """

    space: Array
    weights: Array

    @classmethod
    def of(cls, directions: Array) -> NuisanceDirections:
        """From directions of shape (n_rows, n_constants)."""
        products = directions.T @ directions
        squares = np.diag(products)
        if squares.size and np.all((squares > SQUARES[0]) & (squares < SQUARES[1])):
            size = np.sqrt(squares)
            values, axes = np.linalg.eigh(products / np.outer(size, size))
            # Products keep the digits of directions that are far from alike.
            if values[0] > CLEAR * values[-1]:
                weights = axes / np.sqrt(values) / size[:, None]
                return cls(directions @ weights, weights)
        # Starts die out: most rows may show nothing of them.
        shown = directions.any(axis=1)
        seen = directions[shown]
        size = np.linalg.norm(seen, axis=0)
        size[size == 0.0] = 1.0
        left, values, right = np.linalg.svd(seen / size, full_matrices=False)
        kept = values > _RANK * max(float(values.max(initial=0.0)), 1e-300)
        space = np.zeros((len(directions), int(kept.sum())))
        space[shown] = left[:, kept]
        return cls(space, right[kept].T / values[kept] / size[:, None])

    def best(self, rows: Array) -> Nuisance:
        """The best constants for some rows (n_rows,)."""
        return Nuisance(self.weights @ (self.space.T @ rows), self.space)
