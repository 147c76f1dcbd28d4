"""Least squares on the equations of motion of several records: residuals, slopes, weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightid.errors import FitError
from flightid.identification.regression.equation_operators import Operator
from flightid.identification.regression.rounds import Rows
from flightid.identification.regression.sampled_equations import MeasuredMotion, RightSide

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EquationRegression:
    """Equations of motion of all records.

    Attributes
    ----------
    right : RightSide
    motions : tuple of MeasuredMotion
    operators : tuple of Operator
    used : ndarray of int
        Equations that hold a free parameter.
    """

    right: RightSide
    motions: tuple[MeasuredMotion, ...]
    operators: tuple[Operator, ...]
    used: NDArray[np.intp]

    @classmethod
    def of(
        cls,
        right: RightSide,
        motions: Sequence[MeasuredMotion],
        operators: Sequence[Operator],
        start: Array,
    ) -> EquationRegression:
        """Find the equations that a free parameter moves.

        Raises
        ------
        FitError
            There is none.
        """
        slopes = [right.at(start, motion)[1] for motion in motions]
        moved = np.array([np.any(each != 0.0, axis=(1, 2)) for each in slopes]).any(axis=0)
        if not np.any(moved):
            raise FitError(
                "no equation holds a free parameter",
                needed="at least one",
                action="free a parameter, or start it away from zero",
            )
        return cls(right, tuple(motions), tuple(operators), np.flatnonzero(moved))

    @property
    def n_states(self) -> int:
        """Number of state equations, used or not."""
        return len(self.right.model.states)

    def names(self) -> tuple[str, ...]:
        """Name of each used equation: a state with a prime, or an output."""
        model = self.right.model
        every = [f"{state}'" for state in model.states]
        every += [model.outputs[place] for place in self.right.reconstruction.others]
        return tuple(every[place] for place in self.used)

    def left(self, place: int) -> Array:
        """What is measured of the used equations of one record."""
        motion, operator = self.motions[place], self.operators[place]
        both = [operator.derivative(motion.states), operator.values(motion.others)]
        return np.concatenate(both, axis=0)[self.used]

    def rows(self, theta: Array, weights: Sequence[Array]) -> list[Rows]:
        """Residuals and slopes, the unknown constants taken out under these weights."""
        found = []
        for place, (motion, operator) in enumerate(zip(self.motions, self.operators, strict=True)):
            values, slopes = self.right.at(theta, motion)
            residuals = self.left(place) - operator.values(values[self.used])
            moved = -operator.values(np.moveaxis(slopes[self.used], 2, 1))
            rows = Rows(residuals, np.moveaxis(moved, 1, 2).copy())
            found.append(self._without_constants(rows, operator, weights[place]))
        return found

    def _without_constants(self, rows: Rows, operator: Operator, weights: Array) -> Rows:
        for row, equation in enumerate(self.used):
            direction = operator.nuisance(is_state=bool(equation < self.n_states))
            if direction is None:
                continue
            weighed = direction * weights[row] ** 2
            weighed /= weighed @ direction
            rows.residuals[row] -= direction * (weighed @ rows.residuals[row])
            rows.slopes[row] -= np.multiply.outer(direction, weighed @ rows.slopes[row])
        return rows

    def reach(self) -> Array:
        """Root mean square of each equation's left side over all records."""
        lefts = [self.left(place) for place in range(len(self.motions))]
        power = np.sum([np.sum(left**2, axis=1) for left in lefts], axis=0)
        count = sum(left.shape[1] for left in lefts)
        size = np.sqrt(power / count)
        if np.any(size == 0.0):
            still = [name for name, each in zip(self.names(), size, strict=True) if each == 0.0]
            raise FitError(
                "an equation does not move in any record",
                found=", ".join(still),
                needed="motion of every state whose equation is fitted",
                action="fix the parameters of that equation, or add records that excite it",
            )
        return np.asarray(size)
